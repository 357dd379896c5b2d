"""A calibration, in one folder."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from tactile_bayes.calibration.calibrate import calibrate
from tactile_bayes.calibration.ledger import REPLICATES
from tactile_bayes.files import write_atomically
from tactile_bayes.netcdf import write_netcdf
from tactile_bayes.runs.picture import write_picture

__all__ = ["CalibrationRun", "calibrate_into"]


@dataclass(frozen=True)
class CalibrationRun:
    """What `calibrate_into` made.

    Attributes
    ----------
    calibration : xr.Dataset
        From `calibrate`.
    files : mapping of str to Path
        By what they hold.
    """

    calibration: xr.Dataset
    files: Mapping[str, Path]


def calibrate_into(out: str | os.PathLike[str], **options: Any) -> CalibrationRun:
    """Calibrate, and write what comes out to a folder.

    Parameters
    ----------
    out : path-like
        Folder for replicates.json, which a run that was stopped goes on from, calibration.nc, verdict.txt, ranks.png
        and coverage.png; made if it is not there. Files of these names in it are replaced.
    options
        As `calibrate` takes them.

    Returns
    -------
    CalibrationRun

    Raises
    ------
    ParameterError, CalibrationError, TaskError
        As `calibrate`.
    """
    folder = Path(out)
    found = calibrate(out=folder, **options)
    files = {
        "replicates": folder / REPLICATES.file,
        "calibration": folder / "calibration.nc",
        "verdict": folder / "verdict.txt",
        "ranks": folder / "ranks.png",
        "coverage": folder / "coverage.png",
    }
    write_netcdf(found, files["calibration"])
    with write_atomically(files["verdict"]) as temporary:
        temporary.write_text(f"{found.attrs['verdict']}\n", encoding="utf-8")
    _draw(found, files["ranks"], files["coverage"])
    return CalibrationRun(found, files)


def _draw(found: xr.Dataset, ranks: Path, coverage: Path) -> None:
    from matplotlib import pyplot as plt

    from tactile_bayes import plotting

    with plt.ioff():
        axes = {coverage: plotting.coverage(found)}
        if np.any(found["ranks"].values >= 0):
            axes[ranks] = plotting.calibration_ranks(found)[0]
        for path, ax in axes.items():
            plt.sca(ax)
            write_picture(plt.gcf(), path)
            plt.close()
