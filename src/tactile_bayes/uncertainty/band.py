"""Uncertainty bands of contours."""

from __future__ import annotations

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike, NDArray

from tactile_bayes.errors import ParameterError
from tactile_bayes.inference.contour import contours_of
from tactile_bayes.inference.result import posterior_draws

__all__ = ["contour_band", "contour_heights"]

Floats = NDArray[np.float64]

_DRAWS = 4000


def contour_band(
    posterior: xr.DataTree, x: ArrayLike, probability: float = 0.95, simultaneous: bool = False
) -> xr.Dataset:
    """Band in which the contour lies with a given probability, and its median.

    Parameters
    ----------
    posterior : xr.DataTree
        From `infer_contour`.
    x : array_like, shape (n,)
        Where, in the record's unit of length.
    probability : float
        In (0, 1).
    simultaneous : bool
        Whether the probability holds at every x by itself (False), or for the whole stretch at once: the pointwise
        band is then widened about the median, everywhere by the same factor, until it contains that share of contours.

    Returns
    -------
    xr.Dataset
        Over "x": lower, upper, median [length], and share_reaching, the share of contours that extend to x; where it is
        below 1 the rest is NaN.

    Raises
    ------
    ParameterError
        If the probability is not in (0, 1), or x is not a list of finite numbers.

    Examples
    --------
    >>> values = {"a": 0.5, "q": 0.3, "x_c": 0.0}
    >>> draws = xr.Dataset({k: (("chain", "draw"), np.full((1, 9), v)) for k, v in values.items()})
    >>> tree = xr.DataTree.from_dict({"posterior": draws})
    >>> tree.attrs = {"family": "parabola", "units": "dimensionless"}
    >>> contour_band(tree, [0.0, 1.0])["median"].values
    array([0.3, 0.8])
    """
    if not 0.0 < probability < 1.0:
        raise ParameterError(f"probability is {probability!r}: give a number between 0 and 1, like 0.95")
    at = np.atleast_1d(np.asarray(x, dtype=float))
    if at.ndim != 1 or not np.all(np.isfinite(at)):
        raise ParameterError("x must be a list of finite numbers")
    heights = contour_heights(posterior, at)
    share = np.isfinite(heights).mean(axis=0)
    known = share == 1.0
    tail = 0.5 * (1.0 - probability)
    lower, median, upper = np.full((3, at.size), np.nan)
    if known.any():
        lower[known], median[known], upper[known] = np.quantile(heights[:, known], [tail, 0.5, 1.0 - tail], axis=0)
        if simultaneous:
            off = heights[:, known] - median[known]
            reach = np.where(off > 0.0, upper[known] - median[known], median[known] - lower[known])
            with np.errstate(divide="ignore", invalid="ignore"):
                most = np.nan_to_num(np.abs(off) / reach, nan=0.0).max(axis=1)
            factor = max(1.0, float(np.quantile(most, probability)))
            lower, upper = median - factor * (median - lower), median + factor * (upper - median)
    unit = {"units": "1" if posterior.attrs["units"] == "dimensionless" else "m"}
    return xr.Dataset(
        {
            "lower": ("x", lower, unit),
            "median": ("x", median, unit),
            "upper": ("x", upper, unit),
            "share_reaching": ("x", share, {"units": "1"}),
        },
        coords={"x": ("x", at, unit)},
        attrs={"probability": probability, "simultaneous": int(simultaneous)},
    )


def contour_heights(posterior: xr.DataTree, x: Floats, most: int = _DRAWS) -> Floats:
    """Heights at x of up to `most` contours, evenly picked from the posterior's draws; shape (contours, x)."""
    contours = contours_of(posterior_draws(posterior), posterior.attrs["family"])
    count = contours.shape[0]
    index = np.unique(np.linspace(0, count - 1, min(count, most)).astype(np.intp))
    return np.broadcast_to(contours.take(index[:, None]).height(x), (index.size, x.size))
