"""The header of a CSV file: attributes and descriptions of columns in commented lines, and the line of names."""

from __future__ import annotations

import csv
import json
import math
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import islice
from typing import Any, BinaryIO

from tactile_bayes.errors import ParameterError
from tactile_bayes.record.attribute_names import stray_attribute
from tactile_bayes.record.encoding import WITH_NUL, not_utf8
from tactile_bayes.record.parsing import integer_in, is_integer_text, number_in
from tactile_bayes.record.quantity import accepted_units, converted, same_quantity
from tactile_bayes.record.schema import ATTRIBUTE_UNITS, MEASURED, RECORD_FORMAT
from tactile_bayes.record.spelling import visible
from tactile_bayes.record.table import Source
from tactile_bayes.tasks import check_format
from tactile_bayes.tasks.documents import read_json

KINDS = {"i": "integer", "f": "number", "U": "text", "O": "text"}
_DELIMITERS = ",;\t"
_SEARCHED, _LONGEST = 50, 100_000  # number of lines, and of bytes of each, that are inspected ahead of reading
_NAME = r"[\w.\-]+"
_QUOTED = r'"(?:[^"\\]|\\.)*"'
_UNIT = r'(?!\s)[^\]"]*(?<!\s)'
_FORMAT_LINE = re.compile(r"tactile_bayes record, format (?P<format>[0-9]+)")
_HEADER_LINE = re.compile(rf"(?P<key>{_NAME}|{_QUOTED})\s*:\s*+(?P<value>.*)")
_COLUMN_LINE = re.compile(
    rf"column\s+(?P<name>{_NAME}|{_QUOTED})\s*:\s*+(?P<kind>\w++)\s*+"
    rf"(?:\[\s*(?P<units>{_QUOTED}|{_UNIT})\s*\])?\s*+(?P<long_name>.+)?"
)
_STRAY_COLUMN = re.compile(rf"column\s+(?:{_NAME}|{_QUOTED})\s*[:=]|column\s[^:]*:\s*+(?:integer|number|text)\b")
_QUANTITY = re.compile(r"(?P<number>[^\[\]]+)(?:\[(?P<unit>[^\]]*)\])?")


@dataclass(frozen=True)
class Header:
    """Content of a CSV file before its first sample."""

    attrs: Mapping[str, Any]  # quantities in the units of the record
    descriptions: Mapping[str, Mapping[str, str]]  # kind, units and long_name of columns
    heads: Mapping[str, int]  # lines of the descriptions
    stated: Mapping[str, int]  # lines of the attributes
    names: list[str]  # "" for a column without
    delimiter: str
    line: int  # that of the names
    remarks: tuple[str, ...]


# --- Writing ----------------------------------------------------------------------------------------------------


def header_line(name: str, value: str | float, units: str) -> str:
    """Format an attribute of a record in the given units as a line of a header."""
    unit = "1" if isinstance(value, str) else _attribute_unit(name, units)
    return f"# {_quoted(name, _NAME)}: {_header_text(value)}{'' if unit == '1' else f' [{unit}]'}\n"


def column_line(name: str, kind: str, attrs: Mapping[str, Any]) -> str:
    """Format the description of a column as a line of a header."""
    unit = _quoted(str(attrs["units"]), _UNIT)
    return f"# column {_quoted(name, _NAME)}: {kind} [{unit}] {_header_text(str(attrs['long_name']))}\n"


def _attribute_unit(name: str, units: str) -> str:
    """Return the unit of an attribute in a record of the given units; "1" if it has none."""
    unit = ATTRIBUTE_UNITS.get(name, "1")
    return unit if units != "dimensionless" or unit == "rad" else "1"


def _header_text(value: str | float) -> str:
    if not isinstance(value, str):
        return repr(value)
    is_plain = value != "" and value.isprintable() and _header_value(_unpadded(value)) == value
    return value if is_plain else json.dumps(value, ensure_ascii=False)


def _quoted(text: str, plain: str) -> str:
    """Put a text in quotation marks where recognition requires them."""
    return text if re.fullmatch(plain, text) and text.isprintable() else json.dumps(text, ensure_ascii=False)


