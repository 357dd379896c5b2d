"""The equilibrium path of one rod along one contour, from first contact to snap-off, and what it is at drive angles.

A path runs along the contour from first contact (the tip, or a tangent line from the pivot, whichever is first) against
the sense of the contour's parameter, until the drive angle has its first maximum: the snap-off. It is cut where the
phase changes and where the contour's curvature jumps; on each stretch all observables are smooth, and interpolated.
Stretches are halved until the interpolants are as good as asked for. The first maximum of the drive angle is a fold
(its derivative vanishes), a corner, or where the line of force comes to pass through the pivot.

`follow` is the one program for all: likelihoods take loads from the interpolants, as well as noise asks; where a path
is wanted exactly, the interpolants say where to look for the state at a drive angle.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from tactile_bayes.mechanics.compiler import compiled, inlined
from tactile_bayes.mechanics.fates import Reach, SnapOff
from tactile_bayes.mechanics.outline import Outline, Place, bearing, frame, place
from tactile_bayes.mechanics.phases import TANGENTIAL, TIP
from tactile_bayes.mechanics.reach import limits
from tactile_bayes.mechanics.series import (
    Nodes,
    at_all,
    change_of,
    crossing,
    tail,
    three_at_all,
    value,
    value_and_slope,
    weighted,
)
from tactile_bayes.mechanics.states import State, exact_state, tabled_state
from tactile_bayes.mechanics.stretches import BRIEF, Accuracy, Stretch, along, along_rate, cut
from tactile_bayes.mechanics.tables import MOST_FRICTION, Room, Tables, prepare

__all__ = ["MOST_CHANGES", "STATE_COLUMNS", "Ends", "Found", "Rig", "Samples", "Work", "follow", "work"]

Floats = NDArray[np.float64]

MOST_CHANGES = 16
"""Phases of a path, one after the other, of which an account is kept."""

STATE_COLUMNS = 13
"""Numbers that are kept of a state: phase, parameter, point, slope angle, and those of `State`."""

_MOST = 96
"""Stretches that may wait for being followed."""

_MOST_MORE = 64
"""Stretches beyond those that are cut from which on none is halved: what is rough everywhere, like a contour whose
curvature is interpolated, is not smooth in smaller pieces either."""

_SMALL_ERROR, _RUBBING_ERROR = 1.3e-7, 2e-7
"""Largest errors of tables: of loads over the loads, and of the drive angle [rad]."""

_NEAR = 1e-3
"""Error of the interpolated way, as a share of the stretch, from which two steps of Newton's method leave nothing."""

_LAST = 1e-13
"""Newton step, as a share of a stretch, below which there is only rounding of its interpolants."""

_NO_MOMENT = 1e-12
"""Holding moment [EI/L] that is none."""

_STRAINED = 65
"""Ways along a stretch at which its largest curvature is sought."""

_TOUCHES, _RUNS_OUT = int(Reach.TOUCHES), int(Reach.RUNS_OUT)
_NEVER, _FOLD, _CORNER, _THRUST = (int(kind) for kind in SnapOff)


class Rig(NamedTuple):
    """What loads depend on beside rod and contour."""

    friction_angle: float
    """δ = arctan μ [rad]."""
    compliance: float
    """Turn of the pivot's suspension per holding moment, c in (drive angle) = φ0 + c m0 [rad/(EI/L)]."""
    offset: float
    """What the encoder reads too much, as seen in forward sweeps [rad]."""
    sign: float
    """−1 in backward sweeps."""


class Samples(NamedTuple):
    """What is asked for."""

    angles: Floats
    """Drive angles, as read and as seen in forward sweeps, increasing."""
    rows: NDArray[np.intp]
    """Where their loads and states go."""


class Found(NamedTuple):
    """What is known of samples and stretches; filled by `follow`."""

    loads: Floats
    """With the sign of the sweep, zero beforehand, shape (rows, 3)."""
    states: Floats
    """Seen in forward sweeps, zero beforehand, shape (rows, `STATE_COLUMNS`)."""
    changes: Floats
    """Where phases begin, as seen: parameter and whether the tip touches, shape (`MOST_CHANGES`, 2), or none if no
    states are wanted."""


