"""The folder of a run: writing and finding results."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Generic, Self, TypeVar

import numpy as np
import xarray as xr

from tactile_bayes.errors import InferenceError
from tactile_bayes.plotting.style import own_style, save_figure
from tactile_bayes.record.netcdf import RESULT_FORMAT, write_netcdf
from tactile_bayes.tasks import errors_of, replace_together

Result = TypeVar("Result")

# Other contents of a folder, by a file that shows them.
_OTHERS = {"comparison.nc": "a comparison of shapes", "design.nc": "a design", "manifest.json": "a data set"}


@dataclass(frozen=True)
class Run(Generic[Result]):
    """Result of the library function behind a command, and its files by content."""

    result: Result
    files: Mapping[str, Path]


class Folder:
    """A folder of results, created if missing, in which the files of one run replace those of the former one together.

    They are moved into it at the end of a `with` block, in place of all `names` that such a run can write.
    """

    def __init__(self, out: str | os.PathLike[str], names: Sequence[str]) -> None:
        self.path = Path(out)
        self.path.mkdir(parents=True, exist_ok=True)
        self.names = tuple(names)
        self.files: dict[str, Path] = {}  # those written so far, by content

    def __enter__(self) -> Self:
        self._replacing = replace_together(self.path, self.names)
        self._new = self._replacing.__enter__()
        return self

    def __exit__(self, *error: Any) -> None:
        self._replacing.__exit__(*error)

    @contextmanager
    def file(self, what: str, name: str) -> Iterator[Path]:
        """Yield a temporary path to write to; the file is listed once the block has succeeded."""
        if name not in self.names:
            raise ValueError(f"{name} is not among the files of this folder: {', '.join(self.names)}")
        with errors_of(self.path / name):
            yield self._new / name
        self.files[what] = self.path / name

    def write_lines(self, what: str, name: str, lines: Iterable[str]) -> None:
        """Write lines of text."""
        with self.file(what, name) as temporary:
            temporary.write_text("".join(f"{line}\n" for line in lines), encoding="utf-8")

    def write_table(self, what: str, name: str, table: xr.Dataset) -> None:
        """Write a dataset as CSV."""
        with self.file(what, name) as temporary:
            table.to_dataframe().to_csv(temporary)

    def write_summary(self, messages: Iterable[str], numbers: xr.Dataset, message: str) -> None:
        """Write a summary of a posterior: beside messages and that of its sampling, and alone as CSV."""
        lines = (*messages, "", numbers.to_dataframe().to_string(), "", message)
        self.write_lines("messages", "summary.txt", lines)
        self.write_table("summary", "summary.csv", numbers)

    def write_netcdf(self, what: str, name: str, content: xr.Dataset | xr.DataTree) -> None:
        """Write a dataset or a tree as NetCDF, with checksums."""
        content = content.copy(deep=False)
        content.attrs |= RESULT_FORMAT
        with self.file(what, name) as temporary:
            write_netcdf(content, temporary)

    def draw(self, what: str, name: str, plot: Callable[..., Any], *arguments: Any, **options: Any) -> None:
        """Write the figure of the Axes that a function returns, as PNG."""
        with own_style():
            figure = np.ravel(plot(*arguments, **options))[0].figure
            with self.file(what, name) as temporary:
                save_figure(figure, temporary, "png")
        if "matplotlib.pyplot" in sys.modules:  # it would keep the figure; to load it takes a while
            sys.modules["matplotlib.pyplot"].close(figure)


def panels(rows: int, columns: int, width: float, height: float, **options: Any) -> Any:
    """Return Axes of a new figure outside pyplot, shape (rows, columns); width and height are in inches."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width, height), layout="constrained")
    return figure.subplots(rows, columns, squeeze=False, **options)


def posterior_in(run: Path) -> Path:
    """Return the path of the posterior in the folder of a run, without opening it."""
    correction = "give the folder that `tactile-bayes infer RECORD --out FOLDER` has written"
    if not run.exists():
        raise InferenceError(f"there is no folder {run}: {correction}")
    if not run.is_dir():
        raise InferenceError(f"{run} is a file: {correction}")
    path = run / "posterior.nc"
    if not path.is_file():
        found = next((f", but {kind}" for name, kind in _OTHERS.items() if (run / name).exists()), "")
        raise InferenceError(f"{run} holds no posterior.nc{found}: {correction}")
    return path
