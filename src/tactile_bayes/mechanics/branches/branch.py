"""The branch of equilibria of any rod along one contour, from first contact to snap-off.

The branch is followed in legs (`leg`), which are shortened until the tails of their series are small enough
(`advance`). A leg ends where the phase changes or the contour is not smooth (`meet`), and the branch goes on from there
(`go_on`). The first maximum of the drive angle is the snap-off: a fold (its derivative vanishes), a corner, or
the point where the line of force passes through the pivot. A maximum after which the drive angle falls by less than
`DIP` before it exceeds the maximum again does not count: the branch continues where it does so. This happens where a
radius of curvature vanishes.

If the rod is curved or the drive carries the base, contact may also end because the force vanishes. If it carries the
base, travel along lines takes the place of the drive angle; contact is known as far as the drive goes, and a leg ends
where a line does.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from tactile_bayes.arrays import Floats
from tactile_bayes.mechanics.branches.advance import FIRST_LENGTH, LONGEST, Here, LegStep, Setting, advance, next_length
from tactile_bayes.mechanics.branches.equilibrium import nowhere
from tactile_bayes.mechanics.branches.first_contact import Beginning, beginning
from tactile_bayes.mechanics.branches.leg import (
    RATE,
    Accuracy,
    LegSeries,
    leg_series,
)
from tactile_bayes.mechanics.branches.line import pivots
from tactile_bayes.mechanics.branches.meeting import OPEN, Meeting, fate_of, go_on, meet, slid_back
from tactile_bayes.mechanics.branches.phase import contact_at, slides, tip_touches
from tactile_bayes.mechanics.branches.readings import (
    Legs,
    PathResults,
    PathSamples,
    TravelCourse,
    largest_curvature,
    legs_for,
    recall,
    store,
    write_event,
    write_samples,
)
from tactile_bayes.mechanics.branches.refusals import ruled_out
from tactile_bayes.mechanics.branches.scene import Equilibrium, Scene
from tactile_bayes.mechanics.branches.series import value
from tactile_bayes.mechanics.compiler import compiled, inlined
from tactile_bayes.mechanics.poses.beam import is_straight
from tactile_bayes.mechanics.reachability import Reachability, SnapOff

MOST_CHANGES = 16  # largest number of phases of a branch that are recorded
# Largest number of legs of a path, to which one for each knot and this number for each line of its drive are added.
_MOST, _MOST_ON_LINE = 256, 2
_LEAST_TRAVEL = 1e-12  # travel of a path that rounding may leave of none
_TOUCHES, _GRAZES, _SLIPS_OFF = int(Reachability.TOUCHES), int(Reachability.GRAZES), int(Reachability.SLIPS_OFF)
_NEVER, _FOLD, _RELEASE = int(SnapOff.NEVER), int(SnapOff.FOLD), int(SnapOff.RELEASE)

_ACROSS = 0.5 * math.pi


class BranchWorkspace(NamedTuple):
    """Workspace for one branch, reused for the next."""

    leg: LegSeries
    legs: Legs
    knots: Floats  # parameters at which the contour may not be smooth


def branch_workspace(accuracy: Accuracy, order: int, samples: int, knots: int, lines: int) -> BranchWorkspace:
    """Workspace for series of `order` terms, and for so many samples, knots of the contour, and lines of the drive."""
    legs = legs_for(_MOST + knots + _MOST_ON_LINE * lines, order, samples)
    return BranchWorkspace(leg_series(accuracy, order), legs, np.empty(knots))


@compiled
def follow_branch(
    scene: Scene, lines: Floats, samples: PathSamples, workspace: BranchWorkspace, found: PathResults
) -> bool:
    """Follow a branch from first contact to snap-off, and write its events and what is known of its samples. The scene
    has the first line of a drive that carries the base. False if a contact that sticks seems to end in a fold: it
    hardly yields, and errors of the travel may be larger than its growth."""
    work, event = workspace.leg, found.event
    start = beginning(scene, lines, work.accuracy.first_step)
    here, length, followed = _begin(start, found), FIRST_LENGTH, 0
    if event.reach != _TOUCHES:
        return True
    may_release = not pivots(lines) or not is_straight(scene.beam)
    setting = Setting(lines, workspace.knots, start.near.ends, may_release)
    for _ in range(workspace.legs.phase.size):
        in_dip = event.snap_off > _NEVER
        step, pace = advance(here, setting, length, in_dip, work)
        if not step.is_sound:
            if slides(here.scene.phase):
                break
            here = slid_back(here)
            if not math.isfinite(here.begin.at.p):
                break
            length = FIRST_LENGTH
            continue
        met = meet(here, step, in_dip, followed == 0, work)
        if not in_dip:
            followed = _grow(followed, here, setting, step, met, samples, workspace, found)
        if event.reach != _TOUCHES or event.snap_off == _RELEASE:
            break
        here = go_on(here, setting, step, met, event, work)
        if not math.isfinite(here.begin.at.p):
            break
        length = next_length(here, step, pace, work)
    _end(followed, here, lines, start, samples, workspace, found)
    return event.snap_off != _FOLD or slides(here.scene.phase)


@inlined
def _begin(start: Beginning, found: PathResults) -> Here:
    """Where a branch begins; its events so far are written."""
    begin, event = start.state, found.event
    event.reach, event.distance, event.snap_off, event.phases = start.reach, start.near.distance, OPEN, 0
    event.first_angle, event.first_parameter = begin.travel, start.near.begin
    event.snap_angle, event.snap_parameter = begin.travel, contact_at(start.scene, begin.at).p
    event.curvature = 0.0 if found.events.size else math.nan
    if start.reach != _TOUCHES:
        refuse(start.reach, event.snap_parameter, event)
    return Here(start.scene, start.line, begin, nowhere(), Equilibrium(0.0, 0.0, 1.0), LONGEST)


@compiled
def refuse(reach: int, where: float, event: Any) -> None:
    """Write why there is no path, a `Reachability`, and the contact where that is found."""
    event.first_angle, event.first_parameter, event.snap_angle, event.curvature = math.nan, math.nan, math.nan, math.nan
    event.reach, event.snap_parameter, event.snap_off, event.phases = reach, where, _NEVER, 0


@inlined
def _grow(
    followed: int,
    here: Here,
    setting: Setting,
    step: LegStep,
    met: Meeting,
    samples: PathSamples,
    workspace: BranchWorkspace,
    found: PathResults,
) -> int:
    """Store the growing part of a leg, unless it is ruled out, and write what is known of the path with it; return the
    number of legs that are stored."""
    work, legs, event, begin = workspace.leg, workspace.legs, found.event, found.event.snap_angle
    scene, at, stop = here.scene, met.at, met.stop
    event.snap_off = fate_of(step, met)
    event.reach, where = ruled_out(here, setting, met, work)
    if event.reach != _TOUCHES:
        event.snap_parameter = where
    if event.reach != _TOUCHES or not stop > 0.0:
        return followed
    if found.events.size:
        event.curvature = max(event.curvature, largest_curvature(scene, stop, work))
        if event.phases + 1 < found.events.size and (followed == 0 or legs.phase[followed - 1] != scene.phase):
            write_event(scene, step.leg.begin, found.events[event.phases])
            event.phases += 1
    steadiness = 0.0
    if samples.angles.size and not met.is_maximum and at.travel > begin:
        steadiness = min(max(value(work.series[RATE], stop) * stop / (at.travel - begin), 0.0), 1.0)
    store(followed, scene, here.line, step.leg, at.at, TravelCourse(stop, begin, at.travel, steadiness), work, legs)
    event.snap_angle, event.snap_parameter = at.travel, contact_at(scene, at.at).p
    return followed + 1


@inlined
def _end(
    followed: int,
    here: Here,
    lines: Floats,
    start: Beginning,
    samples: PathSamples,
    workspace: BranchWorkspace,
    found: PathResults,
) -> None:
    """Write the end of a path and its samples; or why there is none."""
    event, wants_states, first = found.event, found.events.size > 0, start.state.travel
    work, legs, where = workspace.leg, workspace.legs, event.snap_parameter
    if event.reach == _TOUCHES and (event.snap_off == OPEN or not event.snap_angle - first > _LEAST_TRAVEL):
        across = tip_touches(start.scene.phase) and contact_at(start.scene, start.state.at).psi1 > _ACROSS
        event.reach, where = _SLIPS_OFF if across else _GRAZES, math.nan
    if event.reach != _TOUCHES:
        refuse(event.reach, where, event)
        return
    if samples.relative:
        angles = legs.angles[: samples.angles.size]
        for j in range(samples.angles.size):
            angles[j] = first + samples.angles[j] * (event.snap_angle - first) + here.scene.rig.offset
        samples = PathSamples(angles, samples.rows, False)
    for k in range(followed):
        part = recall(k, here.scene, lines, work, legs)
        if part.course.end > part.course.begin:
            write_samples(samples, part, wants_states, found)
        if wants_states and k == followed - 1:
            write_event(part.scene, part.end, found.events[event.phases])
