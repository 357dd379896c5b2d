"""Crossings: where on a leg the branch meets a knot, another phase, the edge of friction, or the end of a line, where
its force vanishes, and where its travel stops growing."""

from __future__ import annotations

import math

from tactile_bayes.arrays import Floats
from tactile_bayes.mechanics.branches.equilibrium import SETTLED, Balance, nowhere, settle, unloaded
from tactile_bayes.mechanics.branches.leg import (
    ANGLE,
    HARDLY,
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
from tactile_bayes.mechanics.branches.line import Line, is_rotation
from tactile_bayes.mechanics.branches.phase import STUCK, limit, slides, slip
from tactile_bayes.mechanics.branches.scene import BY_Q, Equilibrium, Scene
from tactile_bayes.mechanics.branches.series import crossing, value, weighted
from tactile_bayes.mechanics.compiler import compiled, inlined

# Least fall of the drive angle beyond a maximum that makes it the snap-off [rad]. After a smaller fall the rod hardly
# jumps, since the same object stops it at once.
DIP = 1e-4
LOST = -1.0  # return value of `regained` where contact does not continue after a maximum of the drive angle
_WEAK = 0.5  # share of its force that a leg loses along its tangent for a release to be looked for on it
NOT_SLIPPING = 1e-9  # slip per length of a leg, or per travel, whose sense rounding may decide
# Angle by which the force of a contact that sticks is beyond the cone [rad], and not by rounding; and on a leg that
# begins at its edge, where the force may move inward to second order only.
_BEYOND, _BEYOND_BEGIN = 1e-9, 1e-5
_MOST_HALVINGS = 60  # largest number of steps to where the slip vanishes
_LAST = 1e-13  # Newton step, as a share of a leg, below which its interpolants have rounding errors only


@compiled
def first_knot(scene: Scene, leg: Leg, knots: Floats, low: float, work: LegSeries) -> tuple[float, float]:
    """First knot or end of the contour that a leg passes, and about where."""
    if scene.phase == STUCK:
        return math.nan, 2.0
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
    """Position at which the phase changes between contact of the tip and of the rod."""
    grid = work.grid
    end = limit(scene, value(work.series[PLACE], 1.0))
    row = PLACE if end.is_p else REST
    weighted(work.on_grid, work.series[row], work.sampled)
    for cell in range(1, grid.size):
        if end.sense * (work.sampled[cell] - end.value) > 0.0:
            return _through(row, end.value, end.sense, cell, work)
    return 2.0


@compiled
def _through(row: int, wanted: float, sense: float, cell: int, work: LegSeries) -> float:
    """Position at which a series rises (1) or falls (−1) through a value, in the cell before a number of the grid."""
    weighted(work.slopes, work.series[row], work.slope)
    left, right = work.grid[cell - 1], work.grid[cell]
    if sense > 0.0:
        left, right = right, left
    return crossing(work.series[row], work.slope, wanted, left, right, 0.5 * (left + right), work.accuracy.last_step)


@compiled
def change_of_mode(scene: Scene, leg: Leg, last: float, work: LegSeries) -> tuple[float, Balance]:
    """Position on a leg, up to a last one, at which sliding or sticking ends, and the equilibrium there."""
    delta = scene.rig.friction_angle
    if delta == 0.0:
        return 2.0, nowhere()
    if slides(scene.phase):
        way = _end_of_sliding(scene, leg, last, work)
        if way > last:
            return 2.0, nowhere()
        return way, settle_on(scene, leg, way, guess(work, way), SETTLED)
    weighted(work.on_grid, work.series[REST], work.sampled)
    most = abs(delta) + (_BEYOND if abs(leg.begin.q) < abs(delta) - _BEYOND else _BEYOND_BEGIN)
    for cell in range(1, work.grid.size):
        gamma = work.sampled[cell]
        if abs(gamma) > most:
            edge, sense = math.copysign(delta, gamma), math.copysign(1.0, gamma)
            way = _through(REST, edge, sense, cell, work)
            if way > last:
                break
            start = guess(work, way)
            found = settle(scene, start, Equilibrium(0.0, edge, 0.0), BY_Q, 0.0, SETTLED)
            return min(max(share_of(leg, found), 0.0), last), found
    return 2.0, nowhere()


@inlined
def _end_of_sliding(scene: Scene, leg: Leg, last: float, work: LegSeries) -> float:
    """Position up to which friction opposes the slip: between two nodes, by regula falsi (Illinois)."""
    at_nodes, half, sense = work.at_nodes, work.nodes.size, math.copysign(1.0, scene.rig.friction_angle)
    before, old = 0.0, 0.0
    for k in range(half):
        at = Equilibrium(at_nodes[PLACE, k], at_nodes[REST, k], 0.0)
        along = Equilibrium(at_nodes[PLACE, half + k], at_nodes[REST, half + k], 0.0)
        way, against = work.nodes[k], sense * slip(scene, at, along)
        if k > 0 and against > NOT_SLIPPING:
            if not before < 0.0:
                return old
            return _no_slip(scene, leg, sense, old, before, way, against, work)
        if way > last:
            break
        before, old = against, way
    return 2.0


@compiled
def _no_slip(
    scene: Scene, leg: Leg, sense: float, low: float, before: float, high: float, after: float, work: LegSeries
) -> float:
    """Position between two at which the slip vanishes, from its values there."""
    settled, side = work.accuracy.last_step * (high - low), 0
    way = high
    for _ in range(_MOST_HALVINGS):
        new = (low * after - high * before) / (after - before)
        found = settle_on(scene, leg, new, guess(work, new), SETTLED)
        value_there = sense * slip(scene, found.at, found.tangent)
        step, way = abs(new - way), new
        if value_there > 0.0:
            high, after = new, value_there
            before *= 0.5 if side == 1 else 1.0
            side = 1
        else:
            low, before = new, value_there
            after *= 0.5 if side == -1 else 1.0
            side = -1
        if not step > settled or value_there == 0.0:
            break
    return way


@compiled
def release(scene: Scene, leg: Leg) -> float:
    """Share of a leg at which the force vanishes; NaN if it hardly falls, or if that is not on the leg."""
    if not leg.along.force < -_WEAK * leg.begin.force:
        return math.nan
    share = -leg.begin.force / leg.along.force
    begin, along = leg.begin, leg.along
    start = Equilibrium(begin.p + share * along.p, begin.q + share * along.q, 0.0)
    share = share_of(leg, unloaded(scene, start, HARDLY * begin.force))
    return share if 0.0 < share <= 1.0 else math.nan


@compiled
def end_of_line(line: Line, last: float, work: LegSeries) -> float:
    """Position on a leg, up to a last one, at which the line of the drive ends. The series has the travel's rate."""
    if is_rotation(line):
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
            return _through(RATE, 0.0, -1.0, cell, work)
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
