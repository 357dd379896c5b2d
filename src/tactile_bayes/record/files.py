"""The files of a record: CSV and NetCDF."""

from __future__ import annotations

import errno
import os
import warnings
from collections.abc import Collection, Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import xarray as xr

from tactile_bayes.checks import check_path
from tactile_bayes.errors import RecordError, RecordWarning
from tactile_bayes.mechanics.rods.rod import Rod
from tactile_bayes.record.bag import is_bag, read_bag_table
from tactile_bayes.record.construction import completed_record
from tactile_bayes.record.csv_format import read_csv, write_csv
from tactile_bayes.record.netcdf import read_netcdf_table, write_netcdf_record
from tactile_bayes.record.origin import ORIGIN, renamed
from tactile_bayes.record.reading import Reading
from tactile_bayes.record.schema import Frame
from tactile_bayes.record.sweep_segments import split_at_turns
from tactile_bayes.record.table import Table
from tactile_bayes.record.units import assumed_units, in_units_of_record
from tactile_bayes.record.validation import validate

if TYPE_CHECKING:
    from tactile_bayes.rig import Rig

__all__ = ["read_record", "record_in", "refuse_no_file", "write_record"]

_READERS = {".csv": read_csv, ".nc": read_netcdf_table}
_WRITERS = {".csv": write_csv, ".nc": write_netcdf_record}


def read_record(
    path: str | os.PathLike[str],
    rig: Rig | None = None,
    *,
    columns: Mapping[str, str] | None = None,
    split_sweeps: bool = False,
    rod: Rod | None = None,
    missing: Collection[str] = (),
    load_cell_frame: Frame | None = None,
) -> xr.Dataset:
    """Read a record from a CSV or a NetCDF file, or a bag of ROS, with columns of any name, unit, sign and zero.

    A CSV file has a header of commented lines, `# key: value`, then a line of column names, then one line per sample;
    `write_record` shows the format. The header is optional: without it the numbers are dimensionless, or SI if a column
    states a unit or `rod` is given, with a warning. The line `# load_cell_frame: turning` states a load cell that turns
    with the drive. Semicolons or tabs may separate columns, and decimals may then have commas; text is in UTF-8 or
    Windows-1252. In a NetCDF file every variable has one common dimension, "sample" or any other. In a bag columns are
    fields of messages, like "/wrench.wrench.force.x" (see `tactile_bayes.record.bag`); it takes the package rosbags.

    Units are those of the record (SI, or those of the rod; angles in radians). Other units are converted if they are
    stated: by `columns`, in the name of a column ("force_x [mN]"), in a row of units below the names, in a line of the
    header (`# column force_x: number [mN]`, `# rod_length: 200 [mm]`), or in the attribute `units` of a NetCDF
    variable.

    Parameters
    ----------
    path : path-like
        A file with suffix .csv or .nc.
    rig : Rig, optional
        The rig that wrote the file: its `file` states columns, split_sweeps and missing, its rod and its load cell what
        the file does not state. A rod without a length gives the shape of the one that the file states. What is given
        beside it comes first.
    columns : mapping of str to str, optional
        Source of a column of a record in the file: `NAME`, or `NAME[UNIT]` if the file does not state the unit. A minus
        before it, `-NAME[UNIT]`, reverses the sign, a factor scales it to the unit, `1e-3*NAME[N]`, and a number with a
        sign shifts the zero, in the same unit: `90-NAME[deg]` or `NAME[mN]+12.5`. For base_x, base_y, drive_angle,
        sweep and direction one value for all samples can be given, as "12[mm]", "90[deg]", "0" or "forward"; so can a
        line of the header, `# drive_angle: 90 [deg]`, for a rod that is clamped while its base is carried. A unit in
        the name of a column may be left out. Further columns keep their names, except for a slash, which no NetCDF file
        can store: "Temp / °C" becomes "Temp [°C]", and another slash "|".
    split_sweeps : bool
        Whether to derive the columns sweep and direction from the drive angle if the file lacks them. A sweep ends
        where the angle returns from an extreme by more than a tenth of its whole range, or where the pivot moves; its
        direction is that of a straight line fitted to its angles. An angle that returns within one sample was reset,
        and the sweeps before and after it have the same direction. Where the base moves in more than half of the steps,
        a sweep ends where the base turns back, and it is forward if the left side of the rod leads; turned here and
        carried there in one file takes columns sweep and direction.
    rod : Rod, optional
        The rod, if the file does not state it.
    missing : collection of str, optional
        Channels that the file has no column for, because the rig does not measure them.
    load_cell_frame : {"fixed", "turning"}, optional
        The frame of the forces, if the file does not state it; see `make_record`.

    Returns
    -------
    xr.Dataset
        The record. Its attribute `units_source` is "assumed" if neither the file nor `rod` states the units.

    Raises
    ------
    RecordError
        If the content is not a record, see `validate` (the message names line and column); if the file is SI and no rod
        is stated; if it states another rod than `rod`, or another frame than `load_cell_frame`; if a column has the
        unit of another quantity, or its source in `columns` does not exist; if the file to be split has sweeps already,
        or its drive angle jumps by about a turn; if the path is a folder, a pipe or a device, or has another suffix.
    FileNotFoundError
        If there is no such file.
    ParameterError
        If a key of `columns` is not a column of a record, or a value is invalid.

    Warns
    -----
    RecordWarning
        If the record is SI and nobody states the unit of a measured column, or if the last line of a CSV file has no
        end: it may be cut. Its row is left out if its last number stands out from those above.

    Examples
    --------
    A rig with names, units and signs of its own, and semicolons:

    >>> import tempfile
    >>> rig = "Angle [°];M;Fx;Fy\\n60,0;0;0;0\\n60,5;0,25;-1,5;40\\n"
    >>> with tempfile.TemporaryDirectory() as directory:
    ...     path = Path(directory) / "rig.csv"
    ...     _ = path.write_text(rig, encoding="utf-8")
    ...     record = read_record(
    ...         path,
    ...         columns={"drive_angle": "Angle", "holding_moment": "M[Nmm]", "force_x": "-Fx[mN]", "force_y": "Fy[mN]"},
    ...         split_sweeps=True,
    ...         rod=Rod(0.1, 1.2e-5),
    ...     )
    >>> record["holding_moment"].values.tolist(), record["force_x"].values.tolist(), str(record["direction"].values[0])
    ([0.0, 0.00025], [-0.0, 0.0015], 'forward')

    A rig that measures the moment only:

    >>> with tempfile.TemporaryDirectory() as directory:
    ...     path = Path(directory) / "moment_only.csv"
    ...     _ = path.write_text("sweep,direction,drive_angle [deg],holding_moment [N m]\\n0,forward,69,6e-5\\n")
    ...     record = read_record(path, rod=Rod(0.1, 1.2e-5), missing=("force_x", "force_y"))
    >>> record.attrs["units"]
    'SI'
    """
    path = check_path("path", path)
    reading = Reading.of(rig, columns, split_sweeps, rod, missing, load_cell_frame)
    if not path.exists():
        raise FileNotFoundError(errno.ENOENT, os.strerror(errno.ENOENT), str(path))
    if not is_bag(path):
        refuse_no_file(path)
    table = (read_bag_table if is_bag(path) else _READERS[_suffix(path)])(path, reading.columns)
    record = record_in(table, reading)
    for note in record.encoding["notes"]:
        warnings.warn(f"{path}: {note}", RecordWarning, stacklevel=2)
    return record


