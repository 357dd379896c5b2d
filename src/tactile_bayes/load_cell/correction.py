"""The correction of a record: what is known of a sensor's errors, taken out of its readings."""

from __future__ import annotations

import numpy as np
import xarray as xr

from tactile_bayes.errors import ParameterError
from tactile_bayes.load_cell.data_sheet import CERTAIN, DataSheet
from tactile_bayes.record import CHANNELS, present_channels, validate

__all__ = ["corrected"]

_TAKEN_OUT = tuple(
    f"load_cell_{name}"
    for name in ("bias_h", "bias_f", "gain_", "lever_", "drive_angle_offset", "drive_angle_backlash")
)


def corrected(sheet: DataSheet, record: xr.Dataset) -> xr.Dataset:
    """The record without bias, gain, lever, and the encoder's offset and backlash; see `LoadCell.corrected`."""
    ideal = DataSheet()
    if all(getattr(sheet, name) == getattr(ideal, name) for name in CERTAIN):
        return record
    corrected = validate(record)
    present = [CHANNELS.index(name) for name in present_channels(corrected)]
    if np.any(np.delete(sheet.gain_matrix, present, axis=1)[present]):
        raise ParameterError(
            "the load cell has cross-talk from a channel that the record misses: its gain and lever cannot be taken "
            "out; infer_contour works without"
        )
    loads = np.stack([corrected[CHANNELS[i]].values for i in present], axis=-1) - np.array(sheet.bias)[present]
    if (sheet.gain, sheet.lever) != (ideal.gain, ideal.lever):
        loads = loads @ np.linalg.inv(sheet.gain_matrix[np.ix_(present, present)]).T
    for values, index in zip(loads.T, present, strict=True):
        corrected[CHANNELS[index]].values = values
    corrected["drive_angle"].values = corrected["drive_angle"].values - sheet.misread(corrected["direction"].values)
    corrected.attrs = {k: v for k, v in corrected.attrs.items() if not str(k).startswith(_TAKEN_OUT)}
    return validate(corrected)
