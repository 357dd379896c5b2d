"""The point of a step of the rod at which its moment vanishes, or its distance from the pivot rises to a level."""

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
    start: State, force: float, step: Step, sense: float, level: float, x: float, work: Floats
) -> tuple[float, float]:
    """The moment times its sense, 1 or −1, less the level; with a sense of 0 that of the squared distance."""
    at = moved(start, force, step, x, work)
    cos, sin = math.cos(at.psi), math.sin(at.psi)
    if sense != 0.0:
        return sense * at.load - level, sense * force * step.length * cos
    return at.u * at.u + at.v * at.v - level * level, 2.0 * step.length * (at.u * cos + at.v * sin)


@compiled
def peak(start: State, force: float, step: Step, sense: float, work: Floats) -> float:
    """Point of a step at which the moment times its sense, or the distance, is largest: its end, or a maximum."""
    low, high = 0.0, step.share
    if not (
        _value_and_slope(start, force, step, sense, 0.0, low, work)[1] > 0.0
        and _value_and_slope(start, force, step, sense, 0.0, high, work)[1] < 0.0
    ):
        return high
    while high - low > _FLAT:
        middle = 0.5 * (low + high)
        if _value_and_slope(start, force, step, sense, 0.0, middle, work)[1] > 0.0:
            low = middle
        else:
            high = middle
    return low


@compiled
def rise(start: State, force: float, step: Step, sense: float, level: float, work: Floats) -> float:
    """Point x of a step at which the moment times its sense, or the distance, rises to a level; NaN without one."""
    top = peak(start, force, step, sense, work)
    if not _value_and_slope(start, force, step, sense, level, top, work)[0] >= 0.0:
        return math.nan
    # Newton's method for a function that falls through zero.
    x, below, above, before = 0.5 * top, 0.0, top, top
    for _ in range(_MOST_STEPS):
        value, slope = _value_and_slope(start, force, step, sense, level, x, work)
        new, below, above, before = newton_step(x, -value, -slope, below, above, before)
        moved_by = abs(new - x)
        x = new
        if not moved_by > _SETTLED or value == 0.0:
            break
    return x
