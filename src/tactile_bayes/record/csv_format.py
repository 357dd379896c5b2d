"""The CSV form of a record: a header of commented lines, a line of column names, a line per sample."""

from __future__ import annotations

import csv
import json
import math
import re
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from tactile_bayes.record.cell import integer_in, is_integer_text, number_in
from tactile_bayes.record.schema import ATTRIBUTE_UNITS, MEASURED, column_of, same_unit
from tactile_bayes.record.table import Cells, Source, Table

__all__ = ["read_csv", "write_csv"]

_FORMAT = 1
_KINDS = {"i": "integer", "f": "number", "U": "text"}
_NAME = r"[\w.\-]+"
_QUOTED = r'"(?:[^"\\]|\\.)*"'
_UNIT = r'(?!\s)[^\]"]*(?<!\s)'
_FORMAT_LINE = re.compile(r"tactile_bayes record, format (?P<format>[0-9]+)")
_HEADER_LINE = re.compile(rf"(?P<key>{_NAME}|{_QUOTED})\s*:\s*(?P<value>.*)")
_COLUMN_LINE = re.compile(
    rf"column\s+(?P<name>{_NAME}|{_QUOTED})\s*:\s*(?P<kind>\w+)\s*"
    rf"(?:\[\s*(?P<units>{_QUOTED}|{_UNIT})\s*\])?\s*(?P<long_name>.*)"
)
_QUANTITY = re.compile(r"(?P<number>[^\[\]]+)(?:\[(?P<unit>[^\]]*)\])?")


# --- Writing ----------------------------------------------------------------------------------------------------


def write_csv(record: xr.Dataset, path: Path) -> None:
    """Write a record that has been validated."""
    columns = {str(name): variable for name, variable in record.variables.items()}
    columns = {name: columns[name] for name in sorted(columns, key=lambda name: name not in MEASURED)}
    with open(path, "w", encoding="utf-8", newline="") as file:
        file.write(f"# tactile_bayes record, format {_FORMAT}\n")
        for name, value in record.attrs.items():
            unit = f" [{ATTRIBUTE_UNITS[name]}]" if name in ATTRIBUTE_UNITS and record.attrs["units"] == "SI" else ""
            file.write(f"# {_quoted(name, _NAME)}: {_header_text(value)}{unit}\n")
        for name, variable in columns.items():
            unit = _quoted(str(variable.attrs["units"]), _UNIT)
            long_name = _header_text(str(variable.attrs["long_name"]))
            file.write(f"# column {_quoted(name, _NAME)}: {_KINDS[variable.dtype.kind]} [{unit}] {long_name}\n")
        file.write(",".join(map(_cell_text, columns)) + "\n")
        for row in zip(*(column.values.tolist() for column in columns.values()), strict=True):
            file.write(",".join(map(_cell_text, row)) + "\n")


def _cell_text(value: str | float) -> str:
    if isinstance(value, str):  # csv.writer would leave a lone carriage return unquoted
        return '"' + value.replace('"', '""') + '"' if re.search('[,"\r\n]', value) else value
    return "" if math.isnan(value) else repr(value)


def _header_text(value: str | float) -> str:
    if not isinstance(value, str):
        return repr(value)
    is_plain = value != "" and value.isprintable() and _header_value(_unpadded(value)) == value
    return value if is_plain else json.dumps(value, ensure_ascii=False)


def _quoted(text: str, plain: str) -> str:
    """The text, in quotation marks where it would not be recognised without."""
    return text if re.fullmatch(plain, text) and text.isprintable() else json.dumps(text, ensure_ascii=False)


# --- Reading ----------------------------------------------------------------------------------------------------


def read_csv(path: Path) -> Table:
    """Read a table, and remember the line of each sample; cells that the schema knows are left as text."""
    source = Source(str(path))
    try:
        with open(path, encoding="utf-8-sig", newline="") as file:
            attrs, descriptions, name_line, above = _read_header(file, source)
            names = _column_names(name_line, above, source)
            rows = _read_rows(file, names, above, source)
    except UnicodeDecodeError as error:
        raise source.error(f"the file is not UTF-8 text ({error}): save it as CSV in UTF-8") from error
    source = Source(str(path), list(rows))
    columns: dict[str, Cells] = {}
    for index, name in enumerate(names):
        texts = [row[index] for row in rows.values()]
        description = descriptions.get(name, {})
        kind = description.pop("kind", None)
        columns[name] = (_column_values(name, texts, kind, source), description)
    return Table(columns, attrs, source)


