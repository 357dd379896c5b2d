"""A calibration, in one folder."""

from __future__ import annotations

import os
from typing import Any

import numpy as np
import xarray as xr

from tactile_bayes import plotting
from tactile_bayes.calibration.calibrate import calibrate
from tactile_bayes.calibration.replicate import REPLICATES
from tactile_bayes.runs.folder import Folder, Run
from tactile_bayes.runs.names import CALIBRATION


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
