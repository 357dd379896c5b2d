"""The stretch of x that a rod can touch from its pivots, or from the path on which a drive carries it."""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray as xr

from tactile_bayes.arrays import Flags, Floats
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
