"""The folder of a run: writing and finding results."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Generic, TypeVar

import numpy as np
import xarray as xr

from tactile_bayes.errors import InferenceError
from tactile_bayes.record.netcdf import write_netcdf
from tactile_bayes.tasks import write_atomically

__all__ = ["Folder", "Run", "panels", "posterior_in"]

Result = TypeVar("Result")

_OTHERS = {"comparison.nc": "a comparison of shapes", "design.nc": "a design", "manifest.json": "a data set"}
"""Other contents of a folder, by a file that shows them."""


@dataclass(frozen=True)
class Run(Generic[Result]):
    """Result of a command.

    Attributes
    ----------
    result : object
        Result of the library function behind the command.
    files : mapping of str to Path
        Files by content.
    """

    result: Result
    files: Mapping[str, Path]


class Folder:
    """A folder of results, created if missing; each file is written whole, and replaces one of its name.

    Attributes
    ----------
    path : Path
    files : dict of str to Path
        Files written so far, by content.
    """

    def __init__(self, out: str | os.PathLike[str]) -> None:
        self.path = Path(out)
        self.path.mkdir(parents=True, exist_ok=True)
        self.files: dict[str, Path] = {}

    @contextmanager
    def file(self, what: str, name: str) -> Iterator[Path]:
        """Yield a temporary path to write to; the file exists, and is listed, once the block has succeeded."""
        with write_atomically(self.path / name) as temporary:
            yield temporary
        self.files[what] = self.path / name

    def write_lines(self, what: str, name: str, lines: Iterable[str]) -> None:
        """Write lines of text."""
        with self.file(what, name) as temporary:
            temporary.write_text("".join(f"{line}\n" for line in lines), encoding="utf-8")

    def write_table(self, what: str, name: str, table: xr.Dataset) -> None:
        """Write a dataset as CSV."""
        with self.file(what, name) as temporary:
            table.to_dataframe().to_csv(temporary)

    def write_netcdf(self, what: str, name: str, content: xr.Dataset | xr.DataTree) -> None:
        """Write a dataset or a tree as NetCDF, with checksums."""
        write_netcdf(content, self.path / name)
        self.files[what] = self.path / name

    def draw(self, what: str, name: str, plot: Callable[..., Any], *arguments: Any, **options: Any) -> None:
        """Write the figure of the Axes that a function returns, as PNG."""
        from matplotlib import pyplot as plt

        with plt.ioff():
            figure = np.ravel(plot(*arguments, **options))[0].figure
            with self.file(what, name) as temporary:
                figure.savefig(temporary, dpi=200, format="png")
            plt.close(figure)


def panels(rows: int, columns: int, width: float, height: float, **options: Any) -> Any:
    """Return Axes of a new figure outside pyplot, shape (rows, columns); width and height are in inches."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width, height), layout="constrained")
    return figure.subplots(rows, columns, squeeze=False, **options)


def posterior_in(run: Path) -> Path:
    """Return the path of the posterior in the folder of a run, without opening it.

    Raises
    ------
    InferenceError
        If the folder holds no posterior.

    Examples
    --------
    >>> posterior_in(Path("no/such/run"))
    Traceback (most recent call last):
    ...
    tactile_bayes.errors.InferenceError: there is no folder no/such/run: give the folder that `tactile-bayes infer RECORD --out FOLDER` has written
    """  # noqa: E501
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
