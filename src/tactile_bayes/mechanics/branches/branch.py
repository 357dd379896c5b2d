"""The branch of equilibria of any rod along one contour, from first contact to snap-off.

The branch is followed in legs (`leg`), which are shortened until the tails of their series are small enough
(`advance`). A leg ends where the phase changes or the contour is not smooth (`meeting`), and the branch goes on from
there (`onward`). The first maximum of the drive angle is the snap-off: a fold (its derivative vanishes), a corner, or
the point where the line of force passes through the pivot. A maximum after which the drive angle falls by less than
`curves.DIP` before it exceeds the maximum again does not count: the branch continues where it does so. This happens
where a radius of curvature vanishes.

If the rod is curved or the drive carries the base, contact may also end because the force vanishes. If it carries the
base, travel along lines takes the place of the drive angle; contact is known as far as the drive goes, and a leg ends
where a line does.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from tactile_bayes.arrays import Floats
from tactile_bayes.mechanics.branches.advance import FIRST_LENGTH, LONGEST, Here, Setting, Step, advance, next_length
from tactile_bayes.mechanics.branches.beginning import Beginning, beginning
from tactile_bayes.mechanics.branches.curves import ANGLE, LOST, Accuracy, Course, largest_curvature
from tactile_bayes.mechanics.branches.equilibrium import Equilibrium, Scene, in_phase, nowhere
from tactile_bayes.mechanics.branches.followed import Legs, legs_for, recall, store
from tactile_bayes.mechanics.branches.leg import LegCurves, leg_curves
from tactile_bayes.mechanics.branches.meeting import KNOT, LINE, Growth, Leaving, fate_of, growth_on, leave, ruled_out
from tactile_bayes.mechanics.branches.onward import continued, goes_on, regained_at, stopped
from tactile_bayes.mechanics.branches.readings import (
    Asked,
    Found,
    Samples,
    asked,
    find_samples,
    polish_states,
    write_event,
    write_loads,
    write_states,
)
from tactile_bayes.mechanics.branches.series import value
from tactile_bayes.mechanics.compiler import compiled, inlined
from tactile_bayes.mechanics.phases import TIP
from tactile_bayes.mechanics.poses.beam import is_straight
from tactile_bayes.mechanics.reachability import Reachability, SnapOff

__all__ = ["MOST_CHANGES", "BranchWorkspace", "Ends", "branch_workspace", "follow_branch"]

MOST_CHANGES = 16
"""Largest number of phases of a branch that are recorded."""

_MOST, _MOST_ON_LINE = 256, 2
"""Largest number of legs of a path, to which one for each knot and this number for each line of its drive are added."""

_LEAST_TRAVEL = 1e-12
"""Travel of a path that rounding may leave of none."""

_TOUCHES, _RUNS_OUT, _GRAZES = int(Reachability.TOUCHES), int(Reachability.RUNS_OUT), int(Reachability.GRAZES)
_SLIPS_OFF = int(Reachability.SLIPS_OFF)
_NEVER, _RELEASE = int(SnapOff.NEVER), int(SnapOff.RELEASE)

_ACROSS = 0.5 * math.pi


class Ends(NamedTuple):
    """Beginning and end of a path; NaN where there is none. Drive angles are in the sweep frame."""

    reach: int
    distance: float
    first_angle: float
    first_parameter: float
    snap_angle: float
    snap_parameter: float
    """Parameter at the end of the path, or at a second contact if there is one."""
    snap_off: int
    phases: int
    """Number of phases."""
    curvature: float
    """Largest curvature of the rod up to snap-off [1/L]; NaN if no states are computed."""


class BranchWorkspace(NamedTuple):
    """Workspace for one branch, reused for the next."""

    leg: LegCurves
    asked: Asked
    knots: Floats
    """Parameters at which the contour may not be smooth."""
    legs: Legs


class SoFar(NamedTuple):
    """What is known of a path from the legs up to here."""

    fate: int
    """How it ends, a `SnapOff`: beyond a maximum of the travel it is known, unless the branch exceeds that again."""
    reach: int
    """A `Reachability`: why there is no path after all."""
    where: float
    """Parameter of the contour where that is found."""
    travel: float
    """Greatest travel."""
    last: Equilibrium
    phase: int
    """Equilibrium at the end of the last leg on which the travel grew, and its phase."""
    phases: int
    curvature: float
    legs: int
    """Number of legs that are stored."""
    is_first: bool
    """Whether no leg has been followed."""
    is_over: bool
    """Whether the drive ends here."""


def branch_workspace(samples: int, order: int, knots: int, lines: int) -> BranchWorkspace:
    """Workspace for at most so many samples, `order` nodes on a leg, knots of the contour, and lines of the drive."""
    legs = legs_for(_MOST + knots + _MOST_ON_LINE * lines, order)
    return BranchWorkspace(leg_curves(order), asked(samples), np.empty(knots), legs)


@compiled
def follow_branch(
    scene: Scene,
    lines: Floats | None,
    knots: Floats,
    samples: Samples,
    accuracy: Accuracy,
    tolerance: Floats,
    workspace: BranchWorkspace,
    found: Found,
    slides: bool,
) -> Ends:
    """Follow a branch from first contact to snap-off.

    Parameters
    ----------
    scene : Scene
        With the first line of a drive that carries the base.
    lines : ndarray, shape (lines, `LINE_COLUMNS`), optional
        Lines of that drive, NaN after the last.
    knots : ndarray, shape (k,)
        Parameters at which the contour may not be smooth.
    tolerance : ndarray, shape (3,)
        Tolerated errors of moment and forces [EI/L and EI/L²].
    slides : bool
        Whether friction opposes the slip everywhere, else there is no path; otherwise it acts as in a forward sweep of
        a straight rod.
    """
    work = workspace.leg
    start = beginning(scene, lines, accuracy.first_step, slides)
    if start.reach != _TOUCHES:
        return _nothing(start.reach, start.near.distance, start.state.at.p)
    may_release = lines is not None or not is_straight(scene.beam)
    setting = Setting(knots, start.near.low, start.seen, accuracy, tolerance, slides, may_release)
    here, so_far = _set_out(start)
    for _ in range(workspace.legs.place.shape[0]):
        in_dip = so_far.fate != _NEVER
        step, pace = advance(here, setting, in_dip, work)
        if not step.is_sound:
            break
        leaving, stop = leave(here, setting, step, in_dip, so_far.is_first, work)
        growth = growth_on(here, step, leaving, stop, work)
        if not in_dip:
            so_far = _with_leg(here, lines, setting, step, leaving, growth, so_far, workspace, found, samples)
        if so_far.reach != _TOUCHES or so_far.fate == _RELEASE:
            break
        here, so_far = _go_on(here, lines, setting, step, leaving, growth, so_far, pace, work)
        if not math.isfinite(here.begin.at.p):
            break
    return _end(here, lines, start, setting, so_far, samples, workspace, found)


@inlined
def _set_out(start: Beginning) -> tuple[Here, SoFar]:
    """Where a branch begins, and what is known of it."""
    begin, phase = start.state, start.scene.phase
    onward = Equilibrium(0.0, 0.0, 1.0)
    here = Here(start.scene, start.line, begin, nowhere(), onward, FIRST_LENGTH, LONGEST)
    return here, SoFar(_NEVER, _TOUCHES, math.nan, begin.travel, begin.at, phase, 0, math.nan, 0, True, False)


@inlined
def _with_leg(
    here: Here,
    lines: Floats | None,
    setting: Setting,
    step: Step,
    leaving: Leaving,
    growth: Growth,
    so_far: SoFar,
    workspace: BranchWorkspace,
    found: Found,
    samples: Samples,
) -> SoFar:
    """What is known of a path with the growing part of another leg, which is stored, and its event, if one begins."""
    work, scene, at, stop = workspace.leg, here.scene, growth.at, growth.stop
    fate = fate_of(growth, step, leaving)
    reach, where = ruled_out(here, lines, setting, step, leaving, growth, work)
    _, _, _, travel, last, phase, phases, curvature, legs, is_first, is_over = so_far
    if not stop > 0.0:
        return SoFar(fate, reach, where, travel, last, phase, phases, curvature, legs, is_first, is_over)
    wants_states = found.changes.shape[0] > 0
    if wants_states:
        bent = largest_curvature(scene, stop, work.curves)
        curvature = bent if math.isnan(curvature) else max(bent, curvature)
    if found.changes.shape[0] > phases + 1 and (not phases or phase != scene.phase):
        write_event(scene, here.line, step.leg.begin, scene.phase == TIP, phases, found)
        phases += 1
    if samples.angles.size and at.travel > travel:
        steadiness = 0.0
        if not growth.is_maximum:
            rate = value(work.curves.series[ANGLE + 1], stop)
            steadiness = min(max(rate * stop / (at.travel - travel), 0.0), 1.0)
        store(scene.phase, here.line, step.leg, Course(stop, travel, at.travel, steadiness), work, workspace.legs, legs)
        legs += 1
    return SoFar(fate, reach, where, at.travel, at.at, scene.phase, phases, curvature, legs, False, is_over)


@inlined
def _go_on(
    here: Here,
    lines: Floats | None,
    setting: Setting,
    step: Step,
    leaving: Leaving,
    growth: Growth,
    so_far: SoFar,
    pace: float,
    work: LegCurves,
) -> tuple[Here, SoFar]:
    """Where the branch goes on, and what is known of it."""
    fate, reach, where, travel, last, phase, phases, curvature, legs, is_first, is_over = so_far
    position, begin = 2.0, here.begin
    if fate != _NEVER:
        position, begin = regained_at(here, setting, step, leaving, growth, travel, work)
    if position == LOST:
        return stopped(here), so_far
    if position <= 1.0:
        fate = _NEVER
        there = Here(here.scene, here.line, begin, nowhere(), begin.tangent, here.length, here.longest)
    else:
        there = continued(here, lines, setting, step, leaving)
        if fate == _NEVER and leaving.kind == KNOT and step.knot == setting.low:
            reach = _RUNS_OUT
        is_over = leaving.kind == LINE and not goes_on(lines, here.line)
    scene, line, begin, before, onward, _, longest = there
    there = Here(scene, line, begin, before, onward, next_length(there, setting, step, pace), longest)
    return there, SoFar(fate, reach, where, travel, last, phase, phases, curvature, legs, is_first, is_over)


@inlined
def _end(
    here: Here,
    lines: Floats | None,
    start: Beginning,
    setting: Setting,
    so_far: SoFar,
    samples: Samples,
    workspace: BranchWorkspace,
    found: Found,
) -> Ends:
    """Ends of a path, whose samples are written; or why there is none."""
    first, near, rig = start.state.travel, start.near, here.scene.rig
    if so_far.reach != _TOUCHES:
        return _nothing(so_far.reach, near.distance, so_far.where)
    if not so_far.travel - first > _LEAST_TRAVEL or (so_far.fate == _NEVER and not so_far.is_over):
        across = start.scene.phase == TIP and start.state.at.q > _ACROSS
        return _nothing(_SLIPS_OFF if across else _GRAZES, near.distance, math.nan)
    wants_states = found.changes.shape[0] > 0
    if wants_states:
        scene = in_phase(here.scene, so_far.phase)
        write_event(scene, here.line, so_far.last, so_far.phase == TIP, so_far.phases, found)
    if samples.relative:
        angles = workspace.asked.angles[: samples.angles.size]
        for j in range(samples.angles.size):
            angles[j] = first + samples.angles[j] * (so_far.travel - first) + rig.offset
        samples = Samples(angles, samples.rows, False)
    for k in range(so_far.legs):
        part = recall(here.scene, lines, setting.accuracy, workspace.leg, workspace.asked, workspace.legs, k)
        there = find_samples(samples, part)
        if not wants_states:
            write_loads(there, part, found.loads)
        elif setting.accuracy.polished:
            polish_states(there, part, found)
        else:
            write_states(there, part, found)
    return Ends(
        _TOUCHES,
        near.distance,
        first,
        near.begin,
        so_far.travel,
        so_far.last.p,
        so_far.fate,
        so_far.phases,
        so_far.curvature,
    )


@compiled
def _nothing(reach: int, distance: float, where: float) -> Ends:
    return Ends(reach, distance, math.nan, math.nan, math.nan, where, _NEVER, 0, math.nan)
