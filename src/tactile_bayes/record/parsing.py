"""The parsing of columns: cells become integers, numbers or text, or the first invalid one is refused."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tactile_bayes.record.cell import integer_in, number_in
from tactile_bayes.record.schema import Kind, column_of
from tactile_bayes.record.storable import LONGEST_CELL, not_storable
from tactile_bayes.record.table import Source

FREE = 1 << 26  # bytes that a column of text may always take


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
    parse: Callable[[Any], Any] = {"integer": integer_in, "number": number_in, "text": _text}[kind]
    cells = values.tolist()
    parsed = [parse(cell) for cell in cells]
    if None in parsed:
        bad = parsed.index(None)
        what = {"integer": "an integer", "number": "a number", "text": "text"}[kind]
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


def _text(cell: Any) -> str | None:
    return cell if isinstance(cell, str) else None


def text_array(texts: Sequence[str]) -> NDArray[Any]:
    """Return texts as an array of NumPy strings, or of str objects.

    NumPy gives every cell the width of the longest one, four bytes a character. If that is much, and less than half of
    it would be used, the cells are objects, with one object for equal texts.
    """
    width = max(map(len, texts), default=0)
    if 4 * width * len(texts) > FREE and width * len(texts) > 2 * (sum(map(len, texts)) + len(texts)):
        seen: dict[str, str] = {}
        return np.fromiter((seen.setdefault(text, text) for text in texts), dtype=object, count=len(texts))
    return np.array(texts, dtype=np.str_)
