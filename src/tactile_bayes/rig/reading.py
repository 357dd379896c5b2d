"""Records as a rig writes them: read from files, and made of tables and columns."""

from __future__ import annotations

import operator
import os
import re
import warnings
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import xarray as xr

from tactile_bayes.arrays import Flags
from tactile_bayes.errors import RecordWarning
from tactile_bayes.mechanics.rods.rod import Rod
from tactile_bayes.record.bag import is_bag
from tactile_bayes.record.files import read_table
from tactile_bayes.record.origin import ORIGIN, found_column, renamed
from tactile_bayes.record.parsing import parsed_column
from tactile_bayes.record.spelling import nearest
from tactile_bayes.record.sweep_segments import each_row, split_at_turns
from tactile_bayes.record.table import Table
from tactile_bayes.record.units import assumed_units, in_units_of_record, with_rod
from tactile_bayes.record.validation import completed_record, table_of_columns
from tactile_bayes.rig.rig import Rig, rig_of

_COMPARISONS = {
    "==": operator.eq,
    "!=": operator.ne,
    "<=": operator.le,
    ">=": operator.ge,
    "<": operator.lt,
    ">": operator.gt,
}
_SIGN = re.compile("|".join(_COMPARISONS))


def read_record(path: str | os.PathLike[str], rig: Rig | None = None) -> xr.Dataset:
    """Read a record from a CSV or a NetCDF file, or a bag of ROS, with columns of any name, unit, sign and zero.

    A CSV file has a header of commented lines, `# key: value`, then a line of column names, then one line per sample;
    `write_record` shows the format. The header is optional: without it the numbers are dimensionless, or SI if a column
    states a unit or the rig has a rod, with a warning. The line `# load_cell_frame: turning` states a load cell that
    turns with the drive. Semicolons or tabs may separate columns, and decimals may then have commas; text is in UTF-8
    or Windows-1252. In a NetCDF file every variable has one common dimension, "sample" or any other. In a bag columns
    are fields of messages, like "/wrench.wrench.force.x" (see `tactile_bayes.record.bag`); it takes the package
    rosbags.

    Units are those of the record (SI, or those of the rod; angles in radians). Other units are converted if they are
    stated: by the rig, in the name of a column ("force_x [mN]"), in a row of units below the names, in a line of the
    header (`# column force_x: number [mN]`, `# rod_length: 200 [mm]`), or in the attribute `units` of a NetCDF
    variable.

    Parameters
    ----------
    path : path-like
        A file with suffix .csv or .nc, or a bag: a file with suffix .mcap, .bag or .db3, or a folder of ROS 2.
    rig : Rig, optional
        The rig that wrote the file. Its `file` states how, see `tactile_bayes.rig.FileFormat`; its rod and the frame of
        its load cell are those of a file that states none. A rod without a length gives the shape of the one that the
        file states.

    Returns
    -------
    xr.Dataset
        The record. Its attribute `units_source` is "assumed" if neither the file nor a rod states the units.

    Raises
    ------
    RecordError
        If the content is not a record, see `validate` (the message names line and column); if the file is SI and no rod
        is stated; if it states another rod or another frame than the rig; if a column has the unit of another quantity,
        or its source does not exist; if the file to be split has sweeps already, or its drive angle jumps by about a
        turn; if the path is a folder that is no bag, a pipe or a device, or has another suffix.
    FileNotFoundError
        If there is no such file.
    ParameterError
        If an entry of the rig's `file` is impossible.

    Warns
    -----
    RecordWarning
        If the record is SI and nobody states the unit of a measured column, or if the last line of a CSV file has no
        end: it may be cut. Its row is left out if its last number stands out from those above.

    Examples
    --------
    A rig with names, units and signs of its own, semicolons, and no force across the drive:

    >>> import tempfile
    >>> rig = Rig(
    ...     rod=Rod(0.1, 1.2e-5),
    ...     file={
    ...         "drive_angle": "Angle",
    ...         "holding_moment": "M[Nmm]",
    ...         "force_x": "-Fx[mN]",
    ...         "missing": "force_y",
    ...         "split_sweeps": True,
    ...     },
    ... )
    >>> with tempfile.TemporaryDirectory() as directory:
    ...     path = Path(directory) / "rig.csv"
    ...     _ = path.write_text("Angle [°];M;Fx\\n60,0;0;0\\n60,5;0,25;-1,5\\n", encoding="utf-8")
    ...     record = read_record(path, rig)
    >>> record["holding_moment"].values.tolist(), record["force_x"].values.tolist(), str(record["direction"].values[0])
    ([0.0, 0.00025], [-0.0, 0.0015], 'forward')
    """
    rig = rig_of(rig)
    record = record_in(read_table(path, rig.format.columns), rig)
    _warn(record, f"{path}: ")
    return record


