"""Loads of a touching rod from the tables of `tactile_bayes.universal`."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from tactile_bayes.compiled.compiler import compiled, inlined
from tactile_bayes.compiled.lane import Lane, place
from tactile_bayes.universal import number_tables

__all__ = ["SMALL_FORCE", "SMALL_TURN", "Room", "Tables", "combine", "excess", "room_for", "series", "state", "tables"]

Floats = NDArray[np.float64]

_WIDE = 1.25
"""Angle of a tip contact in its table from which on the small one misses by ten times as much [rad]."""

SMALL_FORCE, SMALL_TURN = 1.3e-7, 1.3e-7
"""Largest errors of the small tables elsewhere: of loads over the loads, and of the drive angle [rad]."""


class Tables(NamedTuple):
    """Chebyshev coefficients in tangential contact, and of the tip over angle and share of the greatest radius.

    They are arrays of their own, because making views of parts of one takes as long as a series.
    """

    lying_force: Floats
    lying_turn: Floats
    stretch: Floats
    radius: Floats
    """The greatest one, over the angle."""
    tip_force: Floats
    tip_turn: Floats
    tip_tilt: Floats


class Room(NamedTuple):
    """Room for the polynomials of one state, of the sizes of its tables."""

    by_angle: Floats
    by_share: Floats
    row: Floats


def room_for(known: Tables) -> Room:
    shares, angles = known.tip_force.shape
    return Room(np.empty(angles), np.empty(shares), np.empty(angles))


def tables(*, roughly: bool) -> Tables:
    """Those of `tactile_bayes.universal`, large or small."""
    lying, radius, tip = number_tables(roughly=roughly)
    return Tables(*(np.array(table) for table in (*lying, radius, *tip)))


@compiled
def series(coefficients: Floats, z: float) -> float:
    """A Chebyshev series on [0, 1], by Clenshaw's recurrence."""
    twice = 4.0 * z - 2.0
    now, before = 0.0, 0.0
    for k in range(coefficients.size - 1, 0, -1):
        now, before = coefficients[k] + twice * now - before, now
    return coefficients[0] + 0.5 * twice * now - before


@inlined
def _polynomials(z: float, out: Floats) -> None:
    twice = 4.0 * z - 2.0
    out[0] = 1.0
    out[1] = 0.5 * twice
    for k in range(2, out.size):
        out[k] = twice * out[k - 1] - out[k - 2]


@inlined
def excess(lane: Lane, p: float, stretch: Floats) -> float:
    """Arc length over the rod's that tangential contact would take, less one."""
    x, y, sin, cos, _, _ = place(lane, p)
    angle = math.atan2(max(y * cos - x * sin, 0.0), x * cos + y * sin)
    return math.sqrt(x * x + y * y) * series(stretch, min(angle / (0.5 * math.pi), 1.0)) - 1.0


@inlined
def combine(rows: Floats, weights: Floats, out: Floats) -> None:
    """Σ weights[i] · rows[i], an inner loop that has no order to keep."""
    out[:] = 0.0
    for i in range(weights.size):
        weight = weights[i]
        for j in range(out.size):
            out[j] += weight * rows[i, j]


@inlined
def _twice(coefficients: Floats, by_share: Floats, by_angle: Floats, row: Floats) -> float:
    """A series in both directions."""
    combine(coefficients, by_share, row)
    total = 0.0
    for a in range(row.size):
        total += row[a] * by_angle[a]
    return total


@inlined
def state(
    lane: Lane, p: float, tip: bool, both: tuple[Tables, Tables], rooms: tuple[Room, Room], large: bool
) -> tuple[float, float, float, float]:
    """Drive angle, holding moment and forces of a contact; NaN where the rod cannot make it."""
    x, y, sin, cos, _, _ = place(lane, p)
    slope = math.atan2(sin, cos)
    along, across = x * cos + y * sin, y * cos - x * sin
    distance2 = x * x + y * y
    if across < 0.0 or along < -1e-12 or (tip and distance2 > 1.0):
        return math.nan, math.nan, math.nan, math.nan
    if tip:
        lack, tilt = math.sqrt(1.0 - distance2), max(math.atan2(along, across), 0.0)
        angle = math.atan2(lack, tilt)
        which = int(large or angle > _WIDE)
        known, room = both[which], rooms[which]
        by_angle, by_share, row = room.by_angle, room.by_share, room.row
        _polynomials(angle / (0.5 * math.pi), by_angle)
        share = min(math.sqrt(lack * lack + tilt * tilt) / series(known.radius, angle / (0.5 * math.pi)), 1.0)
        _polynomials(share, by_share)
        force = _twice(known.tip_force, by_share, by_angle, row) * angle
        turn = _twice(known.tip_turn, by_share, by_angle, row) * angle
        drive_angle = slope + 0.5 * math.pi - _twice(known.tip_tilt, by_share, by_angle, row) * share + turn
    else:
        known = both[int(large)]
        angle = math.atan2(across, along)
        level = min(angle / (0.5 * math.pi), 1.0)
        force = series(known.lying_force, level) * angle / distance2
        drive_angle = slope + series(known.lying_turn, level) * angle
    return drive_angle, force * along, -force * sin, force * cos
