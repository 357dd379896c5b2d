"""The path of one lane, and the loads on it at drive angles: `tactile_bayes.path` without friction, as well as noise
asks.

Each stretch of a path is halved until the interpolated loads miss by less than a tolerance of each channel, which the
noise sets: near pivots loads are far above it. Where the small tables of states miss by more, the large ones serve, and
where loads are no polynomials of the drive angle, each sample is looked for by itself.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from tactile_bayes import chebyshev
from tactile_bayes.compiled.compiler import compiled, inlined
from tactile_bayes.compiled.lane import Lane, bearing
from tactile_bayes.compiled.limits import limits
from tactile_bayes.compiled.states import (
    SMALL_FORCE,
    SMALL_TURN,
    Room,
    Tables,
    combine,
    excess,
    room_for,
    series,
    state,
)
from tactile_bayes.reach import Reach
from tactile_bayes.segments import BRIEF

__all__ = ["Nodes", "Work", "follow", "nodes", "work"]

Floats = NDArray[np.float64]

_ORDER = 16
_CELLS = 16
"""Of each piece, in which a change of the phase is looked for."""

_RESOLVED, _HALVINGS, _BRIEF = 1e-3, 12, BRIEF
_SHARP = 1e-6
"""Error of the drive angle that a snap-off may have [rad]."""
_LAST_STEP, _CHANGE = 1e-4, 1e-7
_TOUCHES, _RUNS_OUT = int(Reach.TOUCHES), int(Reach.RUNS_OUT)
_NEAR = 1e-3
"""Error of the interpolated way, as a share of the stretch, from which two steps of Newton's method leave nothing."""

_MOST = 64
"""Stretches that may wait for being followed."""


class Nodes(NamedTuple):
    """What belongs to interpolation on [0, 1]."""

    nodes: Floats
    fit: Floats
    """Coefficients for a one at each node, a row each."""
    slopes: Floats
    """Those of the derivative of each polynomial."""
    grid: Floats
    """Where the drive angle is asked whether it still grows."""
    on_grid: Floats
    """Each polynomial there."""


class Work(NamedTuple):
    """Room for what is computed on one stretch, used again for the next."""

    series: Floats
    """Of drive angle and the three loads along the way."""
    slope: Floats
    bend: Floats
    values: Floats
    over_angle: Floats
    """Those of the way and of the loads over the drive angle."""
    tables: tuple[Room, Room]
    """For the small and the large tables."""
    on_grid: Floats
    there: NDArray[np.intp]
    """Samples on the stretch."""
    wanted: Floats
    twice: Floats
    rate: Floats
    now: Floats
    before: Floats
    waiting: Floats
    """Stretches still to be followed, the next one last: begin, end, tip, rooted, halvings, large tables."""


def nodes() -> Nodes:
    unit, grid = np.eye(_ORDER), np.linspace(0.0, 1.0, 2 * _ORDER + 1)
    return Nodes(
        chebyshev.nodes(_ORDER),
        np.ascontiguousarray(chebyshev.coefficients(unit).T),
        np.ascontiguousarray(np.vstack([chebyshev.derivative(unit), np.zeros(_ORDER)]).T),
        grid,
        chebyshev.basis(_ORDER, grid),
    )


def work(samples: int, known: tuple[Tables, Tables]) -> Work:
    """For strokes of so many samples at most, and for tables."""
    small, large = known
    row = np.empty(_ORDER)
    wanted, twice, rate, now, before = np.empty((5, samples))
    return Work(
        series=np.empty((4, _ORDER)),
        slope=row.copy(),
        bend=row.copy(),
        values=np.empty((4, _ORDER)),
        over_angle=np.empty((4, _ORDER)),
        tables=(room_for(small), room_for(large)),
        on_grid=np.empty(2 * _ORDER + 1),
        there=np.empty(samples, dtype=np.intp),
        wanted=wanted,
        twice=twice,
        rate=rate,
        now=now,
        before=before,
        waiting=np.empty((_MOST, 6)),
    )


@compiled
def _change(lane: Lane, stretch: Floats, p: float, at_p: float, q: float, at_q: float) -> float:
    """Where the excess changes its sign between p and q: false position with halved weights (Illinois)."""
    span = _CHANGE * abs(q - p)
    for _ in range(60):
        new = q - at_q * (q - p) / (at_q - at_p)
        value = excess(lane, new, stretch)
        if (value > 0.0) == (at_q > 0.0):
            at_p *= 0.5
        else:
            p, at_p = q, at_q
        moved = abs(new - q)
        q, at_q = new, value
        if moved <= span or value == 0.0:
            break
    return q


