"""Uncertainty bands of contours, in height or across a contour along its normals."""

from __future__ import annotations

import json
from typing import Any, cast

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike

from tactile_bayes.arrays import Floats, Index
from tactile_bayes.checks import as_numbers, check_probability, check_switch, refused
from tactile_bayes.contours.base import Contour, check_single
from tactile_bayes.contours.families import family_named
from tactile_bayes.errors import InferenceError, ParameterError
from tactile_bayes.inference.contour import contours_of
from tactile_bayes.inference.result import contour_draws
from tactile_bayes.numerics.selection import evenly_spread
from tactile_bayes.record import COLUMNS
from tactile_bayes.uncertainty.offsets import Moves, aligned, feet_of, heights_of, most_central, normal_offsets
from tactile_bayes.uncertainty.rod_reach import BEYOND_REACH, beyond_reach, reach

_MOVED = 1000  # contours of a band after each is moved onto the most central one, about as many as effective draws
_DRAWS = 4000
_ROUNDING = 1e-9  # share of its largest width below which a band is so narrow that its draws differ only by rounding


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
        If True, the probability holds for all x at once, not at every x by itself: the pointwise band is widened about
        the median, everywhere by the same factor, until it contains that share of contours.
    align : {"translation", "rigid", "similarity"}, optional
        Give the band of the shape alone: each contour is first shifted, or also turned, or also scaled, onto the most
        central one, by least squares of the distances along its normals over what was touched, or at these x if the
        posterior has no events.

    Returns
    -------
    xr.Dataset
        Over "x": lower, upper, median [length]; share_reaching, the share of contours that extend to x; status, "ok",
        "beyond the reach of the rod", where family and prior alone continue the contour, or the reason why the band is
        NaN. An average has the attributes averaged_by, "evidence" or "stacking", and weights, of the families (JSON).

    Raises
    ------
    ParameterError, InferenceError
        If the probability is not in (0, 1), x is not a list of finite numbers, or the alignment is unknown, or asked of
        an average over families; if families are to be averaged of which none fits the record, or without weights.

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
    return _labelled(heights, at, posterior, probability, simultaneous).assign_attrs(average)


def normal_band(
    posterior: xr.DataTree,
    x: ArrayLike,
    probability: float = 0.95,
    simultaneous: bool = False,
    *,
    reference: Contour | None = None,
    align: str | None = None,
) -> xr.Dataset:
    """Return the band in which the contour lies with a given probability, measured along normals of a reference.

    On a steep flank the width of a band in y is dominated by the slope; the width along the normal is not.

    Parameters
    ----------
    posterior : xr.DataTree
        From `infer_contour`.
    x : array_like, shape (n,)
        Positions on the reference at which the normals start, in the record's unit of length.
    probability : float
        Probability of the band, in (0, 1).
    simultaneous : bool
        As in `contour_band`: if True, the probability holds at all normals at once.
    reference : Contour, optional
        By default the most central draw: the one with the smallest sum of distances between its heights at these x and
        their medians, since a pointwise median need not be convex.
    align : {"translation", "rigid", "similarity"}, optional
        As in `contour_band`, onto this reference: the band of the shape alone.

    Returns
    -------
    xr.Dataset
        Over "x": y and slope_angle of the reference; lower, median and upper, the signed distances of contours from it
        [length], positive into the object; both edges as points, lower_x, lower_y, upper_x, upper_y [length];
        share_reaching, the share of contours that the normal meets; status as in `contour_band`.

    Raises
    ------
    ParameterError
        If the probability is not in (0, 1), x is not a list of finite numbers, the reference is not one contour, or the
        alignment is unknown.

    Examples
    --------
    >>> values = {"r": np.array([[0.5, 0.6, 0.7]]), "q": np.array([[0.5, 0.4, 0.3]]), "x_c": np.zeros((1, 3))}
    >>> tree = xr.DataTree.from_dict({"posterior": xr.Dataset({k: (("chain", "draw"), v) for k, v in values.items()})})
    >>> tree.attrs = {"family": "circle", "units": "dimensionless"}
    >>> normal_band(tree, [0.0, 0.3, 0.55], 0.5)["upper"].values.round(12)  # circles about one centre
    array([0.05, 0.05, 0.05])
    """
    at = grid_points(x)
    contours = contours_drawn(posterior)
    if reference is None:
        reference = most_central(contours, at)
    check_single("reference", reference, "give one contour, or none for the most central draw")
    feet = feet_of(reference, at)
    moves = None if align is None else _moves_onto(reference, contours, posterior, at, align)
    offsets = normal_offsets(contours, feet, moves)
    band = _labelled(offsets, at, posterior, probability, simultaneous, " the normal")
    band["status"] = "x", np.where(np.isnan(feet.y), "the reference ends before", band["status"].values)
    points = {"y": feet.y}
    for edge in ("lower", "upper"):
        points[f"{edge}_x"] = feet.x - band[edge].values * np.sin(feet.slope_angle)
        points[f"{edge}_y"] = feet.y + band[edge].values * np.cos(feet.slope_angle)
    unit = length_unit(posterior)
    band = band.assign({name: ("x", values, unit) for name, values in points.items()})
    return band.assign(slope_angle=("x", feet.slope_angle, {"units": "rad"}))


def _labelled(
    draws: Floats, x: Floats, posterior: xr.DataTree | xr.Dataset, probability: float, simultaneous: bool, end: str = ""
) -> xr.Dataset:
    """Return the band of draws, shape (contours, x), which are NaN where contours end, before `end`."""
    lower, median, upper = quantile_band(draws, probability, simultaneous)
    share = np.isfinite(draws).mean(axis=0)
    status = np.select(
        [(share == 1.0) & beyond_reach(posterior, x), share == 1.0, share > 0.0],
        [BEYOND_REACH, "ok", f"some contours end before{end}"],
        f"all contours end before{end}",
    )
    unit = length_unit(posterior)
    edges = {"lower": ("x", lower, unit), "median": ("x", median, unit), "upper": ("x", upper, unit)}
    return xr.Dataset(
        edges | {"share_reaching": ("x", share, {"units": "1"}), "status": ("x", status)},
        coords={"x": ("x", x, unit)},
        attrs={"probability": probability, "simultaneous": int(simultaneous)},
    )


def contour_heights(posterior: xr.DataTree, x: Floats, most: int = _DRAWS) -> Floats:
    """Heights at x of up to `most` contours, evenly picked from the posterior's draws; shape (contours, x)."""
    return heights_of(contours_drawn(posterior, most), x)


def _aligned_heights(posterior: xr.DataTree, x: Floats, align: str) -> Floats:
    """Heights at x of contours moved onto the most central one; shape (contours, x)."""
    contours = contours_drawn(posterior, _MOVED)
    reference = most_central(contours, x)
    feet, moves = feet_of(reference, x), _moves_onto(reference, contours, posterior, x, align)
    if align == "translation":
        return heights_of(contours, x - moves.shift.real[:, None]) + moves.shift.imag[:, None]
    return feet.y + normal_offsets(contours, feet._replace(slope_angle=np.zeros_like(x)), moves)


def _moves_onto(reference: Contour, contours: Contour, posterior: xr.DataTree, x: Floats, align: str) -> Moves:
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
