"""Intervals and bands: quantiles of posterior draws."""

from __future__ import annotations

import numpy as np

from tactile_bayes.arrays import Floats
from tactile_bayes.checks import check_probability, check_switch

_ROUNDING = 1e-9  # share of its largest width below which a band is so narrow that its draws differ only by rounding


def central_levels(probability: float) -> tuple[float, float, float]:
    """Return the quantile levels of the central interval's lower end, the median, and its upper end."""
    check_probability("probability", probability)
    return 0.5 * (1.0 - probability), 0.5, 0.5 * (1.0 + probability)


def quantile_band(values: Floats, probability: float, simultaneous: bool = False) -> Floats:
    """Return lower edge, median and upper edge of draws on a grid.

    Shapes: values (draws, grid points) → (3, grid points).
    """
    levels = central_levels(probability)
    check_switch("simultaneous", simultaneous)
    band = np.full((3, values.shape[1]), np.nan)
    known = np.isfinite(values).all(axis=0)
    if not known.any():
        return band
    lower, median, upper = np.quantile(values[:, known], levels, axis=0)
    if simultaneous:
        off = values[:, known] - median
        reach = np.where(off > 0.0, upper - median, median - lower)
        widest = float(np.max(upper - lower))
        if widest > 0.0:
            most = (np.abs(off) / np.maximum(reach, _ROUNDING * widest)).max(axis=1)
            factor = max(1.0, float(np.quantile(most, probability, method="inverted_cdf")))
            lower, upper = median - factor * (median - lower), median + factor * (upper - median)
    band[:, known] = lower, median, upper
    return band
