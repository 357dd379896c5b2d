"""The curve of a sensor whose reading is not in proportion to the moment, as of a Hall sensor: with a moment M it reads
what a sensor without a curve reads of M + a M² + b M³, up to the nearest extremum on either side, where it saturates.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from tactile_bayes.arrays import Floats

_LEAST_SLOPE = 1e-3  # slope that counts as the least, so that a saturated reading has an error, though a large one
_BISECTIONS, _POLISHED = 40, 3


def unsaturated(quadratic: Any, cubic: Any) -> tuple[Floats, Floats]:
    """Return the moments between which curves rise, infinite where there is no extremum."""
    a, b = np.asarray(quadratic, dtype=float), np.asarray(cubic, dtype=float)
    root = np.sqrt(np.maximum(a**2 - 3.0 * b, 0.0))
    turns = a**2 > 3.0 * b
    with np.errstate(divide="ignore", over="ignore"):
        low = np.where(turns & (root + a > 0.0), -1.0 / (root + a), -np.inf)
        high = np.where(turns & (root - a > 0.0), 1.0 / (root - a), np.inf)
    return low, high


def curved(moment: Any, quadratic: Any, cubic: Any) -> Floats:
    """Return the values of the curve at moments; arguments may be arrays that broadcast."""
    low, high = unsaturated(quadratic, cubic)
    if np.isfinite(low).any() or np.isfinite(high).any():
        moment = np.clip(moment, low, high)
    return np.asarray(moment * (1.0 + moment * (quadratic + cubic * moment)))


def slope_of(moment: Any, quadratic: Any, cubic: Any) -> Floats:
    """Return the slope of the curve at moments, at least a thousandth."""
    return np.maximum(1.0 + moment * (2.0 * quadratic + 3.0 * cubic * moment), _LEAST_SLOPE)


def straightened(values: Floats, quadratic: float, cubic: float) -> Floats:
    """Return the moments at which the curve has values; beyond saturation those at which it begins."""
    ends = []
    largest = float(np.nanmax(np.abs(values), initial=0.0))
    for end, reach in zip(unsaturated(quadratic, cubic), (-1.0, 1.0), strict=True):
        while np.isinf(end) and abs(curved(reach, quadratic, cubic)) < largest:
            reach *= 2.0
        ends.append(np.full(values.shape, reach if np.isinf(end) else end))
    low, high = ends
    for _ in range(_BISECTIONS):
        middle = 0.5 * (low + high)
        below = curved(middle, quadratic, cubic) < values
        low, high = np.where(below, middle, low), np.where(below, high, middle)
    found = 0.5 * (low + high)
    for _ in range(_POLISHED):
        slope = slope_of(found, quadratic, cubic)
        step = (values - curved(found, quadratic, cubic)) / slope
        found = np.where(slope > _LEAST_SLOPE, np.clip(found + step, ends[0], ends[1]), found)
    return np.asarray(np.where(np.isnan(values), np.nan, found))
