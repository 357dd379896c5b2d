"""The branch of equilibria of any rod along one contour, from first contact to snap-off.

The branch is followed in legs (`leg`), which are halved until the tails of their series are small enough. A leg ends
where the phase changes or the contour is not smooth. The first maximum of the drive angle is the snap-off: a fold (its
derivative vanishes), a corner, or the point where the line of force passes through the pivot. A maximum after which the
drive angle falls by less than `curves.DIP` before it exceeds the maximum again does not count: the branch continues
where it does so. This happens where a radius of curvature vanishes.

If the rod is curved or the drive carries the base, contact may also end because the force vanishes. If it carries the
base, travel along lines takes the place of the drive angle; contact is known as far as the drive goes, and a leg ends
where a line does.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from tactile_bayes.arrays import Floats
from tactile_bayes.mechanics.branches.beginning import beginning
from tactile_bayes.mechanics.branches.curves import (
    ANGLE,
    DIP,
    LOST,
    Accuracy,
    Course,
    Curves,
    first_fall,
    largest_curvature,
    regained,
)
from tactile_bayes.mechanics.branches.equilibrium import (
    SETTLED,
    Balance,
    Equilibrium,
    Loaded,
    Rig,
    Scene,
    balance,
    dot,
    in_phase,
    nowhere,
    on_line,
    settle,
    settle_at,
    tangential_psi1,
    times,
)
from tactile_bayes.mechanics.branches.leg import (
    NUDGE,
    Leg,
    LegCurves,
    guess,
    leg_curves,
    leg_from,
    sample_leg,
    settle_on,
    shortened,
)
from tactile_bayes.mechanics.branches.leg_events import (
    change_of_phase,
    end_of_line,
    first_knot,
    polished_fold,
    release,
    share_of,
)
from tactile_bayes.mechanics.branches.line import Line
from tactile_bayes.mechanics.branches.readings import (
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
from tactile_bayes.mechanics.branches.second_contact import folded_over, second_contact
from tactile_bayes.mechanics.branches.series import change_of, copy_rows, tail, value
from tactile_bayes.mechanics.branches.slip import held
from tactile_bayes.mechanics.compiler import compiled
from tactile_bayes.mechanics.poses.beam import is_straight
from tactile_bayes.mechanics.reachability import CLEARANCE, Reachability, SnapOff

__all__ = ["MOST_CHANGES", "BranchWorkspace", "Ends", "branch_workspace", "follow_branch"]

MOST_CHANGES = 16
"""Largest number of phases of a branch that are recorded."""

_FIRST = 0.5
"""Length of the first leg; see `leg_from`."""

_LONGEST, _SHORTEST = 1.0, 1e-6
"""Lengths between which those of legs lie."""

_ACCEPT = 0.05
"""Share of the tolerated error that is accepted."""

_FLOOR, _NOISE = 1e-2, 1e3
"""Shares of the tolerated error: an exact leg has rounding errors only below the first, and others too above the
second."""

_AIM, _BACK, _LEAST_PACE, _MOST_PACE = 0.01, 0.8, 0.3, 2.0
"""Share of the tolerated error that is aimed at, and bounds on the change of the length."""

_MOST, _MOST_ON_LINE = 256, 2
"""Largest number of legs of a path, to which a number for each line of its drive is added, and a quarter of the largest
number that are tried."""

_ROOM_IN_TIP, _ROOM_PAST_TIP = 0.3, 0.02
"""Largest distances by which a leg of a rod that is not smooth at its tip passes the change of the phase, in ψ1 [rad]
and in arc length [L]."""

_ROOM_PAST_LINE = 1.1
"""Largest travel of a leg on a line of the drive, over the travel up to its end."""

_PAST_TIP = 1e-6
"""Share of a leg by which it passes the tip of a rod that is not smooth there."""

_IN_A_DIP = 1e-5
"""Error of the drive angle beyond a maximum, over the least fall that makes it the snap-off."""

_NO_MOMENT = 1e-7
"""Holding moment [EI/L] that counts as zero."""

_ROUNDING = 1e-14
"""Tail of the series of a drive angle that its rounding leaves [rad]."""

_LEAST_TRAVEL = 1e-12
"""Travel of a path that rounding may leave of none."""

_RESOLVED_LOADS = 1e-10
"""Error of loads that no tolerance is below, over the loads: rounding may leave it where the rod bears on its base."""

_TOUCHES, _RUNS_OUT, _GRAZES = int(Reachability.TOUCHES), int(Reachability.RUNS_OUT), int(Reachability.GRAZES)
_TOUCHES_TWICE, _SLIPS_OFF = int(Reachability.TOUCHES_TWICE), int(Reachability.SLIPS_OFF)
_STICKS, _TOO_CLOSE, _CLEARANCE = int(Reachability.STICKS), int(Reachability.TOO_CLOSE), CLEARANCE
_FOLDS_OVER = int(Reachability.FOLDS_OVER)
_NEVER, _FOLD, _CORNER, _THRUST, _RELEASE = (int(kind) for kind in SnapOff)

_ACROSS = 0.5 * math.pi

_BY_Q = Equilibrium(0.0, 1.0, 0.0)

_NO_LOAD = 1e-8
"""Force [EI/L²] at the end of a leg on which a release was found that is zero. There may be another state without force
on the plane across its end."""


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
    followed: Floats
    """Legs that have been followed, as in `Leg` and `Course`, shape (legs, 15)."""
    curves: Floats
    """Their series, shape (legs, 7, order)."""


def branch_workspace(samples: int, order: int, knots: int, lines: int) -> BranchWorkspace:
    """Workspace for at most so many samples, `order` nodes on a leg, knots of the contour, and lines of the drive."""
    legs = _MOST + _MOST_ON_LINE * lines
    return BranchWorkspace(
        leg_curves(order), asked(samples), np.empty(knots), np.empty((legs, 15)), np.empty((legs, 7, order))
    )


@compiled
def _excess(accuracy: Accuracy, tolerance: Floats, dips: bool, work: LegCurves) -> float:
    """Estimated error of the drive angle, the loads or the states over the tolerated one."""
    curves = work.curves
    angle, change = tail(curves.series[ANGLE]), change_of(curves.series[ANGLE])
    if dips:
        return angle / (_IN_A_DIP * DIP)
    found = max(angle / max(accuracy.resolved * change, _ROUNDING), angle / accuracy.sharp)
    for c in range(3):
        loads = curves.series[c]
        tolerated = max(tolerance[c], _RESOLVED_LOADS * (abs(loads[0]) + change_of(loads)))
        found = max(found, (tail(loads) + angle * change_of(loads) / change) / tolerated)
    if not accuracy.polished:
        for c in range(ANGLE):
            found = max(found, tail(curves.series[c]) / (accuracy.resolved * max(change_of(curves.series[c]), 1.0)))
    return found


@compiled
def _share_in_phase(leg: Leg, psi1: float) -> float:
    """Share of a leg up to somewhat beyond the change of the phase, as far as its direction tells."""
    room = leg.begin.q - psi1 + _ROOM_IN_TIP if leg.tip else 1.0 + _ROOM_PAST_TIP - leg.begin.q
    pace = -leg.along.q if leg.tip else leg.along.q
    return room / pace if pace > room > 0.0 else 1.0


@compiled
def _length_on_line(line: Line | None, loaded: Loaded, begin: Balance, before: Equilibrium, length: float) -> float:
    """Length of a leg up to somewhat beyond the end of the line of the drive, as far as its travel's rate tells."""
    if line is None:
        return length
    leg = leg_from(loaded, begin, before, length)
    room = _ROOM_PAST_LINE * (line.end - begin.travel)
    pace = begin.travel_rate / dot(leg.normal, begin.tangent)
    return length * room / pace if pace > room > 0.0 else length


