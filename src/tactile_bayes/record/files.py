"""The files of a record: CSV and NetCDF."""

from __future__ import annotations

import errno
import os
from collections.abc import Mapping
from pathlib import Path

import xarray as xr

from tactile_bayes.checks import check_path
from tactile_bayes.errors import RecordError
from tactile_bayes.record.bag import is_bag, read_bag_table
from tactile_bayes.record.csv_format import read_csv, write_csv
from tactile_bayes.record.netcdf import read_netcdf_table, write_netcdf_record
from tactile_bayes.record.table import Table
from tactile_bayes.record.validation import validate

_FORMATS = {".csv": (read_csv, write_csv), ".nc": (read_netcdf_table, write_netcdf_record)}


def read_table(path: str | os.PathLike[str], columns: Mapping[str, str]) -> Table:
    """Read a table as it is in a file; from a bag, the messages that columns of a record come from."""
    path = check_path("path", path)
    if not path.exists():
        raise FileNotFoundError(errno.ENOENT, os.strerror(errno.ENOENT), str(path))
    if is_bag(path):
        return read_bag_table(path, columns)
    refuse_no_file(path)
    return _FORMATS[_suffix(path)][0](path, columns)


def refuse_no_file(path: Path) -> None:
    """Refuse a folder, and a pipe or a device, which could only be read once or without an end."""
    if path.is_dir():
        raise RecordError(f"{path} is a folder: give the record itself, a .csv or a .nc file, or a bag")
    if path.exists() and not path.is_file():
        raise RecordError(
            f"{path} is a pipe or a device, and a record is read several times: write it to a file first, as in "
            "zcat record.csv.gz > record.csv"
        )


def write_record(record: xr.Dataset, path: str | os.PathLike[str]) -> None:
    """Write a record to a CSV or a NetCDF file, without loss of digits.

    The file is written atomically: if writing fails, an existing file stays as it was. Of the attributes of a column, a
    CSV file keeps `units` and `long_name`.

    Parameters
    ----------
    record : xr.Dataset
        A record.
    path : path-like
        File to write; its suffix, .csv or .nc, determines the format.

    Raises
    ------
    RecordError
        If `record` is not a record, or the suffix is another one.

    Examples
    --------
    >>> import tempfile
    >>> from tactile_bayes import make_record
    >>> columns = {"sweep": 0, "direction": "forward", "drive_angle": [1.2], "force_y": [0.1], "force_x": [0.0]}
    >>> record = make_record(columns | {"holding_moment": float("nan")})
    >>> with tempfile.TemporaryDirectory() as directory:
    ...     write_record(record, Path(directory) / "scan.csv")
    ...     print((Path(directory) / "scan.csv").read_text(encoding="utf-8"))
    # tactile_bayes record, format 1
    # units: dimensionless
    # rod_length: 1.0
    # rod_flexural_rigidity: 1.0
    # rod_diameter: 0.0
    # column sweep: integer [1] number of the sweep
    # column direction: text [1] sense of the drive
    # column base_x: number [1] horizontal position of the pivot
    # column base_y: number [1] vertical position of the pivot
    # column drive_angle: number [rad] slope of the rod at the pivot
    # column holding_moment: number [1] moment that the drive must hold
    # column force_x: number [1] horizontal support reaction
    # column force_y: number [1] vertical support reaction
    sweep,direction,base_x,base_y,drive_angle,holding_moment,force_x,force_y
    0,forward,0.0,0.0,1.2,,0.0,0.1
    <BLANKLINE>
    """
    path = check_path("path", path)
    write = _FORMATS[_suffix(path)][1]
    write(validate(record), path)


def _suffix(path: Path) -> str:
    suffix = path.suffix.lower()
    if suffix not in _FORMATS:
        raise RecordError(f"{path}: a record is a .csv or a .nc file, not {suffix or 'one without suffix'}: rename it")
    return suffix