@compiled
def _cut(lane: Lane, begin: float, end: float, has_knot: bool, tip_first: bool, stretch: Floats, out: Floats) -> int:
    """Stretches of one phase without a knot inside, in the order of the path; the answer is their number."""
    count = 0
    knot = has_knot and end < 0.0 < begin
    for piece in range(2 if knot else 1):
        p = 0.0 if piece else begin
        last = 0.0 if knot and not piece else end
        span = last - p
        if not abs(span) > 1e-13 * (begin - end):
            continue
        start, old = p, p
        at_old = excess(lane, p, stretch)
        beyond = at_old > 0.0
        for cell in range(_CELLS):
            new = last if cell == _CELLS - 1 else p + span * (cell + 1.0) / _CELLS
            at_new = excess(lane, new, stretch)
            if (at_new > 0.0) != beyond and count < out.shape[0] - 2:
                here = _change(lane, stretch, old, at_old, new, at_new)
                out[count, 0], out[count, 1], out[count, 2] = start, here, beyond
                count += 1
                start, beyond = here, not beyond
            old, at_old = new, at_new
        out[count, 0], out[count, 1], out[count, 2] = start, last, beyond
        count += 1
    for k in range(count):
        out[k, 3] = k == 0 and tip_first and out[k, 2] > 0.0
        out[k, 4] = out[k, 5] = 0.0
    return count


@compiled
def _sample(
    lane: Lane, stretch: Floats, compliance: float, known: tuple[Tables, Tables], on: Nodes, room: Work
) -> None:
    """Series along the way of drive angle and loads."""
    span = stretch[1] - stretch[0]
    for k in range(_ORDER):
        way = on.nodes[k]
        p = stretch[0] + span * (way * way if stretch[3] else way)
        at = state(lane, p, stretch[2] > 0.0, known, room.tables, stretch[5] > 0.0)
        room.values[0, k], room.values[1, k], room.values[2, k], room.values[3, k] = at
        room.values[0, k] += compliance * room.values[1, k]
    for c in range(4):
        combine(on.fit, room.values[c], room.series[c])


@inlined
def _tail(series_of: Floats) -> float:
    """About how far a series is from what it interpolates."""
    return max(abs(series_of[_ORDER - 1]), abs(series_of[_ORDER - 2]))


@inlined
def _change_of(series_of: Floats) -> float:
    largest = 0.0
    for k in range(1, _ORDER):
        largest = max(largest, abs(series_of[k]))
    return largest


@compiled
def _misses(tolerance: Floats, room: Work) -> tuple[bool, bool]:
    """Whether small tables, and whether series along a stretch, miss loads by more than a tolerance."""
    angle, change = _tail(room.series[0]), _change_of(room.series[0])
    small, rough = False, angle > _RESOLVED * change or angle > _SHARP
    for c in range(3):
        loads = room.series[c + 1]
        moved = _change_of(loads)
        steepness = moved / change
        small |= SMALL_FORCE * (abs(loads[0]) + moved) + SMALL_TURN * steepness > tolerance[c]
        rough |= _tail(loads) + angle * steepness > tolerance[c]
    return small, rough


@compiled
def _first_fall(room: Work, on: Nodes, is_first: bool) -> float:
    """Way to where the drive angle stops growing: above 1 if it grows to the end, 0 if it does not grow at all."""
    combine(on.on_grid, room.slope, room.on_grid)
    for cell in range(1 if is_first else 0, on.grid.size):
        if room.on_grid[cell] <= 0.0:
            if cell == 0:
                return 0.0
            combine(on.slopes, room.slope, room.bend)
            left, right = on.grid[cell - 1], on.grid[cell]
            return _root_of(room.slope, room.bend, 0.0, left, right, 0.5 * (left + right))
    return 2.0


