"""The equilibrium path of one rod along one contour, from first contact to snap-off, and its states at drive angles.

A path runs along the contour from first contact (the tip, or a tangent line from the pivot, whichever is first) against
the sense of the contour's parameter, until the drive angle has its first maximum: the snap-off. It is cut where the
phase changes and where the contour's curvature jumps; on each stretch all observables are smooth and interpolated.
Stretches are halved until the interpolants are as accurate as required. The first maximum of the drive angle is a fold
(its derivative vanishes), a corner, or the point where the line of force passes through the pivot. A maximum after
which the drive angle falls by less than `curves.DIP` before it exceeds the maximum again does not count: the path
continues where it does so. This happens where a radius of curvature vanishes.

`follow` serves all callers. Likelihoods take loads from the interpolants, as accurate as noise requires. Where a path
is computed exactly, the interpolants guide the search for the state at a drive angle.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from tactile_bayes.arrays import Floats
from tactile_bayes.mechanics.compiler import compiled
from tactile_bayes.mechanics.curves import (
    ANGLE,
    DIP,
    LOST,
    Course,
    Curves,
    curves_of,
    exact_at,
    first_fall,
    largest_curvature,
    misses,
    polished_fold,
    regained,
    sample,
)
from tactile_bayes.mechanics.limits import limits
from tactile_bayes.mechanics.outline import bearing
from tactile_bayes.mechanics.reachability import Reachability, SnapOff
from tactile_bayes.mechanics.readings import (
    Asked,
    Followed,
    Found,
    Samples,
    asked,
    find_samples,
    polish_states,
    write_loads,
    write_states,
)
from tactile_bayes.mechanics.series import copy_rows, tail, value
from tactile_bayes.mechanics.states import Scene
from tactile_bayes.mechanics.stretches import BRIEF, Accuracy, Stretch, along, cut

__all__ = ["MOST_CHANGES", "Ends", "PathWorkspace", "follow", "path_workspace"]

MOST_CHANGES = 16
"""Largest number of phases of a path that are recorded."""

_MOST = 96
"""Capacity for stretches that are not followed yet."""

_MOST_MORE = 64
"""Number of further stretches beyond which none is halved: a contour that is rough everywhere, as one with interpolated
curvature, is not smooth in smaller pieces either."""

_FEWER = 0.65
"""Share of the nodes that usually suffices in tip contact."""

_FELT = 15.0
"""Arc length [L] by which tangential contact may be mistaken for tip contact, over the tolerated error of loads."""

_IN_A_DIP = 1e-5
"""Error of the drive angle beyond a maximum, over the least fall that makes it the snap-off."""

_NO_MOMENT = 1e-12
"""Holding moment [EI/L] that counts as zero."""

_TOUCHES, _RUNS_OUT, _GRAZES = int(Reachability.TOUCHES), int(Reachability.RUNS_OUT), int(Reachability.GRAZES)
_NEVER, _FOLD, _CORNER, _THRUST = (int(kind) for kind in SnapOff)


class Ends(NamedTuple):
    """Beginning and end of a path; NaN where there is none. Drive angles are in the sweep frame."""

    reach: int
    distance: float
    first_angle: float
    first_parameter: float
    snap_angle: float
    snap_parameter: float
    snap_off: int
    phases: int
    """Number of phases."""
    curvature: float
    """Largest curvature of the rod up to snap-off [1/L]; NaN if no states are computed."""


class PathWorkspace(NamedTuple):
    """Workspace for one path, reused for the next."""

    brief: Curves
    """Workspace with fewer nodes, which suffice in tip contact unless it is long."""
    full: Curves
    asked: Asked
    knots: Floats
    """Parameters at which the contour may not be smooth."""
    pieces: Floats
    """Stretches as cut."""
    waiting: Floats
    """Stretches to be followed, the next one last, as in `Stretch`."""
    followed: Floats
    """Stretches that have been followed, as in `Stretch` and `Course`, if there are samples."""
    curves: Floats
    """Their series and values at nodes, shape (stretches, 11, order)."""


class _End(NamedTuple):
    """End of a stretch, and the course of the drive angle up to it."""

    fate: int
    """A `SnapOff`; `NEVER` if the drive angle grows to the end."""
    parameter: float
    course: Course
    curvature: float


def path_workspace(samples: int, order: int, knots: int) -> PathWorkspace:
    """Workspace for at most so many samples, with `order` nodes on a stretch and `knots` knots of the contour."""
    most = _MOST + 4 * (order + 4) + 4 * knots
    return PathWorkspace(
        brief=curves_of(int(_FEWER * order)),
        full=curves_of(order),
        asked=asked(samples),
        knots=np.empty(knots),
        pieces=np.empty((most, 3)),
        waiting=np.empty((most + _MOST_MORE, 6)),
        followed=np.empty((most + _MOST_MORE, 10)),
        curves=np.empty((most + _MOST_MORE, 11, order)),
    )


@compiled
def _follow_stretch(
    scene: Scene,
    stretch: Stretch,
    accuracy: Accuracy,
    may_fall: bool,
    is_first: bool,
    at_begin: float,
    asks_curvature: bool,
    curves: Curves,
) -> _End:
    """Follow one stretch by its series from the drive angle at its beginning."""
    stop = first_fall(accuracy, is_first, curves)
    if not may_fall:
        stop = 2.0
    if stop == 0.0:
        return _End(_CORNER, stretch.begin, Course(0.0, at_begin, at_begin, 0.0), 0.0)
    folds, stop = stop <= 1.0, min(stop, 1.0)
    if folds and scene.exact and scene.rig.compliance == 0.0:
        stop = polished_fold(scene, stretch, stop, curves)
    parameter = along(stretch, stop)
    at_end, moment = value(curves.series[ANGLE], stop), 1.0
    if scene.exact:
        state, _ = exact_at(scene, stretch, stop)
        driven, moment = state.drive_angle + scene.rig.compliance * state.holding_moment, state.holding_moment
        if math.isfinite(driven):
            at_end = driven
    steadiness = 0.0
    if not folds:
        steadiness = min(max(value(curves.series[ANGLE + 1], stop) * stop / (at_end - at_begin), 0.0), 1.0)
    curvature = largest_curvature(stop, 0.0, scene.rig, curves) if asks_curvature else 0.0
    fate = _NEVER
    if folds:
        # At a flat vertex the maximum and the zero of the moment coincide, and rounding must not choose between them.
        fate = _THRUST if abs(moment) <= _NO_MOMENT else _FOLD
    return _End(fate, parameter, Course(stop, at_begin, at_end, steadiness), curvature)


@compiled
def follow(
    scene: Scene,
    knots: Floats,
    samples: Samples,
    accuracy: Accuracy,
    tolerance: Floats,
    workspace: PathWorkspace,
    found: Found,
) -> Ends:
    """Follow a path from first contact to snap-off.

    Parameters
    ----------
    scene : Scene
    knots : ndarray, shape (k,)
        Parameters at which the contour may not be smooth, decreasing.
    tolerance : ndarray, shape (3,)
        Tolerated errors of moment and forces [EI/L and EI/L²].
    """
    outline = scene.outline
    limit = limits(outline, scene.rig.friction_angle, accuracy.first_step)
    if limit.reach != _TOUCHES:
        return _nothing(limit.reach, limit.distance)
    pieces, waiting = workspace.pieces, workspace.waiting
    whole, full = limit.begin - limit.end, workspace.full
    miss = _FELT * min(tolerance[0], tolerance[1], tolerance[2])
    count = cut(scene, limit, knots, accuracy, miss, full.on, full.values, pieces)
    most = count + _MOST_MORE
    for k in range(count):  # the stack is taken from its end
        row = waiting[count - 1 - k]
        row[0], row[1], row[2] = pieces[k, 0], pieces[k, 1], pieces[k, 2]
        row[3] = k == 0 and limit.tip_first and row[2] > 0.0
        row[4], row[5] = 0.0, row[2]
    first = bearing(outline, limit.begin)
    at_begin, snap_parameter, fate = first, limit.begin, _NEVER
    changes, largest, stretches, is_first, done = 0, math.nan, count, True, 0
    wants_states = found.changes.shape[0] > 0
    while count:
        row = waiting[count - 1]
        stretch = _stretch(row)
        curves = workspace.brief if stretch.brief else workspace.full
        sample(scene, stretch, curves)
        # Shorter stretches may be lost in rounding.
        halved = stretch.halvings < accuracy.halvings and stretches < most
        halved &= stretch.begin - stretch.end > BRIEF * whole
        dips = fate != _NEVER
        rough = tail(curves.series[ANGLE]) > _IN_A_DIP * DIP if dips else misses(accuracy, tolerance, curves)
        if (stretch.brief or halved) and rough:
            if stretch.brief:
                row[5] = 0.0
                continue
            # Where loads begin like a square root, the parameter depends on the square of the position.
            middle = along(stretch, 0.5)
            above = waiting[count]
            above[0], above[1], above[2], above[3] = row[0], middle, row[2], row[3]
            above[4], above[5] = row[4] + 1.0, 0.0
            row[0], row[3], row[4] = middle, 0.0, row[4] + 1.0
            count, stretches = count + 1, stretches + 1
            continue
        behind = -1.0  # position of the maximum; a stretch beyond it has none
        if fate == _NEVER:
            may_fall = limit.begin - stretch.end >= BRIEF * whole or count == 1
            end = _follow_stretch(scene, stretch, accuracy, may_fall, is_first, at_begin, wants_states, curves)
            fate, behind = end.fate, end.course.stop
            if fate != _CORNER:
                if wants_states:
                    largest = max(end.curvature, 0.0 if math.isnan(largest) else largest)
                if found.changes.shape[0] > changes and (
                    not changes or (found.changes[changes - 1, 1] > 0.0) != stretch.tip
                ):
                    found.changes[changes, 0], found.changes[changes, 1] = stretch.begin, stretch.tip
                    changes += 1
                at_begin, snap_parameter, is_first = end.course.end, end.parameter, False
                if samples.angles.size:
                    for c in range(6):
                        workspace.followed[done, c] = row[c]
                    for c in range(4):
                        workspace.followed[done, 6 + c] = end.course[c]
                    copy_rows(curves.series, workspace.curves[done])
                    copy_rows(curves.values, workspace.curves[done, 6:])
                    done += 1
        count -= 1
        if fate != _NEVER:  # after a maximum: does the drive angle exceed it again?
            onward = regained(behind, at_begin, curves)
            if onward == LOST or stretches >= most:
                break
            if onward <= 1.0:
                row[0], row[3] = along(stretch, onward), 0.0
                fate, count, stretches = _NEVER, count + 1, stretches + 1
    if fate == _NEVER:
        if limit.runs_out:
            return _nothing(_RUNS_OUT, limit.distance)
        fate = _THRUST
    if not at_begin > first:
        return _nothing(_GRAZES, limit.distance)
    if samples.relative:
        for j in range(samples.angles.size):
            workspace.asked.angles[j] = first + samples.angles[j] * (at_begin - first) + scene.rig.offset
        samples = Samples(workspace.asked.angles[: samples.angles.size], samples.rows, False)
    for k in range(done):
        row = workspace.followed[k]
        stretch = _stretch(row)
        curves = workspace.brief if stretch.brief else workspace.full
        copy_rows(workspace.curves[k], curves.series)
        copy_rows(workspace.curves[k, 6:], curves.values)
        course = Course(row[6], row[7], row[8], row[9])
        part = Followed(scene, stretch, accuracy, course, curves, workspace.asked)
        there = find_samples(samples, part)
        if not wants_states:
            write_loads(there, part, found.loads)
        elif accuracy.polished:
            polish_states(there, part, found)
        else:
            write_states(there, part, found)
    return Ends(_TOUCHES, limit.distance, first, limit.begin, at_begin, snap_parameter, fate, changes, largest)


@compiled
def _stretch(row: Floats) -> Stretch:
    return Stretch(row[0], row[1], row[2] > 0.0, row[3] > 0.0, int(row[4]), row[5] > 0.0)


@compiled
def _nothing(reach: int, distance: float) -> Ends:
    return Ends(reach, distance, math.nan, math.nan, math.nan, math.nan, _NEVER, 0, math.nan)