@compiled
def _past(loaded: Loaded, at_knot: Balance, sense: float) -> Balance:
    """Equilibrium at a knot, with the tangent and the rates behind it."""
    at = at_knot.at
    behind = Equilibrium(at.p + math.copysign(NUDGE, sense), at.q, at.force)
    rates = balance(loaded, behind)[0]
    return Balance(
        at,
        at_knot.travel,
        at_knot.holding_moment,
        at_knot.force_x,
        at_knot.force_y,
        rates.tangent,
        rates.travel_rate,
        rates.moment_rate,
        rates.x_rate,
        rates.y_rate,
    )


@compiled
def _bent(stop: float, loaded: Loaded, curves: Curves) -> float:
    """Largest change of the rod's curvature up to a position on a leg."""
    for c in range(5):
        for k in range(curves.on.nodes.size):
            curves.values[c, k] = value(curves.series[c], curves.on.nodes[k])
    return largest_curvature(stop, loaded, curves)


@compiled
def _ending(line: Line | None, found: Balance) -> Balance:
    """Equilibrium at the end of a line, to which it was found with rounding errors."""
    if line is None:
        return found
    at, _, moment, force_x, force_y, tangent, rate, moment_rate, x_rate, y_rate = found
    return Balance(at, line.end, moment, force_x, force_y, tangent, rate, moment_rate, x_rate, y_rate)


