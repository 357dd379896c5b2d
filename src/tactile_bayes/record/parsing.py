"""The parsing of cells and columns: they become integers, numbers or text, or the first invalid one is refused."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tactile_bayes.record.schema import Kind, column_of
from tactile_bayes.record.spelling import plain_number
from tactile_bayes.record.storable import LONGEST_CELL, not_storable
from tactile_bayes.record.table import Source

FREE = 1 << 26  # bytes that a column of text may always take


def number_in(cell: Any) -> float | None:
    """Parse the number in a cell: NaN for an empty cell, None for other content."""
    if cell is None:
        return math.nan
    if isinstance(cell, str):
        cell = plain_number(cell).strip() or "nan"
        if "_" in cell:  # Python would read 1_0 as ten
            return None
    try:
        return float(cell)
    except (TypeError, ValueError, OverflowError):
        return None


def number_with_comma(text: str) -> float | None:
    """Parse the number in a cell whose decimals may have a comma, None for an empty cell too."""
    return number_in(text.replace(",", ".")) if text else None


def integer_in(cell: Any) -> int | None:
    """Parse the integer in a cell, None for other content; 2.0 is accepted, since tables often contain it."""
    if isinstance(cell, int):
        integer = cell
    elif isinstance(cell, str) and is_integer_text(cell):
        digits = cell.strip().lstrip("+-").lstrip("0")[:20] or "0"  # 20 overflow; Python refuses more than 4300
        integer = -int(digits) if "-" in cell else int(digits)
    else:
        number = number_in(cell)
        if number is None or not number.is_integer():
            return None
        integer = int(number)
    return integer if -(2**63) <= integer < 2**63 else None


def is_integer_text(text: str) -> bool:
    """Return whether a text has the form of an integer, without a point or an exponent."""
    return re.fullmatch(r"\s*[+-]?[0-9]+\s*", text) is not None


_PARSERS: Mapping[Kind, tuple[Callable[[Any], Any], str]] = {
    "integer": (integer_in, "an integer"),
    "number": (number_in, "a number"),
    "text": (lambda cell: cell if isinstance(cell, str) else None, "text"),
}


def parsed_column(name: str, values: NDArray[Any], source: Source) -> NDArray[Any]:
    """Convert the cells of a column to int64, float64 or text; an array of that type is returned as it is."""
    column = column_of(name)
    if column is not None:
        kind: Kind = column.kind
    elif values.dtype.kind in "biu":
        kind = "integer"
    elif values.dtype.kind in "US" or any(isinstance(cell, str) for cell in values if values.dtype.kind == "O"):
        kind = "text"
    else:
        kind = "number"
    if values.dtype.kind == "S":
        values = np.char.decode(values, "utf-8")
    if values.dtype.kind in "mM":
        raise source.cell_error(0, name, f"{values[0]!r} is a time: give seconds, as numbers, or text")

    if kind == "number" and values.dtype.kind in "biuf":
        return values.astype(np.float64, copy=False)
    if kind == "integer" and values.dtype.kind in "bi":
        return values.astype(np.int64, copy=False)
    if kind == "integer" and values.dtype.kind == "f":  # 2.0 counts as one, since tables often contain it
        with np.errstate(invalid="ignore"):
            integers = values.astype(np.int64)
        if (integers == values).all() and (np.abs(values) < 2.0**63).all():
            return integers
    if kind == "text" and values.dtype.kind == "U":
        _refuse_text(name, values, source)
        return values
    parse, what = _PARSERS[kind]
    cells = values.tolist()
    parsed = [parse(cell) for cell in cells]
    if None in parsed:
        bad = parsed.index(None)
        raise source.cell_error(bad, name, f"{cells[bad]!r} is not {what}: correct it, or remove the row")
    if kind == "text":
        _refuse_text(name, values, source)
        return text_array(parsed)
    return np.array(parsed, np.int64 if kind == "integer" else np.float64)


def _refuse_text(name: str, values: NDArray[Any], source: Source) -> None:
    """Refuse cells that not every file format can store."""
    other = values[1:][values[1:] != values[:-1]]  # most neighbours are equal
    for text in {*values[:1].tolist(), *other.tolist()}:
        reason = not_storable(text)
        if reason is None and len(text) > LONGEST_CELL:
            reason = f"has {len(text)} characters, more than {LONGEST_CELL}"
        if reason:
            raise source.cell_error(values.tolist().index(text), name, f"the text {reason}: correct it, or shorten it")


def text_array(texts: Sequence[str]) -> NDArray[Any]:
    """Return texts as an array of NumPy strings, or of objects if strings, as wide as the longest, take much more."""
    width = max(map(len, texts), default=0)
    if 4 * width * len(texts) > FREE and width * len(texts) > 2 * (sum(map(len, texts)) + len(texts)):
        seen: dict[str, str] = {}
        return np.fromiter((seen.setdefault(text, text) for text in texts), dtype=object, count=len(texts))
    return np.array(texts, dtype=np.str_)
