"""The CSV form of a record: a header of commented lines, a line of column names, a line per sample."""

from __future__ import annotations

import io
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any, BinaryIO, cast

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from tactile_bayes.record.csv_header import FORMAT, KINDS, column_line, header_line, read_header
from tactile_bayes.record.csv_rows import Layout, read_rows
from tactile_bayes.record.origin import meant_kinds, origins_of
from tactile_bayes.record.schema import MEASURED, Kind
from tactile_bayes.record.table import Source, Table

__all__ = ["read_csv", "write_csv"]

_ROWS = 20_000
"""Samples that are written at once."""


def write_csv(record: xr.Dataset, path: Path) -> None:
    """Write a record that has been validated."""
    columns = {str(name): variable for name, variable in record.variables.items()}
    columns = {name: columns[name] for name in sorted(columns, key=lambda name: name not in MEASURED)}
    with open(path, "w", encoding="utf-8", newline="") as file:
        file.write(f"# tactile_bayes record, format {FORMAT}\n")
        for name, value in record.attrs.items():
            file.write(header_line(name, value, record.attrs["units"]))
        for name, variable in columns.items():
            file.write(column_line(name, KINDS[variable.dtype.kind], variable.attrs))
        file.write(",".join(_quoted_cells(list(columns))) + "\n")
        arrays = [variable.values for variable in columns.values()]
        for begin in range(0, record.sizes["sample"], _ROWS):
            cells = [_cell_texts(array[begin : begin + _ROWS]) for array in arrays]
            file.write("\n".join(map(",".join, zip(*cells, strict=True))) + "\n")


def _cell_texts(values: NDArray[Any]) -> list[str]:
    if values.dtype.kind in "UO":
        return _quoted_cells(values.tolist())
    texts = list(map(repr, values.tolist()))
    if values.dtype.kind == "f":
        for sample in np.flatnonzero(np.isnan(values)).tolist():
            texts[sample] = ""
    return texts


def _quoted_cells(texts: list[str]) -> list[str]:
    """The texts, in quotation marks where they would not be read back without."""
    quoted = {  # csv.writer would leave a lone carriage return unquoted
        text: '"' + text.replace('"', '""') + '"' for text in set(texts) if re.search('[,;\t"\r\n]', text)
    }
    return [quoted.get(text, text) for text in texts] if quoted else texts


def read_csv(path: Path, columns: Mapping[str, str]) -> Table:
    """Read a table as it is in the file; columns that mean something in a record have the right kind of cells."""
    source = Source(str(path))
    with open(path, "rb") as file:
        text = _with_usual_line_ends(file)
        header = read_header(text, source)
        source = Source(str(path), heads=header.heads)
        origins = origins_of(columns, header.names, source)
        described = {
            name: cast(Kind, header.descriptions[name]["kind"]) for name in header.names if name in header.descriptions
        }
        layout = Layout(header.names, header.delimiter, header.line, meant_kinds(origins, header.names), described)
        values, lines = read_rows(text, layout, Source(str(path)))
    attrs = {
        name: {key: word for key, word in header.descriptions.get(name, {}).items() if key != "kind"} for name in values
    }
    return Table(
        {name: (array, attrs[name]) for name, array in values.items()},
        header.attrs,
        Source(str(path), lines, header.heads),
    )


def _with_usual_line_ends(file: BinaryIO) -> BinaryIO:
    """The file; or a copy with other line ends, if it has only carriage returns, as files once had."""
    start = file.peek(1 << 16) if isinstance(file, io.BufferedReader) else b""
    if b"\n" in start or b"\r" not in start:
        return file
    return io.BytesIO(file.read().replace(b"\r", b"\n"))
