"""Derivatives of predicted readings by differences; samples at a snap-off jump."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from tactile_bayes.arrays import Floats

_JUMP = 0.01  # second difference of a value over a step, in its unit, above which it may be a jump


def central_slopes(values: Callable[[Floats], Floats], point: Floats, steps: Floats | float) -> Floats:
    """Derivatives of values by central differences, shape (k, d) of a point (d,), by steps (d,); zero at a jump. A
    value jumps if a sample is in contact on one side of the point alone: that is a limit of contours, and no slope."""
    steps = np.broadcast_to(np.asarray(steps, dtype=float), point.shape)
    moves = np.diag(steps)
    found = values(np.concatenate([point + moves, point - moves, point[None]]))
    more, less, here = found[: point.size], found[point.size : -1], found[-1]
    jump = np.abs(more + less - 2.0 * here)
    slopes = np.where(jump > np.maximum(_JUMP, 0.5 * np.abs(more - less)), 0.0, (more - less) / (2.0 * steps[:, None]))
    return np.asarray(slopes.T)
