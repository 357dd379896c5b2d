"""Loads and states at the drive angles of the samples on a stretch of a path."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from tactile_bayes.arrays import Floats, Index
from tactile_bayes.mechanics.branches.curves import ANGLE, REST, WAY, Accuracy, Course, lay_over_angle, left_of
from tactile_bayes.mechanics.branches.equilibrium import (
    SETTLED,
    Balance,
    Equilibrium,
    Scene,
    balance,
    tangential_psi1,
)
from tactile_bayes.mechanics.branches.leg import Leg, LegCurves, guess, settle_on
from tactile_bayes.mechanics.branches.line import drive_angle_at
from tactile_bayes.mechanics.branches.outline import on_object, place
from tactile_bayes.mechanics.branches.phase import on_rod
from tactile_bayes.mechanics.branches.series import at_all, crossing, value, value_and_slope, weighted
from tactile_bayes.mechanics.compiler import compiled

__all__ = [
    "STATE",
    "STATE_COLUMNS",
    "Asked",
    "Followed",
    "Found",
    "Samples",
    "asked",
    "find_samples",
    "polish_states",
    "write_event",
    "write_loads",
    "write_states",
]

STATE_COLUMNS = (
    *("phase", "parameter", "x", "y", "slope_angle", "drive_angle"),
    *("holding_moment", "force_x", "force_y", "arclength", "tip_angle", "travel"),
)
STATE = np.dtype([(name, np.float64) for name in STATE_COLUMNS])
"""A state in the sweep frame; the drive angle is that of the unloaded rod, without the turn of the suspension."""

_SETTLED = 1e-14
"""Share of a stretch by which an exact state may miss its drive angle; the interpolant corrects for it."""

_NEAR, _MOST_STEPS = 1e-5, 6
"""Newton step, as a share of the stretch, after which the search ends, and the largest number of steps."""

_MOST_HALVINGS = 100
"""Largest number of steps to an exact state: more than halvings of a stretch to rounding."""

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
    states: Any
    """States, initially zero, structured as `STATE`, shape (rows,)."""
    changes: Floats
    """Beginnings of phases, then the end of the last: coordinates p, q and f of the equilibrium, 1 for tip contact, the
    number of the line of the drive, and the friction angle with the sign of its sense, shape (phases + 1, 6); no rows
    if no states are computed."""
    events: Any
    """States there, initially zero, structured as `STATE`, shape (phases + 1,)."""


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
    work: LegCurves
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
    course, curves, workspace = part.course, part.work.curves, part.workspace
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
    count, workspace = samples.rows.size, part.workspace
    _look_for(part, count)
    at_all(part.work.curves.series[:REST], workspace.twice, count, workspace.now, workspace.before, workspace.found)
    for j in range(count):
        moment, force_x, force_y = workspace.found[0, j], workspace.found[1, j], workspace.found[2, j]
        _write_loads(part.scene, moment, force_x, force_y, out[samples.rows[j]])


@compiled
def _write_loads(scene: Scene, moment: float, force_x: float, force_y: float, out: Floats) -> None:
    """Write loads with the sign of the sweep and the rod's rigidity."""
    rig = scene.rig
    out[0], out[1] = rig.sign * rig.moment_unit * moment, rig.sign * rig.force_unit * force_x
    out[2] = rig.force_unit * force_y


@compiled
def _write_state(
    scene: Scene, p: float, q: float, travel: float, moment: float, force_x: float, force_y: float, out: Any
) -> None:
    """Write a state."""
    at = place(scene.outline, p)
    psi1, arclength = on_rod(scene.phase, q, tangential_psi1(scene))
    out.phase, out.parameter, out.travel, out.arclength = scene.phase, p, travel, arclength
    out.x, out.y = on_object(scene.outline, at)
    out.slope_angle = math.atan2(at.sin, at.cos)
    out.tip_angle = out.slope_angle + (scene.rig.friction_angle + psi1)
    out.drive_angle = drive_angle_at(scene.line, travel) - scene.rig.compliance * moment
    out.holding_moment, out.force_x, out.force_y = moment, force_x, force_y