def make_record(
    columns: Mapping[str, Any] | pd.DataFrame, rig: Rig | None = None, *, attrs: Mapping[str, Any] | None = None
) -> xr.Dataset:
    """Make a record from a mapping of columns, or from a pandas DataFrame.

    Parameters
    ----------
    columns : mapping of str to array, shape (n_samples,), or DataFrame
        The columns of `MEASURED`, and any further columns of numbers or text. In a mapping a single value stands for a
        whole column; base_x and base_y are 0 by default; a channel that the rig does not measure is NaN. Columns are in
        the units of the record (angles in radians), or in others that the attribute `units` (of a DataArray), the name
        ("force_x [mN]") or the rig states. A DataFrame is read as a CSV file without a header; its index is ignored.
    rig : Rig, optional
        The rig, as for `read_record`: its rod makes the record SI, its load cell states the frame, and its `file` the
        names, units and signs of columns, and missing channels. By default, or with the dimensionless `Rod()`, the
        record is dimensionless: lengths in rod lengths L, moments in EI/L, forces in EI/L². What `attrs` state must
        agree.
    attrs : mapping, optional
        Attributes of the record, strings and numbers: `load_cell_force_noise` and `load_cell_moment_noise` belong to
        the data sheet of the sensor, in the record's units; `load_cell_frame` is "fixed", forces along the axes of the
        laboratory, or "turning", along the rod at the pivot and across it; others are kept as they are.

    Returns
    -------
    xr.Dataset
        The record, dimension "sample"; every variable has attributes `units` and `long_name`.

    Raises
    ------
    RecordError
        If the columns are not a valid record; see `validate`. Samples are counted from 0.
    ParameterError
        If an entry of the rig's `file` is impossible.

    Warns
    -----
    RecordWarning
        If a DataFrame is SI and nobody states the unit of a measured column.

    Examples
    --------
    >>> columns = {"sweep": 0, "direction": "forward", "drive_angle": [1.2, 1.3], "holding_moment": [0.0, 0.4]}
    >>> record = make_record(columns, Rig(file={"missing": ["force_x", "force_y"]}))
    >>> record.attrs["units"]
    'dimensionless'

    A table with names and units of its own:

    >>> frame = pd.DataFrame({"Angle [deg]": [60.0, 61.0], "Mz [N mm]": [0.0, 0.4]})
    >>> file = {"drive_angle": "Angle", "holding_moment": "Mz", "missing": ["force_x", "force_y"], "split_sweeps": True}
    >>> make_record(frame, Rig(rod=Rod(0.1, 1.2e-5), file=file))["holding_moment"].values.tolist()
    [0.0, 0.0004]
    """
    record = record_in(table_of_columns(columns, attrs), rig_of(rig))
    if isinstance(columns, pd.DataFrame):
        _warn(record)
    return record


def _warn(record: xr.Dataset, where: str = "") -> None:
    for note in record.encoding["notes"]:
        warnings.warn(f"{where}{note}", RecordWarning, stacklevel=3)


def record_in(table: Table, rig: Rig) -> xr.Dataset:
    """Return the record in a table as its rig wrote it, with "notes" and "remarks" of the file in its encoding."""
    columns, rod, cell = rig.format.columns, rig.rod, rig.load_cell
    shape = rod if rod is not None and rod.is_dimensionless and rod != Rod() else None
    if shape is not None:
        rod = None
    if "drive_angle" in table.attrs and "drive_angle" not in {*columns, *table.columns}:
        columns = {**columns, "drive_angle": str(table.attrs["drive_angle"])}
        attrs = {name: value for name, value in table.attrs.items() if name != "drive_angle"}
        table = replace(table, attrs=attrs)
    table = in_units_of_record(renamed(rows_where(table, rig.format.where), columns), rod)
    if rig.format.split_sweeps == "rows":
        table = each_row(table)
    elif rig.format.split_sweeps:
        stated = table.attrs.get("rod_length", 1.0) if rod is None else rod.length
        table = split_at_turns(table, float(stated) if isinstance(stated, int | float) else 1.0)
    frame = None if cell is None else cell.frame
    record = with_rod(completed_record(table, rod, rig.format.missing, frame), shape)
    notes = [*table.source.notes]
    if table.source.name:
        if rod is None and "units" not in table.attrs:
            record.attrs["units_source"] = "assumed"
        if record.attrs["units"] == "SI" and not is_bag(Path(table.source.name)):  # messages of ROS are SI
            notes.append(assumed_units(table))
    record.encoding = {"notes": [note for note in notes if note], "remarks": [*table.source.remarks]}
    for variable in record.variables.values():
        if ORIGIN in variable.attrs:
            variable.encoding[ORIGIN] = variable.attrs.pop(ORIGIN)
    return record


# ---- the rows of a table that belong to a record


def rows_where(table: Table, where: str) -> Table:
    """Return the rows of a table that meet each of some conditions, as in `FileFormat`."""
    if not where:
        return table
    table.refuse_empty()
    met = np.ones(table.samples, dtype=bool)
    for condition in re.split(r"\sand\s", where):
        met &= _meets(table, condition)
    if not met.any():
        raise table.source.error(f"no row meets where = {where!r} in [file]: mend it, or leave it out")
    columns = {name: (values[met], attrs) for name, (values, attrs) in table.columns.items()}
    lines = None if table.source.lines is None else np.asarray(table.source.lines)[met]
    return replace(table, columns=columns, source=replace(table.source, lines=lines))


def _meets(table: Table, condition: str) -> Flags:
    names, sign = list(table.columns), _SIGN.search(condition)
    wanted, value = (condition[: sign.start()].strip(), condition[sign.end() :].strip()) if sign else ("", "")
    if not (sign and wanted and value):
        example = f"{names[0]} > 0" if names else "trial == 3"
        raise table.source.error(
            f"where = {condition.strip()!r} in [file] is no condition: write a column, one of "
            f"{', '.join(_COMPARISONS)}, and a value, as in {example!r}; several are joined by 'and'"
        )
    name, text = found_column(wanted, names), value.strip("'\"")
    if name is None:
        near = nearest(wanted, names)
        raise table.source.error(
            f"where = {condition.strip()!r} in [file]: there is no column {wanted!r}: "
            + (f"did you mean {near!r}?" if near else f"the columns are {', '.join(names)}")
        )
    values, compared = table.columns[name][0], _COMPARISONS[sign[0]]
    try:
        number = float(text)
    except ValueError:
        return np.asarray(compared(np.asarray(values).astype(str), text))
    return np.asarray(compared(parsed_column(name, values, table.source), number))
