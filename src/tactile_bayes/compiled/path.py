"""The path of one lane, and the loads on it at drive angles: `tactile_bayes.path` without friction, roughly."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from tactile_bayes import chebyshev
from tactile_bayes.compiled.compiler import compiled, inlined
from tactile_bayes.compiled.lane import Lane, bearing
from tactile_bayes.compiled.limits import limits
from tactile_bayes.compiled.states import Tables, combine, excess, series, state
from tactile_bayes.reach import Reach
from tactile_bayes.segments import BRIEF

__all__ = ["Nodes", "Work", "follow", "nodes", "work"]

Floats = NDArray[np.float64]

_ORDER = 16
_CELLS = 16
"""Of each piece, in which a change of the phase is looked for."""

_RESOLVED, _HALVINGS, _BRIEF = 1e-3, 8, BRIEF
_LAST_STEP, _CHANGE = 1e-4, 1e-7
_TOUCHES, _RUNS_OUT = int(Reach.TOUCHES), int(Reach.RUNS_OUT)
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
    loads: Floats
    """Coefficients of the loads over the drive angle."""
    by_angle: Floats
    by_share: Floats
    row: Floats
    on_grid: Floats
    there: NDArray[np.intp]
    """Samples on the stretch."""
    twice: Floats
    now: Floats
    before: Floats
    waiting: Floats
    """Stretches still to be followed, the next one last: begin, end, tip, rooted, halvings."""


def nodes() -> Nodes:
    unit, grid = np.eye(_ORDER), np.linspace(0.0, 1.0, 2 * _ORDER + 1)
    return Nodes(
        chebyshev.nodes(_ORDER),
        np.ascontiguousarray(chebyshev.coefficients(unit).T),
        np.ascontiguousarray(np.vstack([chebyshev.derivative(unit), np.zeros(_ORDER)]).T),
        grid,
        chebyshev.basis(_ORDER, grid),
    )


def work(samples: int) -> Work:
    """For strokes of so many samples at most."""
    row, of_samples = np.empty(_ORDER), np.empty(samples)
    return Work(
        np.empty((4, _ORDER)),
        row.copy(),
        row.copy(),
        np.empty((4, _ORDER)),
        np.empty((3, _ORDER)),
        row.copy(),
        row.copy(),
        row,
        np.empty(2 * _ORDER + 1),
        np.empty(samples, dtype=np.intp),
        of_samples.copy(),
        of_samples.copy(),
        of_samples,
        np.empty((_MOST, 5)),
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
        out[k, 4] = 0.0
    return count


@compiled
def _sample(lane: Lane, stretch: Floats, compliance: float, known: Tables, on: Nodes, room: Work) -> None:
    """Series along the way of drive angle and loads."""
    span = stretch[1] - stretch[0]
    for k in range(_ORDER):
        way = on.nodes[k]
        p = stretch[0] + span * (way * way if stretch[3] else way)
        at = state(lane, p, stretch[2] > 0.0, known, room.by_angle, room.by_share, room.row)
        room.values[0, k], room.values[1, k], room.values[2, k], room.values[3, k] = at
        room.values[0, k] += compliance * room.values[1, k]
    for c in range(4):
        combine(on.fit, room.values[c], room.series[c])


@compiled
def _is_rough(angle: Floats) -> bool:
    largest = 0.0
    for k in range(1, angle.size):
        largest = max(largest, abs(angle[k]))
    return max(abs(angle[angle.size - 1]), abs(angle[angle.size - 2])) > _RESOLVED * largest


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
    """Coefficients of the loads over the stretched drive angle."""
    angle, moment, force_x, force_y = room.series[0], room.series[1], room.series[2], room.series[3]
    slope, values = room.slope, room.values
    for k in range(_ORDER):
        ahead = 1.0 - on.nodes[k]
        wanted = end - (end - begin) * ahead * (steadiness + (1.0 - steadiness) * ahead)
        way = _root_of(angle, slope, wanted, stop, 0.0, stop * on.nodes[k])
        values[0, k], values[1, k] = _both(moment, force_x, way)
        values[2, k] = series(force_y, way)
    for c in range(3):
        combine(on.fit, room.values[c], room.loads[c])


@compiled
def _write(
    angles: Floats,
    rows: NDArray[np.intp],
    sign: float,
    offset: float,
    span: tuple[float, float],
    steadiness: float,
    room: Work,
    out: Floats,
) -> None:
    """Loads of the samples on a stretch, side by side in the inner loop."""
    begin, end = span
    there, twice, count = room.there, room.twice, 0
    for j in range(angles.size):
        angle = angles[j] - sign * offset
        if begin <= angle <= end:
            left = min(max((end - angle) / (end - begin), 0.0), 1.0)
            root = math.sqrt(steadiness * steadiness + 4.0 * (1.0 - steadiness) * left)
            ahead = 2.0 * left / (steadiness + root) if left > 0.0 else 0.0
            there[count], twice[count] = rows[j], 2.0 - 4.0 * ahead
            count += 1
    now, before = room.now, room.before
    for c in range(3):
        series_of = room.loads[c]
        for j in range(count):
            now[j], before[j] = 0.0, 0.0
        for k in range(_ORDER - 1, 0, -1):
            for j in range(count):
                new = series_of[k] + twice[j] * now[j] - before[j]
                before[j] = now[j]
                now[j] = new
        factor = 1.0 if c == 2 else sign
        for j in range(count):
            out[there[j], c] = factor * (series_of[0] + 0.5 * twice[j] * now[j] - before[j])


@compiled
def follow(
    lane: Lane,
    has_knot: bool,
    angles: Floats,
    rows: NDArray[np.intp],
    sign: float,
    offset: float,
    compliance: float,
    known: Tables,
    on: Nodes,
    room: Work,
    out: Floats,
) -> tuple[int, float]:
    """`Reach` and snap-off's drive angle of a lane; loads at drive angles go into rows of `out`, zero beforehand.

    The sign is −1 in backward sweeps; the offset is what the encoder reads too much, the compliance the suspension's.
    """
    reach, begin, end, tip_first, runs_out = limits(lane)
    if reach != _TOUCHES:
        return reach, math.nan
    waiting = room.waiting
    count = _cut(lane, begin, end, has_knot, tip_first, known.stretch, waiting)
    for k in range(count // 2):  # the first one is to be the last, where a stack ends
        for c in range(5):
            waiting[k, c], waiting[count - 1 - k, c] = waiting[count - 1 - k, c], waiting[k, c]
    whole = begin - end
    at_begin, is_first = bearing(lane, begin), True
    grows_to_the_end = True
    while count:
        stretch = waiting[count - 1]
        _sample(lane, stretch, compliance, known, on, room)
        if (
            stretch[4] < _HALVINGS
            and count < _MOST
            and stretch[0] - stretch[1] > _BRIEF * whole
            and _is_rough(room.series[0])
        ):
            span = stretch[1] - stretch[0]
            middle = stretch[0] + span * (0.25 if stretch[3] else 0.5)
            waiting[count, 0], waiting[count, 1] = stretch[0], middle
            waiting[count, 2], waiting[count, 3], waiting[count, 4] = stretch[2], stretch[3], stretch[4] + 1.0
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
        _write(angles, rows, sign, offset, (at_begin, at_end), steadiness, room, out)
        at_begin, is_first = at_end, False
        if folds:
            grows_to_the_end = False
            break
    if runs_out and grows_to_the_end:
        return _RUNS_OUT, math.nan
    return _TOUCHES, at_begin
