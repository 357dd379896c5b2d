"""Loads along a stretch of a path, as Chebyshev series in the position on the stretch and in the drive angle.

A stretch is smooth, so that the states at a few nodes determine all of it. The position at which a drive angle is
reached is found from the series in the position ("way", from 0 to 1). The search for exact states at drive angles
begins and ends with series in the drive angle; the variable is stretched toward the end, where the drive may turn back,
so that fewer terms are needed.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from tactile_bayes.arrays import Floats
from tactile_bayes.mechanics.branches.equilibrium import Scene
from tactile_bayes.mechanics.branches.line import drive_angle_at
from tactile_bayes.mechanics.branches.phase import on_rod
from tactile_bayes.mechanics.branches.series import Nodes, crossing, nodes_of, value, value_and_slope, weighted
from tactile_bayes.mechanics.compiler import compiled
from tactile_bayes.mechanics.poses.beam import bending

__all__ = [
    "ANGLE",
    "DIP",
    "LOST",
    "REST",
    "WAY",
    "Accuracy",
    "Course",
    "Curves",
    "curves_of",
    "first_fall",
    "largest_curvature",
    "lay_over_angle",
    "left_of",
    "regained",
]

REST, ANGLE = 3, 4
"""Rows after those of the three loads: the rest of a state (the arc length of the contact, or in tip contact the slope
angle of the tip), and the drive angle."""

WAY = 3
"""Row of the position where loads are series in the drive angle."""

DIP = 1e-4
"""Least fall of the drive angle beyond a maximum that makes it the snap-off [rad]. After a smaller fall the rod hardly
jumps, since the same object stops it at once."""

LOST = -1.0
"""Return value of `regained` where contact does not continue after a maximum of the drive angle."""

_LAST = 1e-13
"""Newton step, as a share of a stretch, below which its interpolants have rounding errors only."""


class Accuracy(NamedTuple):
    """Accuracy of a path."""

    resolved: float
    """Tolerated error of an interpolant, as a share of the change of the drive angle on a stretch."""
    sharp: float
    """Tolerated error of the drive angle of an event [rad]."""
    halvings: int
    """Largest number of halvings of a stretch; a singularity at its end exhausts them."""
    first_step: float
    """Newton step, as a share of the bracket, at which the search for first contact ends."""
    last_step: float
    """Newton step, as a share of the bracket, at which searches on a stretch end."""
    polished: bool
    """True if states at drive angles are solved for, and not taken from the series."""


class Curves(NamedTuple):
    """Workspace for the series of one stretch, reused for the next."""

    on: Nodes
    series: Floats
    """In the position: loads, rest of the state, drive angle, and its derivative, shape (6, order)."""
    bend: Floats
    """Second derivative of the drive angle, or first derivative of the position by it."""
    over_angle: Floats
    """The three loads and the position in the stretched drive angle, shape (4, order)."""
    values: Floats
    """Values of the drive angle and the rows before it at the nodes, shape (5, order)."""
    on_grid: Floats


class Course(NamedTuple):
    """Course of the drive angle along a stretch."""

    stop: float
    """Position at which the stretch, or the path, ends."""
    begin: float
    """Drive angle at the beginning [rad]."""
    end: float
    steadiness: float
    """Rate at the end over the mean rate: 0 where the drive turns back, 1 if the rate is constant."""


def curves_of(order: int) -> Curves:
    """Workspace for `order` nodes."""
    return Curves(
        on=nodes_of(order),
        series=np.zeros((6, order)),
        bend=np.empty(order),
        over_angle=np.empty((4, order)),
        values=np.zeros((5, order)),
        on_grid=np.empty(2 * order + 1),
    )


@compiled
def first_fall(accuracy: Accuracy, is_first: bool, curves: Curves) -> float:
    """Position at which the drive angle stops growing: above 1 if it grows to the end, 0 if it does not grow at all."""
    on, slope = curves.on, curves.series[ANGLE + 1]
    weighted(on.slopes, curves.series[ANGLE], slope)
    weighted(on.on_grid, slope, curves.on_grid)
    for cell in range(1 if is_first else 0, on.grid.size):  # it always grows from first contact
        if curves.on_grid[cell] <= 0.0:
            if cell == 0:
                return 0.0
            weighted(on.slopes, slope, curves.bend)
            left, right = on.grid[cell - 1], on.grid[cell]
            return crossing(slope, curves.bend, 0.0, left, right, 0.5 * (left + right), accuracy.last_step)
    return 2.0


@compiled
def regained(stop: float, most: float, curves: Curves) -> float:
    """Position after `stop` at which the drive angle exceeds a maximum again; above 1 if the stretch ends before,
    `LOST` if the drive angle falls too far below it."""
    on, angle, slope = curves.on, curves.series[ANGLE], curves.series[ANGLE + 1]
    weighted(on.on_grid, angle, curves.on_grid)
    weighted(on.slopes, angle, slope)
    weighted(on.slopes, slope, curves.bend)
    below = max(stop, 0.0)
    falls = stop >= 0.0 or value(slope, below) < 0.0
    for cell in range(on.grid.size):
        above = on.grid[cell]
        if above <= stop:
            continue
        rises = value(slope, above) > 0.0
        lowest = above
        if falls and rises and above > below:  # the whole dip may lie between two points of the grid
            lowest = crossing(slope, curves.bend, 0.0, above, below, 0.5 * (above + below), _LAST)
        if value(angle, lowest) < most - DIP:
            return LOST
        if curves.on_grid[cell] > most:
            below = lowest if lowest < above else below
            return crossing(angle, slope, most, above, below, 0.5 * (above + below), _LAST)
        below, falls = above, not rises
    return 2.0


@compiled
def lay_over_angle(accuracy: Accuracy, course: Course, curves: Curves) -> None:
    """Fit the series of the loads and of the position in the stretched drive angle."""
    series, values, on = curves.series, curves.values, curves.on
    steadiness, way = course.steadiness, course.stop
    last_step = max(accuracy.last_step, _LAST)
    for k in range(on.nodes.size):
        ahead = 1.0 - on.nodes[k]
        wanted = course.end - (course.end - course.begin) * ahead * (steadiness + (1.0 - steadiness) * ahead)
        way = crossing(series[ANGLE], series[ANGLE + 1], wanted, course.stop, 0.0, course.stop * on.nodes[k], last_step)
        values[0, k], values[1, k] = value_and_slope(series[0], series[1], way)
        values[2, k], values[WAY, k] = value(series[2], way), way
    for c in range(4):
        weighted(on.fit, values[c], curves.over_angle[c])


@compiled
def left_of(angle: float, course: Course) -> float:
    """Remainder of a stretch at a drive angle, from 1 to 0, in a variable in which states are smooth."""
    left = min(max((course.end - angle) / (course.end - course.begin), 0.0), 1.0)
    root = math.sqrt(course.steadiness * course.steadiness + 4.0 * (1.0 - course.steadiness) * left)
    return 2.0 * left / (course.steadiness + root) if left > 0.0 else 0.0


@compiled
def largest_curvature(scene: Scene, stop: float, curves: Curves) -> float:
    """Largest change of the rod's curvature from its rest curvature up to a position on a stretch [1/L], from values at
    the nodes."""
    nodes, curvature = curves.on.nodes, curves.bend
    at_stop, best, count = _bent(scene, stop, curves.series), 0, 0
    while count < nodes.size and nodes[count] < stop:
        curvature[count] = _bent(scene, nodes[count], curves.series)
        best = count if curvature[count] > curvature[best] else best
        count += 1
    if best == 0 or best >= count - 1:
        return max(at_stop, curvature[best] if count else 0.0)
    # The maximum of a parabola through three nodes.
    before, after = nodes[best - 1] - nodes[best], nodes[best + 1] - nodes[best]
    falls, falls_on = curvature[best - 1] - curvature[best], curvature[best + 1] - curvature[best]
    bend = (falls_on / after - falls / before) / (after - before)
    slope = falls / before - bend * before
    return max(at_stop, curvature[best] - (0.25 * slope * slope / bend if bend < 0.0 else 0.0))


@compiled
def _bent(scene: Scene, way: float, series: Floats) -> float:
    """Largest change of curvature between pivot and contact at a position [1/L]."""
    moment, force_x = value_and_slope(series[0], series[1], way)
    force_y, rest = value_and_slope(series[2], series[REST], way)
    slope = drive_angle_at(scene.line, value(series[ANGLE], way)) - scene.rig.compliance * moment
    return bending(scene.beam, slope, moment, force_x, force_y, on_rod(scene.phase, rest, 0.0)[1])
