"""What the base feels at the drive angles of samples that lie on a stretch of a path."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from tactile_bayes.arrays import Floats
from tactile_bayes.mechanics.compiler import compiled
from tactile_bayes.mechanics.curves import ANGLE, MISS, REST, WAY, Course, Curves, angle_rate, lay_over_angle, left_of
from tactile_bayes.mechanics.outline import Place, place
from tactile_bayes.mechanics.phases import TANGENTIAL, TIP
from tactile_bayes.mechanics.series import at_all, crossing, value, value_and_slope, weighted
from tactile_bayes.mechanics.states import Rig, Scene, exact_state
from tactile_bayes.mechanics.stretches import Accuracy, Stretch, along, along_rate

__all__ = [
    "STATE_COLUMNS",
    "Asked",
    "Followed",
    "Found",
    "Samples",
    "asked",
    "find_samples",
    "polish_states",
    "write_loads",
    "write_states",
]

STATE_COLUMNS = 13
"""Numbers that are kept of a state: phase, parameter, point, slope angle, and those of `State`."""

_SETTLED = 1e-14
"""Share of a stretch by which an exact state may miss its drive angle, for the interpolant to make up for it."""

_NEAR, _MOST_STEPS = 1e-5, 6
"""Newton step, as a share of the stretch, after which nothing is left to do, and how many there are at most."""

_PAST = 1e-6
"""Share of a stretch by which a step may go past the end."""


class Samples(NamedTuple):
    """What is asked for."""

    angles: Floats
    """Drive angles, as read and as seen in forward sweeps, increasing."""
    rows: NDArray[np.intp]
    """Where their loads and states go."""
    relative: bool
    """Whether angles are shares of the way from first contact to snap-off."""


class Found(NamedTuple):
    """What is known of samples and stretches."""

    loads: Floats
    """With the sign of the sweep and the rod's rigidity, zero beforehand, shape (rows, 3)."""
    states: Floats
    """Seen in forward sweeps, zero beforehand, shape (rows, `STATE_COLUMNS`)."""
    changes: Floats
    """Where phases begin, as seen: parameter and whether the tip touches, shape (phases, 2), or none if no states are
    wanted."""


class Asked(NamedTuple):
    """Room for samples of a path, and on one stretch."""

    angles: Floats
    """Drive angles of all, if shares were asked for."""
    wanted: Floats
    """Their drive angles."""
    twice: Floats
    """Stretched drive angles z, or ways, as 4z − 2."""
    now: Floats
    before: Floats
    found: Floats
    """Values of up to four series, shape (4, samples)."""


class Followed(NamedTuple):
    """A stretch that has been followed, with what its samples are found by."""

    scene: Scene
    stretch: Stretch
    accuracy: Accuracy
    course: Course
    curves: Curves
    room: Asked


def asked(samples: int) -> Asked:
    """Room for so many at most."""
    angles, wanted, twice, now, before = np.empty((5, samples))
    return Asked(angles, wanted, twice, now, before, np.empty((4, samples)))


@compiled
def find_samples(samples: Samples, part: Followed) -> Samples:
    """Those on a stretch; their drive angles go into the room."""
    course, room, offset = part.course, part.room, part.scene.rig.offset
    first, last = _before(samples.angles, course.begin + offset), _before(samples.angles, course.end + offset)
    while last < samples.angles.size and samples.angles[last] - offset <= course.end:
        last += 1
    for j in range(last - first):
        room.wanted[j] = samples.angles[first + j] - offset
        room.twice[j] = 2.0 - 4.0 * left_of(room.wanted[j], course)
    return Samples(samples.angles[first:last], samples.rows[first:last], samples.relative)


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
def _look_for(part: Followed, count: int) -> None:
    """Turn stretched drive angles of samples into ways along the stretch, as 4z − 2: by Newton's method from between
    the nodes of the series, all side by side, or each by itself where that does not come near."""
    course, curves, room = part.course, part.curves, part.room
    wanted, twice, found, stop = room.wanted, room.twice, room.found, course.stop
    nodes, angles, angle, rate = curves.on.nodes, curves.values[ANGLE], curves.series[ANGLE], curves.series[ANGLE + 1]
    k, before, after, way_before, way_after = 0, -2.0, -2.0, 0.0, 0.0
    for j in range(count):
        while twice[j] > after and after < 2.0:
            before, way_before = after, way_after
            beyond = k == nodes.size or nodes[k] >= stop or angles[k] >= course.end
            after = 2.0 if beyond else 2.0 - 4.0 * left_of(angles[k], course)
            way_after = stop if beyond else nodes[k]
            k += 1
        share = (twice[j] - before) / (after - before) if after > before else 1.0
        twice[j] = 4.0 * (way_before + share * (way_after - way_before)) - 2.0
    for _ in range(_MOST_STEPS):
        at_all(curves.series[ANGLE:], twice, count, room.now, room.before, found)
        largest = 0.0
        for j in range(count):
            way = 0.25 * (twice[j] + 2.0)
            most = 0.5 * (stop - way) + _PAST * stop
            step = (found[0, j] - wanted[j]) / found[1, j] if found[1, j] > 0.0 else 0.0
            found[2, j] = min(max(step, -most), most)
            twice[j] = 4.0 * min(max(way - found[2, j], 0.0), stop) - 2.0
            largest = max(largest, abs(found[2, j]))
        if largest <= _NEAR * stop:
            return
    for j in range(count):
        if abs(found[2, j]) > _NEAR * stop:
            way = 0.25 * (twice[j] + 2.0)
            way = crossing(angle, rate, wanted[j], stop, 0.0, way, part.accuracy.last_step)
            twice[j] = 4.0 * way - 2.0


