"""Meeting an event on a leg: how the leg is left, up to where the travel of the drive grows, and what rules it out."""

from __future__ import annotations

import math
from typing import NamedTuple

from tactile_bayes.arrays import Floats
from tactile_bayes.mechanics.branches.advance import Here, Setting, Step
from tactile_bayes.mechanics.branches.curves import first_fall
from tactile_bayes.mechanics.branches.equilibrium import SETTLED, Balance, settle_at_limit
from tactile_bayes.mechanics.branches.leg import LegCurves, guess, settle_on
from tactile_bayes.mechanics.branches.leg_events import change_of_phase, end_of_line, polished_fold, share_of
from tactile_bayes.mechanics.branches.line import Line
from tactile_bayes.mechanics.branches.second_contact import folded_over, second_contact
from tactile_bayes.mechanics.branches.slip import held
from tactile_bayes.mechanics.compiler import compiled, inlined
from tactile_bayes.mechanics.phases import TANGENTIAL
from tactile_bayes.mechanics.reachability import CLEARANCE, Reachability, SnapOff

__all__ = ["KNOT", "LINE", "PHASE", "Growth", "Leaving", "fate_of", "growth_on", "leave", "ruled_out"]

_SMOOTHLY, KNOT, PHASE, LINE = range(4)
"""How a leg is left: the branch goes on smoothly, or there is a knot of the contour, a change of the phase, or the end
of a line of the drive."""

_NO_MOMENT = 1e-7
"""Holding moment [EI/L] that counts as zero: a hundred times the error of the loads of exact legs."""

_NO_LOAD = 1e-8
"""Force [EI/L²] at the end of a leg on which a release was found that is zero. There may be another state without force
on the plane across its end."""

_TOUCHES, _TOO_CLOSE = int(Reachability.TOUCHES), int(Reachability.TOO_CLOSE)
_TOUCHES_TWICE, _STICKS = int(Reachability.TOUCHES_TWICE), int(Reachability.STICKS)
_FOLDS_OVER, _CLEARANCE = int(Reachability.FOLDS_OVER), CLEARANCE
_NEVER, _FOLD, _CORNER, _THRUST, _RELEASE = (int(kind) for kind in SnapOff)


class Leaving(NamedTuple):
    """How a leg is left."""

    kind: int
    share: float
    """Position on the leg."""
    at: Balance


class Growth(NamedTuple):
    """Part of a leg on which the travel of the drive grows."""

    stop: float
    """Position at which it ends: 0 if the travel falls from the beginning, −1 if the leg lies beyond a maximum."""
    at: Balance
    is_maximum: bool
    """Whether the travel falls beyond it."""


@inlined
def leave(
    here: Here, setting: Setting, step: Step, in_dip: bool, is_first: bool, work: LegCurves
) -> tuple[Leaving, float]:
    """How a leg is left, and where its travel stops growing, as `first_fall`; −1 beyond a maximum."""
    scene, accuracy = here.scene, setting.accuracy
    kind, share, at = _SMOOTHLY, 1.0, step.end
    change = change_of_phase(scene, accuracy, work)
    if change <= 1.0:
        kind, at = PHASE, settle_at_limit(scene, guess(work, change))
        share = min(max(share_of(step.leg, at), 0.0), 1.0)
    elif math.isfinite(step.knot):
        kind, at = KNOT, step.at_knot
    if in_dip:
        return Leaving(kind, share, at), -1.0
    stop = first_fall(accuracy, is_first, work.curves)
    over = end_of_line(scene.line, min(stop, share), accuracy, work)
    if over <= 1.0:
        at = _ending(scene.line, settle_on(scene, step.leg, over, guess(work, over), SETTLED))
        return Leaving(LINE, over, at), 2.0
    return Leaving(kind, share, at), stop


@compiled
def _ending(line: Line | None, found: Balance) -> Balance:
    """Equilibrium at the end of a line, to which it was found with rounding errors."""
    if line is None:
        return found
    at, _, moment, force_x, force_y, tangent, rates = found
    return Balance(at, line.end, moment, force_x, force_y, tangent, rates)


@inlined
def growth_on(here: Here, step: Step, leaving: Leaving, stop: float, work: LegCurves) -> Growth:
    """Part of a leg on which the travel grows, before it is left."""
    if stop <= 0.0:
        return Growth(stop, here.begin, stop == 0.0)
    if stop > leaving.share:
        return Growth(leaving.share, leaving.at, False)
    if here.scene.exact:
        stop = polished_fold(here.scene, step.leg, stop, work)
    return Growth(stop, settle_on(here.scene, step.leg, stop, guess(work, stop), SETTLED), True)


@inlined
def fate_of(growth: Growth, step: Step, leaving: Leaving) -> int:
    """How the path ends on a leg, a `SnapOff`."""
    if growth.is_maximum:
        if abs(growth.at.holding_moment) <= _NO_MOMENT:
            return _THRUST
        return _FOLD if growth.stop > 0.0 else _CORNER
    is_free = step.is_released and step.end.at.force < _NO_LOAD
    return _RELEASE if is_free and leaving.kind == _SMOOTHLY else _NEVER


@inlined
def ruled_out(
    here: Here, lines: Floats | None, setting: Setting, step: Step, leaving: Leaving, growth: Growth, work: LegCurves
) -> tuple[int, float]:
    """Reason why there is no path with the growing part of a leg, a `Reachability`, and the contact where it holds."""
    scene, at, stop = here.scene, growth.at, growth.stop
    goes_on = math.isfinite(here.before.at.p)
    if stop > 0.0 and scene.phase == TANGENTIAL and lines is not None and at.at.q < _CLEARANCE:
        return _TOO_CLOSE, at.at.p
    twice = second_contact(scene, setting.seen, goes_on, stop, work)
    if not math.isnan(twice):
        return _TOUCHES_TWICE, twice
    if stop > 0.0 and setting.slides:
        before_knot = step.end if leaving.kind == KNOT and not growth.is_maximum else at
        stuck = held(scene, step.leg, stop, before_knot, work)
        if not math.isnan(stuck):
            return _STICKS, stuck
    folded = folded_over(scene, stop, work)
    return (_TOUCHES, math.nan) if math.isnan(folded) else (_FOLDS_OVER, folded)
