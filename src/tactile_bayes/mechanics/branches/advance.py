"""Advancing on a branch: the next leg, shortened until the tails of its series are small enough."""

from __future__ import annotations

import math
from typing import NamedTuple

from tactile_bayes.arrays import Floats
from tactile_bayes.mechanics.branches.crossings import DIP, change_of_phase, first_knot, release
from tactile_bayes.mechanics.branches.equilibrium import Balance, settle_at, settle_at_limit
from tactile_bayes.mechanics.branches.leg import (
    ANGLE,
    NUDGE,
    REST,
    Leg,
    LegSeries,
    guess,
    leg_from,
    sample_leg,
    share_of,
    shortened,
)
from tactile_bayes.mechanics.branches.phase import limit, slides
from tactile_bayes.mechanics.branches.scene import Equilibrium, Scene
from tactile_bayes.mechanics.branches.series import change_of, tail
from tactile_bayes.mechanics.compiler import compiled, inlined
from tactile_bayes.mechanics.phases import TANGENTIAL, TIP

# Length of the first leg, and those between which all lie; see `leg_from`. First legs of 0.1 and 1 take 4 and 20 % more
# Newton steps in likelihoods; legs of more than 1 save nothing, and one of 1e-6 is beside a singularity.
FIRST_LENGTH, LONGEST, _SHORTEST = 0.5, 1.0, 1e-6
# Errors over the tolerated one: the largest that is accepted, the one that is aimed at, and the largest that may be
# rounding in an exact leg. Tails underestimate the errors of singular series: with 0.5 they are three times as large,
# for 8 % fewer Newton steps; 0.01 takes 34 % more. Aiming at 0.05 takes 38 % more, since legs are then tried twice.
_ACCEPT, _AIM, _NOISE = 0.05, 0.01, 1e3
# Largest change of the length after a failure, and bounds of any change: others between 0.5 and 0.95, 0.1 and 0.6, and
# 1.2 and 5 change the number of Newton steps by less than 15 %.
_BACK, _LEAST_PACE, _MOST_PACE = 0.8, 0.3, 2.0
_MOST_TRIES = 64  # largest number of trials of a leg: as many as `_BACK` takes from `LONGEST` to `_SHORTEST`
# Largest distances by which a leg of a rod that is not smooth at its tip passes the change of the phase, in ψ1 [rad]
# and in arc length [L].
_ROOM_IN_TIP, _ROOM_PAST_TIP = 0.3, 0.02
_PAST_TIP = 1e-6  # share of a leg by which it passes the tip of a rod that is not smooth there
_SCATTER = 1e-12  # distance from a knot, in the contour's parameter, which rounding does not pass where a leg ends
_IN_A_DIP = 1e-5  # error of the drive angle beyond a maximum, over the least fall that makes it the snap-off
# Tail of the series of a drive angle that its rounding leaves [rad], and where a contact sticks, which hardly yields.
_ROUNDING, _ROUNDING_STUCK = 1e-14, 3e-11
# Error of loads that no tolerance is below, over the loads: rounding may leave it where the rod bears on its base.
_RESOLVED_LOADS = 1e-10


class Setting(NamedTuple):
    """What is the same all along a branch."""

    lines: Floats  # lines of a drive that carries the base, in rod lengths, NaN after the last; see `line_of`
    knots: Floats  # parameters at which the contour may not be smooth
    ends: tuple[float, float]  # least and greatest parameter of the contour
    may_release: bool  # whether the force may vanish: for a straight rod that turns about a pivot it does not


class Here(NamedTuple):
    """Where a branch goes on."""

    scene: Scene  # with the phase, the line of the drive, and the sense of the friction
    line: int
    begin: Balance
    before: Balance  # an equilibrium before that, if the branch is smooth there, else NaN
    onward: Equilibrium  # direction of the branch, of any length
    longest: float  # largest length of a leg


class LegStep(NamedTuple):
    """A leg, with its series in the workspace."""

    is_sound: bool  # false if the branch does not cut all planes of the leg
    leg: Leg
    length: float
    end: Balance
    before_end: Balance
    knot: float  # knot of the contour at its end, else NaN
    at_knot: Balance
    is_released: bool  # whether the force vanishes at its end


