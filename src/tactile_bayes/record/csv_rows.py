"""The rows of a CSV file: a fast reader, or a careful one that reports positions, converts chunks to columns."""

from __future__ import annotations

import csv
import io
import warnings
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, BinaryIO, NoReturn

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from tactile_bayes.record.cell import integer_in, is_integer_text, number_in
from tactile_bayes.record.encoding import CUT_BY_NUL, WITH_NUL, not_utf8
from tactile_bayes.record.parsing import text_array
from tactile_bayes.record.schema import Kind
from tactile_bayes.record.spelling import look_alikes, plain_number
from tactile_bayes.record.storable import LONGEST_CELL
from tactile_bayes.record.table import Source

# Bytes that are read at once: first a small chunk, from which the kinds of columns are inferred.
_FIRST, _CHUNK = 1 << 16, 1 << 21
# Last cell of each line for the fast reader, which shows whether cells are in the right columns.
_MARK = 5_790_842_613_117
# Options for rounding to the nearest double, the only behaviour since pandas 3.1.
_ROUNDING: dict[str, Any] = (
    {} if tuple(map(int, pd.__version__.split(".")[:2])) >= (3, 1) else {"float_precision": "round_trip"}
)


@dataclass
class Layout:
    """Known properties of the columns of a file before they are read; `line` is the one above the first row.

    `meant` are the kinds of the columns of a record, `described` those of others that the header describes, and
    `guessed` those of the remaining ones, inferred from their cells. If the delimiter is no comma, a comma may separate
    decimals.
    """

    names: list[str]
    delimiter: str
    line: int
    meant: Mapping[str, Kind]
    described: Mapping[str, Kind]
    guessed: dict[str, Kind] = field(default_factory=dict)
    decimal: str | None = None

    def __post_init__(self) -> None:
        if self.delimiter == ",":
            self.decimal = "."

    def kind(self, name: str) -> Kind | None:
        """Return the kind of a column, None if it is not known yet."""
        return self.meant.get(name) or self.described.get(name) or self.guessed.get(name)


class _WrongGuessError(Exception):
    """A column that seemed numeric contains text: the whole column must be read again, as text."""


def read_rows(file: BinaryIO, layout: Layout, source: Source) -> tuple[dict[str, NDArray[Any]], NDArray[np.int64]]:
    """Read the columns of a file from its position, as int64, float64 or text, and the first line of each sample.

    The memory needed is little more than that of the result. Text is returned as by `text_array`. Columns without a
    known kind are integers, else numbers (empty cells are NaN), else text.
    """
    begin = file.tell()
    most = 1 + sum(block.count(b"\n") + block.count(b"\r") for block in iter(lambda: file.read(_CHUNK), b""))
    while True:
        file.seek(begin)
        try:
            return _read_once(_chunks(file), layout, most, source)
        except _WrongGuessError:
            continue


def _read_once(
    chunks: Iterator[bytes], layout: Layout, most: int, source: Source
) -> tuple[dict[str, NDArray[Any]], NDArray[np.int64]]:
    columns = {name: _Values(most) for name in layout.names}
    lines = _Values(most)
    lines.append(np.empty(0, np.int64))
    above = layout.line
    for chunk in chunks:
        cells = _read_fast(chunk, layout)
        if cells is None:
            cells, here, above = _read_carefully(chunk, chunks, layout, above, source)
        else:
            rows = len(cells[layout.names[0]])
            here, above = np.arange(above + 1, above + 1 + rows), above + rows
        lines.append(here)
        for name, values in cells.items():
            columns[name].append(values)
    return {name: columns.pop(name).joined() for name in layout.names}, lines.joined()


def _chunks(file: BinaryIO) -> Iterator[bytes]:
    """Yield the rest of a file in pieces that end with a line, except the last."""
    size, rest = _FIRST, b""
    while block := file.read(size):
        end = block.rfind(b"\n") + 1
        if end:
            yield rest + block[:end]
        rest = block[end:] if end else rest + block
        size = _CHUNK
    if rest:
        yield rest


