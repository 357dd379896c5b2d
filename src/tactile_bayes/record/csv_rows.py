"""The rows of a CSV file, read in chunks that become columns."""

from __future__ import annotations

import csv
import io
import math
import re
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from itertools import pairwise
from statistics import mean, median
from typing import Any, BinaryIO, NoReturn

import numpy as np
from numpy.typing import NDArray

from tactile_bayes.numerics.scatter import DEVIATION_OVER_MEDIAN
from tactile_bayes.record.csv_header import Header, cells_in
from tactile_bayes.record.encoding import CUT_BY_NUL, WITH_NUL, not_utf8
from tactile_bayes.record.parsing import integer_in, is_integer_text, number_in, number_with_comma, text_array
from tactile_bayes.record.schema import Kind
from tactile_bayes.record.spelling import look_alikes, plain_number
from tactile_bayes.record.table import Source

_ROWS = 500  # number of rows that become columns at once; more take longer, as cells do not stay in the cache
_TAIL = 1 << 16  # bytes of the end of a file in which rows are compared with the last one
# Largest number of rows that are compared; smallest numbers for a comparison of values, and of notations.
_COMPARED, _FEWEST, _ENOUGH = 50, 3, 10
_WIDTHS = 8.0  # usual steps from row to row by which a cut number is off
_INTEGER = (None, None)  # notation of a number without decimals and exponent, which is the same if digits are cut off
_NOTATION = re.compile(r"[+-]?[0-9]*(?:[.,](?P<decimals>[0-9]*))?(?:[eE][+-]?(?P<power>[0-9]*))?")


@dataclass
class Layout:
    """Known properties of the columns of a file before they are read, and kinds that their cells show."""

    names: list[str]
    delimiter: str
    line: int  # the one above the first row
    meant: Mapping[str, Kind]  # of the columns of a record
    described: Mapping[str, Kind]  # of others that the header describes
    decimal: str | None  # separator of decimals, if it is known
    guessed: dict[str, Kind] = field(default_factory=dict)

    def kind(self, name: str) -> Kind | None:
        """Return the kind of a column, None if it is not known yet."""
        return self.meant.get(name) or self.described.get(name) or self.guessed.get(name)


class _WrongGuessError(Exception):
    """A column that seemed numeric contains text: the whole column must be read again, as text."""


def read_rows(file: BinaryIO, layout: Layout, source: Source) -> tuple[dict[str, NDArray[Any]], NDArray[np.int64]]:
    """Read the columns of a file from its position, as int64, float64 or text, and the first line of each sample.
    Columns without a known kind are integers, else numbers (empty cells are NaN), else text.
    """
    begin = file.tell()
    most = 1 + sum(block.count(b"\n") + block.count(b"\r") for block in iter(lambda: file.read(1 << 16), b""))
    while True:
        file.seek(begin)
        text = io.TextIOWrapper(file, "utf-8", "surrogateescape", newline="")
        try:
            return _read_once(text, layout, most, source)
        except _WrongGuessError:
            continue
        finally:
            text.detach()


def _read_once(
    text: Iterator[str], layout: Layout, most: int, source: Source
) -> tuple[dict[str, NDArray[Any]], NDArray[np.int64]]:
    columns = {name: _Values(most) for name in layout.names}
    lines = _Values(most)
    lines.append(np.empty(0, np.int64))
    order = sorted(layout.names, key=lambda name: name not in layout.meant)  # these show the decimal separator
    for rows, begins in _pieces(text, layout, source):
        lines.append(np.array(begins, dtype=np.int64))
        here = Source(source.name, begins, aliases=source.aliases)
        texts = dict(zip(layout.names, zip(*rows, strict=True), strict=True))
        for name in order:
            columns[name].append(_column_values(name, texts[name], layout, here))
    return {name: columns.pop(name).joined() for name in layout.names}, lines.joined()


