"""A table that may become a record: columns and attributes as read, and their source."""

from __future__ import annotations

from collections.abc import Hashable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from tactile_bayes.arrays import Index
from tactile_bayes.errors import RecordError

Cells = tuple[NDArray[Any], Mapping[str, Any]]  # values of a column, shape (n_samples,), and its attributes
_LONGEST = 1500  # largest number of characters of a message


@dataclass(frozen=True)
class Source:
    """Source of a table, for the positions in messages."""

    name: str = ""  # name of the file; "" for columns that come from none
    lines: Sequence[int] | NDArray[np.int64] | None = None  # first line of each sample in the file
    heads: Mapping[str, int] = field(default_factory=dict)  # line of the description of each column
    aliases: Mapping[str, str] = field(default_factory=dict)  # name of a column in the file, if it differs
    names: Sequence[str] = ()  # columns of the file
    # Origins of columns, with sign and zero, in the form of `FileFormat`, without the unit.
    origins: Mapping[str, str] = field(default_factory=dict)
    stated: Mapping[str, int] = field(default_factory=dict)  # line of each attribute
    units: Mapping[str, str] = field(default_factory=dict)  # unit that is stated for a column, before conversion
    remarks: Sequence[str] = ()  # commented lines without a meaning
    notes: Sequence[str] = ()  # what was assumed or left out as the file was read

    def row(self, sample: int) -> str:
        """Return the name of a sample in messages."""
        return f"sample {sample}" if self.lines is None else f"line {self.lines[sample]}"

    def error(self, what: str, samples: Index | slice | None = None) -> RecordError:
        """Make an error about the table, or about samples, whose lines it then has."""
        if len(what) > _LONGEST:  # quoted content may be of any length; the correction is at the end
            what = f"{what[: _LONGEST // 2]} … {what[-_LONGEST // 2 :]}"
        what = what.replace("\0", "\\0")  # terminals and logs show none
        error = RecordError(f"{self.name}: {what}" if self.name else what)
        if samples is not None and self.lines is not None:
            error.lines = tuple(np.asarray(self.lines)[samples].tolist())
        return error

    def line_error(self, line: int, what: str) -> RecordError:
        """Make an error with a line of the file."""
        return self.error(f"line {line}: {what}")

    def row_error(self, line: int, what: str) -> RecordError:
        """Make an error with a row of the file."""
        error = self.line_error(line, what)
        error.lines = (line,)
        return error

    def cell_error(self, samples: int | Index, column: str, what: str) -> RecordError:
        """Make an error with a cell, the first of those in which the same is wrong."""
        every = np.atleast_1d(samples)
        return self.error(f"{self.row(int(every[0]))}, {self.column(column)}: {what}", every)

    def column_error(self, column: str, what: str) -> RecordError:
        """Make an error with the description of a column."""
        return self._error_at(self.heads.get(column), f"{self.column(column)} {what}")

    def attribute_error(self, name: str, what: str) -> RecordError:
        """Make an error with an attribute."""
        return self._error_at(self.stated.get(name), f"attribute {name!r} {what}")

    def _error_at(self, line: int | None, what: str) -> RecordError:
        return self.error(what if line is None else f"line {line}, {what}")

    def column(self, name: str) -> str:
        """Return the name of a column in messages."""
        alias = self.aliases.get(name, name)
        return f"column {name!r}" if alias == name else f"column {name!r} ({alias!r} as given)"


@dataclass(frozen=True)
class Table:
    """Table that may become a record: columns, all of one length, and attributes, with their source."""

    columns: Mapping[str, Cells]
    attrs: Mapping[str, Any]
    source: Source

    @property
    def samples(self) -> int:
        """Number of samples."""
        return next((len(values) for values, _ in self.columns.values()), 0)

    def refuse_empty(self) -> None:
        """Refuse a table without samples."""
        if self.samples == 0:
            raise self.source.error("there are no samples: give at least one row below the column names")


def table_of(dataset: xr.Dataset, source: Source, dimension: Hashable = "sample") -> Table:
    """Return the table in a dataset, if all its variables have the dimension of the samples only."""
    for name, variable in dataset.variables.items():
        if variable.dims != (dimension,):
            what = f"variable {str(name)!r} has dimensions {variable.dims}: a column of a record has the one dimension "
            raise source.error(f"{what}'sample'; drop the variable, or stack it")
    columns = {str(name): (np.asarray(variable.values), variable.attrs) for name, variable in dataset.variables.items()}
    return Table(columns, dataset.attrs, source)