@compiled
def _goes_on(lines: Floats | None, k: int) -> bool:
    """True if the drive continues after a line."""
    if lines is None:
        return False
    return k + 1 < lines.shape[0] and not math.isnan(lines[k + 1, 0])


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
    curves = work.curves
    start = beginning(scene, lines, accuracy.first_step, slides)
    near, scene, line, seen, loaded, begin = start.near, start.scene, start.line, start.seen, start.loaded, start.state
    z, rig = begin.at, scene.rig
    if start.reach != _TOUCHES:
        return _nothing(start.reach, near.distance, z.p)
    low, psi1, first = near.low, tangential_psi1(scene), begin.travel
    onward_from, nothing = Equilibrium(0.0, 0.0, 1.0), nowhere()
    grazes = _SLIPS_OFF if loaded.tip and z.q > _ACROSS else _GRAZES
    behind_begin, length, known = nothing, _FIRST, 0.0
    settled, power = max(SETTLED, 0.1 * accuracy.last_step), 1.0 / (2 * work.nodes.size - 1)
    shortest, excess_before = _LONGEST * 0.5**accuracy.halvings, math.inf
    begin_angle, last_at, last_tip, fate, longest = first, z, loaded.tip, _NEVER, _LONGEST
    changes, largest, is_first, done, runs_out, is_over = 0, math.nan, True, 0, False, False
    wants_states = found.changes.shape[0] > 0
    may_release = lines is not None or not is_straight(scene.beam)
    most = workspace.followed.shape[0]
    for _ in range(4 * most):
        if done == most:
            break
        leg = leg_from(loaded, begin, onward_from, length)
        if known == 0.0 and scene.beam.varied is not None:
            share = _share_in_phase(leg, psi1)
            leg, length = shortened(leg, share), share * length
        share = release(loaded, leg) if may_release else math.nan
        released = share <= 1.0
        if released:
            leg, length, known = shortened(leg, share), share * length, share * known
        sound, end, last_before = sample_leg(loaded, leg, begin, behind_begin, known, settled, work)
        known, knot, at_knot = 0.0, math.nan, begin
        if sound:
            knot, node = first_knot(leg, knots, low, work)
            if node <= 1.0:  # rates at the end are those before the knot
                at_knot = settle_at(loaded, knot, guess(work, node))
                share = share_of(leg, at_knot) * (1.0 - NUDGE)
                if not share > 0.0:
                    length *= _LEAST_PACE
                    continue
                leg, length, released = shortened(leg, share), share * length, False
                sound, end, last_before = sample_leg(loaded, leg, begin, behind_begin, share, settled, work)
        excess = _excess(accuracy, tolerance, fate != _NEVER, work) if sound else math.inf
        pace = min(max((_AIM / excess) ** power, _LEAST_PACE), _MOST_PACE) if sound else _LEAST_PACE
        if scene.exact and excess < _FLOOR:
            pace = _MOST_PACE
        # Rounding, which a shorter leg does not make smaller.
        noisy = 0.5 * excess_before < excess < (_NOISE if scene.exact else 1.0)
        excess_before = excess
        if not (excess <= _ACCEPT or noisy) and length > (shortest if sound else _SHORTEST):
            share = min(pace, _BACK)
            if sound and not leg.tip and scene.beam.varied is not None:  # such rods are not smooth at their tip
                change = change_of_phase(leg, psi1, accuracy, work)
                if change < _BACK:
                    at_tip = settle(loaded, guess(work, change), Equilibrium(0.0, 1.0, 0.0), _BY_Q, 0.0, SETTLED)
                    change = share_of(leg, at_tip) + _PAST_TIP
                    share = change if _PAST_TIP < change < _BACK else share
            length *= share
            known = share if sound else 0.0
            continue
        if not sound:
            break
        excess_before = math.inf
        change, at_change = change_of_phase(leg, psi1, accuracy, work), begin
        if change <= 1.0:
            limit = Equilibrium(0.0, psi1 if leg.tip else 1.0, 0.0)
            at_change = settle(loaded, guess(work, change), limit, _BY_Q, 0.0, SETTLED)
            change = min(max(share_of(leg, at_change), 0.0), 1.0)
        last, behind, twice, stuck, over, at_over = min(change, 1.0), -1.0, math.nan, math.nan, 2.0, begin
        folded, stop, goes_on = math.nan, 2.0, math.isfinite(behind_begin.at.p)
        if fate == _NEVER:
            stop = first_fall(accuracy, is_first, curves)
            over = end_of_line(scene.line, min(stop, last), accuracy, work)
            if over <= 1.0:
                at_over = _ending(scene.line, settle_on(loaded, leg, over, guess(work, over), SETTLED))
                stop, last, change = 2.0, over, 2.0
            if stop == 0.0:
                twice = second_contact(scene, seen, leg, goes_on, stop, work)
                fate, behind = _THRUST if abs(begin.holding_moment) <= _NO_MOMENT else _CORNER, 0.0
            else:
                folds, stop = stop <= last, min(stop, last)
                if folds and scene.exact:
                    stop = polished_fold(loaded, leg, stop, work)
                until = end if math.isnan(knot) else at_knot
                if change <= 1.0:
                    until = at_change
                if over <= 1.0:
                    until = at_over
                ends_before = folds or change <= 1.0 or over <= 1.0
                if folds:
                    until = settle_on(loaded, leg, stop, guess(work, stop), SETTLED)
                twice = second_contact(scene, seen, leg, goes_on, stop, work)
                last_at, last_tip, steadiness = until.at, leg.tip, 0.0
                if folds:
                    fate = _THRUST if abs(until.holding_moment) <= _NO_MOMENT else _FOLD
                else:
                    rate = value(curves.series[ANGLE + 1], stop)
                    steadiness = min(max(rate * stop / (until.travel - begin_angle), 0.0), 1.0)
                    if released and end.at.force < _NO_LOAD and change > 1.0 and over > 1.0:
                        fate = _RELEASE
                stuck = held(loaded, leg, stop, until if ends_before else end, work) if slides else math.nan
                if not leg.tip and lines is not None and until.at.q < _CLEARANCE:
                    return _nothing(_TOO_CLOSE, near.distance, until.at.p)
                if wants_states:
                    bent = _bent(stop, loaded, curves)
                    largest = bent if math.isnan(largest) else max(bent, largest)
                if found.changes.shape[0] > changes + 1 and (
                    not changes or (found.changes[changes - 1, 3] > 0.0) != leg.tip
                ):
                    _note_event(leg.begin, leg.tip, line, rig, found.changes[changes])
                    changes += 1
                if samples.angles.size and until.travel > begin_angle:
                    course = Course(stop, begin_angle, until.travel, steadiness)
                    _store(leg, line, course, work, workspace, done)
                    done += 1
                begin_angle, is_first, behind = until.travel, False, stop
            folded = folded_over(scene, leg, stop, work)
        if not math.isnan(twice):
            return _nothing(_TOUCHES_TWICE, near.distance, twice)
        if not math.isnan(stuck):
            return _nothing(_STICKS, near.distance, stuck)
        if not math.isnan(folded):
            return _nothing(_FOLDS_OVER, near.distance, folded)
        if fate == _RELEASE:
            break
        onward = 2.0
        if fate != _NEVER:
            if change < 1.0:
                sample_leg(loaded, shortened(leg, change), begin, nothing, change, settled, work)
                behind = min(behind / change, 1.0)
            onward = regained(behind, begin_angle, curves)
            if onward == LOST or end.at.force < 0.0:
                break
        behind_begin, onward_from = nothing, leg.along
        if onward <= 1.0:
            fate = _NEVER
            begin = settle_on(loaded, leg, last * onward, guess(work, onward), SETTLED)
            onward_from = begin.tangent
        elif over <= 1.0:
            if not _goes_on(lines, line):
                is_over = True
                break
            line += 1
            scene = on_line(scene, lines, line)
            loaded = in_phase(scene, leg.tip)
            begin = settle(loaded, at_over.at, at_over.at, leg.normal, 0.0, SETTLED)
            onward_from = times(math.copysign(1.0, begin.travel_rate), begin.tangent)
            longest = _LONGEST
            if _goes_on(lines, line):
                longest = _length_on_line(scene.line, loaded, begin, onward_from, _LONGEST)
        elif change <= 1.0:
            loaded = in_phase(scene, not leg.tip)
            begin = balance(loaded, Equilibrium(at_change.at.p, 1.0 if leg.tip else psi1, at_change.at.force))[0]
            onward_from = Equilibrium(0.0, -1.0 if leg.tip else 1.0, 0.0)
        elif math.isnan(knot):
            behind_begin = last_before
            begin, onward_from = end, end.tangent
        else:
            begin, onward_from = _past(loaded, at_knot, end.tangent.p), end.tangent
            if knot == low:
                runs_out = True
                break
        length = max(min((max(pace, 1.0) if noisy else pace) * length, longest), shortest)
        if not math.isfinite(begin.at.p):
            break
    if fate == _NEVER and not is_over:
        return _nothing(_RUNS_OUT if runs_out else grazes, near.distance, math.nan)
    if not begin_angle - first > _LEAST_TRAVEL:
        return _nothing(grazes, near.distance, math.nan)
    if wants_states:
        _note_event(last_at, last_tip, line, rig, found.changes[changes])
    if samples.relative:
        for j in range(samples.angles.size):
            workspace.asked.angles[j] = first + samples.angles[j] * (begin_angle - first) + rig.offset
        samples = Samples(workspace.asked.angles[: samples.angles.size], samples.rows, False)
    for k in range(done):
        leg, line, course = _recall(work, workspace, k)
        part = Followed(on_line(scene, lines, line), leg, accuracy, course, curves, workspace.asked)
        there = find_samples(samples, part)
        if not wants_states:
            write_loads(there, part, found.loads)
        elif accuracy.polished:
            polish_states(there, part, work, found)
        else:
            write_states(there, part, work, found)
    return Ends(_TOUCHES, near.distance, first, near.begin, begin_angle, last_at.p, fate, changes, largest)


