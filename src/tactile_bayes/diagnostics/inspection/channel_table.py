"""The channels of a record in a table: their ranges, zeros and noise."""

from __future__ import annotations

import numpy as np
import xarray as xr

from tactile_bayes.arrays import Index
from tactile_bayes.diagnostics.inspection.stretches import autocorrelation
from tactile_bayes.load_cell import LoadCell
from tactile_bayes.record import CHANNELS, present_channels

__all__ = ["channel_table"]

_FROM_ZERO_LOAD = ("bias", "bias_uncertainty", "noise", "noise_uncertainty", "resolution", "same_bias_p_value")


def channel_table(record: xr.Dataset, found: xr.Dataset, stretches: list[Index], stated: LoadCell | None) -> xr.Dataset:
    """See `Inspection`; `found` is what `zero_load` returns."""
    columns = {name: np.full(len(CHANNELS), np.nan) for name in ("smallest", "largest", "stated_noise", "stated_bias")}
    likeness = np.full((2, len(CHANNELS)), np.nan)
    for index, name in enumerate(CHANNELS):
        if name not in present_channels(record):
            continue
        reading = record[name].values
        columns["smallest"][index], columns["largest"][index] = reading.min(), reading.max()
        likeness[:, index] = autocorrelation(reading, stretches)
        if stated is not None:
            step = stated.resolution[index] / np.sqrt(12.0)
            noise = float(np.hypot(stated.standard_deviations[name], step))
            columns["stated_noise"][index] = noise if 0.0 < noise < np.inf else np.nan
            columns["stated_bias"][index] = stated.bias[index]
    columns["neighbour_correlation"], columns["neighbour_score"] = likeness
    table = xr.Dataset(
        {name: ("channel", values) for name, values in columns.items()},
        coords={"channel": list(CHANNELS), "unit": ("channel", found["unit"].values)},
        attrs={"units": record.attrs["units"]},
    )
    return table.assign({name: found[name].variable for name in _FROM_ZERO_LOAD})
