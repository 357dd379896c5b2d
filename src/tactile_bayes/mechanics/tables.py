"""Chebyshev tables of the two maps of a straight rod in contact: how its ends lie → force, turn and where to look.

In tangential contact they are series in the angle of the chord over the contour's tangent, as a share of the largest
one, and in the friction angle; in tip contact in polar coordinates of (tilt, lack): the angle, and the radius as a
share of the largest one. What makes a quantity vanish at first contact is divided out. Tables are made once a process,
from exact arcs, in a few milliseconds.
"""

from __future__ import annotations

import functools
import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from tactile_bayes import chebyshev
from tactile_bayes.mechanics.arc import arc_to, chord_angle, slack
from tactile_bayes.mechanics.chord import tangential_arc, tip_arc
from tactile_bayes.mechanics.compiler import compiled, inlined, kept

__all__ = [
    "AMPLITUDE",
    "FORCE",
    "MOST_FRICTION",
    "SMALL",
    "STRETCH",
    "TILT",
    "TURN",
    "Room",
    "Tables",
    "TipTable",
    "combine",
    "combined",
    "in_polar",
    "prepare",
    "room",
    "series",
    "tables",
]

Floats = NDArray[np.float64]

MOST_FRICTION = 0.4
"""Friction angle up to which there are tables [rad]: the nearer to where the map folds, the longer their series."""

FORCE, TURN, TILT, STRETCH, AMPLITUDE = 0, 1, 2, 2, 3
"""What tables hold: force times the square of the chord (of the rod, for a tip) and turn, both over the angle; ε1 over
the share in tip contact, arc length over chord in tangential contact; χ² over the angle."""

SMALL = 16
"""Number of coefficients in each direction of small tables, without friction: to 2e-7, and 3e-6 in a corner."""

_LARGE = 30, 26
"""Of large ones, over the angle and over the share: to 5e-10."""

_RUBBING = 24, 36
"""With friction: to 6e-7, mostly to 1e-7."""

_LYING = 30, 16
"""Over the angle in tangential contact, and over the friction angle."""

_MARGIN = 0.02
"""By how much ε1 of tables exceeds that of tangential contact."""

_CHI_MAX = 3.2


class TipTable(NamedTuple):
    """What belongs to tip contact."""

    radius: Floats
    """The largest one, over the angle, shape (angles,)."""
    rows: Floats
    """What is tabulated, side by side, so that one loop runs over all: force, turn, tilt and then the amplitude, shape
    (shares, 4 · angles)."""


class Tables(NamedTuple):
    """All of them."""

    lying: Floats
    """Tangential contact, shape (4, friction angles, angles)."""
    tip: tuple[TipTable, TipTable, TipTable]
    """Tip contact: small, large, with friction."""


class Room(NamedTuple):
    """Where a state is put together, for one friction angle."""

    lying: Floats
    """Series of tangential contact over the angle, shape (4, angles)."""
    by_angle: Floats
    by_share: Floats
    row: Floats
    """Of the size of four series over the angle."""


def room() -> Room:
    most = max(*_LARGE, *_RUBBING, SMALL)
    return Room(np.empty((4, _LYING[0])), np.empty(most), np.empty(most), np.empty(4 * most))


@functools.cache
def tables() -> Tables:
    """Tables for any friction angle up to `MOST_FRICTION`."""
    straight = 0.5 * np.pi + _MARGIN
    tips = (
        _tip_table(SMALL, SMALL, straight),
        _tip_table(*_LARGE, straight),
        _tip_table(*_RUBBING, straight + MOST_FRICTION),
    )
    angles, frictions = _LYING
    lying = _lying_on(chebyshev.nodes(angles), MOST_FRICTION * chebyshev.nodes(frictions))
    return Tables(np.stack([np.ascontiguousarray(_fit(values).T) for values in lying]), tips)


def _tip_table(angles: int, shares: int, largest: float) -> TipTable:
    radius, values = _tips_on(0.5 * np.pi * chebyshev.nodes(angles), chebyshev.nodes(shares), largest)
    rows = np.stack([_fit(table).T for table in values], axis=1)
    return TipTable(chebyshev.coefficients(radius), rows.reshape(shares, -1))