class Ends(NamedTuple):
    """How a path begins and ends; NaN where there is none. Drive angles are as seen in forward sweeps."""

    reach: int
    distance: float
    first_angle: float
    first_parameter: float
    snap_angle: float
    snap_parameter: float
    snap_off: int
    phases: int
    """How many there are."""
    curvature: float
    """The largest one of the rod up to snap-off [1/L]; NaN if states are not wanted."""


class Work(NamedTuple):
    """Room for what is computed on one stretch, used again for the next."""

    series: Floats
    """Of drive angle and the three loads along the way."""
    slope: Floats
    bend: Floats
    values: Floats
    over_angle: Floats
    """Those of the way and of the loads over the drive angle."""
    states: Room
    on_grid: Floats
    wanted: Floats
    """Drive angles of samples on the stretch, and below what is made of them."""
    twice: Floats
    rate: Floats
    now: Floats
    before: Floats
    found: Floats
    """Loads of samples, shape (3, samples)."""
    pieces: Floats
    """Stretches as they are cut."""
    waiting: Floats
    """Stretches still to be followed, the next one last: begin, end, tip, rooted, halvings, large tables."""


def work(samples: int, order: int, knots: int, states: Room) -> Work:
    """For so many samples at most, nodes on a stretch, and knots of the contour."""
    row, most = np.empty(order), _MOST + 4 * (order + 4) + 4 * knots
    wanted, twice, rate, now, before = np.empty((5, samples))
    return Work(
        series=np.empty((4, order)),
        slope=row.copy(),
        bend=row.copy(),
        values=np.empty((4, order)),
        over_angle=np.empty((4, order)),
        states=states,
        on_grid=np.empty(2 * order + 1),
        wanted=wanted,
        twice=twice,
        rate=rate,
        now=now,
        before=before,
        found=np.empty((3, samples)),
        pieces=np.empty((most, 3)),
        waiting=np.empty((most + _MOST_MORE, 6)),
    )


@compiled
def _sample(outline: Outline, stretch: Stretch, rig: Rig, exact: bool, known: Tables, on: Nodes, room: Work) -> None:
    """Series along the way of drive angle and loads."""
    values, delta = room.values, rig.friction_angle
    for k in range(on.nodes.size):
        at = place(outline, along(stretch, on.nodes[k]))
        if exact:
            state = exact_state(at, delta, stretch.tip, known, room.states)
            values[0, k], values[1, k] = state.drive_angle, state.holding_moment
            values[2, k], values[3, k] = state.force_x, state.force_y
        else:
            quick = tabled_state(at, delta, stretch.tip, stretch.large, known, room.states)
            values[0, k], values[1, k], values[2, k], values[3, k] = quick
        values[0, k] += rig.compliance * values[1, k]
    for c in range(4):
        weighted(on.fit, values[c], room.series[c])


@compiled
def _misses(accuracy: Accuracy, tolerance: Floats, tables_miss: float, room: Work) -> tuple[bool, bool]:
    """Whether tables, and whether series along a stretch, miss loads by more than a tolerance."""
    angle, change = tail(room.series[0]), change_of(room.series[0])
    poor, rough = False, angle > accuracy.resolved * change or angle > accuracy.sharp
    for c in range(3):
        loads = room.series[c + 1]
        moved = change_of(loads)
        steepness = moved / change
        poor |= tables_miss * (abs(loads[0]) + moved + steepness) > tolerance[c]
        rough |= tail(loads) + angle * steepness > tolerance[c]
    return poor, rough


