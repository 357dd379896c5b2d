"""Positions on a leg at which a branch changes: knots of the contour, the change of the phase, folds, the end of a line
of the drive, and releases. Each is a share of the leg.
"""

from __future__ import annotations

import math

from tactile_bayes.arrays import Floats
from tactile_bayes.mechanics.branches.curves import ANGLE, REST, Accuracy
from tactile_bayes.mechanics.branches.equilibrium import (
    BY_FORCE,
    NO_FORCE,
    SETTLED,
    Balance,
    Equilibrium,
    Scene,
    dot,
    less,
    settle,
    tangential_psi1,
)
from tactile_bayes.mechanics.branches.leg import NUDGE, PLACE, Leg, LegCurves, guess, settle_on
from tactile_bayes.mechanics.branches.line import Line
from tactile_bayes.mechanics.branches.phase import limit
from tactile_bayes.mechanics.branches.series import crossing, value, weighted
from tactile_bayes.mechanics.compiler import compiled

__all__ = ["change_of_phase", "end_of_line", "first_knot", "polished_fold", "release", "share_of"]

_WEAK = 0.5
"""Share of its force that a leg loses along its tangent for a release to be looked for on it."""


@compiled
def first_knot(leg: Leg, knots: Floats, low: float, work: LegCurves) -> tuple[float, float]:
    """First knot or end of the contour that a leg passes, and about where; a position above 1 if it passes none."""
    before, old = leg.begin.p, 0.0
    for k in range(1, work.nodes.size):
        after = work.at_nodes[PLACE, k]
        for i in range(-1, knots.size):
            knot = low if i < 0 else knots[i]
            if (before - knot) * (after - knot) < 0.0 and abs(leg.begin.p - knot) > NUDGE:
                return knot, old + (work.nodes[k] - old) * (before - knot) / (before - after)
        before, old = after, work.nodes[k]
    return math.nan, 2.0


@compiled
def change_of_phase(scene: Scene, accuracy: Accuracy, work: LegCurves) -> float:
    """Position at which the phase changes; above 1 if it does not."""
    curves = work.curves
    on, rest = curves.on, curves.series[REST]
    end, sense = limit(scene.phase, tangential_psi1(scene))
    weighted(on.on_grid, rest, curves.on_grid)
    for cell in range(1, on.grid.size):
        if sense * (curves.on_grid[cell] - end) > 0.0:
            weighted(on.slopes, rest, work.rest_slope)
            left, right = on.grid[cell - 1], on.grid[cell]
            if sense > 0.0:
                left, right = right, left
            return crossing(rest, work.rest_slope, end, left, right, 0.5 * (left + right), accuracy.last_step)
    return 2.0


@compiled
def polished_fold(scene: Scene, leg: Leg, stop: float, work: LegCurves) -> float:
    """Position at which the exact derivative of the drive angle vanishes, by secants from the interpolant."""
    curves = work.curves
    weighted(curves.on.slopes, curves.series[ANGLE + 1], curves.bend)
    bend = value(curves.bend, stop)
    at_stop, last = settle_on(scene, leg, stop, guess(work, stop), SETTLED).rates.travel, 2e-2
    for _ in range(7):
        step = at_stop / bend
        if not abs(step) < 0.5 * last:
            break
        new = min(max(stop - step, 0.0), 1.0)
        at_new = settle_on(scene, leg, new, guess(work, new), SETTLED).rates.travel
        bend = (at_new - at_stop) / (new - stop)
        stop, at_stop, last = new, at_new, abs(step)
    return stop


@compiled
def share_of(leg: Leg, found: Balance) -> float:
    """Position on a leg."""
    return dot(leg.normal, less(found.at, leg.begin))


@compiled
def release(scene: Scene, leg: Leg) -> float:
    """Share of a leg at which the force vanishes; NaN if it hardly falls, or if that is not on the leg."""
    if not leg.along.force < -_WEAK * leg.begin.force:
        return math.nan
    share = -leg.begin.force / leg.along.force
    begin, along = leg.begin, leg.along
    start = Equilibrium(begin.p + share * along.p, begin.q + share * along.q, 0.0)
    found = settle(scene, start, NO_FORCE, BY_FORCE, 0.0, SETTLED)
    share = share_of(leg, found)
    return share if 0.0 < share <= 1.0 else math.nan


@compiled
def end_of_line(line: Line | None, last: float, accuracy: Accuracy, work: LegCurves) -> float:
    """Position on a leg, up to a last one, at which the line of the drive ends; above 1 if it does not.

    The series has the derivative of the travel."""
    if line is None:
        return 2.0
    series, end = work.curves.series, line.end
    if value(series[ANGLE], last) < end:
        return 2.0
    return crossing(series[ANGLE], series[ANGLE + 1], end, last, 0.0, 0.5 * last, accuracy.last_step)
