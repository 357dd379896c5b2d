"""A sensitivity analysis, in one folder."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import xarray as xr

from tactile_bayes.files import write_atomically
from tactile_bayes.planning.error_map import CELLS, error_map
from tactile_bayes.planning.sensitivity import sensitivity

if TYPE_CHECKING:
    from matplotlib.axes import Axes

__all__ = ["SensitivityRun", "sensitivity_into"]


@dataclass(frozen=True)
class SensitivityRun:
    """What `sensitivity_into` made.

    Attributes
    ----------
    sensitivity : xr.DataTree
        From `sensitivity`.
    study : xr.Dataset or None
        From `error_map`, where one was asked for.
    files : mapping of str to Path
        By what they hold.
    """

    sensitivity: xr.DataTree
    study: xr.Dataset | None
    files: Mapping[str, Path]


def sensitivity_into(
    out: str | os.PathLike[str], *, study: Mapping[str, Any] | None = None, **options: Any
) -> SensitivityRun:
    """Analyse what errors of the sensor do, and write what comes out to a folder.

    Parameters
    ----------
    out : path-like
        Folder for sensitivity.nc, words.txt, amplification.png, information.png, noise_shares.png and
        required_noise.png; made if it is not there. Files of these names in it are replaced. A study is in its folder
        study: cells.json, which a run that was stopped goes on from, study.nc and study.png.
    study : mapping, optional
        What `error_map` takes beside `out`: its answer is made as well, after the rest has been written.
    options
        As `sensitivity` takes them.

    Returns
    -------
    SensitivityRun

    Raises
    ------
    ParameterError, ReachError
        As `sensitivity` and `error_map`.
    StudyError, TaskError
        As `error_map`.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     run = sensitivity_into(folder, seed=1, parts=["information"])
    ...     sorted(path.name for path in Path(folder).iterdir())
    ['information.png', 'sensitivity.nc', 'words.txt']
    """
    folder = Path(out)
    found = sensitivity(**options)
    folder.mkdir(parents=True, exist_ok=True)
    files = {"sensitivity": folder / "sensitivity.nc", "words": folder / "words.txt"}
    with write_atomically(files["sensitivity"]) as temporary:
        found.to_netcdf(temporary, engine="h5netcdf")
    with write_atomically(files["words"]) as temporary:
        temporary.write_text(f"{found.attrs['words']}\n", encoding="utf-8")
    for part in found.children:
        files[part] = folder / f"{part}.png"
        _write_figure(_DRAWN[part], found, files[part])
    if study is None:
        return SensitivityRun(found, None, files)
    inside = folder / "study"
    studied = error_map(out=inside, **study)
    files |= {"cells": inside / CELLS.file, "study": inside / "study.nc", "errors": inside / "study.png"}
    with write_atomically(files["study"]) as temporary:
        studied.to_netcdf(temporary, engine="h5netcdf")
    _write_figure(_draw_study, studied, files["errors"])
    return SensitivityRun(found, studied, files)


def _write_figure(draw: Callable[[Any], Axes], found: xr.DataTree | xr.Dataset, path: Path) -> None:
    from matplotlib import pyplot as plt

    with plt.ioff():
        plt.sca(draw(found))
        with write_atomically(path) as temporary:
            plt.savefig(temporary, dpi=200, format="png")
        plt.close()


def _two_panels() -> Any:
    from matplotlib import pyplot as plt

    return plt.subplots(2, 1, figsize=(7.0, 7.4), layout="constrained")[1]


def _draw_amplification(found: xr.DataTree) -> Axes:
    from tactile_bayes import plotting

    return plotting.amplification(found)


def _draw_information(found: xr.DataTree) -> Axes:
    from tactile_bayes import plotting

    return plotting.information(found)


def _draw_noise_shares(found: xr.DataTree) -> Axes:
    """Of both methods."""
    from tactile_bayes import plotting

    panels = _two_panels()
    plotting.noise_shares(found, reconstruction="raw", ax=panels[0])
    return plotting.noise_shares(found, reconstruction="constrained", ax=panels[1])


def _draw_required_noise(found: xr.DataTree) -> Axes:
    from tactile_bayes import plotting

    return plotting.required_noise(found)


def _draw_study(studied: xr.Dataset) -> Axes:
    """Of contacts and of bands."""
    from tactile_bayes import plotting

    panels = _two_panels()
    plotting.error_map(studied, quantity="across", ax=panels[0])
    return plotting.error_map(studied, quantity="touched", ax=panels[1])


_DRAWN: Mapping[str, Callable[[xr.DataTree], Axes]] = {
    "amplification": _draw_amplification,
    "information": _draw_information,
    "noise_shares": _draw_noise_shares,
    "required_noise": _draw_required_noise,
}
