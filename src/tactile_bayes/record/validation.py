"""The validation of records: each error says what is wrong, where, and what to do."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Mapping
from typing import Any

import numpy as np
import pandas as pd
import xarray as xr
from numpy.typing import NDArray

from tactile_bayes.checks import check_mapping, refused, unmasked
from tactile_bayes.mechanics.rods.rod import Rod
from tactile_bayes.record.attributes import checked_attributes, completed_attributes, stated_frame
from tactile_bayes.record.origin import ORIGIN
from tactile_bayes.record.parsing import number_in, parsed_column
from tactile_bayes.record.quantity import units_disagree
from tactile_bayes.record.rig_entry import file_entry
from tactile_bayes.record.schema import CHANNELS, COLUMNS, FRAMES, MEASURED, REQUIRED, Frame, column_of
from tactile_bayes.record.spelling import nearest
from tactile_bayes.record.storable import is_storable, is_storable_attribute, not_storable, storable
from tactile_bayes.record.sweep import refuse_impossible_sweeps
from tactile_bayes.record.table import Cells, Source, Table, table_of


def validate(record: xr.Dataset) -> xr.Dataset:
    """Validate and complete a record, or raise an error that says what is wrong, where, and what to do.

    As encoders are noisy, a sweep runs against its direction only if every step of its drive angle does, or its
    least-squares trend by more than six standard errors.
    """
    source = Source()
    if not isinstance(record, xr.Dataset):
        hint = "take its record" if hasattr(record, "record") else "build one with make_record"
        raise source.error(f"a record is an xarray.Dataset, not a {type(record).__name__}: {hint}")
    checked = checked_record(table_of(record, source))
    for name in set(record.variables) & set(checked.variables):
        if ORIGIN in record[name].encoding:
            checked[name].encoding[ORIGIN] = record[name].encoding[ORIGIN]
    return checked.set_coords([name for name in record.coords if name in checked.data_vars])


def checked_record(table: Table) -> xr.Dataset:
    """Make a record from a table, or raise an error that says why this is not possible."""
    columns, attrs, source = table.columns, table.attrs, table.source
    _refuse_names(attrs, source, is_storable_attribute)
    attributes = checked_attributes(attrs, source)
    _refuse_absent_columns(columns, source)
    table.refuse_empty()

    at_origin: dict[str, Cells] = {name: (np.zeros(table.samples), {}) for name in ("base_x", "base_y")}
    filled = at_origin | dict(columns)
    order = [*MEASURED, *(name for name in columns if name not in MEASURED)]
    values = {name: parsed_column(name, filled[name][0], source) for name in order}
    _refuse_gaps(values, source)
    refuse_impossible_sweeps(values, source)
    _refuse_names(columns, source, is_storable)
    variables = {
        name: ("sample", values[name], _checked_column_attributes(name, filled[name][1], attributes, source))
        for name in order
    }
    return xr.Dataset(variables, attrs=attributes)


def _refuse_names(names: Collection[Any], source: Source, is_allowed: Callable[[Any], bool]) -> None:
    for name in names:
        if is_allowed(name):
            continue
        way = ": use printable characters, at most 200 bytes, no '/', not '.' alone, and no name that NetCDF reserves"
        if isinstance(name, str) and name in source.names and is_storable(storable(name)):
            way = f", and as {storable(name)!r} there is another column: rename one of the two"
        raise source.error(f"the name {name!r} cannot be stored in every file{way}")


def _checked_column_attributes(
    name: str, attrs: Mapping[str, Any], of_record: Mapping[str, Any], source: Source
) -> dict[str, Any]:
    for key, value in attrs.items():
        if isinstance(value, str) and (reason := not_storable(value)):
            raise source.column_error(name, f"has an attribute {key!r} that {reason}: remove it")
    column = column_of(name)
    if column is None:
        return {"units": "unknown", "long_name": name, **attrs}
    units = of_record["units"]
    expected = column.unit_in(units)
    stated = str(attrs.get("units", expected))
    if units_disagree(stated, expected):
        what = f"column {name!r} is in [{stated}], but the record is {units}: convert the column to [{expected}], or "
        raise source.error(f"{what}state the units that the record is in, and for SI the rod")
    long_name = column.long_name_in(stated_frame(of_record, source))
    own_words = [column.long_name_in(frame) for frame in FRAMES]  # descriptions for another frame are replaced
    kept = {key: value for key, value in attrs.items() if not (key == "long_name" and value in own_words)}
    return {"long_name": long_name, **kept, "units": expected}


def _refuse_absent_columns(columns: Collection[str], source: Source) -> None:
    unknown = [name for name in columns if column_of(name) is None]
    for name in MEASURED:
        if name in columns:
            continue
        is_required = name in REQUIRED
        similar = nearest(name, unknown, cutoff=0.6 if is_required else 0.8)
        if similar is not None:
            stands = source.aliases.get(similar, similar)
            what = f"there is no column {name!r}, but a column {stands!r}: did you mean {name!r}? Rename it"
        elif is_required:
            stands = "NAME[UNIT]" if COLUMNS[name].kind == "number" else "NAME"
            what = f"there is no column {name!r} (columns: {', '.join(source.names or columns) or 'none'}): add it"
        else:
            continue
        if source.name:
            what += f", or say what stands for it, {file_entry(name, stands)}"
        if name in CHANNELS:
            what += f", or declare the channel missing, with an empty column, {file_entry('missing', [name])}"
        elif name in ("sweep", "direction"):
            what += f", or have the record split where the drive turns back: {file_entry('split_sweeps', True)}"
        elif not is_required:
            what += f", or add a column {name!r} (0 for a pivot in the origin)"
        raise source.error(what)


def _refuse_gaps(values: Mapping[str, NDArray[Any]], source: Source) -> None:
    missing = [name for name in CHANNELS if np.isnan(values[name]).all()]
    if len(missing) == len(CHANNELS):
        what = f"every load channel is empty: a record needs measurements of at least one of {', '.join(CHANNELS)}"
        raise source.error(what, slice(None))
    for name in MEASURED:
        if COLUMNS[name].kind != "number" or name in missing:
            continue
        bad = np.flatnonzero(~np.isfinite(values[name]))
        if bad.size:
            way_out = ", or empty the whole column if the channel is missing" if name in CHANNELS else ""
            content = float(values[name][bad[0]])
            what = "is missing (nan)" if math.isnan(content) else f"is {content!r}"
            raise source.cell_error(bad, name, f"the value {what}: give a finite number, remove the row{way_out}")


# ---- records made of columns and of tables


def table_of_columns(columns: Mapping[str, Any] | pd.DataFrame, attrs: Mapping[str, Any] | None) -> Table:
    """Return a table of columns by name, in which a single value stands for a whole column."""
    check_mapping("attrs", attrs, "give strings and numbers by name")
    if isinstance(columns, pd.DataFrame):
        return Table(_cells_of_frame(columns), attrs or {}, Source("the DataFrame"))
    if not isinstance(columns, Mapping) or isinstance(columns, xr.DataTree):
        raise refused("columns", columns, "give arrays by name of a column, or a pandas DataFrame")
    cells = {str(name): (np.array(unmasked(values)), getattr(values, "attrs", {})) for name, values in columns.items()}
    source = Source()
    lengths = [len(values) for values, _ in cells.values() if values.ndim == 1]
    shape = (lengths[0] if lengths else 0,)
    for name, (values, column_attrs) in cells.items():
        if values.ndim == 0 and lengths:
            cells[name] = (np.full(shape, values), column_attrs)
        elif values.shape != shape:
            expected = f"others have {shape}" if lengths else "(n_samples,) is wanted"
            raise source.error(f"column {name!r} has shape {values.shape}, where {expected}: give one value per sample")
    return Table(cells, attrs or {}, source)


def _cells_of_frame(frame: pd.DataFrame) -> dict[str, Cells]:
    names = [*frame.columns]
    for name in names:
        if not isinstance(name, str):
            raise refused("columns", names, f"the column {name!r} has no text as its name: rename it")
        if names.count(name) > 1:
            raise refused("columns", names, f"there are two columns {name!r}: rename or remove one of them")
    empty = {"na_value": np.nan}  # instead of the NA of pandas
    return {
        name: (column.to_numpy(copy=True, **(empty if pd.api.types.is_extension_array_dtype(column) else {})), {})
        for name, column in frame.items()
    }


def completed_record(table: Table, rod: Rod | None, missing: Collection[str], frame: Frame | None) -> xr.Dataset:
    """Make a record from a table, with the given rod, missing channels, which have empty columns, and frame."""
    columns = dict(table.columns)
    for name in missing:
        numbers = list(map(number_in, columns[name][0].tolist())) if name in columns else []
        if not all(number is not None and math.isnan(number) for number in numbers):
            what = f"column {name!r} has values, but is declared missing: do not declare it, or empty the column"
            raise table.source.error(what)
        columns.setdefault(name, (np.full(table.samples, np.nan), {}))
    return checked_record(Table(columns, completed_attributes(table.attrs, rod, frame, table.source), table.source))
