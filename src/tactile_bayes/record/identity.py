"""The identity of a record: a hash of the measured values."""

from __future__ import annotations

import hashlib

import numpy as np
import xarray as xr

from tactile_bayes.record.attributes import rod_shape_attributes
from tactile_bayes.record.frame import frame_of
from tactile_bayes.record.schema import COLUMNS, MEASURED
from tactile_bayes.record.units import rod_of
from tactile_bayes.record.validation import validate


def record_hash(record: xr.Dataset) -> str:
    """SHA-256 of names, values and units of the columns of `MEASURED`, in any order, their frame, and the rod."""
    record = validate(record)
    digest = hashlib.sha256()

    def add(content: bytes) -> None:
        digest.update(len(content).to_bytes(8, "little") + content)

    rod = rod_of(record)
    add(str(record.attrs["units"]).encode())
    add(np.array([rod.length, rod.flexural_rigidity, rod.diameter], dtype="<f8").tobytes())
    for name, value in rod_shape_attributes(rod).items():  # straight, uniform rods have none
        add(f"{name} {value!r}".encode())
    if frame_of(record) != "fixed":  # older records do not state it
        add(frame_of(record).encode())
    for name in MEASURED:
        values = record[name].values
        add(f"{name} [{record[name].attrs['units']}]".encode())
        if COLUMNS[name].kind == "text":
            add("\n".join(values.tolist()).encode())
        elif COLUMNS[name].kind == "integer":
            add(values.astype("<i8").tobytes())
        else:  # all NaN have the same bits
            add(np.where(np.isnan(values), np.nan, values).astype("<f8").tobytes())
    return digest.hexdigest()