def refuse_no_file(path: Path) -> None:
    """Refuse a folder, and a pipe or a device, which could only be read once or without an end."""
    if path.is_dir():
        raise RecordError(f"{path} is a folder: give the record itself, a .csv or a .nc file, or a bag")
    if path.exists() and not path.is_file():
        raise RecordError(
            f"{path} is a pipe or a device, and a record is read several times: write it to a file first, as in "
            "zcat record.csv.gz > record.csv"
        )


def record_in(table: Table, reading: Reading) -> xr.Dataset:
    """Return the record in a table as it was read.

    Its encoding has "notes", what was assumed or left out, and "remarks", commented lines without a meaning.
    """
    columns, rod = reading.columns, reading.rod
    if "drive_angle" in table.attrs and "drive_angle" not in {*columns, *table.columns}:
        columns = {**columns, "drive_angle": str(table.attrs["drive_angle"])}
        attrs = {name: value for name, value in table.attrs.items() if name != "drive_angle"}
        table = replace(table, attrs=attrs)
    table = in_units_of_record(renamed(table, columns), rod)
    if reading.split_sweeps:
        stated = table.attrs.get("rod_length", 1.0) if rod is None else rod.length
        table = split_at_turns(table, float(stated) if isinstance(stated, int | float) else 1.0)
    record = reading.shaped(completed_record(table, rod, reading.missing, reading.load_cell_frame))
    if rod is None and "units" not in table.attrs:
        record.attrs["units_source"] = "assumed"
    notes = [*table.source.notes]
    if record.attrs["units"] == "SI" and not is_bag(Path(table.source.name)):  # messages of ROS are SI
        notes.append(assumed_units(table))
    record.encoding = {"notes": [note for note in notes if note], "remarks": [*table.source.remarks]}
    for variable in record.variables.values():
        if ORIGIN in variable.attrs:
            variable.encoding[ORIGIN] = variable.attrs.pop(ORIGIN)
    return record


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
    path = check_path("path", path)
    write = _WRITERS[_suffix(path)]
    record = validate(record)
    write(record, path)


def _suffix(path: Path) -> str:
    suffix = path.suffix.lower()
    if suffix not in (".csv", ".nc"):
        raise RecordError(f"{path}: a record is a .csv or a .nc file, not {suffix or 'one without suffix'}: rename it")
    return suffix
