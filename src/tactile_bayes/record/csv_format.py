"""The CSV format of a record: a header of commented lines, a line of column names, a line for each sample."""

from __future__ import annotations

import io
import re
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any, BinaryIO, cast

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from tactile_bayes.record.csv_header import KINDS, Header, cells_in, column_line, header_line, lines_below, read_header
from tactile_bayes.record.csv_rows import Layout, read_rows, without_cut_row
from tactile_bayes.record.encoding import in_utf8, refuse_other_kinds
from tactile_bayes.record.origin import any_meant, found_column, meant_kinds, origins_of
from tactile_bayes.record.parsing import number_with_comma
from tactile_bayes.record.quantity import Unit, unit_of, units_disagree
from tactile_bayes.record.rig_entry import file_entry
from tactile_bayes.record.schema import MEASURED, RECORD_FORMAT, Kind
from tactile_bayes.record.table import Source, Table
from tactile_bayes.tasks import write_atomically

_ROWS = 20_000  # number of samples that are written at once
_BRACKETS = re.compile(r"\[(?P<square>[^\[\]]*)\]|\((?P<round>[^()]*)\)")


def write_csv(record: xr.Dataset, path: Path) -> None:
    """Write a validated record."""
    columns = {str(name): variable for name, variable in record.variables.items()}
    columns = {name: columns[name] for name in sorted(columns, key=lambda name: name not in MEASURED)}
    with write_atomically(path) as temporary, open(temporary, "w", encoding="utf-8", newline="") as file:
        file.write(f"# tactile_bayes record, format {RECORD_FORMAT}\n")
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
    """Put texts in quotation marks where reading requires them."""
    quoted = {  # csv.writer would leave a lone carriage return unquoted
        text: '"' + text.replace('"', '""') + '"' for text in set(texts) if re.search('[,;\t"\r\n]', text)
    }
    return [quoted.get(text, text) for text in texts] if quoted else texts


def read_csv(path: Path, columns: Mapping[str, str]) -> Table:
    """Read a table as it is in the file; columns of a record have the right kind of cells."""
    with open(path, "rb") as file:
        return read_csv_content(file, str(path), columns)


def read_csv_content(file: BinaryIO, called: str, columns: Mapping[str, str]) -> Table:
    """Read a table from an open file, which has a name for messages."""
    source = Source(called)
    refuse_other_kinds(file.read(8), source)
    file.seek(0)
    text = in_utf8(_with_usual_line_ends(file))
    header = read_header(text, source)
    source = Source(called, heads=header.heads)
    names = [name for name in header.names if name]
    header = _with_found_names(header, names, source)
    _refuse_title(text, header, names, columns, source)
    origins = origins_of(columns, names, source)
    meant = meant_kinds(origins, names)
    units, last = _units_below(text, header, meant, source), header.line
    if units:
        last += 1
        source = Source(called, heads={**header.heads, **dict.fromkeys(units, last)})
    described = {name: cast(Kind, header.descriptions[name]["kind"]) for name in names if name in header.descriptions}
    # Columns without a name, as of a separator at the end of every line, are called by their position, and left out.
    places = [name or f" (column {place})" for place, name in enumerate(header.names, start=1)]
    unnamed = {name: place for place, name in enumerate(places, start=1) if name not in names}
    for name in unnamed:
        described[name] = "text"
    layout = Layout(places, header.delimiter, last, meant, described, "." if header.delimiter == "," else None)
    text, note = without_cut_row(text, header, last)
    values, lines = read_rows(text, layout, Source(called))
    for name, place in unnamed.items():
        texts = values.pop(name)
        for sample in np.flatnonzero(texts != "").tolist():
            if texts[sample].strip():
                raise source.line_error(header.line, _without_name(place, lines[sample], str(texts[sample])))
    attrs = {
        name: {key: word for key, word in header.descriptions.get(name, {}).items() if key != "kind"} for name in values
    }
    for name, unit in units.items():
        attrs[name]["units"] = unit
    notes = [note] if note else []
    source = replace(source, lines=lines, names=names, stated=header.stated, remarks=header.remarks, notes=notes)
    return Table({name: (array, attrs[name]) for name, array in values.items()}, header.attrs, source)