@compiled
def _first_fall(accuracy: Accuracy, is_first: bool, on: Nodes, room: Work) -> float:
    """Way to where the drive angle stops growing: above 1 if it grows to the end, 0 if it does not grow at all."""
    weighted(on.on_grid, room.slope, room.on_grid)
    for cell in range(1 if is_first else 0, on.grid.size):  # it always grows from first contact
        if room.on_grid[cell] <= 0.0:
            if cell == 0:
                return 0.0
            weighted(on.slopes, room.slope, room.bend)
            left, right = on.grid[cell - 1], on.grid[cell]
            return crossing(room.slope, room.bend, 0.0, left, right, 0.5 * (left + right), accuracy.last_step)
    return 2.0


@compiled
def _angle_rate(outline: Outline, stretch: Stretch, way: float, rig: Rig, known: Tables, room: Work) -> float:
    """Derivative of the exact drive angle by the way, of a stiff suspension."""
    at = place(outline, along(stretch, way))
    state = exact_state(at, rig.friction_angle, stretch.tip, known, room.states)
    return _rate(at, state) * along_rate(stretch, way)


@inlined
def _rate(at: Place, state: State) -> float:
    """Derivative of the drive angle by the contour's parameter."""
    lever, facing = frame(at)
    turning = -facing * at.speed / (at.x * at.x + at.y * at.y)
    return turning + state.by_slope * (at.bend - turning) + state.by_distance * 2.0 * lever * at.speed


@compiled
def _polished_fold(
    outline: Outline, stretch: Stretch, stop: float, rig: Rig, known: Tables, on: Nodes, room: Work
) -> float:
    """Way at which the exact derivative of the drive angle vanishes: secants, the first by the interpolant."""
    weighted(on.slopes, room.slope, room.bend)
    bend = value(room.bend, stop)
    at_stop, last = _angle_rate(outline, stretch, stop, rig, known, room), 2e-2
    for _ in range(7):
        step = at_stop / bend
        if not abs(step) < 0.5 * last:
            break
        new = min(max(stop - step, 0.0), 1.0)
        at_new = _angle_rate(outline, stretch, new, rig, known, room)
        bend = (at_new - at_stop) / (new - stop)
        stop, at_stop, last = new, at_new, abs(step)
    return stop


@compiled
def _over_drive_angle(
    accuracy: Accuracy, stop: float, begin: float, end: float, steadiness: float, on: Nodes, room: Work
) -> None:
    """Coefficients of the way and of the loads over the stretched drive angle."""
    angle, moment, force_x, force_y = room.series[0], room.series[1], room.series[2], room.series[3]
    slope, values = room.slope, room.values
    last_step = max(accuracy.last_step, _LAST)
    for k in range(on.nodes.size):
        ahead = 1.0 - on.nodes[k]
        wanted = end - (end - begin) * ahead * (steadiness + (1.0 - steadiness) * ahead)
        way = crossing(angle, slope, wanted, stop, 0.0, stop * on.nodes[k], last_step)
        values[0, k] = way
        values[1, k], values[2, k] = value_and_slope(moment, force_x, way)
        values[3, k] = value(force_y, way)
    for c in range(4):
        weighted(on.fit, values[c], room.over_angle[c])


@inlined
def _ahead(angle: float, begin: float, end: float, steadiness: float) -> float:
    """What is left of a stretch from 1 to 0, stretched toward its end so that states are smooth functions of it."""
    left = min(max((end - angle) / (end - begin), 0.0), 1.0)
    root = math.sqrt(steadiness * steadiness + 4.0 * (1.0 - steadiness) * left)
    ahead = 2.0 * left / (steadiness + root)
    return ahead if left > 0.0 else 0.0


@compiled
def _on_stretch(
    samples: Samples, offset: float, span: tuple[float, float], steadiness: float, room: Work
) -> tuple[int, int]:
    """The first sample on a stretch and how many there are; in the room their drive angles and stretched ones z, as
    4z − 2."""
    begin, end = span
    first, last = _before(samples.angles, begin + offset), _before(samples.angles, end + offset)
    while last < samples.angles.size and samples.angles[last] - offset <= end:
        last += 1
    wanted, twice, count = room.wanted, room.twice, last - first
    for j in range(count):
        wanted[j] = samples.angles[first + j] - offset
        twice[j] = 2.0 - 4.0 * _ahead(wanted[j], begin, end, steadiness)
    return first, count


