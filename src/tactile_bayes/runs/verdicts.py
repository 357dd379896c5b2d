"""Verdicts, each in one folder: a calibration, the trust in a run, and a comparison of families."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from tactile_bayes import plotting
from tactile_bayes.assessment.trust import trust
from tactile_bayes.calibration.calibrate import calibrate
from tactile_bayes.calibration.replicate import REPLICATES
from tactile_bayes.comparison.families import compare_families
from tactile_bayes.diagnostics.units_and_signs import unit_and_sign_findings
from tactile_bayes.errors import InferenceError
from tactile_bayes.inference.ensembles import Progress
from tactile_bayes.rig.rig import Rig, rig_of
from tactile_bayes.runs.folder import Folder, Run, posterior_in
from tactile_bayes.runs.names import CALIBRATION, COMPARISON, TRUST

REPLICATES_FOLDER = "trust"  # subfolder of the replicates, from which a stopped run resumes
_WIDTHS = {0.5: "probability_half_width", 2.0: "probability_twice_width"}


def calibrate_into(out: str | os.PathLike[str], **options: Any) -> Run[xr.Dataset]:
    """Calibrate, and write the result to a folder."""
    found = calibrate(out=out, **options)
    with Folder(out, CALIBRATION) as folder:
        folder.files["replicates"] = folder.path / REPLICATES.file
        folder.write_netcdf("calibration", "calibration.nc", found)
        folder.write_lines("verdict", "verdict.txt", [found.attrs["verdict"]])
        if np.any(found["ranks"].values >= 0):
            folder.draw("ranks", "ranks.png", plotting.calibration_ranks, found)
        folder.draw("coverage", "coverage.png", plotting.coverage, found)
    return Run(found, folder.files)


def trust_into(
    run: str | os.PathLike[str], out: str | os.PathLike[str] | None = None, **options: Any
) -> Run[xr.Dataset]:
    """Judge the posterior of a run, and write the result."""
    path = posterior_in(Path(run))
    place = path.parent if out is None else Path(out)
    found = trust(path, out=place / REPLICATES_FOLDER, **options)
    with Folder(place, TRUST) as folder:
        folder.write_netcdf("trust", "trust.nc", found)
        folder.write_lines("words", "trust.txt", (found.attrs["summary"], "", *found.attrs["words"].splitlines()))
        if "assumption" in found.dims:
            folder.draw("figure", "assumptions.png", plotting.assumptions, found)
    return Run(found, folder.files)


def compare_into(
    measured: xr.Dataset,
    out: str | os.PathLike[str],
    *,
    rig: Rig | None = None,
    progress: Callable[[str, Progress], object] = lambda name, progress: None,
    **options: Any,
) -> Run[xr.Dataset]:
    """Compare families of contours, and write the result to a folder."""
    path = Path(out)

    def note(name: str, done: Progress) -> None:
        path.mkdir(parents=True, exist_ok=True)  # now: all options are checked, and sampling may take hours
        progress(name, done)

    try:
        comparison = compare_families(measured, rig=rig, progress=note, **options)
    except InferenceError as error:
        raise type(error)(" ".join((str(error), *unit_and_sign_findings(measured, rig_of(rig).load_cell)))) from error
    return Run(comparison, write_comparison(comparison, path))


def write_comparison(comparison: xr.Dataset, out: str | os.PathLike[str]) -> dict[str, Path]:
    """Write a comparison to a folder, and return the files by content."""
    with Folder(out, COMPARISON) as folder:
        folder.write_netcdf("comparison", "comparison.nc", comparison)
        folder.write_table("table", "comparison.csv", _by_family(comparison))
        folder.draw("families", "families.png", plotting.families, comparison)
    return folder.files


def _by_family(comparison: xr.Dataset) -> xr.Dataset:
    """Return the variables with one number for each family; True is 1, False is 0."""
    columns = {}
    for name, values in comparison.data_vars.items():
        if values.dims == ("family",):
            columns[str(name)] = values.astype(int) if values.dtype == bool else values
        if name == "probability":
            by_width = comparison["probability_by_width"]
            columns |= {column: by_width.sel(prior_width=width, drop=True) for width, column in _WIDTHS.items()}
    return xr.Dataset(columns)