# --- Reading ----------------------------------------------------------------------------------------------------


def read_header(file: BinaryIO, source: Source) -> Header:
    """Read the lines up to the names; the file is then positioned at the first sample."""
    stated: dict[str, tuple[int, str]] = {}
    descriptions: dict[str, dict[str, str]] = {}
    heads: dict[str, int] = {}
    delimiter = None
    remarks: dict[int, str] = {}
    for number, line in enumerate(_lines(file, source), start=1):
        if number == 1 and (match := re.fullmatch(rf"sep=([{_DELIMITERS}])\s*", line)):  # written by spreadsheets
            delimiter = match[1]
            continue
        if not line.startswith("#"):
            if line.strip(_DELIMITERS + " \r\n"):
                below = lines_below(file)
                delimiter = delimiter or _delimiter_of(line, below)
                names = list(map(visible, cells_in(line, delimiter)))
                if not names[0] and "index" not in names and _counted(below, delimiter):
                    names[0] = "index"  # which pandas writes without a name
                if twice := [name for name in names if name and names.count(name) > 1]:
                    what = f"there are two columns {twice[0]!r}: rename or remove one of them"
                    raise source.line_error(number, what)
                heads = dict.fromkeys(names, number) | heads
                lines = {name: line for name, (line, _) in stated.items()}
                _refuse_stray(remarks, lines, source)
                attrs = _stated_attributes(stated, source)
                texts = tuple(f"line {at}: {text}" for at, text in remarks.items() if text)
                return Header(attrs, descriptions, heads, lines, names, delimiter, number, texts)
            continue
        content = _unpadded(line[1:])
        if match := _FORMAT_LINE.fullmatch(content):
            check_format(integer_in(match["format"]) or math.inf, RECORD_FORMAT, partial(source.line_error, number))
        elif match := _COLUMN_LINE.fullmatch(content):
            if match["kind"] not in KINDS.values():
                what = f"{match['kind']!r} is no kind of column: write integer, number or text"
                raise source.line_error(number, what)
            description = {key: _unquoted(text) for key, text in match.groupdict().items() if text is not None}
            name = description.pop("name")
            descriptions[name], heads[name] = description, number
        elif match := _HEADER_LINE.fullmatch(content):
            key = _unquoted(match["key"])
            if key in stated:
                raise source.line_error(number, f"{key!r} is stated a second time: keep one of the lines")
            stated[key] = (number, match["value"])
        elif (seen := visible(content)) != content and (_COLUMN_LINE.fullmatch(seen) or _HEADER_LINE.fullmatch(seen)):
            what = f"{content!r} has characters that cannot be seen, or odd blanks: write {seen!r}"
            raise source.line_error(number, what)
        else:
            remarks[number] = content
    raise source.error(f"there is no line of column names: add one, {','.join(MEASURED)}")


def _refuse_stray(remarks: Mapping[int, str], stated: Mapping[str, int], source: Source) -> None:
    """Refuse a commented line that states an attribute or a column in a form that is not read."""
    for line, text in remarks.items():
        if _STRAY_COLUMN.match(text):
            what = f"{text!r} describes a column in a form that is not read: write '# column NAME: KIND [UNIT] TEXT', "
            what += "the kind being integer, number or text, and a name with blanks or brackets in quotation marks"
            raise source.line_error(line, what)
        found = stray_attribute(text)
        if found is not None and (found[0] not in stated or text.startswith(found[0])):  # else words about it
            raise source.line_error(line, f"{text!r} looks like the attribute {found[0]!r}, but {found[1]}")


def _lines(file: BinaryIO, source: Source) -> Iterator[str]:
    for number, line in enumerate(iter(file.readline, b""), start=1):
        try:
            text = line.decode("utf-8-sig" if number == 1 else "utf-8")
        except UnicodeDecodeError as error:
            raise source.line_error(number, not_utf8(error)) from error
        if "\0" in text:
            raise source.line_error(number, WITH_NUL)
        yield text.lstrip("\ufeff\u200b")


