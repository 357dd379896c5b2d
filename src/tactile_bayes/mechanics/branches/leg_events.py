"""Positions on a leg at which a branch changes: knots of the contour, the change of the phase, releases, the end of a
line of the drive, folds, and where the travel exceeds its maximum again. A position above 1 is beyond the leg.
"""

from __future__ import annotations

import math

from tactile_bayes.arrays import Floats
from tactile_bayes.mechanics.branches.equilibrium import (
    BY_FORCE,
    NO_FORCE,
    SETTLED,
    Equilibrium,
    Scene,
    settle,
    tangential_psi1,
)
from tactile_bayes.mechanics.branches.leg import (
    ANGLE,
    NUDGE,
    PLACE,
    RATE,
    REST,
    Leg,
    LegSeries,
    guess,
    settle_on,
    share_of,
)
from tactile_bayes.mechanics.branches.line import Line
from tactile_bayes.mechanics.branches.phase import limit
from tactile_bayes.mechanics.branches.series import crossing, value, weighted
from tactile_bayes.mechanics.compiler import compiled

__all__ = [
    "DIP",
    "LOST",
    "change_of_phase",
    "end_of_line",
    "first_fall",
    "first_knot",
    "polished_fold",
    "regained",
    "release",
]

DIP = 1e-4
"""Least fall of the drive angle beyond a maximum that makes it the snap-off [rad]. After a smaller fall the rod hardly
jumps, since the same object stops it at once."""

LOST = -1.0
"""Return value of `regained` where contact does not continue after a maximum of the drive angle."""

_WEAK = 0.5
"""Share of its force that a leg loses along its tangent for a release to be looked for on it."""

_LAST = 1e-13
"""Newton step, as a share of a leg, below which its interpolants have rounding errors only."""


@compiled
def first_knot(leg: Leg, knots: Floats, low: float, work: LegSeries) -> tuple[float, float]:
    """First knot or end of the contour that a leg passes, and about where."""
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
def change_of_phase(scene: Scene, work: LegSeries) -> float:
    """Position at which the phase changes."""
    rest, grid = work.series[REST], work.grid
    end, sense = limit(scene.phase, tangential_psi1(scene))
    weighted(work.on_grid, rest, work.sampled)
    for cell in range(1, grid.size):
        if sense * (work.sampled[cell] - end) > 0.0:
            weighted(work.slopes, rest, work.slope)
            left, right = grid[cell - 1], grid[cell]
            if sense > 0.0:
                left, right = right, left
            return crossing(rest, work.slope, end, left, right, 0.5 * (left + right), work.accuracy.last_step)
    return 2.0


@compiled
def release(scene: Scene, leg: Leg) -> float:
    """Share of a leg at which the force vanishes; NaN if it hardly falls, or if that is not on the leg."""
    if not leg.along.force < -_WEAK * leg.begin.force:
        return math.nan
    share = -leg.begin.force / leg.along.force
    begin, along = leg.begin, leg.along
    start = Equilibrium(begin.p + share * along.p, begin.q + share * along.q, 0.0)
    share = share_of(leg, settle(scene, start, NO_FORCE, BY_FORCE, 0.0, SETTLED))
    return share if 0.0 < share <= 1.0 else math.nan


@compiled
def end_of_line(line: Line | None, last: float, work: LegSeries) -> float:
    """Position on a leg, up to a last one, at which the line of the drive ends. The series has the travel's rate."""
    if line is None:
        return 2.0
    travel = work.series[ANGLE]
    if value(travel, last) < line.end:
        return 2.0
    return crossing(travel, work.series[RATE], line.end, last, 0.0, 0.5 * last, work.accuracy.last_step)


@compiled
def first_fall(is_first: bool, work: LegSeries) -> float:
    """Position at which the travel stops growing: 0 if it does not grow at all. Its rate is written to the series."""
    rate, grid = work.series[RATE], work.grid
    weighted(work.slopes, work.series[ANGLE], rate)
    weighted(work.on_grid, rate, work.sampled)
    for cell in range(1 if is_first else 0, grid.size):  # it always grows from first contact
        if work.sampled[cell] <= 0.0:
            if cell == 0:
                return 0.0
            weighted(work.slopes, rate, work.slope)
            left, right = grid[cell - 1], grid[cell]
            return crossing(rate, work.slope, 0.0, left, right, 0.5 * (left + right), work.accuracy.last_step)
    return 2.0


@compiled
def polished_fold(scene: Scene, leg: Leg, stop: float, work: LegSeries) -> float:
    """Position at which the exact derivative of the travel vanishes, by secants from the interpolant."""
    weighted(work.slopes, work.series[RATE], work.slope)
    bend = value(work.slope, stop)
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
def regained(stop: float, most: float, work: LegSeries) -> float:
    """Position after `stop` at which the travel exceeds a maximum again; `LOST` if it falls too far below it."""
    travel, rate, grid = work.series[ANGLE], work.series[RATE], work.grid
    weighted(work.on_grid, travel, work.sampled)
    weighted(work.slopes, travel, rate)
    weighted(work.slopes, rate, work.slope)
    below = max(stop, 0.0)
    falls = stop >= 0.0 or value(rate, below) < 0.0
    for cell in range(grid.size):
        above = grid[cell]
        if above <= stop:
            continue
        rises = value(rate, above) > 0.0
        lowest = above
        if falls and rises and above > below:  # the whole dip may lie between two points of the grid
            lowest = crossing(rate, work.slope, 0.0, above, below, 0.5 * (above + below), _LAST)
        if value(travel, lowest) < most - DIP:
            return LOST
        if work.sampled[cell] > most:
            below = lowest if lowest < above else below
            return crossing(travel, rate, most, above, below, 0.5 * (above + below), _LAST)
        below, falls = above, not rises
    return 2.0
