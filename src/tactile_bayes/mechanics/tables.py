"""Chebyshev tables of the two maps of a straight rod in contact: how its ends lie → force, turn and where to look.

In tangential contact they are series in the angle of the chord over the contour's tangent, as a share of the largest
one, and in the friction angle; in tip contact in polar coordinates of (tilt, lack): the angle, and the radius as a
share of the largest one. What makes a quantity vanish at first contact is divided out. Toward where the maps fold they
are divided into cells, so that few terms serve everywhere: loads and drive angles are right to 5e-8 (`tests/`). Tables
are made once a process, from exact arcs, in a few milliseconds.
"""

from __future__ import annotations

import functools
import math
from typing import NamedTuple

import numpy as np

from tactile_bayes.arrays import Floats
from tactile_bayes.mechanics.arc import arc_to, chord_angle, slack
from tactile_bayes.mechanics.chord import tangential_arc, tip_arc
from tactile_bayes.mechanics.compiler import compiled, kept
from tactile_bayes.numerics import chebyshev

__all__ = [
    "AMPLITUDE",
    "FORCE",
    "MOST_FRICTION",
    "STRETCH",
    "TILT",
    "TURN",
    "Room",
    "Tables",
    "in_polar",
    "prepare",
    "room",
    "series",
    "tables",
]

MOST_FRICTION = 0.58
"""Friction angle up to which there are tables [rad]: the nearer to where the map folds, the longer their series."""

FORCE, TURN, AMPLITUDE, STRETCH, TILT = 0, 1, 2, 3, 3
"""What tables hold. Tangential contact: force times the square of the chord, turn, and χ², all over the angle; arc
length over chord. Tip contact: force over the angle, turn less ε1, χ² over the angle, ε1 over the share."""

_TERMS = 10
"""Of each series in a cell of tip contact, over angle and share."""

_ANGLES = np.array([0.0, 0.1, 0.25, 0.45, 0.6, 0.75, 0.9, 1.0])
"""Where cells of tip contact begin and end, shares of the right angle."""

_SHARES = np.array([0.0, 0.5, 0.75, 0.9, 0.97, 0.993, 1.0])
"""And shares of the largest radius."""

_LYING = 12, 20
"""Terms of a cell in tangential contact, over the angle, and over the friction angle."""

_LEVELS = np.array([0.0, 0.45, 0.65, 0.82, 1.0])
"""Where these cells begin and end, shares of the largest angle."""

_MARGIN = 0.02
"""By how much ε1 of tables exceeds that of tangential contact."""

_CHI_MAX = 3.2


class Tables(NamedTuple):
    """All of them."""

    lying: Floats
    """Tangential contact, shape (4, friction angles, cells, terms)."""
    radius: Floats
    """The largest one in tip contact, over the angle, shape (angles, terms)."""
    tip: Floats
    """Tip contact: what is tabulated side by side, so that one loop runs over all, shape (angles, shares, terms over
    the share, 4 · terms over the angle)."""


class Room(NamedTuple):
    """Where a state is put together, for one friction angle."""

    lying: Floats
    """Series of tangential contact over the angle, shape (4, cells, terms)."""
    by_angle: Floats
    by_share: Floats
    row: Floats
    """Two series over the angle, one after the other."""


def room() -> Room:
    by_angle, by_share = np.empty((2, _TERMS))
    row, lying = np.empty(max(2 * _TERMS, _LYING[1])), np.empty((4, _LEVELS.size - 1, _LYING[0]))
    return Room(lying, by_angle, by_share, row)


@functools.cache
def tables() -> Tables:
    """Tables for any friction angle up to `MOST_FRICTION`."""
    angles, shares, levels = _in_cells(_ANGLES, _TERMS), _in_cells(_SHARES, _TERMS), _in_cells(_LEVELS, _LYING[0])
    radius, tip = np.empty(angles.size), np.empty((4, angles.size, shares.size))
    _tips_on(0.5 * np.pi * angles.ravel(), shares.ravel(), 0.5 * np.pi + _MARGIN + MOST_FRICTION, radius, tip)
    by_share = chebyshev.coefficients(tip.reshape(4, *angles.shape, *shares.shape))
    by_both = chebyshev.coefficients(by_share.swapaxes(-1, -2)).transpose(3, 4, 1, 2, 0)
    lying = np.empty((4, levels.size, _LYING[1]))
    _lying_on(levels.ravel(), MOST_FRICTION * chebyshev.nodes(_LYING[1]), lying)
    by_friction = chebyshev.coefficients(lying.reshape(4, *levels.shape, -1))
    return Tables(
        lying=np.ascontiguousarray(chebyshev.coefficients(by_friction).transpose(2, 1, 3, 0)),
        radius=np.ascontiguousarray(chebyshev.coefficients(radius.reshape(angles.shape)).T),
        tip=by_both.reshape(*by_both.shape[:3], -1),
    )


