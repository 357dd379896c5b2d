"""The conversion of a table to the units of a record, from the units that its columns state."""

from __future__ import annotations

from typing import Any

from tactile_bayes.mechanics.rod import Rod
from tactile_bayes.record.parsing import parsed_column
from tactile_bayes.record.quantity import accepted_units, converted, unit_of
from tactile_bayes.record.schema import UNITS, column_of
from tactile_bayes.record.table import Cells, Table

__all__ = ["in_units_of_record"]


def in_units_of_record(table: Table, rod: Rod | None) -> Table:
    """The table with every column that the schema knows in the unit of the record.

    The record is SI or dimensionless as its attribute `units` says, or else as the rod does; where neither is there,
    a column in newtons or millimetres says that it is SI. Arrays of float64 are converted in place.

    Raises
    ------
    RecordError
        If a column is in a unit of another quantity, or in one that is not known.
    """
    attrs: dict[str, Any] = dict(table.attrs)
    if "units" not in attrs and rod is None and any(_is_physical(*item) for item in table.columns.items()):
        attrs["units"] = "SI"
    units = attrs.get("units", "dimensionless" if rod is None or rod.is_dimensionless else "SI")
    if units not in UNITS:  # which is refused with the other attributes
        return table
    columns: dict[str, Cells] = {}
    for name, (values, of_column) in table.columns.items():
        column = column_of(name)
        if column is None or "units" not in of_column:
            columns[name] = (values, of_column)
            continue
        expected = column.unit_in(units)
        stated, wanted = unit_of(str(of_column["units"])), unit_of(expected)
        if stated is None or wanted is None or stated.dimension != wanted.dimension:
            what = f"is in [{of_column['units']}], but "
            if units == "dimensionless" and column.scale is not None:
                what += (
                    f"the record is dimensionless, so that it takes [{expected}]: convert it, or state units 'SI' and "
                    "the rod"
                )
            else:
                what += f"takes {accepted_units(expected)}: correct the unit, or convert the column"
            raise table.source.column_error(name, what)
        if stated != wanted:
            values = converted(parsed_column(name, values, table.source), stated, wanted)
        columns[name] = (values, {**of_column, "units": expected})
    return Table(columns, attrs, table.source)


def _is_physical(name: str, cells: Cells) -> bool:
    """Whether a column states a unit that it would not have in a dimensionless record."""
    column = column_of(name)
    if column is None or column.scale is None or "units" not in cells[1]:
        return False
    unit, expected = unit_of(str(cells[1]["units"])), unit_of(column.unit)
    return unit is not None and expected is not None and unit.dimension == expected.dimension