@compiled
def _before(angles: Floats, angle: float) -> int:
    """How many angles, which increase, are less than one."""
    low, high = 0, angles.size
    while low < high:
        middle = (low + high) // 2
        if angles[middle] < angle:
            low = middle + 1
        else:
            high = middle
    return low


@compiled
def _look_for(accuracy: Accuracy, stop: float, count: int, room: Work) -> None:
    """Turn stretched drive angles of samples into ways along the stretch, as 4z − 2: from what interpolation says by
    Newton's method, if that is near, or each by itself."""
    wanted, twice, rate = room.wanted, room.twice, room.rate
    if tail(room.over_angle[0]) > _NEAR * stop:
        for j in range(count):
            way = crossing(room.series[0], room.slope, wanted[j], stop, 0.0, 0.5 * stop, accuracy.last_step)
            twice[j] = 4.0 * way - 2.0
        return
    at_all(room.over_angle[0], twice, count, room.now, room.before)
    for j in range(count):
        twice[j] = 4.0 * min(max(room.now[j], 0.0), stop) - 2.0
    for _ in range(2):
        at_all(room.slope, twice, count, rate, room.before)
        at_all(room.series[0], twice, count, room.now, room.before)
        for j in range(count):
            way = 0.25 * (twice[j] + 2.0)
            most = 0.5 * (stop - way) + _NEAR * _NEAR * stop
            step = (room.now[j] - wanted[j]) / rate[j] if rate[j] > 0.0 else 0.0
            twice[j] = 4.0 * min(max(way - min(max(step, -most), most), 0.0), stop) - 2.0


@compiled
def _write_loads(
    samples: Samples,
    first: int,
    count: int,
    accuracy: Accuracy,
    sign: float,
    stop: float,
    tolerance: Floats,
    room: Work,
    out: Floats,
) -> None:
    """Loads of the samples on a stretch: over the drive angle if they are smooth functions of it, else over the way."""
    smooth = True
    for c in range(3):
        smooth &= tail(room.over_angle[c + 1]) <= tolerance[c]
    loads = room.over_angle
    if not smooth:
        _look_for(accuracy, stop, count, room)
        loads = room.series
    three_at_all(loads, room.twice, count, room.now, room.before, room.found)
    for j in range(count):
        row = samples.rows[first + j]
        out[row, 0], out[row, 1] = sign * room.found[0, j], sign * room.found[1, j]
        out[row, 2] = room.found[2, j]