class _Values:
    """The values of a column one after the other. Numbers go into one array: memory that is never written to costs
    nothing, and that of many small arrays would not be given back. A word that comes again is kept once.
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


# --- The fast reader --------------------------------------------------------------------------------------------


def _read_fast(chunk: bytes, layout: Layout) -> dict[str, NDArray[Any]] | None:
    """Read the columns of a chunk; None if anything is unusual, for the careful reader."""
    kinds = {name: layout.kind(name) for name in layout.names}
    if None in kinds.values() or layout.decimal is None or b"\0" in chunk:
        return None
    chunk = chunk.replace(b"\r\n", b"\n")
    if b"\r" in chunk or not chunk.endswith(b"\n"):
        return None
    if _begins_with_truth(chunk, kinds, layout):
        return None
    rows = chunk.count(b"\n")
    chunk = chunk.replace(b"\n", f"{layout.delimiter}{_MARK}\n".encode())
    dtypes: dict[int, Any] = {len(layout.names): np.int64}
    for index, (name, kind) in enumerate(kinds.items()):
        if kind != "integer" or name not in layout.guessed:  # in an inferred column 2.0 is not an integer
            dtypes[index] = {"integer": np.int64, "number": np.float64, "text": object}[kind or "text"]
    try:
        with warnings.catch_warnings(action="error"), np.errstate(invalid="raise"):
            frame = pd.read_csv(
                io.BytesIO(chunk),
                sep=layout.delimiter,
                decimal=layout.decimal,
                header=None,
                names=list(range(len(layout.names) + 1)),
                index_col=False,
                dtype=dtypes,
                keep_default_na=False,
                na_values={
                    index: ["", "nan", "NaN", "NAN"] for index, kind in enumerate(kinds.values()) if kind == "number"
                },
                skip_blank_lines=False,
                low_memory=False,
                engine="c",
                **_ROUNDING,
            )
    except (ValueError, OverflowError, ArithmeticError, Warning):  # ParserError and UnicodeError are ValueErrors
        return None
    if len(frame) != rows or not (frame[len(layout.names)] == _MARK).all():
        return None
    columns: dict[str, NDArray[Any]] = {}
    for index, (name, kind) in enumerate(kinds.items()):
        values = frame[index].to_numpy()
        if kind == "text":
            texts = values.tolist()
            if max(map(len, texts)) > LONGEST_CELL:
                return None
            values = _text_array(texts, name in layout.meant)
        elif values.dtype != (np.int64 if kind == "integer" else np.float64):
            return None
        columns[name] = values
    return columns


def _begins_with_truth(chunk: bytes, kinds: Mapping[str, Kind | None], layout: Layout) -> bool:
    """Return whether a number in the first line may be the word true or false, which pandas converts to 1 and 0."""
    line = chunk[: chunk.index(b"\n")].lower()
    if b"true" not in line and b"false" not in line:
        return False
    cells = line.split(layout.delimiter.encode())
    return b'"' in line or any(
        b"e" in cell for cell, kind in zip(cells, kinds.values(), strict=False) if kind != "text"
    )


def _text_array(texts: Sequence[str], stripped: bool) -> NDArray[Any]:
    words = set(texts)
    if stripped and any(word != word.strip() for word in words):
        texts = [text.strip() for text in texts]
    return text_array(texts)


# --- The careful reader -----------------------------------------------------------------------------------------


def _read_carefully(
    chunk: bytes, chunks: Iterator[bytes], layout: Layout, above: int, source: Source
) -> tuple[dict[str, NDArray[Any]], NDArray[np.int64], int]:
    """Read the columns of a chunk, the lines of its samples, and its last line; an error states the position."""
    lines: list[str] = []

    def fed() -> Iterator[str]:
        piece = chunk
        while piece:  # more than one if a cell in quotation marks continues beyond the end of a piece
            lines.extend(_text_lines(piece, above + len(lines), source))
            yield from lines[reader.line_num :]
            piece = next(chunks, b"")

    rows: list[list[str]] = []
    begins: list[int] = []
    reader = csv.reader(fed(), delimiter=layout.delimiter)
    begin = above + 1
    try:
        for row in reader:
            if row and len(row) != len(layout.names):
                raise source.row_error(
                    begin,
                    f"there are {len(row)} cells in {len(layout.names)} columns "
                    f"({', '.join(map(str.strip, layout.names))}): write one per column, with a point in decimals"
                    + ("" if layout.delimiter == "," else " or a comma, but none between thousands"),
                )
            if row:
                rows.append(row)
                begins.append(begin)
            begin = above + 1 + reader.line_num
            if reader.line_num == len(lines):
                break
    except csv.Error as error:
        raise source.row_error(
            begin,
            f"the line cannot be read ({error}): correct it; a quotation mark that is not closed takes in what follows",
        ) from error
    here = Source(source.name, begins, aliases=source.aliases)
    order = sorted(layout.names, key=lambda name: name not in layout.meant)  # these show the decimal separator
    places = {name: index for index, name in enumerate(layout.names)}
    columns = {name: _column_values(name, [row[places[name]] for row in rows], layout, here) for name in order}
    return columns, np.array(begins, dtype=np.int64), begin - 1


def _text_lines(chunk: bytes, above: int, source: Source) -> list[str]:
    try:
        text = chunk.decode("utf-8")
    except UnicodeDecodeError as error:
        line = above + 1 + chunk.count(b"\n", 0, error.start)
        raise source.row_error(line, not_utf8(error)) from error
    if "\0" in text:
        begin = text.index("\0")
        is_lost = not text[begin:].strip("\0\r\n")
        raise source.row_error(above + 1 + text.count("\n", 0, begin), CUT_BY_NUL if is_lost else WITH_NUL)
    return io.StringIO(text, newline="").readlines()


def _column_values(name: str, texts: list[str], layout: Layout, source: Source) -> NDArray[Any]:
    """Convert the cells of a column to its known kind, or to the kind of their content."""
    kind = layout.kind(name)
    if kind == "text":
        return _text_array(texts, name in layout.meant)
    if name not in layout.meant and name not in layout.described:
        looks = _kind_of(texts, layout)
        if looks == "text":
            layout.guessed[name] = "text"
            if kind is None:
                return text_array(texts)
            raise _WrongGuessError
        if kind != "number":
            kind = layout.guessed[name] = looks
    parsed = [integer_in(text) if kind == "integer" else _number_in(text, layout) for text in texts]
    if None in parsed:
        _refuse_cell(name, kind, texts, [i for i, value in enumerate(parsed) if value is None], layout, source)
    return np.array(parsed, dtype=np.int64 if kind == "integer" else np.float64)


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


def _kind_of(texts: list[str], layout: Layout) -> Kind:
    """Infer the kind of a column from its cells."""
    if all(is_integer_text(text) and integer_in(text) is not None for text in texts):
        return "integer"
    decimal = layout.decimal
    if all(_number_in(text, layout) is not None for text in texts):
        return "number"
    layout.decimal = decimal
    return "text"


def _refuse_cell(
    name: str, kind: Kind | None, texts: list[str], samples: list[int], layout: Layout, source: Source
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