class _Values:
    """The values of a column one after the other: words, each kept once, or numbers in one array: memory that is never
    written to costs nothing, and that of many small arrays would not be given back.
    """

    def __init__(self, most: int) -> None:
        self._most, self._size = most, 0
        self._numbers: NDArray[Any] | None = None
        self._texts: list[str] = []
        self._seen: dict[str, str] = {}

    def append(self, values: NDArray[Any]) -> None:
        if values.dtype.kind in "UO":
            self._texts.extend(self._seen.setdefault(text, text) for text in values.tolist())
            return
        before, end = self._numbers, self._size + len(values)
        if before is None:
            before = np.empty(self._most, values.dtype)
        self._numbers = before.astype(np.result_type(before, values), copy=False)
        self._numbers[self._size : end] = values
        self._size = end

    def joined(self) -> NDArray[Any]:
        if self._numbers is None:
            return text_array(self._texts) if self._texts else np.empty(0, object)
        self._numbers.resize(self._size, refcheck=False)
        return self._numbers


def _pieces(text: Iterator[str], layout: Layout, source: Source) -> Iterator[tuple[list[list[str]], list[int]]]:
    """Yield the cells of some rows after the others, and their first lines."""
    rows: list[list[str]] = []
    begins: list[int] = []
    reader = csv.reader(_lines(text, layout.line, source), delimiter=layout.delimiter)
    begin, width = layout.line + 1, len(layout.names)
    try:
        for row in reader:
            if len(row) == width:
                rows.append(row)
                begins.append(begin)
            elif row:
                what = f"there are {len(row)} cells in {width} columns ({', '.join(map(str.strip, layout.names))})"
                way = "" if layout.delimiter == "," else " or a comma, but none between thousands"
                raise source.row_error(begin, f"{what}: write one per column, with a point in decimals{way}")
            begin = layout.line + 1 + reader.line_num
            if len(rows) == _ROWS:
                yield rows, begins
                rows, begins = [], []
    except csv.Error as error:
        what = f"the line cannot be read ({error}): correct it; "
        raise source.row_error(begin, f"{what}a quotation mark that is not closed takes in what follows") from error
    if rows:
        yield rows, begins


def _lines(text: Iterator[str], above: int, source: Source) -> Iterator[str]:
    """Yield the lines of a text, and refuse bytes that are none."""
    for number, line in enumerate(text, start=above + 1):
        if not line.isascii():
            try:
                line.encode("utf-8", "surrogateescape").decode("utf-8")
            except UnicodeDecodeError as error:
                raise source.row_error(number, not_utf8(error)) from error
        if "\0" in line:
            rest = line.partition("\0")[2] + next(text, "")
            raise source.row_error(number, WITH_NUL if rest.strip("\0\r\n") else CUT_BY_NUL)
        yield line


def _column_values(name: str, texts: Sequence[str], layout: Layout, source: Source) -> NDArray[Any]:
    """Convert the cells of a column to its known kind, or to the kind of their content."""
    kind = layout.kind(name)
    if kind == "text":
        return text_array([text.strip() for text in texts] if name in layout.meant else texts)
    is_known, decimal = name in layout.meant or name in layout.described, layout.decimal
    found: Kind = "number" if kind == "number" else "integer"
    parsed: Sequence[float | None] = _numbers(texts, layout) if kind == "number" else _integers(texts, is_known)
    if None in parsed and not (is_known or kind == "number"):
        found, parsed = "number", _numbers(texts, layout)
    if None not in parsed:
        if not is_known:
            layout.guessed[name] = found
        return np.array(parsed, dtype=np.int64 if found == "integer" else np.float64)
    if is_known:
        _refuse_cell(name, found, texts, [i for i, value in enumerate(parsed) if value is None], layout, source)
    layout.guessed[name], layout.decimal = "text", decimal
    if kind is not None:
        raise _WrongGuessError
    return text_array(texts)


def _integers(texts: Sequence[str], is_known: bool) -> Sequence[int | None]:
    """Parse integers, None for other content; in a column that is not known to hold integers 2.0 is none."""
    together = "".join(texts)
    if together.isascii() and "_" not in together:  # which Python reads otherwise
        with suppress(ValueError):
            integers = list(map(int, texts))
            if min(integers, default=0) >= -(2**63) and max(integers, default=0) < 2**63:
                return integers
    return [integer_in(text) if is_known or is_integer_text(text) else None for text in texts]