def _stated_attributes(stated: Mapping[str, tuple[int, str]], source: Source) -> dict[str, str | int | float]:
    """Parse the values of header lines; known quantities are converted, and a unit of one of them means SI."""
    attrs = {key: _header_value(text) for key, (_, text) in stated.items()}
    known = {key: text for key, (_, text) in stated.items() if key in ATTRIBUTE_UNITS}
    matches = {key: _QUANTITY.fullmatch(text) for key, text in known.items() if not text.startswith("{")}  # polynomials
    with_unit = [key for key, match in matches.items() if match is not None and match["unit"] is not None]
    if "units" not in attrs and any(ATTRIBUTE_UNITS[key] not in ("1", "rad") for key in with_unit):
        attrs["units"] = "SI"
    for key, match in matches.items():
        line, text = stated[key]
        expected = _attribute_unit(key, str(attrs.get("units")))
        number = number_in(match["number"]) if match else None
        if match is None or number is None:
            raise source.line_error(line, f"{key} is {text!r}: give a number [{expected}]")
        if match["unit"] is not None:
            pair = same_quantity(match["unit"], expected)
            if pair is None:
                what = f"{key} is in [{match['unit']}], but takes {accepted_units(expected)}: convert it"
                raise source.line_error(line, what)
            number = converted(number, *pair)
        attrs[key] = number
    return attrs


def _header_value(text: str) -> str | int | float:
    """Parse a value in a header: a number, a text in quotation marks, or else the text itself."""
    number: float | None = integer_in(text) if is_integer_text(text) else number_in(text)
    return _unquoted(text) if number is None or not text else number


def _unpadded(text: str) -> str:
    """Strip blanks, and the delimiters with which a spreadsheet pads a header."""
    return text.strip().rstrip(_DELIMITERS + " ")


def _unquoted(text: str) -> str:
    try:
        return str(read_json(text, "the text")) if re.fullmatch(_QUOTED, text) else text
    except ParameterError:
        return text


def column_described(line: str) -> tuple[str, str] | None:
    """Return the name and the unit that a commented line states of a column, if it does."""
    match = _COLUMN_LINE.fullmatch(_unpadded(line[1:])) if line.startswith("#") else None
    return (_unquoted(match["name"]), _unquoted(match["units"])) if match and match["units"] is not None else None


def lines_below(file: BinaryIO) -> list[str]:
    """Return the next lines of a file, up to a limit, without a change of its position."""
    begin = file.tell()
    lines = [line[:_LONGEST].decode("utf-8", "replace") for line in islice(file, _SEARCHED)]
    file.seek(begin)
    return lines


def cells_in(line: str, delimiter: str | None = None) -> list[str]:
    """Split a line into cells without blanks around them, by default with the delimiter that gives the most cells."""
    cells = (_parted(line, sign) for sign in delimiter or _DELIMITERS)
    return [cell.strip() for cell in max(cells, key=len)]


def _parted(line: str, delimiter: str) -> list[str]:
    try:
        return next(csv.reader([line], delimiter=delimiter), [])
    except csv.Error:  # a row with this error is refused later
        return line.split(delimiter)


def _delimiter_of(line: str, below: Sequence[str]) -> str:
    """Find the delimiter of a line of names: tabs or semicolons if the next line has as many cells by them, since names
    and decimals may contain commas; else the one with the most columns. Tabs may also be blanks after commas."""
    first = next((other for other in below if any(cells_in(other))), "")
    for sign in "\t;":
        names = cells_in(line, sign)
        if 1 < len(names) == len(cells_in(first, sign)) and not names[0].endswith(","):
            return sign
    return max(_DELIMITERS, key=lambda sign: len(cells_in(line, sign)))


def _counted(lines: Sequence[str], delimiter: str) -> bool:
    """Return whether the first cells of lines are 0, 1, 2, ..."""
    first = [cells_in(line, delimiter)[0] for line in lines if line.strip()]
    return bool(first) and first == list(map(str, range(len(first))))