@compiled
def write_loads(samples: Samples, part: Followed, out: Floats) -> None:
    """Loads of the samples on a stretch, from the series."""
    count, rig, curves, room = samples.rows.size, part.scene.rig, part.curves, part.room
    _look_for(part, count)
    sideward = rig.sign * rig.rigidity
    at_all(curves.series[:REST], room.twice, count, room.now, room.before, room.found)
    for j in range(count):
        row = samples.rows[j]
        out[row, 0], out[row, 1] = sideward * room.found[0, j], sideward * room.found[1, j]
        out[row, 2] = rig.rigidity * room.found[2, j]


@compiled
def _note(row: int, p: float, at: Place, tip: bool, rig: Rig, out: Found) -> None:
    """Note phase and place of a state, and the loads that are those of its row."""
    states = out.states[row]
    states[0] = TIP if tip else TANGENTIAL
    states[1], states[2], states[3], states[4] = p, at.x, at.y, math.atan2(at.sin, at.cos)
    for c in range(3):
        out.loads[row, c] = rig.rigidity * (1.0 if c == 2 else rig.sign) * states[6 + c]


@compiled
def write_states(samples: Samples, part: Followed, out: Found) -> None:
    """States of the samples on a stretch from the series, without derivatives."""
    scene, stretch, course, curves, room = part.scene, part.stretch, part.course, part.curves, part.room
    count = samples.rows.size
    # Just before the end of contact it matters where the drive angle ends.
    off = value(curves.series[ANGLE], course.stop) - course.end
    for j in range(count):
        room.wanted[j] += off
    _look_for(part, count)
    at_all(curves.series[:ANGLE], room.twice, count, room.now, room.before, room.found)
    for j in range(count):
        row = samples.rows[j]
        p = along(stretch, 0.25 * (room.twice[j] + 2.0))
        at, states = place(scene.outline, p), out.states[row]
        states[5] = room.wanted[j] - off - scene.rig.compliance * room.found[0, j]
        for c in range(3):
            states[6 + c] = room.found[c, j]
        _note(row, p, at, stretch.tip, scene.rig, out)
        rest = room.found[REST, j]
        states[9], states[10] = (1.0, rest) if stretch.tip else (rest, states[4])
        states[11], states[12] = math.nan, math.nan


@compiled
def polish_states(samples: Samples, part: Followed, out: Found) -> None:
    """Exact states at the drive angles of the samples on a stretch, by Newton in the stretched drive angle."""
    scene, stretch, course, curves, room = part.scene, part.stretch, part.course, part.curves, part.room
    stop, steadiness, over_angle, rig = course.stop, course.steadiness, curves.over_angle, scene.rig
    lay_over_angle(part.accuracy, course, curves)
    weighted(curves.on.slopes, over_angle[WAY], curves.bend)
    for j in range(samples.rows.size):
        row, target = samples.rows[j], 0.25 * (room.twice[j] + 2.0)
        way, pace = value_and_slope(over_angle[WAY], curves.bend, target)
        way = stop - abs(stop - min(max(way, 0.0), 2.0 * stop))  # beyond a fold the drive angle is less again
        low, high, before = 0.0, stop, stop
        for _ in range(100):
            p = along(stretch, way)
            at = place(scene.outline, p)
            state = exact_state(scene, at, stretch.tip, MISS)
            driven = state.drive_angle + rig.compliance * state.holding_moment
            # But for rounding, which may undo the very first contact.
            turned = 1.0 - left_of(driven, course) if math.isfinite(driven) else 0.0
            missing = target - turned
            if abs(missing) <= _SETTLED or not high > low:
                break
            if missing > 0.0:
                low = way
            else:
                high = way
            rate = angle_rate(at, state) * along_rate(stretch, way)
            newton = (steadiness + 2.0 * (1.0 - steadiness) * (1.0 - turned)) * (course.end - course.begin) / rate
            # Much nearer to the end than the goal is, the rate may be zero or rounding: the interpolant's serves.
            sound = rig.compliance == 0.0 and newton > 0.0 and 1.0 - turned > 0.5 * (1.0 - target)
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
        reached = 1.0 - left_of(driven, course)
        states = out.states[row]
        for c in range(8):
            states[5 + c] = state[c]
        for c in range(3):
            states[6 + c] += value(over_angle[c], target) - value(over_angle[c], reached)
        _note(row, p, at, stretch.tip, rig, out)
