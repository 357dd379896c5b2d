"""Meeting an event on a leg: how the leg is left, up to where the travel of the drive grows, and how the path ends."""

from __future__ import annotations

import math
from typing import NamedTuple

from tactile_bayes.mechanics.branches.advance import Here, Step
from tactile_bayes.mechanics.branches.equilibrium import SETTLED, Balance, settle_at_limit
from tactile_bayes.mechanics.branches.leg import LegSeries, guess, settle_on, share_of
from tactile_bayes.mechanics.branches.leg_events import change_of_phase, end_of_line, first_fall, polished_fold
from tactile_bayes.mechanics.branches.line import Line
from tactile_bayes.mechanics.compiler import compiled, inlined
from tactile_bayes.mechanics.reachability import SnapOff

__all__ = ["KNOT", "LINE", "OPEN", "PHASE", "Growth", "Leaving", "fate_of", "meet"]

_SMOOTHLY, KNOT, PHASE, LINE = range(4)
"""How a leg is left: the branch goes on smoothly, or there is a knot of the contour, a change of the phase, or the end
of a line of the drive."""

OPEN = -1
"""In place of a `SnapOff` as long as the end of a path is not known."""

_NO_MOMENT = 1e-7
"""Holding moment [EI/L] that counts as zero: a hundred times the error of the loads of exact legs."""

_NO_LOAD = 1e-8
"""Force [EI/L²] at the end of a leg on which a release was found that is zero. There may be another state without force
on the plane across its end."""

_, _FOLD, _CORNER, _THRUST, _RELEASE = (int(kind) for kind in SnapOff)


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
def meet(here: Here, step: Step, in_dip: bool, is_first: bool, work: LegSeries) -> tuple[Leaving, Growth]:
    """How a leg is left, and its part before that on which the travel grows: none if the branch is in a dip."""
    scene = here.scene
    kind, share, at = _SMOOTHLY, 1.0, step.end
    change = change_of_phase(scene, work)
    if change <= 1.0:
        kind, at = PHASE, settle_at_limit(scene, guess(work, change))
        share = min(max(share_of(step.leg, at), 0.0), 1.0)
    elif math.isfinite(step.knot):
        kind, at = KNOT, step.at_knot
    if in_dip:
        return Leaving(kind, share, at), Growth(-1.0, here.begin, False)
    stop = first_fall(is_first, work)
    over = end_of_line(scene.line, min(stop, share), work)
    if over <= 1.0:
        at = _ending(scene.line, settle_on(scene, step.leg, over, guess(work, over), SETTLED))
        kind, share, stop = LINE, over, 2.0
    leaving = Leaving(kind, share, at)
    if stop <= 0.0:
        return leaving, Growth(stop, here.begin, True)
    if stop > share:
        return leaving, Growth(share, at, False)
    if work.accuracy.exact:
        stop = polished_fold(scene, step.leg, stop, work)
    return leaving, Growth(stop, settle_on(scene, step.leg, stop, guess(work, stop), SETTLED), True)


@compiled
def _ending(line: Line | None, found: Balance) -> Balance:
    """Equilibrium at the end of a line, to which it was found with rounding errors."""
    if line is None:
        return found
    at, _, moment, force_x, force_y, tangent, rates = found
    return Balance(at, line.end, moment, force_x, force_y, tangent, rates)


@inlined
def fate_of(growth: Growth, step: Step, leaving: Leaving) -> int:
    """How the path ends on a leg, a `SnapOff`, or `OPEN`."""
    if growth.is_maximum:
        if abs(growth.at.holding_moment) <= _NO_MOMENT:
            return _THRUST
        return _FOLD if growth.stop > 0.0 else _CORNER
    is_free = step.is_released and step.end.at.force < _NO_LOAD
    return _RELEASE if is_free and leaving.kind == _SMOOTHLY else OPEN
