"""Loads and states at the drive angles of the samples on a stretch of a path."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from tactile_bayes.arrays import Floats, Index
from tactile_bayes.mechanics.branches.curves import ANGLE, REST, WAY, Accuracy, Course, Curves, lay_over_angle, left_of
from tactile_bayes.mechanics.branches.equilibrium import SETTLED, Balance, Scene, in_phase
from tactile_bayes.mechanics.branches.leg import Leg, LegCurves, guess, settle_on
from tactile_bayes.mechanics.branches.line import drive_angle_at
from tactile_bayes.mechanics.branches.outline import on_object, place
from tactile_bayes.mechanics.branches.series import at_all, crossing, value, value_and_slope, weighted
from tactile_bayes.mechanics.compiler import compiled
from tactile_bayes.mechanics.phases import TANGENTIAL, TIP

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
    "write_state",
    "write_states",
]

STATE_COLUMNS = 13
"""Numbers that describe a state: phase, parameter, point, slope angle, and the fields of `State`."""

_SETTLED = 1e-14
"""Share of a stretch by which an exact state may miss its drive angle; the interpolant corrects for it."""

_NEAR, _MOST_STEPS = 1e-5, 6
"""Newton step, as a share of the stretch, after which the search ends, and the largest number of steps."""

_PAST = 1e-6
"""Share of a stretch by which a step may pass the end."""


class Samples(NamedTuple):
    """Samples of one path."""

    angles: Floats
    """Drive angles as read, in the sweep frame, increasing [rad]."""
    rows: Index
    """Rows of their loads and states."""
    relative: bool
    """True if angles are shares of the drive angle from first contact to snap-off."""


class Found(NamedTuple):
    """Results for the samples and stretches of a path."""

    loads: Floats
    """Loads with the sign of the sweep and the rod's rigidity, initially zero, shape (rows, 3)."""
    states: Floats
    """States in the sweep frame, initially zero, shape (rows, `STATE_COLUMNS`)."""
    changes: Floats
    """Beginnings of phases, then the end of the last: coordinates p, q and f of the equilibrium, 1 for tip contact, the
    number of the line of the drive, and the friction angle with the sign of its sense, shape (phases + 1, 6); no rows
    if no states are computed."""


class Asked(NamedTuple):
    """Workspace for the samples of a path and of one stretch."""

    angles: Floats
    """Drive angles of all samples, if shares were given."""
    wanted: Floats
    """Drive angles of the samples on the stretch."""
    twice: Floats
    """Stretched drive angles z, or positions z, as 4z − 2."""
    now: Floats
    before: Floats
    found: Floats
    """Values of up to four series, shape (4, samples)."""


class Followed(NamedTuple):
    """A leg that has been followed, with its series."""

    scene: Scene
    leg: Leg
    accuracy: Accuracy
    course: Course
    curves: Curves
    workspace: Asked


def asked(samples: int) -> Asked:
    """Workspace for at most so many samples."""
    angles, wanted, twice, now, before = np.empty((5, samples))
    return Asked(angles, wanted, twice, now, before, np.empty((4, samples)))


@compiled
def find_samples(samples: Samples, part: Followed) -> Samples:
    """Samples on a stretch; their drive angles are written to the workspace."""
    course, workspace, offset = part.course, part.workspace, part.scene.rig.offset
    first, last = _before(samples.angles, course.begin + offset), _before(samples.angles, course.end + offset)
    while last < samples.angles.size and samples.angles[last] - offset <= course.end:
        last += 1
    for j in range(last - first):
        workspace.wanted[j] = samples.angles[first + j] - offset
        workspace.twice[j] = 2.0 - 4.0 * left_of(workspace.wanted[j], course)
    return Samples(samples.angles[first:last], samples.rows[first:last], samples.relative)


@compiled
def _before(angles: Floats, angle: float) -> int:
    """Number of increasing angles that are less than a given one."""
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
    """Convert the stretched drive angles of samples to positions z on the stretch, as 4z − 2.

    Newton's method starts between the nodes of the series, for all samples together; samples for which it does not
    converge are solved one by one."""
    course, curves, workspace = part.course, part.curves, part.workspace
    wanted, twice, found, stop = workspace.wanted, workspace.twice, workspace.found, course.stop
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
        at_all(curves.series[ANGLE:], twice, count, workspace.now, workspace.before, found)
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
    """Write the loads of the samples on a stretch, from the series."""
    count, rig, curves, workspace = samples.rows.size, part.scene.rig, part.curves, part.workspace
    _look_for(part, count)
    moment, force_x = rig.sign * rig.moment_unit, rig.sign * rig.force_unit
    at_all(curves.series[:REST], workspace.twice, count, workspace.now, workspace.before, workspace.found)
    for j in range(count):
        row = samples.rows[j]
        out[row, 0], out[row, 1] = moment * workspace.found[0, j], force_x * workspace.found[1, j]
        out[row, 2] = rig.force_unit * workspace.found[2, j]


