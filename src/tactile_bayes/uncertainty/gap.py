"""The gap: the arc between the last contact of the forward sweep and that of the backward one."""

from __future__ import annotations

import numpy as np
import xarray as xr

from tactile_bayes.errors import InferenceError, ParameterError

__all__ = ["gap"]


def gap(posterior: xr.DataTree, probability: float = 0.95) -> xr.Dataset:
    """Where the gap begins and ends, and how wide it is.

    Parameters
    ----------
    posterior : xr.DataTree
        From `infer_contour`, of a record with sweeps in both directions.
    probability : float
        Of the central intervals.

    Returns
    -------
    xr.Dataset
        Over "bound" ("lower", "median", "upper"): left (the backward sweep's last contact), right (the forward sweep's)
        and width = right − left, negative where the two overlap [length]. With several pivots the gap is what all
        sweeps together leave open.

    Raises
    ------
    InferenceError
        If the record has sweeps in one direction only.
    ParameterError
        If the probability is not in (0, 1).

    Examples
    --------
    >>> x = xr.DataArray([[[0.2, -0.1]]], dims=("chain", "draw", "stroke"), coords={"stroke": ["forward", "backward"]})
    >>> tree = xr.DataTree.from_dict({"events": xr.Dataset({"snap_off_contact_x": x})})
    >>> round(gap(tree).width.sel(bound="median").item(), 6)
    0.3
    """
    if not 0.0 < probability < 1.0:
        raise ParameterError(f"probability is {probability!r}: give a number between 0 and 1, like 0.95")
    last = posterior["events"].to_dataset()["snap_off_contact_x"]
    strokes = last.stroke.values
    missing = [name for name in ("forward", "backward") if name not in strokes]
    if missing:
        raise InferenceError(f"a gap lies between sweeps of both directions, and there is no {missing[0]} one here")
    right = last[..., strokes == "forward"].min("stroke")
    left = last[..., strokes == "backward"].max("stroke")
    levels = [0.5 * (1.0 - probability), 0.5, 0.5 * (1.0 + probability)]
    bounds = {
        name: (("bound",), np.quantile(values, levels), last.attrs)
        for name, values in (("left", left), ("right", right), ("width", right - left))
    }
    return xr.Dataset(bounds, coords={"bound": ["lower", "median", "upper"]}, attrs={"probability": probability})