def _numbers(texts: Sequence[str], layout: Layout) -> Sequence[float | None]:
    """Parse numbers, NaN for empty cells and None for other content."""
    together = "".join(texts)
    with suppress(ValueError):
        if "_" not in together and layout.decimal == ".":
            return [float(text or "nan") for text in texts]
        if "_" not in together and layout.decimal == "," and "." not in together:
            return [float(text.replace(",", ".") or "nan") for text in texts]
    return [_number_in(text, layout) for text in texts]


def _number_in(text: str, layout: Layout) -> float | None:
    """Parse the number in a cell; the first one with decimals determines the decimal separator."""
    text = plain_number(text)
    if layout.delimiter != "," and ("," in text or "." in text):
        sign = "," if "," in text else "."
        number = number_in(text.replace(",", ".")) if layout.decimal in (None, sign) else None
        if number is not None:
            layout.decimal = sign
        return number
    return number_in(text)


def _refuse_cell(
    name: str, kind: Kind, texts: Sequence[str], samples: list[int], layout: Layout, source: Source
) -> NoReturn:
    sample = samples[0]
    if name in layout.described:
        what = f"is no {kind}, as the header says the column is: correct one"
    else:
        what = f"is not {'an integer' if kind == 'integer' else 'a number'}: correct it, or remove the row"
        if layout.delimiter == ",":
            if "," in texts[sample] and number_in(texts[sample].replace(",", ".")) is not None:
                what += "; where decimals have commas, write ; between columns"
        elif layout.decimal and ("," if layout.decimal == "." else ".") in texts[sample]:
            what += f"; decimals are separated by {layout.decimal!r} in this file, and thousands by nothing"
    raise source.cell_error(np.array(samples), name, f"{texts[sample]!r}{look_alikes(texts[sample])} {what}")


# ---- the end of a file: its last line may be cut within its last number


def without_cut_row(file: BinaryIO, header: Header, line: int) -> tuple[BinaryIO, str]:
    """Return a file from its position after a line on, and a note on what is wrong, "" for nothing. A last row without
    an end is left out if its last number stands out from those above, in notation or value.
    """
    begin, size = file.tell(), file.seek(0, io.SEEK_END)
    file.seek(max(begin, size - _TAIL))
    *above, last = file.read().split(b"\n")
    file.seek(begin)
    if not last.strip(b",;\t \r") or last.endswith((b"\r", b'"')):
        return file, ""
    rows = [cells_in(line.decode("utf-8", "replace"), header.delimiter) for line in above[-_COMPARED:]]
    ends = [row[-1] for row in rows if len(row) == len(header.names) and row[-1]]
    cells = cells_in(last.decode("utf-8", "replace"), header.delimiter)
    number = line + 1 + file.read().count(b"\n")
    file.seek(begin)
    note = f"line {number}, the last one, has no end: was the file copied whole?"
    is_text = header.descriptions.get(header.names[-1], {}).get("kind") == "text"
    if is_text or len(cells) != len(header.names) or not _stands_out(cells[-1], ends):
        return file, note
    note += f" Its last number, {cells[-1]!r}, is unlike those above it, and the row is left out"
    return io.BytesIO(file.read(size - len(last) - begin)), note


def _stands_out(text: str, above: Sequence[str]) -> bool:
    """Return whether a number differs from those above it in its notation, or by much more than they from another."""
    numbers = [number_with_comma(cell) for cell in (*above, text)]
    *values, number = [math.nan if value is None else value for value in numbers]
    if math.isnan(sum(map(abs, (*values, number)))) or len(values) < _FEWEST:  # a column of text
        return False
    notations = set(map(_notation, above))
    if len(values) >= _ENOUGH and len(notations) == 1 and notations != {_INTEGER}:
        return _notation(text) not in notations
    steps = [abs(b - a) for a, b in pairwise(values)]
    usual = DEVIATION_OVER_MEDIAN * median(steps) or mean(steps)
    return abs(number - values[-1]) > _WIDTHS * usual


def _notation(text: str) -> tuple[int | None, ...]:
    """Return the numbers of digits of decimals and exponent, None without."""
    match = _NOTATION.fullmatch(text)
    return () if match is None else tuple(None if part is None else len(part) for part in match.groups())