def _read_header(file: Iterable[str], source: Source) -> tuple[dict[str, Any], dict[str, dict[str, str]], str, int]:
    """Attributes, descriptions of columns, the line of column names, and its number."""
    stated: dict[str, tuple[int, str]] = {}
    descriptions: dict[str, dict[str, str]] = {}
    for number, line in enumerate(file, start=1):
        if not line.startswith("#"):
            if line.strip(", \r\n"):
                return _stated_attributes(stated, source), descriptions, line, number
            continue
        content = _unpadded(line[1:])
        if match := _FORMAT_LINE.fullmatch(content):
            if int(match["format"]) > _FORMAT:
                raise source.line_error(
                    number,
                    f"the file has format {match['format']}, but this version of tactile_bayes reads formats up to "
                    f"{_FORMAT}: update it",
                )
        elif match := _COLUMN_LINE.fullmatch(content):
            if match["kind"] not in _KINDS.values():
                raise source.line_error(
                    number, f"{match['kind']!r} is no kind of column: write integer, number or text"
                )
            description = {"kind": match["kind"]}
            if match["units"] is not None:
                description["units"] = _unquoted(match["units"])
            if match["long_name"]:
                description["long_name"] = _unquoted(match["long_name"])
            descriptions[_unquoted(match["name"])] = description
        elif match := _HEADER_LINE.fullmatch(content):
            key = _unquoted(match["key"])
            if key in stated:
                raise source.line_error(number, f"{key!r} is stated a second time: keep one of the lines")
            stated[key] = (number, match["value"])
    raise source.error(f"there is no line of column names: add one, {','.join(MEASURED)}")


def _stated_attributes(stated: Mapping[str, tuple[int, str]], source: Source) -> dict[str, str | int | float]:
    """The values of header lines; numbers that the schema knows lose their unit, if it is the right one."""
    attrs = {key: _header_value(text) for key, (_, text) in stated.items()}
    for key, si_unit in ATTRIBUTE_UNITS.items():
        if key not in stated:
            continue
        line, text = stated[key]
        unit = "1" if attrs.get("units") == "dimensionless" else si_unit
        match = _QUANTITY.fullmatch(text)
        number = number_in(match["number"]) if match else None
        if match is None or number is None:
            raise source.line_error(line, f"{key} is {text!r}: give a number [{unit}]")
        if match["unit"] is not None and not same_unit(match["unit"], unit):
            raise source.line_error(line, f"{key} is in [{match['unit']}]: convert it to [{unit}]")
        attrs[key] = number
    return attrs


def _header_value(text: str) -> str | int | float:
    """What a value in a header means: a number, a text in quotation marks, or else the text itself."""
    if is_integer_text(text):
        number: float | None = integer_in(text)
    else:
        number = number_in(text) if text else None
    return _unquoted(text) if number is None else number


def _unpadded(text: str) -> str:
    """The text without blanks around it, and without the commas that a spreadsheet pads a header with."""
    return text.strip().rstrip(",").rstrip()


def _unquoted(text: str) -> str:
    try:
        return str(json.loads(text)) if re.fullmatch(_QUOTED, text) else text
    except json.JSONDecodeError:
        return text


def _column_names(line: str, number: int, source: Source) -> list[str]:
    names = [column.strip() for column in next(csv.reader([line]))]
    if len(names) == 1 and re.search(r"[;\t]", line):
        raise source.line_error(number, "the columns are not separated by commas: use commas, and points in decimals")
    for index, column in enumerate(names):
        if not column:
            raise source.line_error(number, f"column {index + 1} has no name: name it, or remove it")
        if column in names[:index]:
            raise source.line_error(number, f"there are two columns {column!r}: rename or remove one of them")
    return names


def _read_rows(file: Iterable[str], names: list[str], above: int, source: Source) -> dict[int, list[str]]:
    """The rows of the table, each under the line that it begins in."""
    rows: dict[int, list[str]] = {}
    reader = csv.reader(file)
    begin = above + 1
    try:
        for row in reader:
            if row and len(row) != len(names):
                raise source.line_error(
                    begin,
                    f"there are {len(row)} cells in {len(names)} columns ({', '.join(names)}): write one per column, "
                    "with a point in decimals",
                )
            if row:
                rows[begin] = row
            begin = above + 1 + reader.line_num
    except csv.Error as error:
        raise source.line_error(begin, f"the line cannot be read ({error}): correct it") from error
    return rows


def _column_values(name: str, texts: list[str], kind: str | None, source: Source) -> NDArray[Any]:
    """The cells of a column; those that the schema knows are left to the validation, with its messages."""
    known = column_of(name)
    if known is not None and known.kind == "text":
        texts = [text.strip() for text in texts]
    if known is None and kind is None:
        kind = _kind_of(texts)
    if known is not None or kind == "text":
        return np.array(texts, dtype=object)
    parsed = [integer_in(text) if kind == "integer" else number_in(text) for text in texts]
    if None in parsed:
        bad = parsed.index(None)
        raise source.cell_error(
            bad, name, f"{texts[bad]!r} is no {kind}, as the header says the column is: correct one"
        )
    return np.array(parsed, dtype=np.int64 if kind == "integer" else np.float64)


def _kind_of(texts: list[str]) -> str:
    """What the cells of a column are of which nothing is said."""
    if all(is_integer_text(text) and integer_in(text) is not None for text in texts):
        return "integer"
    return "text" if any(number_in(text) is None for text in texts) else "number"