def _in_cells(ends: Floats, terms: int) -> Floats:
    """Nodes in every cell, shape (cells, terms)."""
    return np.asarray(ends[:-1, None] + np.diff(ends)[:, None] * chebyshev.nodes(terms))


@kept
def _lying_on(levels: Floats, deltas: Floats, out: Floats) -> None:
    for j in range(deltas.size):
        m, largest = 0.5 * (1.0 + math.sin(deltas[j])), 0.5 * math.pi + deltas[j]
        for i in range(levels.size):
            angle = levels[i] * largest
            guess = min(math.sqrt(3.0 * angle / math.sqrt(m * (1.0 - m))), math.pi)
            chi, arc, _ = tangential_arc(angle, m, guess)
            chord = math.hypot(arc.length - arc.shortfall, arc.offset)
            out[FORCE, i, j], out[TURN, i, j] = chord * chord / angle, arc.turn / angle
            out[AMPLITUDE, i, j], out[STRETCH, i, j] = chi * chi / angle, arc.length / chord


@kept
def _tips_on(angles: Floats, shares: Floats, largest: float, radius: Floats, out: Floats) -> None:
    """Largest radius at every angle, where ε1 is the largest, and into `out` what is tabulated, shape (4, angles,
    shares)."""
    m = math.sin(0.5 * largest) ** 2
    for i in range(angles.size):
        low, high = 0.0, _CHI_MAX
        for _ in range(60):
            chi = 0.5 * (low + high)
            arc, _ = arc_to(chi, m)
            lack, tilt = slack(arc), largest - chord_angle(arc)
            if math.atan2(lack, tilt) > angles[i]:
                high = chi
            else:
                low = chi
        radius[i] = math.hypot(lack, tilt)
        chi, tilt1 = low, largest
        for j in range(shares.size - 1, -1, -1):
            lack, tilt = math.sin(angles[i]) * radius[i] * shares[j], math.cos(angles[i]) * radius[i] * shares[j]
            chi, tilt1, arc, _, _ = tip_arc(lack, tilt, chi, tilt1)
            out[FORCE, i, j], out[TURN, i, j] = arc.length * arc.length / angles[i], arc.turn - tilt1
            out[AMPLITUDE, i, j], out[TILT, i, j] = chi * chi / angles[i], tilt1 / shares[j]


@compiled
def prepare(known: Tables, friction_angle: float, room: Room) -> None:
    """Series of tangential contact at a friction angle, into the room."""
    frictions = known.lying.shape[1]
    _polynomials(min(friction_angle / MOST_FRICTION, 1.0), frictions, room.row)
    room.lying[:] = 0.0
    for k in range(4):
        for j in range(frictions):
            weight = room.row[j]
            for c in range(room.lying.shape[1]):
                for i in range(room.lying.shape[2]):
                    room.lying[k, c, i] += weight * known.lying[k, j, c, i]


@compiled
def _cell(ends: Floats, z: float) -> tuple[int, float]:
    """In which cell one is, and where in it."""
    cell = 0
    for k in range(1, ends.size - 1):
        cell += z > ends[k]
    return cell, (z - ends[cell]) / (ends[cell + 1] - ends[cell])


@compiled
def series(room: Room, k: int, level: float) -> float:
    """What is tabulated of tangential contact at a share of the largest angle, by Clenshaw's recurrence."""
    cell, z = _cell(_LEVELS, level)
    twice = 4.0 * z - 2.0
    now, before = 0.0, 0.0
    for i in range(room.lying.shape[2] - 1, 0, -1):
        now, before = (room.lying[k, cell, i] - before) + twice * now, now
    return (room.lying[k, cell, 0] - before) + 0.5 * twice * now


@compiled
def _polynomials(z: float, size: int, out: Floats) -> None:
    twice = 4.0 * z - 2.0
    out[0] = 1.0
    out[1] = 0.5 * twice
    for k in range(2, size):
        out[k] = twice * out[k - 1] - out[k - 2]


@compiled
def in_polar(known: Tables, lack: float, tilt: float, first: int, room: Room) -> tuple[float, float, float, float]:
    """Angle, share of the largest radius, and two of what is tabulated there, from the first on."""
    terms = _TERMS
    angle = math.atan2(lack, tilt)
    i, z = _cell(_ANGLES, angle / (0.5 * math.pi))
    _polynomials(z, terms, room.by_angle)
    largest = 0.0
    for a in range(terms):
        largest += known.radius[i, a] * room.by_angle[a]
    share = min(math.sqrt(lack * lack + tilt * tilt) / largest, 1.0)
    j, z = _cell(_SHARES, share)
    _polynomials(z, terms, room.by_share)
    begin = first * terms
    for a in range(2 * terms):
        room.row[a] = 0.0
    for s in range(terms):
        weight = room.by_share[s]
        for a in range(2 * terms):
            room.row[a] += weight * known.tip[i, j, s, begin + a]
    one, other = 0.0, 0.0
    for a in range(terms):
        one += room.row[a] * room.by_angle[a]
        other += room.row[terms + a] * room.by_angle[a]
    return angle, share, one, other
