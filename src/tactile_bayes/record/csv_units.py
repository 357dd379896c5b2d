"""The row of units that a CSV file may have below its column names."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import BinaryIO

from tactile_bayes.record.cell import number_in
from tactile_bayes.record.csv_header import Header, cells_in, lines_below
from tactile_bayes.record.quantity import Unit, unit_of
from tactile_bayes.record.schema import Kind
from tactile_bayes.record.table import Source

__all__ = ["units_below"]

_BRACKETS = re.compile(r"\[(?P<square>[^\[\]]*)\]|\((?P<round>[^()]*)\)")


def units_below(file: BinaryIO, header: Header, meant: Mapping[str, Kind], source: Source) -> dict[str, str]:
    """The units of columns, if the line below their names is a row of units; the file is then left behind it.

    In such a row a column that is measured has a unit, and no cell is a number; a unit of another column, like °C, need
    not be known here. Pure numbers alone make none: 1 and - may be units, but readings too.

    Raises
    ------
    RecordError
        If a measured column has a unit that is none, or that differs from what the header states.
    """
    cells = cells_in(next(iter(lines_below(file)), ""), header.delimiter)
    texts = [_without_brackets(cell) for cell in cells]
    units = [unit_of(text) if cell else None for cell, text in zip(cells, texts, strict=True)]
    is_number = [unit is None and _number_in(text) is not None for unit, text in zip(units, texts, strict=True)]
    is_measured = [
        unit is not None and not unit.is_number and meant.get(name) == "number"
        for name, unit in zip(header.names, units, strict=False)
    ]
    if len(cells) != len(header.names) or any(is_number) or not any(is_measured):
        return {}
    found = {}
    for place, (name, cell, text, unit) in enumerate(zip(header.names, cells, texts, units, strict=True), start=1):
        if cell:
            _refuse(place, name, text, unit, header, source, is_measured=meant.get(name) == "number")
            found[name] = text
    file.readline()
    return found


def _refuse(
    place: int, name: str, text: str, unit: Unit | None, header: Header, source: Source, *, is_measured: bool
) -> None:
    """Refuse a cell of a row of units that is none, or not that of its column."""
    number = header.line + 1
    if not name:
        raise source.line_error(
            header.line, f"column {place} has no name: name it, or remove it (in line {number} it has {text!r})"
        )
    if unit is None and is_measured:
        raise source.line_error(
            number,
            f"this looks like a row of units, but {text!r} below {name!r} is none that is known here: empty that cell; "
            "or remove the row, and give units with the columns, columns={'force_x': 'Fx[mN]'}, on the command line "
            "--column 'force_x=Fx[mN]'",
        )
    stated = header.descriptions.get(name, {}).get("units")
    if stated is not None and unit is not None and unit_of(stated) not in (None, unit):
        raise source.line_error(
            number,
            f"column {name!r} is in [{text}] here, and in [{stated}] in line {header.heads[name]}: leave out the one "
            "that is wrong",
        )


def _number_in(text: str) -> float | None:
    return number_in(text.replace(",", ".")) if text else None


def _without_brackets(cell: str) -> str:
    match = _BRACKETS.fullmatch(cell)
    return cell if match is None else (match["square"] or match["round"] or "").strip()
