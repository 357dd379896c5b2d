"""A comparison of families, in one folder."""

from __future__ import annotations

import errno
import os
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import xarray as xr

from tactile_bayes.errors import InferenceError
from tactile_bayes.files import write_atomically
from tactile_bayes.inference.ensembles import Progress
from tactile_bayes.load_cell import LoadCell
from tactile_bayes.netcdf import write_netcdf
from tactile_bayes.runs.picture import write_picture
from tactile_bayes.uncertainty.family_comparison import compare_families
from tactile_bayes.uncertainty.suspicions import suspicions

__all__ = ["ComparisonRun", "compare_into", "write_comparison"]

_WIDTHS = {0.5: "probability_half_width", 2.0: "probability_twice_width"}


@dataclass(frozen=True)
class ComparisonRun:
    """What `compare_into` made.

    Attributes
    ----------
    comparison : xr.Dataset
        From `compare_families`.
    files : mapping of str to Path
        By what they hold.
    """

    comparison: xr.Dataset
    files: Mapping[str, Path]


def compare_into(
    measured: xr.Dataset,
    out: str | os.PathLike[str],
    *,
    load_cell: LoadCell | None = None,
    progress: Callable[[str, Progress], object] = lambda name, progress: None,
    **options: Any,
) -> ComparisonRun:
    """Compare families of contours, and write what comes out to a folder.

    Parameters
    ----------
    measured : xr.Dataset
        A record.
    out : path-like
        Folder for comparison.nc, comparison.csv and families.png; made if it is not there, once sampling goes on. Files
        of these names in it are replaced.
    load_cell, progress, options
        As `compare_families` takes them.

    Returns
    -------
    ComparisonRun

    Raises
    ------
    RecordError, ParameterError, InferenceError
        As `compare_families`; where no contour is found, with what speaks for a wrong unit or sign.
    OSError
        If the folder cannot be made.
    """
    folder = Path(out)
    above = next(place for place in (folder, *folder.absolute().parents) if place.exists())
    if not above.is_dir():
        raise NotADirectoryError(errno.ENOTDIR, os.strerror(errno.ENOTDIR), str(folder))

    def note(name: str, done: Progress) -> None:
        folder.mkdir(parents=True, exist_ok=True)  # now: all options are checked, and hours of sampling lie ahead
        progress(name, done)

    try:
        comparison = compare_families(measured, load_cell=load_cell, progress=note, **options)
    except InferenceError as error:
        raise type(error)(" ".join((str(error), *suspicions(measured, load_cell)))) from error
    folder.mkdir(parents=True, exist_ok=True)
    return ComparisonRun(comparison, write_comparison(comparison, folder))


def write_comparison(comparison: xr.Dataset, folder: Path) -> dict[str, Path]:
    """Write a comparison to a folder that is there; the files by what they hold."""
    files = {
        "comparison": folder / "comparison.nc",
        "table": folder / "comparison.csv",
        "families": folder / "families.png",
    }
    write_netcdf(comparison, files["comparison"])
    with write_atomically(files["table"]) as temporary:
        _by_family(comparison).to_dataframe().to_csv(temporary)
    _draw(comparison, files["families"])
    return files


def _by_family(comparison: xr.Dataset) -> xr.Dataset:
    """What there is one number for each family of; yes is 1, no is 0."""
    columns = {}
    for name, values in comparison.data_vars.items():
        if values.dims == ("family",):
            columns[str(name)] = values.astype(int) if values.dtype == bool else values
        if name == "probability":
            by_width = comparison["probability_by_width"]
            columns |= {column: by_width.sel(prior_width=width, drop=True) for width, column in _WIDTHS.items()}
    return xr.Dataset(columns)


def _draw(comparison: xr.Dataset, path: Path) -> None:
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    from tactile_bayes import plotting
    from tactile_bayes.plotting.family_bars import panel_count, panel_height

    figure = Figure(figsize=(7.0, panel_height(comparison)), layout="constrained")
    FigureCanvasAgg(figure)
    panels = figure.subplots(1, panel_count(comparison), squeeze=False, sharey=True)
    plotting.families(comparison, axes=panels[0])
    write_picture(figure, path)
