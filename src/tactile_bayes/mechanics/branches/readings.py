"""Loads and states at the drive angles of the samples of a path, from the legs that have been followed."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from tactile_bayes.arrays import Floats, Index
from tactile_bayes.mechanics.branches.equilibrium import SETTLED, Balance, balance
from tactile_bayes.mechanics.branches.leg import ANGLE, PLACE, RATE, REST, Leg, LegSeries, guess, settle_on
from tactile_bayes.mechanics.branches.line import drive_angle_at
from tactile_bayes.mechanics.branches.outline import on_object, place
from tactile_bayes.mechanics.branches.phase import contact_at, slides, tip_touches
from tactile_bayes.mechanics.branches.scene import (
    Equilibrium,
    Scene,
    StuckContact,
    anchored,
    in_phase,
    on_line,
    with_friction,
)
from tactile_bayes.mechanics.branches.series import at_all, copy_rows, crossing, two_values, value
from tactile_bayes.mechanics.compiler import compiled
from tactile_bayes.mechanics.newton import newton_step
from tactile_bayes.mechanics.phases import TANGENTIAL, TIP
from tactile_bayes.mechanics.poses.beam import bending

STATE_COLUMNS = (
    *("phase", "parameter", "x", "y", "slope_angle", "drive_angle"),
    *("holding_moment", "force_x", "force_y", "arclength", "tip_angle", "travel", "friction_angle", "sticks"),
)
# A state in the sweep frame; the drive angle is that of the unloaded rod, without the turn of the suspension, the
# friction angle that from the contour's normal to the force, and `sticks` is 1 where the contact does not slip.
STATE = np.dtype([(name, np.float64) for name in STATE_COLUMNS])
# Newton step, as a share of the leg, after which the search in series ends, and the largest number of steps.
_NEAR, _MOST_STEPS = 1e-5, 6
_PAST = 1e-6  # share of a leg by which a step may pass the end
# Newton step to an exact state, over the distance from the end of its leg, after which a first-order correction leaves
# rounding errors only: its square; the rounding of a travel; and that of one by Taylor series, below which a step that
# does not halve what is missing is noise (at 1e-8, 2 of 40 paths had a state just before a fold off by 5e-10 rad).
_SETTLED, _ROUNDING, _NOISE = 1e-8, 1e-15, 1e-13
_STEADY = 1e-6  # steadiness of a leg below which it ends at a fold, up to rounding: also where this is at a knot
_MOST_HALVINGS = 100  # largest number of steps to an exact state: more than halvings of a leg to rounding
_PIECES = 16  # pieces of a leg between which curvatures are compared: the largest is found to some 1e-5 of itself


class PathSamples(NamedTuple):
    """Samples of one path."""

    angles: Floats  # travels, or drive angles as read, in the sweep frame, increasing
    rows: Index  # rows of their loads and states
    relative: bool  # true if angles are shares of the travel from first contact to snap-off


class PathResults(NamedTuple):
    """Results of a path."""

    loads: Floats  # loads with the sign of the sweep and the rod's rigidity, initially zero, shape (rows, 3)
    states: Any  # states of samples, initially zero, structured as `STATE`, shape (rows,)
    # States where phases begin, and at the end of the last, structured as `STATE`, shape (phases + 1,); none if no
    # states are computed.
    events: Any
    event: Any  # events of the path, one record; see `Solutions`


class TravelCourse(NamedTuple):
    """Course of the travel along a leg."""

    stop: float  # position at which the leg, or the path, ends
    begin: float  # travel at the beginning
    end: float
    steadiness: float  # rate at the end over the mean rate: 0 where the drive turns back, 1 if the rate is constant


class Legs(NamedTuple):
    """Legs that have been followed, one in each row, and room for the samples on one of them."""

    phase: Index
    line: Index  # number of the line of the drive
    # Angle of the friction, and where a contact sticks, as in `RigParameters` and `StuckContact`, shape (legs, 3).
    friction: Floats
    leg: Floats  # as in `Leg`, and the equilibrium where its growing part ends, shape (legs, 4, 3)
    course: Floats  # as in `TravelCourse`, shape (legs, 4)
    series: Floats  # as in `LegSeries`, shape (legs, 7, order)
    angles: Floats  # drive angles of all samples, if shares were given
    wanted: Floats  # travels of the samples on a leg
    twice: Floats  # their positions z, as 4 z − 2
    now: Floats
    before: Floats
    found: Floats  # values of up to five series, shape (5, samples)


class Followed(NamedTuple):
    """A leg that has been followed, with its series in the workspace."""

    scene: Scene
    leg: Leg
    end: Equilibrium
    course: TravelCourse
    work: LegSeries
    room: Legs


def legs_for(legs: int, order: int, samples: int) -> Legs:
    """Room for at most so many legs, with series of so many terms, and samples."""
    phase, line = np.empty((2, legs), dtype=np.intp)
    friction = np.empty((legs, 3))
    leg, course, series = np.empty((legs, 4, 3)), np.empty((legs, 4)), np.empty((legs, RATE + 1, order))
    angles, wanted, twice, now, before = np.empty((5, samples))
    return Legs(
        phase, line, friction, leg, course, series, angles, wanted, twice, now, before, np.empty((ANGLE, samples))
    )


@compiled
def store(
    k: int, scene: Scene, line: int, leg: Leg, end: Equilibrium, course: TravelCourse, work: LegSeries, legs: Legs
) -> None:
    """Keep a leg as number k."""
    legs.phase[k], legs.line[k], rows, friction = scene.phase, line, legs.leg[k], legs.friction[k]
    friction[0], friction[1], friction[2] = scene.rig.friction_angle, scene.anchor.p, scene.anchor.arclength
    for c in range(3):
        rows[0, c], rows[1, c], rows[2, c], rows[3, c] = leg.begin[c], leg.along[c], leg.normal[c], end[c]
    for c in range(4):
        legs.course[k, c] = course[c]
    copy_rows(work.series, legs.series[k])


@compiled
def recall(k: int, scene: Scene, lines: Floats, work: LegSeries, legs: Legs) -> Followed:
    """Leg number k, with its series in the workspace."""
    copy_rows(legs.series[k], work.series)
    rows, course, friction = legs.leg[k], legs.course[k], legs.friction[k]
    leg = Leg(_equilibrium(rows[0]), _equilibrium(rows[1]), _equilibrium(rows[2]))
    there = anchored(
        on_line(in_phase(scene, legs.phase[k]), lines, legs.line[k]), StuckContact(friction[1], friction[2])
    )
    there = with_friction(there, friction[0])
    return Followed(
        there, leg, _equilibrium(rows[3]), TravelCourse(course[0], course[1], course[2], course[3]), work, legs
    )


@compiled
def _equilibrium(row: Floats) -> Equilibrium:
    return Equilibrium(row[0], row[1], row[2])


@compiled
def largest_curvature(scene: Scene, stop: float, work: LegSeries) -> float:
    """Largest change of the rod's curvature from its rest curvature up to a position on a leg [1/L]: of values at even
    distances, and where a parabola through three of them about the largest has its vertex."""
    size, curvature, best = stop / _PIECES, work.sampled, 0
    for k in range(_PIECES + 1):
        curvature[k] = _bent(scene, k * size, work.series)
        best = k if curvature[k] > curvature[best] else best
    middle = min(max(best, 1), _PIECES - 1)
    rise, fall = curvature[middle] - curvature[middle - 1], curvature[middle] - curvature[middle + 1]
    off = 0.5 * (rise - fall) / (rise + fall)
    return max(curvature[best], _bent(scene, (middle + off) * size, work.series) if abs(off) < 1.0 else 0.0)


@compiled
def _bent(scene: Scene, way: float, series: Floats) -> float:
    """Largest change of curvature between pivot and contact at a position [1/L]."""
    moment, force_x = two_values(series[0], series[1], way)
    force_y, rest = two_values(series[2], series[REST], way)
    at = Equilibrium(0.0 if slides(scene.phase) else value(series[PLACE], way), rest, 0.0)
    slope = drive_angle_at(scene.line, value(series[ANGLE], way)) - scene.rig.compliance * moment
    return bending(scene.beam, slope, moment, force_x, force_y, contact_at(scene, at).arclength)


@compiled
def write_event(scene: Scene, at: Equilibrium, out: Any) -> None:
    """Write the state at an event of a path."""
    found = balance(scene, at)[0]
    moment, force_x, force_y = found.holding_moment, found.force_x, found.force_y
    _write_state(scene, at, found.travel, moment, force_x, force_y, out)


@compiled
def _write_state(
    scene: Scene, at: Equilibrium, travel: float, moment: float, force_x: float, force_y: float, out: Any
) -> None:
    contact = contact_at(scene, at)
    there = place(scene.outline, contact.p)
    out.phase = TIP if tip_touches(scene.phase) else TANGENTIAL
    out.parameter, out.travel, out.arclength = contact.p, travel, contact.arclength
    out.x, out.y = on_object(scene.outline, there)
    out.slope_angle, out.friction_angle = math.atan2(there.sin, there.cos), contact.friction_angle
    out.sticks = 0.0 if slides(scene.phase) else 1.0
    out.tip_angle = out.slope_angle + (contact.friction_angle + contact.psi1)
    out.drive_angle = drive_angle_at(scene.line, travel) - scene.rig.compliance * moment
    out.holding_moment, out.force_x, out.force_y = moment, force_x, force_y


@compiled
def write_samples(samples: PathSamples, part: Followed, wants_states: bool, out: PathResults) -> None:
    """Write the loads of the samples on a leg, and their states if these are wanted: exact ones, or from the series."""
    scene, work, room, rig = part.scene, part.work, part.room, part.scene.rig
    samples, found = _on_leg(samples, part), room.found
    count = samples.rows.size
    # Just before the end of contact the last drive angle matters.
    off = value(work.series[ANGLE], part.course.stop) - part.course.end if wants_states else 0.0
    _look_for(part, count, off)
    at_all(work.series[: ANGLE if wants_states else REST], room.twice, count, room.now, room.before, found)
    for j in range(count):
        row, moment, force_x, force_y = samples.rows[j], found[0, j], found[1, j], found[2, j]
        if wants_states:
            travel, at = room.wanted[j], Equilibrium(found[PLACE, j], found[REST, j], math.hypot(force_x, force_y))
            if work.accuracy.polished:
                state = _polished(part, travel, 0.25 * (room.twice[j] + 2.0), at)
                if not math.isfinite(state.travel):
                    continue
                at, moment, force_x, force_y = state.at, state.holding_moment, state.force_x, state.force_y
            _write_state(scene, at, travel, moment, force_x, force_y, out.states[row])
        loads = out.loads[row]
        loads[0], loads[1] = rig.sign * rig.moment_unit * moment, rig.sign * rig.force_unit * force_x
        loads[2] = rig.force_unit * force_y


@compiled
def _on_leg(samples: PathSamples, part: Followed) -> PathSamples:
    """Samples on a leg. Their travels are written to the room, and positions at which these are reached if the rate of
    the travel is linear in the position."""
    course, room, offset, angles = part.course, part.room, part.scene.rig.offset, samples.angles
    first = np.searchsorted(angles, course.begin + offset)
    last = max(np.searchsorted(angles, course.end + offset), first)
    while last < angles.size and angles[last] - offset <= course.end:
        last += 1
    for j in range(last - first):
        room.wanted[j] = angles[first + j] - offset
        # With the way z on the leg that is left, left = z (steadiness + (1 − steadiness) z).
        left = min(max((course.end - room.wanted[j]) / (course.end - course.begin), 0.0), 1.0)
        root = math.sqrt(course.steadiness * course.steadiness + 4.0 * (1.0 - course.steadiness) * left)
        way_left = 2.0 * left / (course.steadiness + root) if left > 0.0 else 0.0
        room.twice[j] = 4.0 * course.stop * (1.0 - way_left) - 2.0
    return PathSamples(angles[first:last], samples.rows[first:last], samples.relative)


@compiled
def _look_for(part: Followed, count: int, off: float) -> None:
    """Find the positions at which the series reach the travels of samples and some more, as 4 z − 2. Newton's method
    for all samples together; those for which it does not converge are solved one by one."""
    work, room, stop = part.work, part.room, part.course.stop
    wanted, twice, found = room.wanted, room.twice, room.found
    for _ in range(_MOST_STEPS):
        at_all(work.series[ANGLE:], twice, count, room.now, room.before, found)
        largest = 0.0
        for j in range(count):
            way = 0.25 * (twice[j] + 2.0)
            most = 0.5 * (stop - way) + _PAST * stop
            step = (found[0, j] - (wanted[j] + off)) / found[1, j] if found[1, j] > 0.0 else 0.0
            found[2, j] = min(max(step, -most), most)
            twice[j] = 4.0 * min(max(way - found[2, j], 0.0), stop) - 2.0
            largest = max(largest, abs(found[2, j]))
        if largest <= _NEAR * stop:
            return
    travel, rate, last_step = work.series[ANGLE], work.series[RATE], work.accuracy.last_step
    for j in range(count):
        if abs(found[2, j]) > _NEAR * stop:
            way = crossing(travel, rate, wanted[j] + off, stop, 0.0, 0.25 * (twice[j] + 2.0), last_step)
            twice[j] = 4.0 * way - 2.0


@compiled
def _polished(part: Followed, wanted: float, way: float, start: Equilibrium) -> Balance:
    """Exact state at a travel, by Newton's method from a position on the leg and the equilibrium about there."""
    course, last, step = part.course, math.inf, math.nan
    low, high, before = 0.0, course.stop, course.stop
    state = settle_on(part.scene, part.leg, way, start, SETTLED)
    for _ in range(_MOST_HALVINGS):
        # Rounding may undo the very first contact.
        missing = wanted - (state.travel if math.isfinite(state.travel) else course.begin)
        rate, room = state.rates.travel, course.stop - way
        step = missing / rate if rate > 0.0 else math.nan
        if abs(step) <= _SETTLED * room or abs(missing) <= _ROUNDING or 0.5 * last < abs(missing) < _NOISE:
            break
        new, low, high, before = newton_step(way, missing, -rate, low, high, before)
        if new == way:
            break
        way, last = new, abs(missing)
        state = settle_on(part.scene, part.leg, way, guess(part.work, way), SETTLED)
    at, travel, moment, force_x, force_y, tangent, rates = state
    step = step if math.isfinite(step) else 0.0
    if course.steadiness < _STEADY:  # at a fold the rate vanishes with the room
        step = min(max(step, -0.5 * room), 0.5 * room)
    at = Equilibrium(at.p + step * tangent.p, at.q + step * tangent.q, at.force + step * tangent.force)
    moment, force_x, force_y = moment + step * rates.moment, force_x + step * rates.x, force_y + step * rates.y
    return Balance(at, travel, moment, force_x, force_y, tangent, rates)
