"""The construction of records, from columns and from tables."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping
from typing import Any

import numpy as np
import pandas as pd
import xarray as xr

from tactile_bayes.checks import check_mapping, refused, unmasked
from tactile_bayes.mechanics.rods.rod import Rod
from tactile_bayes.record.attributes import completed_attributes
from tactile_bayes.record.parsing import number_in
from tactile_bayes.record.schema import Frame
from tactile_bayes.record.table import Cells, Source, Table
from tactile_bayes.record.validation import checked_record


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
