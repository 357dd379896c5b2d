"""Intervals and bands: quantiles of posterior draws."""

from __future__ import annotations

import numpy as np

from tactile_bayes.arrays import Floats
from tactile_bayes.checks import check_probability, check_switch

__all__ = ["central_levels", "quantile_band"]

_ROUNDING = 1e-9
"""Share of its largest width below which a band is so narrow that its draws differ only by rounding."""


def central_levels(probability: float) -> tuple[float, float, float]:
    """Return the quantile levels of the central interval's lower end, the median, and its upper end.

    Raises
    ------
    ParameterError
        If the probability is not in (0, 1).

    Examples
    --------
    >>> central_levels(0.5)
    (0.25, 0.5, 0.75)
    """
    check_probability("probability", probability)
    return 0.5 * (1.0 - probability), 0.5, 0.5 * (1.0 + probability)


def quantile_band(values: Floats, probability: float, simultaneous: bool = False) -> Floats:
    """Return lower edge, median and upper edge of draws on a grid.

    Parameters
    ----------
    values : ndarray, shape (draws, grid points)
        NaN where a draw has no value.
    probability : float
        Probability of the band, in (0, 1).
    simultaneous : bool
        If True, the band contains that share of draws at all grid points at once: the pointwise band is widened about
        the median, everywhere by the same factor.

    Returns
    -------
    ndarray, shape (3, grid points)
        NaN where some draw has no value.

    Raises
    ------
    ParameterError
        If the probability is not in (0, 1).

    Examples
    --------
    >>> quantile_band(np.linspace([0.0, 0.0], [1.0, 2.0], 101), 0.9).round(12)
    array([[0.05, 0.1 ],
           [0.5 , 1.  ],
           [0.95, 1.9 ]])
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
