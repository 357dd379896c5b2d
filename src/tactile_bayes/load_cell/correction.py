"""The correction of a record: what is known of a sensor's errors, taken out of its readings."""

from __future__ import annotations

import numpy as np
import xarray as xr

from tactile_bayes.errors import ParameterError
from tactile_bayes.load_cell.data_sheet import DataSheet
from tactile_bayes.record import CHANNELS, present_channels, validate

__all__ = ["corrected"]

_TAKEN_OUT = ("load_cell_bias_h", "load_cell_bias_f", "load_cell_gain_", "load_cell_drive_angle_offset")


def corrected(sheet: DataSheet, record: xr.Dataset) -> xr.Dataset:
    """The record without bias, gain and the encoder's offset; see `LoadCell.corrected`."""
    ideal = DataSheet()
    if (sheet.bias, sheet.gain, sheet.drive_angle_offset) == (ideal.bias, ideal.gain, ideal.drive_angle_offset):
        return record
    corrected = validate(record)
    present = [CHANNELS.index(name) for name in present_channels(corrected)]
    if np.any(np.delete(sheet.gain_matrix, present, axis=1)[present]):
        raise ParameterError(
            "the load cell has cross-talk from a channel that the record misses: its gain cannot be taken out; "
            "infer_contour works without"
        )
    loads = np.stack([corrected[CHANNELS[i]].values for i in present], axis=-1) - np.array(sheet.bias)[present]
    if sheet.gain != ideal.gain:
        loads = loads @ np.linalg.inv(sheet.gain_matrix[np.ix_(present, present)]).T
    for values, index in zip(loads.T, present, strict=True):
        corrected[CHANNELS[index]].values = values
    corrected["drive_angle"].values = corrected["drive_angle"].values - sheet.drive_angle_offset
    corrected.attrs = {k: v for k, v in corrected.attrs.items() if not str(k).startswith(_TAKEN_OUT)}
    return validate(corrected)