@compiled
def write_event(scene: Scene, line: int, at: Equilibrium, tip: bool, k: int, out: Found) -> None:
    """Write an event of a path: its coordinates, and its state."""
    row, state = out.changes[k], balance(scene, at)[0]
    row[0], row[1], row[2], row[3], row[4], row[5] = at.p, at.q, at.force, tip, line, scene.rig.friction_angle
    moment, force_x, force_y = state.holding_moment, state.force_x, state.force_y
    _write_state(scene, at.p, at.q, state.travel, moment, force_x, force_y, out.events[k])


@compiled
def write_states(samples: Samples, part: Followed, out: Found) -> None:
    """Write the states of the samples on a leg, from the series."""
    course, work, workspace = part.course, part.work, part.workspace
    series, count = work.curves.series, samples.rows.size
    # Just before the end of contact the last drive angle matters.
    off = value(series[ANGLE], course.stop) - course.end
    for j in range(count):
        workspace.wanted[j] += off
    _look_for(part, count)
    at_all(series[:ANGLE], workspace.twice, count, workspace.now, workspace.before, workspace.found)
    for j in range(count):
        row, found = samples.rows[j], workspace.found
        p, travel = value(work.place, 0.25 * (workspace.twice[j] + 2.0)), workspace.wanted[j] - off
        moment, force_x, force_y = found[0, j], found[1, j], found[2, j]
        _write_state(part.scene, p, found[REST, j], travel, moment, force_x, force_y, out.states[row])
        _write_loads(part.scene, moment, force_x, force_y, out.loads[row])


@compiled
def polish_states(samples: Samples, part: Followed, out: Found) -> None:
    """Write exact states at the drive angles of the samples on a leg."""
    scene, course, curves = part.scene, part.course, part.work.curves
    over_angle = curves.over_angle
    lay_over_angle(part.accuracy, course, curves)
    weighted(curves.on.slopes, over_angle[WAY], curves.bend)
    for j in range(samples.rows.size):
        row, target = samples.rows[j], 0.25 * (part.workspace.twice[j] + 2.0)
        state = _polished(part, target)
        if not math.isfinite(state.travel):
            continue
        # The digits of a position are limited: the interpolant corrects for the remaining distance to the angle.
        reached, loads = 1.0 - left_of(state.travel, course), part.workspace.found[:, 0]
        for c in range(3):
            loads[c] = value(over_angle[c], target) - value(over_angle[c], reached)
        moment, force_x = state.holding_moment + loads[0], state.force_x + loads[1]
        force_y = state.force_y + loads[2]
        out_state = out.states[row]
        _write_state(scene, state.at.p, state.at.q, state.travel, moment, force_x, force_y, out_state)
        out_state.drive_angle = drive_angle_at(scene.line, state.travel) - scene.rig.compliance * state.holding_moment
        _write_loads(scene, moment, force_x, force_y, out.loads[row])


@compiled
def _polished(part: Followed, target: float) -> Balance:
    """State at a stretched drive angle, by Newton's method in it."""
    course, curves = part.course, part.work.curves
    stop, steadiness = course.stop, course.steadiness
    way, pace = value_and_slope(curves.over_angle[WAY], curves.bend, target)
    way = stop - abs(stop - min(max(way, 0.0), 2.0 * stop))  # beyond a fold the drive angle falls again
    low, high, before = 0.0, stop, stop
    state = settle_on(part.scene, part.leg, way, guess(part.work, way), SETTLED)
    for _ in range(_MOST_HALVINGS):
        # Rounding may undo the very first contact.
        turned = 1.0 - left_of(state.travel, course) if math.isfinite(state.travel) else 0.0
        missing = target - turned
        if abs(missing) <= _SETTLED or not high > low:
            break
        if missing > 0.0:
            low = way
        else:
            high = way
        rate = state.rates.travel
        newton = (steadiness + 2.0 * (1.0 - steadiness) * (1.0 - turned)) * (course.end - course.begin) / rate
        # Much nearer to the end than the target the rate may be zero or rounding: take the interpolant's rate.
        new = way + missing * (newton if newton > 0.0 and 1.0 - turned > 0.5 * (1.0 - target) else pace)
        if not (low < new < high and abs(new - way) <= 0.5 * before):
            new = 0.5 * (low + high)
        before = abs(new - way)
        if new == way or not before > 0.0:
            break
        way = new
        state = settle_on(part.scene, part.leg, way, guess(part.work, way), SETTLED)
    return state