@compiled
def write_state(found: Balance, tip: bool, scene: Scene, out: Floats) -> None:
    """Write the columns of a state."""
    out[5] = drive_angle_at(scene.line, found.travel) - scene.rig.compliance * found.holding_moment
    out[6], out[7], out[8] = found.holding_moment, found.force_x, found.force_y
    _write_place(found.at.p, found.at.q, tip, scene, out)


@compiled
def _write_place(p: float, q: float, tip: bool, scene: Scene, states: Floats) -> None:
    """Write phase and place of a state."""
    at = place(scene.outline, p)
    alpha = math.atan2(at.sin, at.cos)
    states[0] = TIP if tip else TANGENTIAL
    states[1], states[4] = p, alpha
    states[2], states[3] = on_object(scene.outline, at)
    tip_angle = alpha + (scene.rig.friction_angle + q if tip else scene.outline.half_angle)
    states[9], states[10] = 1.0 if tip else q, tip_angle
    states[11], states[12] = math.nan, math.nan


@compiled
def _note(row: int, p: float, q: float, tip: bool, scene: Scene, out: Found) -> None:
    """Write phase and place of a state, and the loads of its row."""
    states, rig = out.states[row], scene.rig
    _write_place(p, q, tip, scene, states)
    out.loads[row, 0] = rig.moment_unit * rig.sign * states[6]
    out.loads[row, 1], out.loads[row, 2] = rig.force_unit * rig.sign * states[7], rig.force_unit * states[8]


@compiled
def write_states(samples: Samples, part: Followed, work: LegCurves, out: Found) -> None:
    """Write the states of the samples on a leg, from the series."""
    course, curves, workspace = part.course, part.curves, part.workspace
    count = samples.rows.size
    # Just before the end of contact the last drive angle matters.
    off = value(curves.series[ANGLE], course.stop) - course.end
    for j in range(count):
        workspace.wanted[j] += off
    _look_for(part, count)
    at_all(curves.series[:ANGLE], workspace.twice, count, workspace.now, workspace.before, workspace.found)
    for j in range(count):
        row = samples.rows[j]
        states = out.states[row]
        driven = drive_angle_at(part.scene.line, workspace.wanted[j] - off)
        states[5] = driven - part.scene.rig.compliance * workspace.found[0, j]
        for c in range(3):
            states[6 + c] = workspace.found[c, j]
        p = value(work.place, 0.25 * (workspace.twice[j] + 2.0))
        _note(row, p, workspace.found[REST, j], part.leg.tip, part.scene, out)


@compiled
def polish_states(samples: Samples, part: Followed, work: LegCurves, out: Found) -> None:
    """Write exact states at the drive angles of the samples on a leg, by Newton's method in the stretched angle."""
    scene, leg, course, curves, workspace = part.scene, part.leg, part.course, part.curves, part.workspace
    stop, steadiness, over_angle = course.stop, course.steadiness, curves.over_angle
    loaded = in_phase(scene, leg.tip)
    lay_over_angle(part.accuracy, course, curves)
    weighted(curves.on.slopes, over_angle[WAY], curves.bend)
    for j in range(samples.rows.size):
        row, target = samples.rows[j], 0.25 * (workspace.twice[j] + 2.0)
        way, pace = value_and_slope(over_angle[WAY], curves.bend, target)
        way = stop - abs(stop - min(max(way, 0.0), 2.0 * stop))  # beyond a fold the drive angle falls again
        low, high, before = 0.0, stop, stop
        for _ in range(100):
            state = settle_on(loaded, leg, way, guess(work, way), SETTLED)
            # Rounding may undo the very first contact.
            turned = 1.0 - left_of(state.travel, course) if math.isfinite(state.travel) else 0.0
            missing = target - turned
            if abs(missing) <= _SETTLED or not high > low:
                break
            if missing > 0.0:
                low = way
            else:
                high = way
            rate = state.travel_rate
            newton = (steadiness + 2.0 * (1.0 - steadiness) * (1.0 - turned)) * (course.end - course.begin) / rate
            # Much nearer to the end than the target the rate may be zero or rounding: take the interpolant's rate.
            new = way + missing * (newton if newton > 0.0 and 1.0 - turned > 0.5 * (1.0 - target) else pace)
            if not (low < new < high and abs(new - way) <= 0.5 * before):
                new = 0.5 * (low + high)
            before = abs(new - way)
            if new == way or not before > 0.0:
                break
            way = new
        if not math.isfinite(state.travel):
            continue
        # The digits of a position are limited: the interpolant corrects for the remaining distance to the angle.
        reached = 1.0 - left_of(state.travel, course)
        states = out.states[row]
        write_state(state, leg.tip, scene, states)
        for c in range(3):
            states[6 + c] += value(over_angle[c], target) - value(over_angle[c], reached)
        _note(row, state.at.p, state.at.q, leg.tip, scene, out)
