"""The stretch of x that a rod can touch from its pivots or from the path of a drive, and the one that it touched."""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray as xr

from tactile_bayes.arrays import Flags, Floats
from tactile_bayes.errors import InferenceError
from tactile_bayes.record import rod_of

# Status of a band at grid points where only the family and the prior determine it.
BEYOND_REACH = "beyond the reach of the rod"
_ENDS = ("reach_left", "reach_right")


def reach_attributes(record: xr.Dataset) -> dict[str, float]:
    """Return the ends of the stretch that the rod of a record can touch [length], as attributes of a result."""
    rod = rod_of(record)
    base, most = record["base_x"].values, rod.length + rod.stem + 0.5 * rod.diameter
    return dict(zip(_ENDS, (float(base.min() - most), float(base.max() + most)), strict=True))


def beyond_reach(result: xr.DataTree | xr.Dataset, x: Floats) -> Flags:
    """Return True for values of x that the rod of a posterior, or of a comparison, cannot touch.

    False where the result does not know its rod.
    """
    ends: dict[Any, Any] = result.attrs
    if isinstance(result, xr.DataTree) and "constant_data" in result.children and "rod_length" in result.attrs:
        ends = reach_attributes(result["constant_data"].to_dataset().assign_attrs(result.attrs))
    if not set(_ENDS) <= set(ends):
        return np.zeros(x.shape, dtype=bool)
    left, right = (float(ends[end]) for end in _ENDS)
    return np.asarray((x < left) | (x > right))


def reach(posterior: xr.DataTree) -> Floats:
    """Return grid points, (201,), from the 5 % to the 95 % quantile of the events' x, for the band of a run."""
    events = events_of(posterior)
    x = np.concatenate([events[f"{when}_contact_x"].values.ravel() for when in ("first", "snap_off")])
    if not np.isfinite(x).any():
        raise InferenceError("the rod touches none of the posterior's contours: there is no touched stretch for a band")
    lo, hi = np.nanquantile(x, [0.05, 0.95])
    return np.linspace(lo, hi, 201)


def events_of(posterior: xr.DataTree) -> xr.Dataset:
    """Return first contacts and snap-offs of a posterior's contours."""
    if "events" not in posterior.children:
        raise InferenceError("the posterior holds no events: first contacts and snap-offs of its contours are missing")
    return posterior["events"].to_dataset()
