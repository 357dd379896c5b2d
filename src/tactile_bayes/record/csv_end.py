"""The end of a CSV file: a last line without an end may be cut within its last number."""

from __future__ import annotations

import io
import math
import re
from collections.abc import Sequence
from itertools import pairwise
from statistics import mean, median
from typing import BinaryIO

from tactile_bayes.numerics.scatter import DEVIATION_OVER_MEDIAN
from tactile_bayes.record.csv_header import Header, cells_in
from tactile_bayes.record.parsing import number_with_comma

_TAIL = 1 << 16  # bytes of the end of a file in which rows are compared with the last one
# Largest number of rows that are compared; smallest numbers for a comparison of values, and of notations.
_COMPARED, _FEWEST, _ENOUGH = 50, 3, 10
_WIDTHS = 8.0  # usual steps from row to row by which a cut number is off
_INTEGER = (None, None)  # notation of a number without decimals and exponent, which is the same if digits are cut off
_NOTATION = re.compile(r"[+-]?[0-9]*(?:[.,](?P<decimals>[0-9]*))?(?:[eE][+-]?(?P<power>[0-9]*))?")


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
