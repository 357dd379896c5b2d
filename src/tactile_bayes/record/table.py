"""A table that may become a record: columns and attributes as they were found, and where that was."""

from __future__ import annotations

from collections.abc import Hashable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from tactile_bayes.errors import RecordError

__all__ = ["Cells", "Source", "Table", "table_of"]

Cells = tuple[NDArray[Any], Mapping[str, Any]]
"""The values of a column, shape (n_samples,), and its attributes."""

_LONGEST = 1500
"""Characters of a refusal."""


@dataclass(frozen=True)
class Source:
    """Where a table comes from, so that a refusal can point at it.

    Parameters
    ----------
    name : str
        Name of the file, if there is one.
    lines : sequence or array of int, optional
        The line of the file that each sample begins in.
    heads : mapping of str to int, optional
        The line of the file that says what a column is.
    aliases : mapping of str to str, optional
        What a column is called in the file, if that is something else.
    names : sequence of str, optional
        The columns of the file.
    origins : mapping of str to str, optional
        What stands for a column in the file, with sign and zero, as `read_record` takes it, less the unit.
    stated : mapping of str to int, optional
        The line of the file that states an attribute.
    """

    name: str = ""
    lines: Sequence[int] | NDArray[np.int64] | None = None
    heads: Mapping[str, int] = field(default_factory=dict)
    aliases: Mapping[str, str] = field(default_factory=dict)
    names: Sequence[str] = ()
    origins: Mapping[str, str] = field(default_factory=dict)
    stated: Mapping[str, int] = field(default_factory=dict)

    def row(self, sample: int) -> str:
        """What a sample is called."""
        return f"sample {sample}" if self.lines is None else f"line {self.lines[sample]}"

    def error(self, what: str) -> RecordError:
        """A refusal of the table."""
        if len(what) > _LONGEST:  # what a file has in it may be of any length; the remedy is at the end
            what = f"{what[: _LONGEST // 2]} … {what[-_LONGEST // 2 :]}"
        what = what.replace("\0", "\\0")  # terminals and logs show none
        return RecordError(f"{self.name}: {what}" if self.name else what)

    def line_error(self, line: int, what: str) -> RecordError:
        """A refusal that points at a line of the file."""
        return self.error(f"line {line}: {what}")

    def cell_error(self, sample: int, column: str, what: str) -> RecordError:
        """A refusal that points at a cell."""
        return self.error(f"{self.row(sample)}, {self.column(column)}: {what}")

    def column_error(self, column: str, what: str) -> RecordError:
        """A refusal that points at what is said of a column."""
        return self._error_at(self.heads.get(column), f"{self.column(column)} {what}")

    def attribute_error(self, name: str, what: str) -> RecordError:
        """A refusal that points at an attribute."""
        return self._error_at(self.stated.get(name), f"attribute {name!r} {what}")

    def _error_at(self, line: int | None, what: str) -> RecordError:
        return self.error(what if line is None else f"line {line}, {what}")

    def column(self, name: str) -> str:
        """What a column is called."""
        alias = self.aliases.get(name, name)
        return f"column {name!r}" if alias == name else f"column {name!r} ({alias!r} in the file)"


@dataclass(frozen=True)
class Table:
    """What may become a record.

    Parameters
    ----------
    columns : mapping of str to Cells
        The columns, all of one length.
    attrs : mapping
        Attributes of the record.
    source : Source
        Where both come from.
    """

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
    """The table in a dataset, if all its variables have the dimension of the samples alone."""
    for name, variable in dataset.variables.items():
        if variable.dims != (dimension,):
            raise source.error(
                f"variable {str(name)!r} has dimensions {variable.dims}: a column of a record has the one dimension "
                "'sample'; drop the variable, or stack it"
            )
    columns = {str(name): (np.asarray(variable.values), variable.attrs) for name, variable in dataset.variables.items()}
    return Table(columns, dataset.attrs, source)
