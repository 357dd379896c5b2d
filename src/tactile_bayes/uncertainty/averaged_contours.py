"""Contours averaged over families, in proportion to the families' probabilities."""

from __future__ import annotations

import numpy as np
import xarray as xr

from tactile_bayes.arrays import Floats, Index
from tactile_bayes.contours.families import family_named
from tactile_bayes.errors import InferenceError
from tactile_bayes.uncertainty.offsets import heights_of


def family_weights(comparison: xr.Dataset) -> tuple[Floats, str]:
    """Return the weight of each family, shape (families,), of sum one, and their source, "evidence" or "stacking"."""
    if "contour_draws" not in comparison:
        raise InferenceError("this comparison has no draws of contours: compare again")
    if comparison.attrs.get("none_fits"):
        raise InferenceError("none of the families fits the record: their average does not describe it either")
    for name, source in (("probability", "evidence"), ("weight", "stacking")):
        if name in comparison and np.isfinite(comparison[name].values).all():
            weights = np.asarray(comparison[name].values, dtype=float)
            return weights / weights.sum(), source
    raise InferenceError(
        "there is no evidence of some family, and no stacking weights: compare longer, or with leave_one_out=True"
    )


def averaged_heights(comparison: xr.Dataset, x: Floats, most: int) -> Floats:
    """Return heights at x of `most` contours, of which each family has its share; shape (contours, x)."""
    weights, _ = family_weights(comparison)
    heights = []
    for name, count in zip(comparison["family"].values, _counts(weights, most), strict=True):
        if not count:
            continue
        family = family_named(str(name))
        draws = comparison["contour_draws"].sel(family=name).values[:, : len(family.parameters)]
        picked = np.floor((np.arange(count) + 0.5) * len(draws) / count).astype(np.intp)
        heights.append(heights_of(family.build(*draws[picked].T), x))
    return np.concatenate(heights)


def _counts(weights: Floats, most: int) -> Index:
    """Return whole numbers of sum `most` in proportion to weights, by largest remainders."""
    exact = weights * most
    counts = np.floor(exact).astype(np.intp)
    counts[np.argsort(counts - exact, kind="stable")[: most - counts.sum()]] += 1
    return counts