@compiled
def _note_event(at: Equilibrium, tip: bool, line: int, rig: Rig, out: Floats) -> None:
    out[0], out[1], out[2], out[3], out[4], out[5] = at.p, at.q, at.force, tip, line, rig.friction_angle


@compiled
def _store(leg: Leg, line: int, course: Course, work: LegCurves, workspace: BranchWorkspace, k: int) -> None:
    row, curves = workspace.followed[k], work.curves
    for c in range(3):
        row[c], row[3 + c], row[6 + c] = leg.begin[c], leg.along[c], leg.normal[c]
    row[9] = leg.tip
    for c in range(4):
        row[10 + c] = course[c]
    row[14] = line
    copy_rows(curves.series, workspace.curves[k])
    for i in range(work.place.size):
        workspace.curves[k, 6, i] = work.place[i]


@compiled
def _recall(work: LegCurves, workspace: BranchWorkspace, k: int) -> tuple[Leg, int, Course]:
    row, curves = workspace.followed[k], work.curves
    copy_rows(workspace.curves[k], curves.series)
    for i in range(work.place.size):
        work.place[i] = workspace.curves[k, 6, i]
        curves.values[ANGLE, i] = value(curves.series[ANGLE], curves.on.nodes[i])
    begin, along = Equilibrium(row[0], row[1], row[2]), Equilibrium(row[3], row[4], row[5])
    leg = Leg(begin, along, Equilibrium(row[6], row[7], row[8]), row[9] > 0.0)
    return leg, int(row[14]), Course(row[10], row[11], row[12], row[13])


@compiled
def _nothing(reach: int, distance: float, where: float) -> Ends:
    return Ends(reach, distance, math.nan, math.nan, math.nan, where, _NEVER, 0, math.nan)
