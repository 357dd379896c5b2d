"""The Monte-Carlo error of a band: how well its ends are known from the draws of a posterior."""

from __future__ import annotations

import math

import numpy as np
import xarray as xr
from arviz_stats.base.array import array_stats
from numpy.typing import ArrayLike

from tactile_bayes.errors import InferenceError
from tactile_bayes.inference.result import contour_draws
from tactile_bayes.uncertainty.band import central_levels, contour_heights, grid_points, length_unit

WANTED_SHARE = 0.1  # Monte-Carlo error of an end over the width of the band, above which more draws are advised


def sampling_error(posterior: xr.DataTree, x: ArrayLike, probability: float = 0.95) -> xr.Dataset:
    """Return Monte-Carlo standard errors of the ends of a band at x, (n,), and the draws for a tenth of the band. By
    the effective sample size of a quantile (Vehtari et al. 2021, doi 10.1214/20-BA1221), with an ensemble as a
    chain."""
    at, (low, middle, high) = grid_points(x), central_levels(probability)
    chains = contour_draws(posterior).sizes["chain"]
    heights = contour_heights(posterior, at)
    heights = heights[: len(heights) // chains * chains].reshape(chains, -1, at.size).transpose(2, 0, 1)
    known = np.isfinite(heights).all(axis=(1, 2))
    if not known.any():
        raise InferenceError("no grid point is reached by all contours of the posterior: give other x")
    errors = np.full((3, at.size), np.nan)
    for row, level in zip(errors, (low, middle, high), strict=True):
        row[known] = array_stats.mcse(heights[known], method="quantile", prob=level)
    lower, upper = np.quantile(heights[known], [low, high], axis=(1, 2))
    share = np.full(at.size, np.nan)
    with np.errstate(invalid="ignore"):  # a band without width has no error either
        share[known] = np.nan_to_num(np.maximum(errors[0], errors[2])[known] / (upper - lower))
    effective = [array_stats.ess(heights[known], method="quantile", prob=level) for level in (low, high)]
    draws, unit, names = heights[0].size, length_unit(posterior), ("lower_error", "median_error", "upper_error")
    return xr.Dataset(
        {
            **{name: ("x", row, unit) for name, row in zip(names, errors, strict=True)},
            "share": ("x", share, {"units": "1"}),
            "draws": draws,
            "effective_draws": float(np.nanmin(effective)),
            "draws_needed": math.ceil(draws * (float(np.nanmax(share)) / WANTED_SHARE) ** 2),
        },
        coords={"x": ("x", at, unit)},
        attrs={"probability": probability},
    )
