"""Where a branch goes on after a leg: in another phase, on another line, past a knot, or where it has left a dip."""

from __future__ import annotations

import math

from tactile_bayes.arrays import Floats
from tactile_bayes.mechanics.branches.advance import LONGEST, Here, Setting, Step
from tactile_bayes.mechanics.branches.equilibrium import (
    SETTLED,
    Balance,
    Equilibrium,
    Scene,
    balance,
    dot,
    in_phase,
    nowhere,
    on_line,
    settle,
    tangential_psi1,
    times,
)
from tactile_bayes.mechanics.branches.leg import NUDGE, LegSeries, guess, leg_from, sample_leg, settle_on, shortened
from tactile_bayes.mechanics.branches.leg_events import LOST, regained
from tactile_bayes.mechanics.branches.line import Line
from tactile_bayes.mechanics.branches.meeting import KNOT, LINE, PHASE, Growth, Leaving
from tactile_bayes.mechanics.branches.phase import following, limit
from tactile_bayes.mechanics.compiler import compiled, inlined

__all__ = ["continued", "goes_on", "regained_at", "stopped"]

_ROOM_PAST_LINE = 1.1
"""Largest travel of a leg on a line of the drive, over the travel up to its end."""


@inlined
def stopped(here: Here) -> Here:
    """End of a branch."""
    return Here(here.scene, here.line, nowhere(), here.before, here.onward, here.longest)


@inlined
def regained_at(
    here: Here, step: Step, leaving: Leaving, growth: Growth, most: float, work: LegSeries
) -> tuple[float, Balance]:
    """Position on a leg at which the travel exceeds its maximum again, as `regained`, and the equilibrium there."""
    scene, behind = here.scene, growth.stop
    if step.end.at.force < 0.0:
        return LOST, here.begin
    if leaving.share < 1.0:
        sample_leg(scene, shortened(step.leg, leaving.share), here.begin, nowhere(), leaving.share, work)
        behind = min(behind / leaving.share, 1.0)
    found = regained(behind, most, work)
    if not 0.0 <= found <= 1.0:
        return found, here.begin
    return found, settle_on(scene, step.leg, leaving.share * found, guess(work, found), SETTLED)


@inlined
def continued(here: Here, setting: Setting, step: Step, leaving: Leaving) -> Here:
    """Beginning of the next leg; NaN where the drive or the contour ends."""
    scene, line, before, onward = here.scene, here.line, nowhere(), step.end.tangent
    if leaving.kind == LINE:
        return _on_next_line(here, setting.lines, step, leaving)
    if leaving.kind == PHASE:
        scene = in_phase(scene, following(scene.phase))
        q, sense = limit(scene.phase, tangential_psi1(scene))
        begin = balance(scene, Equilibrium(leaving.at.at.p, q, leaving.at.at.force))[0]
        onward = Equilibrium(0.0, -sense, 0.0)
    elif leaving.kind == KNOT:
        begin = nowhere() if step.knot == setting.low else _past(scene, step.at_knot, onward.p)
    else:
        begin, before = step.end, step.before_end
    return Here(scene, line, begin, before, onward, here.longest)


@inlined
def _on_next_line(here: Here, lines: Floats | None, step: Step, leaving: Leaving) -> Here:
    """Beginning of a leg on the next line of the drive; NaN after the last."""
    if not goes_on(lines, here.line):
        return stopped(here)
    line = here.line + 1
    scene = on_line(here.scene, lines, line)
    begin = settle(scene, leaving.at.at, leaving.at.at, step.leg.normal, 0.0, SETTLED)
    onward = times(math.copysign(1.0, begin.rates.travel), begin.tangent)
    longest = _length_on_line(scene.line, scene, begin, onward) if goes_on(lines, line) else LONGEST
    return Here(scene, line, begin, nowhere(), onward, longest)


@compiled
def goes_on(lines: Floats | None, k: int) -> bool:
    """True if the drive continues after a line."""
    if lines is None:
        return False
    return k + 1 < lines.shape[0] and not math.isnan(lines[k + 1, 0])


@compiled
def _length_on_line(line: Line | None, scene: Scene, begin: Balance, onward: Equilibrium) -> float:
    """Length of a leg up to somewhat beyond the end of the line of the drive, as far as its travel's rate tells."""
    if line is None:
        return LONGEST
    leg = leg_from(scene, begin, onward, LONGEST)
    room = _ROOM_PAST_LINE * (line.end - begin.travel)
    pace = begin.rates.travel / dot(leg.normal, begin.tangent)
    return LONGEST * room / pace if pace > room > 0.0 else LONGEST


@compiled
def _past(scene: Scene, at_knot: Balance, sense: float) -> Balance:
    """Equilibrium at a knot, with the tangent and the rates behind it."""
    at, travel, moment, force_x, force_y, _, _ = at_knot
    behind = balance(scene, Equilibrium(at.p + math.copysign(NUDGE, sense), at.q, at.force))[0]
    return Balance(at, travel, moment, force_x, force_y, behind.tangent, behind.rates)