@inlined
def _both(one: Floats, other: Floats, z: float) -> tuple[float, float]:
    """Two series at once, which takes no longer than one."""
    twice = 4.0 * z - 2.0
    a, a_before, b, b_before = 0.0, 0.0, 0.0, 0.0
    for k in range(one.size - 1, 0, -1):
        a, a_before = one[k] + twice * a - a_before, a
        b, b_before = other[k] + twice * b - b_before, b
    return one[0] + 0.5 * twice * a - a_before, other[0] + 0.5 * twice * b - b_before


@inlined
def _root_of(function: Floats, slope: Floats, value: float, left: float, right: float, z: float) -> float:
    """Where a series takes a value from above on its way from left to right, or, with left > right, from right to left:
    Newton kept in its bracket."""
    before = abs(right - left)
    settled = _LAST_STEP * before
    for _ in range(60):
        at_z, rate = _both(function, slope, z)
        missing = at_z - value
        if missing > 0.0:
            left = z
        else:
            right = z
        new = z - missing / rate
        if (new - left) * (new - right) <= 0.0 and abs(new - z) <= 0.5 * before:
            before = abs(new - z)
        else:
            new = 0.5 * (left + right)
            before = abs(right - left)
        step = abs(new - z)
        z = new
        if not step > settled or missing == 0.0:
            break
    return z


@compiled
def _over_drive_angle(stop: float, begin: float, end: float, steadiness: float, on: Nodes, room: Work) -> None:
    """Coefficients of the way and of the loads over the stretched drive angle."""
    angle, moment, force_x, force_y = room.series[0], room.series[1], room.series[2], room.series[3]
    slope, values = room.slope, room.values
    for k in range(_ORDER):
        ahead = 1.0 - on.nodes[k]
        wanted = end - (end - begin) * ahead * (steadiness + (1.0 - steadiness) * ahead)
        way = _root_of(angle, slope, wanted, stop, 0.0, stop * on.nodes[k])
        values[0, k] = way
        values[1, k], values[2, k] = _both(moment, force_x, way)
        values[3, k] = series(force_y, way)
    for c in range(4):
        combine(on.fit, room.values[c], room.over_angle[c])


@compiled
def _on_stretch(
    angles: Floats, rows: NDArray[np.intp], offset: float, span: tuple[float, float], steadiness: float, room: Work
) -> int:
    """How many samples lie on a stretch; in the room their rows, drive angles and stretched ones z, as 4z − 2."""
    begin, end = span
    there, wanted, twice, count = room.there, room.wanted, room.twice, 0
    for j in range(angles.size):
        angle = angles[j] - offset
        if begin <= angle <= end:
            left = min(max((end - angle) / (end - begin), 0.0), 1.0)
            root = math.sqrt(steadiness * steadiness + 4.0 * (1.0 - steadiness) * left)
            ahead = 2.0 * left / (steadiness + root) if left > 0.0 else 0.0
            there[count], wanted[count], twice[count] = rows[j], angle, 2.0 - 4.0 * ahead
            count += 1
    return count


@compiled
def _at_all(series_of: Floats, twice: Floats, count: int, now: Floats, before: Floats) -> None:
    """A series at many places, side by side in the inner loop; the values are in `now`."""
    for j in range(count):
        now[j], before[j] = 0.0, 0.0
    for k in range(_ORDER - 1, 0, -1):
        for j in range(count):
            new = series_of[k] + twice[j] * now[j] - before[j]
            before[j] = now[j]
            now[j] = new
    for j in range(count):
        now[j] = series_of[0] + 0.5 * twice[j] * now[j] - before[j]


@compiled
def _look_for(stop: float, count: int, room: Work) -> None:
    """Turn stretched drive angles of samples into ways along the stretch, as 4z − 2: from what interpolation says by
    Newton's method, if that is near, or each by itself."""
    wanted, twice, rate = room.wanted, room.twice, room.rate
    if _tail(room.over_angle[0]) > _NEAR * stop:
        for j in range(count):
            twice[j] = 4.0 * _root_of(room.series[0], room.slope, wanted[j], stop, 0.0, 0.5 * stop) - 2.0
        return
    _at_all(room.over_angle[0], twice, count, room.now, room.before)
    for j in range(count):
        twice[j] = 4.0 * min(max(room.now[j], 0.0), stop) - 2.0
    for _ in range(2):
        _at_all(room.slope, twice, count, rate, room.before)
        _at_all(room.series[0], twice, count, room.now, room.before)
        for j in range(count):
            way = 0.25 * (twice[j] + 2.0)
            most = 0.5 * (stop - way) + _NEAR * _NEAR * stop
            step = (room.now[j] - wanted[j]) / rate[j] if rate[j] > 0.0 else 0.0
            twice[j] = 4.0 * min(max(way - min(max(step, -most), most), 0.0), stop) - 2.0


