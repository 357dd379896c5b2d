"""Uncertainty bands of contours."""

from __future__ import annotations

import json
from typing import Any, cast

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike

from tactile_bayes.arrays import Floats
from tactile_bayes.checks import as_numbers, refused
from tactile_bayes.contours import Contour
from tactile_bayes.errors import ParameterError
from tactile_bayes.inference.contour import contours_of
from tactile_bayes.inference.result import contour_draws
from tactile_bayes.numerics.blocks import blocks
from tactile_bayes.numerics.selection import evenly_spread
from tactile_bayes.record import COLUMNS
from tactile_bayes.uncertainty.averaged_contours import averaged_heights, family_weights
from tactile_bayes.uncertainty.offsets import Moves, aligned, feet_of, most_central, normal_offsets
from tactile_bayes.uncertainty.quantiles import quantile_band
from tactile_bayes.uncertainty.rod_reach import BEYOND_REACH, beyond_reach, reach

_DRAWS = 4000

_NUMBERS_PER_HEIGHT = 12  # numbers that a shape-free contour reads for one of its heights


def contour_band(
    posterior: xr.DataTree | xr.Dataset,
    x: ArrayLike,
    probability: float = 0.95,
    simultaneous: bool = False,
    *,
    align: str | None = None,
) -> xr.Dataset:
    """Return the band in which the contour lies with a given probability, and the median contour height.

    Parameters
    ----------
    posterior : xr.DataTree or xr.Dataset
        From `infer_contour`, or from `compare_families`: the band is then averaged over families, by their
        probabilities from evidence, or by stacking weights if an evidence is missing.
    x : array_like, shape (n,)
        Grid points of the band, in the record's unit of length.
    probability : float
        Probability of the band, in (0, 1).
    simultaneous : bool
        If False, the probability holds at every x by itself. If True, it holds for all x at once: the pointwise band
        is widened about the median, everywhere by the same factor, until it contains that share of contours.
    align : {"translation", "rigid", "similarity"}, optional
        Give the band of the shape alone: each contour is first shifted, or also turned, or also scaled, onto the most
        central one, by least squares of the distances along its normals over what was touched, or at these x if the
        posterior has no events.

    Returns
    -------
    xr.Dataset
        Over "x": lower, upper, median [length]; share_reaching, the share of contours that extend to x; status, "ok",
        "beyond the reach of the rod", where family and prior alone continue the contour, or the reason why the band is
        NaN. An average has the attributes averaged_by, "evidence" or "stacking", and
        weights, of the families (JSON).

    Raises
    ------
    ParameterError
        If the probability is not in (0, 1), x is not a list of finite numbers, or the alignment is unknown, or asked of
        an average over families.
    InferenceError
        If families are to be averaged of which none fits the record, or that have no weights.

    See Also
    --------
    normal_band : the same band measured across the contour, for steep flanks.

    Examples
    --------
    >>> values = {"a": 0.5, "q": 0.3, "x_c": 0.0}
    >>> draws = xr.Dataset({k: (("chain", "draw"), np.full((1, 9), v)) for k, v in values.items()})
    >>> tree = xr.DataTree.from_dict({"posterior": draws})
    >>> tree.attrs = {"family": "parabola", "units": "dimensionless"}
    >>> contour_band(tree, [0.0, 1.0])["median"].values
    array([0.3, 0.8])
    """
    at = grid_points(x)
    average: dict[str, str] = {}
    if isinstance(posterior, xr.Dataset) and "probability" in posterior:
        if align is not None:
            raise refused("align", align, "give the posterior of one family, or None for an average over families")
        weights, source = family_weights(posterior)
        by_name = dict(zip(posterior["family"].values.tolist(), weights.tolist(), strict=True))
        average = {"averaged_by": source, "weights": json.dumps(by_name)}
        heights = averaged_heights(posterior, at, _DRAWS)
    else:
        tree = cast(xr.DataTree, posterior)  # others are refused below
        heights = contour_heights(tree, at) if align is None else _aligned_heights(tree, at, align)
    share = np.isfinite(heights).mean(axis=0)
    lower, median, upper = quantile_band(heights, probability, simultaneous)
    status = np.select(
        [(share == 1.0) & beyond_reach(posterior, at), share == 1.0, share > 0.0],
        [BEYOND_REACH, "ok", "some contours end before"],
        "all contours end before",
    )
    unit = length_unit(posterior)
    return xr.Dataset(
        {
            "lower": ("x", lower, unit),
            "median": ("x", median, unit),
            "upper": ("x", upper, unit),
            "share_reaching": ("x", share, {"units": "1"}),
            "status": ("x", status),
        },
        coords={"x": ("x", at, unit)},
        attrs={"probability": probability, "simultaneous": int(simultaneous), **average},
    )


def contour_heights(posterior: xr.DataTree, x: Floats, most: int = _DRAWS) -> Floats:
    """Heights at x of up to `most` contours, evenly picked from the posterior's draws; shape (contours, x)."""
    contours = contours_drawn(posterior, most)
    return _heights(contours, np.broadcast_to(x, (contours.shape[0], x.size)))


def _heights(contours: Contour, x: Floats) -> Floats:
    """Return the heights of n contours, each at its own x of shape (n, k)."""
    heights = np.empty(x.shape)
    with np.errstate(over="ignore"):  # far out, where no contour is
        for block in blocks(len(heights), _NUMBERS_PER_HEIGHT * x.shape[1]):
            heights[block] = contours.take(block[:, None]).height(x[block])
    return heights


def _aligned_heights(posterior: xr.DataTree, x: Floats, align: str) -> Floats:
    """Heights at x of contours moved onto the most central one; shape (contours, x)."""
    contours = contours_drawn(posterior)
    reference = most_central(contours, x)
    feet, moves = feet_of(reference, x), moves_onto(reference, contours, posterior, x, align)
    if align == "translation":
        return _heights(contours, x - moves.shift[0][:, None]) + moves.shift[1][:, None]
    return feet.y + normal_offsets(contours, feet._replace(slope_angle=np.zeros_like(x)), moves)


def moves_onto(reference: Contour, contours: Contour, posterior: xr.DataTree, x: Floats, align: str) -> Moves:
    """Return the moves of contours onto one, where it was touched, or at x if that is not known."""
    at = reach(posterior) if "events" in posterior.children else x
    return aligned(contours, feet_of(reference, at), align)


def contours_drawn(posterior: xr.DataTree, most: int = _DRAWS) -> Contour:
    """Up to `most` contours, evenly picked from the posterior's draws."""
    draws = contour_draws(posterior).stack(every=("chain", "draw"), create_index=False)
    picked = draws.isel(every=evenly_spread(draws.sizes["every"], most))
    return contours_of(picked, posterior.attrs["family"])


def grid_points(x: ArrayLike) -> Floats:
    """Return the values of x as an array of shape (n,)."""
    numbers = as_numbers(x)
    if numbers is None or numbers.ndim > 1 or not np.all(np.isfinite(numbers)):
        raise ParameterError("x must be a list of finite numbers")
    return np.atleast_1d(numbers)


def length_unit(posterior: xr.DataTree | xr.Dataset) -> dict[str, Any]:
    """Attributes of lengths in the record's unit."""
    return {"units": COLUMNS["base_x"].unit_in(posterior.attrs["units"])}
