"""Steps of searches: by Newton's method within a bracket, for functions that fall through zero, and by the golden
section, for those with one maximum."""

from __future__ import annotations

import math

from tactile_bayes.mechanics.compiler import compiled

_GOLDEN = 0.5 * (math.sqrt(5.0) - 1.0)


@compiled
def golden(low: float, high: float) -> tuple[float, float]:
    """Points between which the bracket of an extremum is cut, by their values."""
    return high - _GOLDEN * (high - low), low + _GOLDEN * (high - low)


@compiled
def newton_step(
    at: float, value: float, slope: float, positive: float, negative: float, before: float
) -> tuple[float, float, float, float]:
    """Next point, its bracket, and the length of this step, or of the bracket that was halved. The function has a value
    and a slope at a point, and is positive at one end of the bracket."""
    if value > 0.0:
        positive = at
    else:
        negative = at
    new = at - value / slope
    # Steps that do not shrink by half may cycle, for instance about a kink.
    if (new - positive) * (new - negative) <= 0.0 and abs(new - at) <= 0.5 * before:
        return new, positive, negative, abs(new - at)
    if value == 0.0:
        return at, positive, negative, before
    return 0.5 * (positive + negative), positive, negative, abs(negative - positive)