@compiled
def _write(
    angles: Floats,
    rows: NDArray[np.intp],
    sign: float,
    offset: float,
    span: tuple[float, float],
    steadiness: float,
    stop: float,
    tolerance: Floats,
    room: Work,
    out: Floats,
) -> None:
    """Loads of the samples on a stretch: over the drive angle if they are smooth functions of it, else over the way."""
    count = _on_stretch(angles, rows, sign * offset, span, steadiness, room)
    smooth = True
    for c in range(3):
        smooth &= _tail(room.over_angle[c + 1]) <= tolerance[c]
    loads = room.over_angle
    if not smooth:
        _look_for(stop, count, room)
        loads = room.series
    for c in range(3):
        _at_all(loads[c + 1], room.twice, count, room.now, room.before)
        factor = 1.0 if c == 2 else sign
        for j in range(count):
            out[room.there[j], c] = factor * room.now[j]


@compiled
def follow(
    lane: Lane,
    has_knot: bool,
    angles: Floats,
    rows: NDArray[np.intp],
    sign: float,
    offset: float,
    compliance: float,
    tolerance: Floats,
    known: tuple[Tables, Tables],
    on: Nodes,
    room: Work,
    out: Floats,
) -> tuple[int, float, float]:
    """`Reach`, drive angles of first contact and snap-off of a lane; loads at drive angles go into rows of `out`.

    They are zero beforehand.
    The sign is −1 in backward sweeps; the offset is what the encoder reads too much, the compliance the suspension's.
    Loads may miss by about the tolerance, of moment and forces.
    """
    reach, begin, end, tip_first, runs_out = limits(lane)
    if reach != _TOUCHES:
        return reach, math.nan, math.nan
    waiting = room.waiting
    count = _cut(lane, begin, end, has_knot, tip_first, known[0].stretch, waiting)
    for k in range(count // 2):  # the first one is to be the last, where a stack ends
        for c in range(6):
            waiting[k, c], waiting[count - 1 - k, c] = waiting[count - 1 - k, c], waiting[k, c]
    whole = begin - end
    first = bearing(lane, begin)
    at_begin, is_first = first, True
    grows_to_the_end = True
    while count:
        stretch = waiting[count - 1]
        _sample(lane, stretch, compliance, known, on, room)
        small, rough = _misses(tolerance, room)
        if small and not stretch[5]:
            stretch[5] = 1.0
            continue
        if rough and stretch[4] < _HALVINGS and count < _MOST and stretch[0] - stretch[1] > _BRIEF * whole:
            span = stretch[1] - stretch[0]
            middle = stretch[0] + span * (0.25 if stretch[3] else 0.5)
            waiting[count, 0], waiting[count, 1] = stretch[0], middle
            waiting[count, 2], waiting[count, 3], waiting[count, 4] = stretch[2], stretch[3], stretch[4] + 1.0
            waiting[count, 5] = stretch[5]
            stretch[0], stretch[3], stretch[4] = middle, 0.0, stretch[4] + 1.0
            count += 1
            continue
        count -= 1
        combine(on.slopes, room.series[0], room.slope)
        stop = 2.0
        if begin - stretch[1] >= _BRIEF * whole or not count:
            stop = _first_fall(room, on, is_first)
        if stop == 0.0:
            grows_to_the_end = False
            break
        folds = stop <= 1.0
        stop = min(stop, 1.0)
        at_end = series(room.series[0], stop)
        steadiness = 0.0
        if not folds:
            steadiness = min(max(series(room.slope, stop) * stop / (at_end - at_begin), 0.0), 1.0)
        _over_drive_angle(stop, at_begin, at_end, steadiness, on, room)
        _write(angles, rows, sign, offset, (at_begin, at_end), steadiness, stop, tolerance, room, out)
        at_begin, is_first = at_end, False
        if folds:
            grows_to_the_end = False
            break
    if runs_out and grows_to_the_end:
        return _RUNS_OUT, math.nan, math.nan
    return _TOUCHES, first, at_begin
