"""Uncertainty bands across a contour, along its normals."""

from __future__ import annotations

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike

from tactile_bayes.contours import Contour
from tactile_bayes.errors import ParameterError
from tactile_bayes.uncertainty.band import contours_drawn, grid_points, length_unit, moves_onto
from tactile_bayes.uncertainty.offsets import feet_of, most_central, normal_offsets
from tactile_bayes.uncertainty.quantiles import quantile_band
from tactile_bayes.uncertainty.rod_reach import BEYOND_REACH, beyond_reach


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
        As in `contour_band`: if False, the probability holds at every normal by itself; if True, at all of them at
        once.
    reference : Contour, optional
        By default the most central draw: the one with the smallest sum of distances between its heights at these x and
        their medians. A pointwise median need not be convex, and the most probable draw may lie at the edge of a
        narrow ridge.
    align : {"translation", "rigid", "similarity"}, optional
        As in `contour_band`, onto this reference: the band of the shape alone.

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
    if not isinstance(reference, Contour) or reference.shape != ():
        raise ParameterError(f"reference is {reference!r}: give one contour, or none for the most central draw")
    feet = feet_of(reference, at)
    moves = None if align is None else moves_onto(reference, contours, posterior, at, align)
    offsets = normal_offsets(contours, feet, moves)
    share = np.isfinite(offsets).mean(axis=0)
    lower, median, upper = quantile_band(offsets, probability, simultaneous)
    sin, cos = np.sin(feet.slope_angle), np.cos(feet.slope_angle)
    unit = length_unit(posterior)
    lengths = {
        "y": feet.y,
        "lower": lower,
        "median": median,
        "upper": upper,
        "lower_x": feet.x - lower * sin,
        "lower_y": feet.y + lower * cos,
        "upper_x": feet.x - upper * sin,
        "upper_y": feet.y + upper * cos,
    }
    status = np.select(
        [np.isnan(feet.y), (share == 1.0) & beyond_reach(posterior, at), share == 1.0, share > 0.0],
        ["the reference ends before", BEYOND_REACH, "ok", "some contours end before the normal"],
        "all contours end before the normal",
    )
    return xr.Dataset(
        {
            **{name: ("x", values, unit) for name, values in lengths.items()},
            "slope_angle": ("x", feet.slope_angle, {"units": "rad"}),
            "share_reaching": ("x", share, {"units": "1"}),
            "status": ("x", status),
        },
        coords={"x": ("x", at, unit)},
        attrs={"probability": probability, "simultaneous": int(simultaneous)},
    )