@compiled
def _write_states(
    outline: Outline,
    stretch: Stretch,
    rig: Rig,
    accuracy: Accuracy,
    stop: float,
    span: tuple[float, float],
    steadiness: float,
    samples: Samples,
    first: int,
    count: int,
    known: Tables,
    on: Nodes,
    room: Work,
    found: Found,
) -> None:
    """Exact states at the drive angles of the samples on a stretch, by Newton in the stretched drive angle."""
    begin, end = span
    delta, stiff, over_angle = rig.friction_angle, rig.compliance == 0.0, room.over_angle
    weighted(on.slopes, over_angle[0], room.bend)
    for j in range(count):
        row, target = samples.rows[first + j], 0.25 * (room.twice[j] + 2.0)
        way, pace = value_and_slope(over_angle[0], room.bend, target)
        way = stop - abs(stop - min(max(way, 0.0), 2.0 * stop))  # beyond a fold the drive angle is less again
        low, high, before = 0.0, stop, stop
        for _ in range(100):
            p = along(stretch, way)
            at = place(outline, p)
            state = exact_state(at, delta, stretch.tip, known, room.states)
            driven = state.drive_angle + rig.compliance * state.holding_moment
            # But for rounding, which may undo the very first contact.
            turned = 1.0 - _ahead(driven, begin, end, steadiness) if math.isfinite(driven) else 0.0
            missing = target - turned
            if abs(missing) <= accuracy.settled or not high > low:
                break
            if missing > 0.0:
                low = way
            else:
                high = way
            rate = _rate(at, state) * along_rate(stretch, way)
            newton = (steadiness + 2.0 * (1.0 - steadiness) * (1.0 - turned)) * (end - begin) / rate
            # Much nearer to the end than the goal is, the rate may be zero or rounding: the interpolant's serves.
            sound = stiff and newton > 0.0 and 1.0 - turned > 0.5 * (1.0 - target)
            new = way + missing * (newton if sound else pace)
            if not (low < new < high and abs(new - way) <= 0.5 * before):
                new = 0.5 * (low + high)
            before = abs(new - way)
            if new == way or not before > 0.0:
                break
            way = new
        if not math.isfinite(driven):
            continue
        # A parameter has only so many digits: what they leave of the way to the angle, the interpolant goes.
        reached = 1.0 - _ahead(driven, begin, end, steadiness)
        states = found.states[row]
        states[0] = TIP if stretch.tip else TANGENTIAL
        states[1], states[2], states[3], states[4] = p, at.x, at.y, math.atan2(at.sin, at.cos)
        for c in range(8):
            states[5 + c] = state[c]
        for c in range(3):
            states[6 + c] += value(over_angle[c + 1], target) - value(over_angle[c + 1], reached)
            found.loads[row, c] = (1.0 if c == 2 else rig.sign) * states[6 + c]


@compiled
def _largest_curvature(stop: float, rig: Rig, room: Work) -> float:
    """Largest curvature of the rod up to a way along a stretch: see `largest_curvature`."""
    largest = 0.0
    for k in range(_STRAINED):
        z = stop * k / (_STRAINED - 1.0)
        angle, moment = value_and_slope(room.series[0], room.series[1], z)
        force_x, force_y = value_and_slope(room.series[2], room.series[3], z)
        largest = max(largest, _curvature(angle - rig.compliance * moment, moment, force_x, force_y))
    return largest


@inlined
def _curvature(drive_angle: float, moment: float, force_x: float, force_y: float) -> float:
    """Largest curvature of the rod between pivot and contact, of a forward contact [1/L]."""
    cos, sin = math.cos(drive_angle), math.sin(drive_angle)
    lever, across = force_x * cos + force_y * sin, force_y * cos - force_x * sin
    inflated = 2.0 * (math.hypot(force_x, force_y) - lever) if across < 0.0 else 0.0
    return math.sqrt(moment * moment + inflated)