def _with_found_names(header: Header, names: list[str], source: Source) -> Header:
    """Return a header whose descriptions name columns of the file; they may leave out a unit in its name."""
    descriptions, heads = dict(header.descriptions), dict(header.heads)
    for described in header.descriptions:
        found = None if described in names else found_column(described, names)
        if found is None:  # of a column that was removed
            continue
        if found in header.descriptions:
            what = f"it describes the column {found!r}, as line {heads[found]} does: keep one"
            raise source.line_error(heads[described], what)
        descriptions[found], heads[found] = descriptions.pop(described), heads.pop(described)
    return replace(header, descriptions=descriptions, heads=heads)


def _refuse_title(file: BinaryIO, header: Header, names: list[str], columns: Mapping[str, str], source: Source) -> None:
    """Refuse a line of unknown column names if a line below looks more like column names."""
    if any_meant(columns, names):
        return
    below = lines_below(file)
    what = f"this line was taken for the column names ({', '.join(names)}), "
    for number, line in enumerate(below, start=header.line + 1):
        if any_meant(columns, cells_in(line)):
            what += f"but they are in line {number}: put # before the lines above that"
            raise source.line_error(header.line, what)
    widths = [len(cells_in(line, header.delimiter)) for line in below]
    if len(header.names) == 1 or len(header.names) not in widths:  # another delimiter separates the cells there
        widths = [len(cells_in(line)) for line in below]
    if max(widths, default=0) > len(header.names):
        what += "but there are more cells in lines below: if the names are further down, put # before the lines above "
        what += "them; else write one cell per column, with a point in decimals"
        raise source.line_error(header.line, what)


def _without_name(place: int, line: int, text: str) -> str:
    return f"column {place} has no name: name it, or remove it (in line {line} it has {text!r})"


def _with_usual_line_ends(file: BinaryIO) -> BinaryIO:
    """Return the file, or a copy with usual line ends if it has carriage returns only, like old files."""
    start = file.peek(1 << 16) if isinstance(file, io.BufferedReader) else b""
    if b"\n" in start or b"\r" not in start:
        return file
    return io.BytesIO(file.read().replace(b"\r", b"\n"))


def _units_below(file: BinaryIO, header: Header, meant: Mapping[str, Kind], source: Source) -> dict[str, str]:
    """Read the units of columns if the line below their names is a row of units, after which the file then is: a
    measured column has a unit other than 1 and -, which may be readings, and no cell is a number.
    """
    cells = cells_in(next(iter(lines_below(file)), ""), header.delimiter)
    texts = [_without_brackets(cell) for cell in cells]
    units = [unit_of(text) if cell else None for cell, text in zip(cells, texts, strict=True)]
    is_number = [unit is None and number_with_comma(text) is not None for unit, text in zip(units, texts, strict=True)]
    pairs = zip(header.names, units, strict=False)
    is_measured = [unit and not unit.is_number and meant.get(name) == "number" for name, unit in pairs]
    if len(cells) != len(header.names) or any(is_number) or not any(is_measured):
        return {}
    found = {}
    for place, (name, cell, text, unit) in enumerate(zip(header.names, cells, texts, units, strict=True), start=1):
        if cell:
            _refuse_unit(place, name, text, unit, header, source, is_measured=meant.get(name) == "number")
            found[name] = text
    file.readline()
    return found


def _refuse_unit(
    place: int, name: str, text: str, unit: Unit | None, header: Header, source: Source, *, is_measured: bool
) -> None:
    """Refuse an unknown unit in a row of units, or one that differs from that of its column."""
    number = header.line + 1
    if not name:
        raise source.line_error(header.line, _without_name(place, number, text))
    if unit is None and is_measured:
        what = f"this looks like a row of units, but {text!r} below {name!r} is none that is known here: empty that "
        what += f"cell; or remove the row, and give units with the columns, {file_entry('force_x', 'Fx[mN]')}"
        raise source.line_error(number, what)
    stated = header.descriptions.get(name, {}).get("units")
    if stated is not None and (is_measured or None not in (unit, unit_of(stated))) and units_disagree(stated, text):
        what = f"column {name!r} is in [{text}] here, and in [{stated}] in line {header.heads[name]}"
        raise source.line_error(number, f"{what}: leave out the one that is wrong")


def _without_brackets(cell: str) -> str:
    match = _BRACKETS.fullmatch(cell)
    return cell if match is None else (match["square"] or match["round"] or "").strip()
