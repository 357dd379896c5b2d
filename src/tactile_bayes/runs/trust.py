"""The trust in a run, in its folder."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import xarray as xr

from tactile_bayes import plotting
from tactile_bayes.assessment.trust import trust
from tactile_bayes.runs.folder import Folder, Run, posterior_in
from tactile_bayes.runs.names import TRUST

REPLICATES_FOLDER = "trust"  # subfolder of the replicates, from which a stopped run resumes


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