@compiled
def follow(
    outline: Outline,
    knots: Floats,
    rig: Rig,
    samples: Samples,
    accuracy: Accuracy,
    tolerance: Floats,
    known: Tables,
    on: Nodes,
    room: Work,
    found: Found,
) -> Ends:
    """Follow a path from first contact to snap-off.

    Parameters
    ----------
    knots : ndarray, shape (k,)
        Where the contour may not be smooth, decreasing.
    tolerance : ndarray, shape (3,)
        By how much loads may miss, of moment and forces [EI/L and EI/L²].
    """
    delta = rig.friction_angle
    tabled = delta <= MOST_FRICTION
    prepare(known, delta, room.states)
    limit = limits(outline, delta, accuracy.first_step)
    if limit.reach != _TOUCHES:
        return _nothing(limit.reach, limit.distance)
    pieces, waiting = room.pieces, room.waiting
    count = cut(outline, limit, knots, delta, accuracy, tabled, on, room.states, room.values, pieces)
    most = count + _MOST_MORE
    for k in range(count):  # the first one is to be the last, where a stack ends
        row = waiting[count - 1 - k]
        row[0], row[1], row[2] = pieces[k, 0], pieces[k, 1], pieces[k, 2]
        row[3] = k == 0 and limit.tip_first and row[2] > 0.0
        row[4], row[5] = 0.0, 0.0
    whole = limit.begin - limit.end
    first = bearing(outline, limit.begin)
    at_begin = first
    snap_parameter, kind, changes, largest = limit.begin, _THRUST, 0, math.nan
    wants_states, is_first, stretches = found.changes.shape[0] > 0, True, count
    ended = False
    while count and not ended:
        row = waiting[count - 1]
        stretch = Stretch(row[0], row[1], row[2] > 0.0, row[3] > 0.0, int(row[4]), row[5] > 0.0)
        exact = accuracy.exact or not tabled or (delta > 0.0 and stretch.large)
        _sample(outline, stretch, rig, exact, known, on, room)
        poor, rough = _misses(accuracy, tolerance, _RUBBING_ERROR if delta > 0.0 else _SMALL_ERROR, room)
        if poor and not (exact or stretch.large):
            row[5] = 1.0
            continue
        long = stretch.begin - stretch.end > BRIEF * whole
        if rough and stretch.halvings < accuracy.halvings and stretches < most and long:
            # Where loads begin like a square root the way does so with its square.
            middle = along(stretch, 0.5)
            above = waiting[count]
            above[0], above[1], above[2], above[3] = row[0], middle, row[2], row[3]
            above[4], above[5] = row[4] + 1.0, row[5]
            row[0], row[3], row[4] = middle, 0.0, row[4] + 1.0
            count, stretches = count + 1, stretches + 1
            continue
        count -= 1
        weighted(on.slopes, room.series[0], room.slope)
        stop = 2.0
        if limit.begin - stretch.end >= BRIEF * whole or not count:  # else it may be lost in rounding
            stop = _first_fall(accuracy, is_first, on, room)
        if stop == 0.0:
            kind, ended = _CORNER, True
            continue
        folds, stop = stop <= 1.0, min(stop, 1.0)
        if folds and accuracy.exact and rig.compliance == 0.0:
            stop = _polished_fold(outline, stretch, stop, rig, known, on, room)
        snap_parameter = along(stretch, stop)
        at_end, moment_left = value(room.series[0], stop), 1.0
        if accuracy.exact:
            at = place(outline, snap_parameter)
            state = exact_state(at, delta, stretch.tip, known, room.states)
            driven, moment_left = state.drive_angle + rig.compliance * state.holding_moment, state.holding_moment
            if math.isfinite(driven):
                at_end = driven
        steadiness = 0.0
        if not folds:
            steadiness = min(max(value(room.slope, stop) * stop / (at_end - at_begin), 0.0), 1.0)
        _over_drive_angle(accuracy, stop, at_begin, at_end, steadiness, on, room)
        first_there, there = _on_stretch(samples, rig.offset, (at_begin, at_end), steadiness, room)
        if wants_states:
            _write_states(
                outline,
                stretch,
                rig,
                accuracy,
                stop,
                (at_begin, at_end),
                steadiness,
                samples,
                first_there,
                there,
                known,
                on,
                room,
                found,
            )
            largest = max(_largest_curvature(stop, rig, room), 0.0 if math.isnan(largest) else largest)
        else:
            _write_loads(samples, first_there, there, accuracy, rig.sign, stop, tolerance, room, found.loads)
        if found.changes.shape[0] > changes and (not changes or (found.changes[changes - 1, 1] > 0.0) != stretch.tip):
            found.changes[changes, 0], found.changes[changes, 1] = stretch.begin, stretch.tip
            changes += 1
        at_begin, is_first = at_end, False
        if folds:
            # At a flat vertex the maximum and the end of all moment are one, and rounding must not choose between them.
            kind, ended = _THRUST if abs(moment_left) <= _NO_MOMENT else _FOLD, True
    if limit.runs_out and not ended:
        return _nothing(_RUNS_OUT, limit.distance)
    return Ends(_TOUCHES, limit.distance, first, limit.begin, at_begin, snap_parameter, kind, changes, largest)


@inlined
def _nothing(reach: int, distance: float) -> Ends:
    return Ends(reach, distance, math.nan, math.nan, math.nan, math.nan, _NEVER, 0, math.nan)