def _fit(values: Floats) -> Floats:
    """Coefficients of a function on a grid of nodes."""
    return chebyshev.coefficients(chebyshev.coefficients(values))


@kept
def _lying_on(levels: Floats, deltas: Floats) -> Floats:
    out = np.empty((4, levels.size, deltas.size))
    for j in range(deltas.size):
        m, largest = 0.5 * (1.0 + math.sin(deltas[j])), 0.5 * math.pi + deltas[j]
        for i in range(levels.size):
            angle = levels[i] * largest
            guess = min(math.sqrt(3.0 * angle / math.sqrt(m * (1.0 - m))), math.pi)
            chi, arc, _ = tangential_arc(angle, m, guess)
            chord = math.hypot(arc.length - arc.shortfall, arc.offset)
            out[FORCE, i, j], out[TURN, i, j] = chord * chord / angle, arc.turn / angle
            out[AMPLITUDE, i, j], out[STRETCH, i, j] = chi * chi / angle, arc.length / chord
    return out


@kept
def _tips_on(angles: Floats, shares: Floats, largest: float) -> tuple[Floats, Floats]:
    """Largest radius at every angle, where ε1 is the largest, and what is tabulated, shape (4, angles, shares)."""
    m = math.sin(0.5 * largest) ** 2
    radius, out = np.empty(angles.size), np.empty((4, angles.size, shares.size))
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
            out[FORCE, i, j], out[TURN, i, j] = arc.length * arc.length / angles[i], arc.turn / angles[i]
            out[AMPLITUDE, i, j], out[TILT, i, j] = chi * chi / angles[i], tilt1 / shares[j]
    return radius, out


@compiled
def prepare(known: Tables, friction_angle: float, room: Room) -> None:
    """Series of tangential contact at a friction angle, into the room."""
    _polynomials(min(friction_angle / MOST_FRICTION, 1.0), known.lying.shape[1], room.row)
    room.lying[:] = 0.0
    for k in range(4):
        for j in range(known.lying.shape[1]):
            weight = room.row[j]
            for i in range(room.lying.shape[1]):
                room.lying[k, i] += weight * known.lying[k, j, i]


@inlined
def series(rows: Floats, k: int, size: int, z: float) -> float:
    """So many terms of the Chebyshev series in row k, on [0, 1], by Clenshaw's recurrence."""
    twice = 4.0 * z - 2.0
    now, before = 0.0, 0.0
    for i in range(size - 1, 0, -1):
        now, before = rows[k, i] + twice * now - before, now
    return rows[k, 0] + 0.5 * twice * now - before


@inlined
def _polynomials(z: float, size: int, out: Floats) -> None:
    twice = 4.0 * z - 2.0
    out[0] = 1.0
    out[1] = 0.5 * twice
    for k in range(2, size):
        out[k] = twice * out[k - 1] - out[k - 2]


@inlined
def in_polar(table: TipTable, lack: float, tilt: float, room: Room) -> tuple[float, float]:
    """Angle and share of the largest radius; their polynomials go into the room."""
    shares, angles = table.rows.shape[0], table.radius.size
    angle = math.atan2(lack, tilt)
    _polynomials(angle / (0.5 * math.pi), angles, room.by_angle)
    largest = 0.0
    for a in range(angles):
        largest += table.radius[a] * room.by_angle[a]
    share = min(math.sqrt(lack * lack + tilt * tilt) / largest, 1.0)
    _polynomials(share, shares, room.by_share)
    return angle, share


@inlined
def combine(table: TipTable, count: int, room: Room) -> None:
    """Series over the angle, into the room, of as many of what is tabulated as wanted."""
    row, size = room.row, count * table.radius.size
    for i in range(size):
        row[i] = 0.0
    for s in range(table.rows.shape[0]):
        weight = room.by_share[s]
        for i in range(size):
            row[i] += weight * table.rows[s, i]


@inlined
def combined(table: TipTable, k: int, room: Room) -> float:
    """One of them at the angle."""
    total, first = 0.0, k * table.radius.size
    for a in range(table.radius.size):
        total += room.row[first + a] * room.by_angle[a]
    return total