@inlined
def advance(here: Here, setting: Setting, length: float, in_dip: bool, work: LegSeries) -> tuple[LegStep, float]:
    """Next leg, at most as long as given, and the factor of the length of the one after it."""
    exact = work.accuracy.exact
    least, known, before, pace, is_noise = LONGEST * 0.5**work.accuracy.halvings, 0.0, math.inf, 1.0, False
    for _ in range(_MOST_TRIES):
        step = _trial(here, setting, length, known, work)
        excess = _excess(in_dip, slides(here.scene.phase), work) if step.is_sound else math.inf
        pace = _pace(excess, work)
        # Rounding, which a shorter leg does not make smaller.
        is_noise = 0.5 * before < excess < (_NOISE if exact else 1.0)
        if is_noise:
            pace = max(pace, 1.0)
        if excess <= _ACCEPT or is_noise or step.length <= (least if step.is_sound else _SHORTEST):
            break
        share, before = min(pace, _BACK), excess
        if step.is_sound:
            share = _up_to_tip(here.scene, step.leg, share, work)
        length, known = share * step.length, share if step.is_sound else 0.0
    # Rounding where a contact that sticks hardly yields: others would all be as short.
    is_stiff = not slides(here.scene.phase) and (step.length <= least or is_noise)
    return step, _MOST_PACE if is_stiff else pace


@inlined
def next_length(here: Here, step: LegStep, pace: float, work: LegSeries) -> float:
    """Length of the next leg."""
    return max(min(pace * step.length, here.longest), LONGEST * 0.5**work.accuracy.halvings)


@inlined
def _trial(here: Here, setting: Setting, length: float, known: float, work: LegSeries) -> LegStep:
    """Leg of at most some length, which ends at the first knot of the contour, and where the force vanishes. `known` is
    as in `sample_leg`."""
    scene, begin = here.scene, here.begin
    leg = leg_from(scene, begin, here.onward, length)
    if known == 0.0 and scene.beam.varied is not None and slides(scene.phase):
        share = _share_in_phase(scene, leg)
        leg, length = shortened(leg, share), share * length
    share = release(scene, leg) if setting.may_release else math.nan
    is_released = share <= 1.0
    if is_released:
        leg, length, known = shortened(leg, share), share * length, share * known
    is_sound, end, before_end = sample_leg(scene, leg, begin, here.before, known, is_released, work)
    knot, at_knot = math.nan, begin
    if is_sound:
        knot, node = first_knot(scene, leg, setting.knots, setting.ends[0], work)
        if node <= 1.0:  # rates at the end are those before the knot
            at_knot = settle_at(scene, knot, guess(work, node))
            share = share_of(leg, at_knot)
            share -= max(NUDGE * share, _SCATTER / abs(leg.along.p))
            is_sound, is_released = share > 0.0, False
            if is_sound:
                leg, length = shortened(leg, share), share * length
                is_sound, end, before_end = sample_leg(scene, leg, begin, here.before, share, is_released, work)
    return LegStep(is_sound, leg, length, end, before_end, knot, at_knot, is_released)


@compiled
def _excess(in_dip: bool, is_sliding: bool, work: LegSeries) -> float:
    """Estimated error of the travel, the loads or the states over the tolerated one."""
    accuracy, series = work.accuracy, work.series
    angle, change = tail(series[ANGLE]), change_of(series[ANGLE])
    if in_dip:
        return angle / (_IN_A_DIP * DIP)
    rounding = _ROUNDING if is_sliding else _ROUNDING_STUCK
    found = max(max(angle - rounding, 0.0) / max(accuracy.resolved * change, rounding), angle / accuracy.sharp)
    for c in range(3):
        of_load = change_of(series[c])
        tolerated = max(accuracy.tolerance[c], _RESOLVED_LOADS * (abs(series[c, 0]) + of_load))
        found = max(found, (tail(series[c]) + angle * of_load / change) / tolerated)
    if not accuracy.polished:
        for c in range(REST + 1):
            found = max(found, tail(series[c]) / (accuracy.resolved * max(change_of(series[c]), 1.0)))
    return found


@compiled
def _pace(excess: float, work: LegSeries) -> float:
    """Factor of the length by which the error becomes the one aimed at, which is of the order of the series."""
    if work.accuracy.exact and excess < _AIM:  # rounding
        return _MOST_PACE
    return min(max((_AIM / excess) ** (1.0 / (2 * work.nodes.size - 1)), _LEAST_PACE), _MOST_PACE)


@compiled
def _share_in_phase(scene: Scene, leg: Leg) -> float:
    """Share of a leg up to somewhat beyond the change of the phase, as far as its direction tells."""
    _, end, sense = limit(scene, leg.begin.p)
    room = sense * (end - leg.begin.q) + (_ROOM_IN_TIP if scene.phase == TIP else _ROOM_PAST_TIP)
    pace = sense * leg.along.q
    return room / pace if pace > room > 0.0 else 1.0


@compiled
def _up_to_tip(scene: Scene, leg: Leg, share: float, work: LegSeries) -> float:
    """Share of a leg to try next: up to the tip of a rod that is not smooth there, if the contact reaches it."""
    if scene.beam.varied is None or scene.phase != TANGENTIAL:
        return share
    change = change_of_phase(scene, work)
    if not change < _BACK:
        return share
    change = share_of(leg, settle_at_limit(scene, guess(work, change))) + _PAST_TIP
    return change if _PAST_TIP < change < _BACK else share
