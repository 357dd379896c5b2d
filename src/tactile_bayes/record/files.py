"""The files of a record, CSV and NetCDF."""

from __future__ import annotations

import os
from collections.abc import Collection
from pathlib import Path

import xarray as xr

from tactile_bayes.errors import RecordError
from tactile_bayes.files import write_atomically
from tactile_bayes.record.construction import completed_record
from tactile_bayes.record.csv_format import read_csv, write_csv
from tactile_bayes.record.netcdf_format import read_netcdf, write_netcdf
from tactile_bayes.record.schema import Frame
from tactile_bayes.record.validation import validate
from tactile_bayes.rod import Rod

__all__ = ["read_record", "write_record"]

_READERS = {".csv": read_csv, ".nc": read_netcdf}
_WRITERS = {".csv": write_csv, ".nc": write_netcdf}


def read_record(
    path: str | os.PathLike[str],
    *,
    rod: Rod | None = None,
    missing: Collection[str] = (),
    load_cell_frame: Frame | None = None,
) -> xr.Dataset:
    """Read a record from a CSV or a NetCDF file.

    A CSV file has a header of commented lines, `# key: value`, then a line of column names, then one line per
    sample; `write_record` shows the form. The header may be absent: then the numbers are dimensionless, or SI if
    `rod` is given. A load cell that turns with the drive is stated by `# load_cell_frame: turning`.

    Parameters
    ----------
    path : path-like
        A file with suffix .csv or .nc.
    rod : Rod, optional
        The rod, if the file does not state it.
    missing : collection of str, optional
        Channels that the file has no column for, because the rig does not measure them.
    load_cell_frame : {"fixed", "turning"}, optional
        The frame of the forces, if the file does not state it; see `make_record`.

    Returns
    -------
    xr.Dataset
        The record. Its attribute `units_source` is "assumed" if neither file nor `rod` told the units.

    Raises
    ------
    RecordError
        If the content is not a record, see `validate` (the message names line and column); if the file is SI
        and no rod is stated; if it states another rod than `rod`, or another frame than `load_cell_frame`; if the
        suffix is another one.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as directory:
    ...     path = Path(directory) / "moment_only.csv"
    ...     _ = path.write_text("sweep,direction,drive_angle,holding_moment\\n0,forward,1.2,6e-5\\n")
    ...     record = read_record(path, rod=Rod(0.1, 1.2e-5), missing=("force_x", "force_y"))
    >>> record.attrs["units"]
    'SI'
    """
    path = Path(path)
    table = _READERS[_suffix(path)](path)
    record = completed_record(table, rod, missing, load_cell_frame)
    if rod is None and "units" not in table.attrs:
        record.attrs["units_source"] = "assumed"
    return record


def write_record(record: xr.Dataset, path: str | os.PathLike[str]) -> None:
    """Write a record to a CSV or a NetCDF file, without loss: what is read back is the same, digit by digit.

    The file is written whole: if writing fails, a file that was there before is still there. Of the attributes of
    a column, a CSV file keeps `units` and `long_name`.

    Parameters
    ----------
    record : xr.Dataset
        A record.
    path : path-like
        Where to; its suffix, .csv or .nc, decides on the form.

    Raises
    ------
    RecordError
        If `record` is not a record, or the suffix is another one.

    Examples
    --------
    >>> import tempfile
    >>> from tactile_bayes.record import make_record
    >>> columns = {"sweep": 0, "direction": "forward", "drive_angle": [1.2], "force_y": [0.1], "force_x": [0.0]}
    >>> record = make_record(columns, missing=("holding_moment",))
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
    path = Path(path)
    write = _WRITERS[_suffix(path)]
    record = validate(record)
    with write_atomically(path) as temporary:
        write(record, temporary)


def _suffix(path: Path) -> str:
    suffix = path.suffix.lower()
    if suffix not in (".csv", ".nc"):
        raise RecordError(f"{path}: a record is a .csv or a .nc file, not {suffix or 'one without suffix'}: rename it")
    return suffix
