"""The load cell of a record: given, stated in its data sheet, or estimated from its unloaded samples."""

from __future__ import annotations

from typing import Literal

import xarray as xr

from tactile_bayes.errors import RecordError
from tactile_bayes.load_cell import LoadCell
from tactile_bayes.record import present_channels

CellSource = Literal["given", "data sheet", "unloaded samples", "nothing", "too few unloaded samples"]


def known_cell(measured: xr.Dataset, given: LoadCell | None = None) -> tuple[LoadCell | None, CellSource]:
    """Return the given load cell, or the record's data sheet, or an estimate from unloaded samples, and its source."""
    if given is not None:
        return given, "given"
    stated = LoadCell.from_record(measured)
    if stated is not None:
        return stated, "data sheet"
    try:
        found = LoadCell.from_zero_load(measured)
    except RecordError:
        return None, "too few unloaded samples"
    present = present_channels(measured)
    noisy = all(found.standard_deviations[name] for name in present)
    return (found, "unloaded samples") if noisy else (None, "nothing")
