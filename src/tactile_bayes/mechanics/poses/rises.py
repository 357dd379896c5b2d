"""The point of a step of the rod at which its moment, or its distance from the pivot, rises to a level."""

from __future__ import annotations

import math

from tactile_bayes.arrays import Floats
from tactile_bayes.mechanics.compiler import compiled
from tactile_bayes.mechanics.newton import newton_step
from tactile_bayes.mechanics.poses.taylor import State, Step, moved

__all__ = ["peak", "rise"]

_MOST_STEPS = 100

_SETTLED = 1e-15
"""Last step of Newton's method."""

_FLAT = 1e-9
"""Distance from a maximum that does not matter to the value there."""


@compiled
def _value_and_slope(
    start: State, force: float, step: Step, of_load: bool, level: float, x: float, work: Floats
) -> tuple[float, float]:
    at = moved(start, force, step, x, work)
    cos, sin = math.cos(at.psi), math.sin(at.psi)
    if of_load:
        return at.load - level, force * step.length * cos
    return at.u * at.u + at.v * at.v - level * level, 2.0 * step.length * (at.u * cos + at.v * sin)


@compiled
def peak(start: State, force: float, step: Step, of_load: bool, work: Floats) -> float:
    """Point of a step at which moment or distance are largest: its end, or a maximum."""
    low, high = 0.0, step.share
    if not (
        _value_and_slope(start, force, step, of_load, 0.0, low, work)[1] > 0.0
        and _value_and_slope(start, force, step, of_load, 0.0, high, work)[1] < 0.0
    ):
        return high
    while high - low > _FLAT:
        middle = 0.5 * (low + high)
        if _value_and_slope(start, force, step, of_load, 0.0, middle, work)[1] > 0.0:
            low = middle
        else:
            high = middle
    return low


@compiled
def rise(start: State, force: float, step: Step, of_load: bool, level: float, work: Floats) -> float:
    """Point x of a step at which moment or distance rises to a level; NaN if there is none."""
    top = peak(start, force, step, of_load, work)
    if not _value_and_slope(start, force, step, of_load, level, top, work)[0] >= 0.0:
        return math.nan
    # Newton's method for a function that falls through zero.
    x, below, above, before = 0.5 * top, 0.0, top, top
    for _ in range(_MOST_STEPS):
        value, slope = _value_and_slope(start, force, step, of_load, level, x, work)
        new, below, above, before = newton_step(x, -value, -slope, below, above, before)
        moved_by = abs(new - x)
        x = new
        if not moved_by > _SETTLED or value == 0.0:
            break
    return x
