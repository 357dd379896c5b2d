"""Uncertainty bands across a contour, along its normals."""

from __future__ import annotations

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike

from tactile_bayes.arrays import Floats, Index
from tactile_bayes.contours import Contour
from tactile_bayes.errors import ParameterError
from tactile_bayes.numerics.blocks import blocks
from tactile_bayes.numerics.roots import bound_ends, falling_root
from tactile_bayes.uncertainty.band import contours_drawn, grid_points, length_unit
from tactile_bayes.uncertainty.quantiles import quantile_band
from tactile_bayes.uncertainty.rod_reach import BEYOND_REACH, beyond_reach

_BLOCK = 100_000  # number of normals that are searched at once
# Lower bound of the rate: where the contour's parameter does not move the point, the root stays as it is.
_SLOWEST = float(np.finfo(float).tiny)
# Distance of a point from a normal, relative to the lengths involved, beyond which the normal misses the contour.
_MISSED = 1e-9


def normal_band(
    posterior: xr.DataTree,
    x: ArrayLike,
    probability: float = 0.95,
    simultaneous: bool = False,
    *,
    reference: Contour | None = None,
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
        As in `contour_band`: if False, the probability holds at every normal by itself; if True, at all of them at
        once.
    reference : Contour, optional
        By default the most central draw: the one with the smallest sum of distances between its heights at these x and
        their medians. A pointwise median need not be convex, and the most probable draw may lie at the edge of a
        narrow ridge.

    Returns
    -------
    xr.Dataset
        Over "x": y and slope_angle of the reference; lower, median and upper, the signed distances of contours from it
        [length], positive into the object; both edges as points, lower_x, lower_y, upper_x, upper_y [length];
        share_reaching, the share of contours that the normal meets; status, "ok", "beyond the reach of the
        rod", where family and prior alone continue the contour, or the reason why the band is NaN.

    Raises
    ------
    ParameterError
        If the probability is not in (0, 1), x is not a list of finite numbers, or the reference is not one contour.

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
        reference = _most_central(contours, at)
    if not isinstance(reference, Contour) or reference.shape != ():
        raise ParameterError(f"reference is {reference!r}: give one contour, or none for the most central draw")
    locus = reference.locate(reference.parameter_of_x(at))
    offsets = normal_offsets(contours, locus.x, locus.y, locus.slope_angle)
    share = np.isfinite(offsets).mean(axis=0)
    lower, median, upper = quantile_band(offsets, probability, simultaneous)
    sin, cos = np.sin(locus.slope_angle), np.cos(locus.slope_angle)
    unit = length_unit(posterior)
    lengths = {
        "y": locus.y,
        "lower": lower,
        "median": median,
        "upper": upper,
        "lower_x": locus.x - lower * sin,
        "lower_y": locus.y + lower * cos,
        "upper_x": locus.x - upper * sin,
        "upper_y": locus.y + upper * cos,
    }
    status = np.select(
        [np.isnan(locus.y), (share == 1.0) & beyond_reach(posterior, at), share == 1.0, share > 0.0],
        ["the reference ends before", BEYOND_REACH, "ok", "some contours end before the normal"],
        "all contours end before the normal",
    )
    return xr.Dataset(
        {
            **{name: ("x", values, unit) for name, values in lengths.items()},
            "slope_angle": ("x", locus.slope_angle, {"units": "rad"}),
            "share_reaching": ("x", share, {"units": "1"}),
            "status": ("x", status),
        },
        coords={"x": ("x", at, unit)},
        attrs={"probability": probability, "simultaneous": int(simultaneous)},
    )


def normal_offsets(contours: Contour, x: Floats, y: Floats, slope_angle: Floats) -> Floats:
    """Return the signed distances of n contours from k points along the normals there; shape (n, k).

    They are positive to the left of the slope's direction, and NaN where a normal misses a contour or a point is NaN.
    """
    count = contours.shape[0]
    contours = contours.broadcast_to((count,))
    offsets = np.full((count, x.size), np.nan)
    given = np.flatnonzero(np.isfinite(x) & np.isfinite(y) & np.isfinite(slope_angle))
    for row in blocks(count, x.size, _BLOCK // max(1, x.size) or 1):
        many = contours.take(np.repeat(row, given.size))
        feet = [np.tile(values[given], row.size) for values in (x, y, slope_angle)]
        offsets[row[:, None], given] = _offsets(many, *feet).reshape(row.size, given.size)
    return offsets


def _offsets(many: Contour, x: Floats, y: Floats, slope_angle: Floats) -> Floats:
    """Return the signed distance of each contour from its own point along the normal there.

    Until its tangent turns by a right angle from the foot's, a contour meets the normal at most once, going into the
    object.
    """
    sin, cos = np.sin(slope_angle), np.cos(slope_angle)
    every = np.arange(x.size)

    def short_of(i: Index, parameter: Floats) -> tuple[Floats, Floats]:
        locus = many.take(i).locate(parameter)
        turn = locus.slope_angle - slope_angle[i]
        along = (locus.x - x[i]) * cos[i] + (locus.y - y[i]) * sin[i]
        along = np.where(np.abs(turn) > 0.5 * np.pi, np.copysign(np.inf, turn), along)
        rate = np.maximum(locus.arclength_rate * np.cos(turn), _SLOWEST)
        return -along, -rate

    lo, hi = (np.broadcast_to(end, x.shape).astype(float) for end in many.domain)
    near = many.parameter_of_x(x)
    near = np.clip(np.where(np.isfinite(near), near, 0.0), lo, hi)
    with np.errstate(over="ignore"):
        bound_ends(short_of, lo, hi, near)
        root = falling_root(short_of, lo, hi, near)
        missed = np.abs(short_of(every, root)[0])
    locus = many.locate(root)
    met = missed <= _MISSED * (np.abs(x) + np.abs(y) + np.abs(locus.x) + np.abs(locus.y))
    return np.where(met, (locus.y - y) * cos - (locus.x - x) * sin, np.nan)


def _most_central(contours: Contour, x: Floats) -> Contour:
    """Return the contour with heights nearest to the pointwise medians, among those defined at the most grid points."""
    every = np.arange(contours.shape[0])[:, None]
    heights = np.broadcast_to(contours.take(every).height(x), (every.size, x.size))
    reaching = np.isfinite(heights)
    some = reaching.any(axis=0)
    away = np.nansum(np.abs(heights[:, some] - np.nanmedian(heights[:, some], axis=0)), axis=1)
    best = np.lexsort((away, -np.count_nonzero(reaching, axis=1)))[0]
    return contours.take(np.asarray(best))
