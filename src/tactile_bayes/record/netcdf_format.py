"""The NetCDF form of a record."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import xarray as xr

from tactile_bayes.record.netcdf import read_netcdf as read_dataset
from tactile_bayes.record.netcdf import write_netcdf as write_dataset
from tactile_bayes.record.table import Source, Table, table_of

__all__ = ["read_netcdf", "write_netcdf"]


def read_netcdf(path: Path, columns: Mapping[str, str]) -> Table:
    """Read a table as it is in the file; all its columns are read, whichever are meant.

    The dimension of the samples may have any name, if all columns lie along it.
    """
    source = Source(str(path))
    record = read_dataset(
        path,
        xr.open_dataset,
        lambda what: source.error(f"the file {what}: write it again, or put a copy of it back"),
        decode_times=False,
        decode_timedelta=False,
        decode_coords=False,
    )
    dimensions = {variable.dims for variable in record.variables.values()}
    shared = dimensions.pop() if len(dimensions) == 1 else ()
    return table_of(record, source, shared[0] if len(shared) == 1 else "sample")


def write_netcdf(record: xr.Dataset, path: Path) -> None:
    """Write a record that has been validated."""
    record = record.reset_coords([name for name in record.coords if name not in record.dims])
    encoding: dict[Any, dict[str, Any]] = {}
    taken = {*map(str, record.variables), "sample"}
    for name, variable in record.variables.items():
        if variable.dtype.kind == "U":  # as fixed-width characters, which every NetCDF library reads
            dimension = re.sub(r"\d", "_", f"{name}_length")  # a number in it would be taken for the length
            while dimension in taken:
                dimension += "_"
            taken.add(dimension)
            encoding[name] = {"dtype": "S1", "char_dim_name": dimension}
        elif variable.dtype.kind != "O":  # objects are texts of different lengths
            encoding[name] = {"_FillValue": None}
    write_dataset(record, path, encoding)
