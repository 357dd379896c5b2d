"""The units of a record: its rod, and the conversion between SI and dimensionless quantities."""

from __future__ import annotations

import operator
from collections.abc import Iterable
from dataclasses import replace
from typing import Any

import numpy as np
import xarray as xr

from tactile_bayes.checks import check_optional
from tactile_bayes.errors import ParameterError, RecordError
from tactile_bayes.mechanics.rods.rod import Rod
from tactile_bayes.record.attributes import rod_attributes, same_rod, stated_rod, without_rod
from tactile_bayes.record.parsing import parsed_column
from tactile_bayes.record.quantity import accepted_units, converted, same_quantity
from tactile_bayes.record.rig_entry import rig_entry
from tactile_bayes.record.schema import COLUMNS, LOAD_CELL_UNITS, MEASURED, UNITS, column_of
from tactile_bayes.record.table import Cells, Source, Table
from tactile_bayes.record.validation import validate


def rod_of(record: xr.Dataset) -> Rod:
    """Return the rod of a record; for a dimensionless record `Rod()`, with a diameter in rod lengths."""
    return stated_rod(record.attrs, Source())


def with_rod(record: xr.Dataset, rod: Rod | None) -> xr.Dataset:
    """Replace the rod that a record states; one without a length gives the shape of that of an SI record."""
    check_optional("the rod", rod, Rod)
    if rod is None:
        return record
    if record.attrs["units"] == "dimensionless" and not rod.is_dimensionless:
        raise ParameterError(f"the record is dimensionless, so {rod} does not fit it: leave the rod out, or use to_si")
    if record.attrs["units"] == "SI" and rod.is_dimensionless:
        shape = {name: value for name, value in vars(rod).items() if value != getattr(Rod(), name)}
        rod = replace(rod_of(record), **shape)
    replaced = record.copy(deep=False)
    replaced.attrs = without_rod(record.attrs) | rod_attributes(rod)
    return replaced


def to_dimensionless(record: xr.Dataset) -> xr.Dataset:
    """Convert a record and its load cell to the units of the rod: lengths L, moments EI/L, forces EI/L² (equation 11 of
    Merker et al. 2018, doi 10.1155/2018/1613945). Columns that the schema does not know are kept.
    """
    if record.attrs.get("units") == "dimensionless":
        return record
    return _converted(record, rod_of(record), "dimensionless")


def to_si(record: xr.Dataset, rod: Rod) -> xr.Dataset:
    """Convert a dimensionless record to SI units with a rod; the inverse of `to_dimensionless`."""
    stated = rod_of(record)
    if record.attrs.get("units") == "SI":
        if not same_rod(stated, rod):
            what = f"the record is SI already, with {stated}"
            raise RecordError(f"{what}; for what {rod} would have given, make it dimensionless first")
        return record
    in_lengths = rod.in_lengths()
    if not same_rod(stated, in_lengths):
        raise RecordError(
            f"the record was made with {stated} (in rod lengths), but {rod} is {in_lengths} in these: give a rod of "
            f"diameter {stated.diameter * rod.length_unit!r} m, and of the same shape"
        )
    return _converted(record, rod, "SI")


def _converted(record: xr.Dataset, rod: Rod, units: str) -> xr.Dataset:
    """Convert a record to other units, and state its rod."""
    converted = validate(record)
    convert = operator.mul if units == "SI" else operator.truediv
    for name, variable in converted.variables.items():
        column = column_of(str(name))
        if column is not None and column.scale is not None:
            with np.errstate(over="ignore"):  # refused below, with the sample that it happened in
                variable.values = convert(variable.values, getattr(rod, column.scale))
            variable.attrs["units"] = column.unit_in(units)
    scales = rod.unit_sizes
    for entry, unit in LOAD_CELL_UNITS.items():
        name = f"load_cell_{entry}"
        if name in converted.attrs and unit in scales:
            converted.attrs[name] = convert(converted.attrs[name], scales[unit])
    converted.attrs |= {"units": units, **rod_attributes(rod if units == "SI" else rod.in_lengths())}
    return validate(converted)


def in_units_of_record(table: Table, rod: Rod | None) -> Table:
    """Convert known columns, arrays of float64 in place, to units of the record: as stated, or else of the rod."""
    attrs: dict[str, Any] = dict(table.attrs)
    if "units" not in attrs and rod is None and any(_is_physical(*item) for item in table.columns.items()):
        attrs["units"] = "SI"
    units = attrs.get("units", "dimensionless" if rod is None or rod.is_dimensionless else "SI")
    if units not in UNITS:  # refused later, with the other attributes
        return table
    columns: dict[str, Cells] = {}
    source = replace(
        table.source, units={name: str(of["units"]) for name, (_, of) in table.columns.items() if "units" in of}
    )
    for name, (values, of_column) in table.columns.items():
        column = column_of(name)
        if column is None or "units" not in of_column:
            columns[name] = (values, of_column)
            continue
        expected = column.unit_in(units)
        pair = same_quantity(str(of_column["units"]), expected)
        if pair is None:
            what = f"takes {accepted_units(expected)}: correct the unit, or convert the column"
            if units == "dimensionless" and column.scale is not None:
                what = f"takes [{expected}] in a dimensionless record: convert it, or state units 'SI' and the rod"
            raise table.source.column_error(name, f"is in [{of_column['units']}], but {what}")
        if pair[0] != pair[1]:
            values = converted(parsed_column(name, values, table.source), *pair)
        columns[name] = (values, {**of_column, "units": expected})
    return Table(columns, attrs, source)


def assumed_units(table: Table) -> str:
    """Return a note on the measured columns of an SI record whose unit nobody states; "" if there are none."""
    if "units" in table.source.stated or (not table.source.stated and "units" in table.attrs):
        return ""
    taken = {
        name: COLUMNS[name].unit
        for name, (values, attrs) in table.columns.items()
        if name in MEASURED and COLUMNS[name].kind == "number" and "units" not in attrs and np.any(values != 0.0)
    }
    if not taken:
        return ""
    name = next(iter(taken))
    entry = rig_entry(name, f"{table.source.origins.get(name, name)}[{taken[name]}]")
    return f"no unit is stated for {_and(taken)}: taken as {_and(taken.values())}. State them, as in {entry}"


def _and(words: Iterable[str]) -> str:
    return " and ".join(filter(None, (", ".join([*words][:-1]), [*words][-1])))


def _is_physical(name: str, cells: Cells) -> bool:
    """Return whether a column states a unit that it would not have in a dimensionless record."""
    column = column_of(name)
    if column is None or column.scale is None or "units" not in cells[1]:
        return False
    return same_quantity(str(cells[1]["units"]), column.unit) is not None
