"""The calibration of a rig on a gauge, in one folder."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, cast

import xarray as xr

from tactile_bayes.checks import check_probability
from tactile_bayes.contours import Contour
from tactile_bayes.diagnostics.result_check import check
from tactile_bayes.inference.contour import calibrate_rig
from tactile_bayes.rig.rig import Rig
from tactile_bayes.rig.rig_prior import RigPrior
from tactile_bayes.runs.folder import Folder, Run
from tactile_bayes.runs.names import RIG
from tactile_bayes.uncertainty.summary import summary


@dataclass(frozen=True)
class RigRun(Run[xr.DataTree]):
    """The posterior of a calibrated rig, with the verdicts on each record, and what later records take over."""

    summary: xr.Dataset
    messages: tuple[str, ...]


def calibrate_rig_into(
    out: str | os.PathLike[str],
    records: Sequence[xr.Dataset],
    *,
    contour: Contour,
    rig: Rig,
    probability: float = 0.95,
    **options: Any,
) -> RigRun:
    """Calibrate a rig by records of one gauge, one after the other, and write the result."""
    check_probability("probability", probability)
    messages = list[str]()
    for number, measured in enumerate(records, start=1):
        rig = calibrate_rig(measured, contour=contour, rig=rig, **options)
        prior = cast(RigPrior, rig.calibration)
        found = cast(xr.DataTree, prior.posterior)
        which = f"Record {number}: " if len(records) > 1 else ""
        messages += [f"{which}{message}" for message in check(found).messages]
    assert prior is not None
    numbers = summary(found, probability)
    messages.append(
        f"With rig.toml, later records take over {', '.join(prior.priors)}, as a density whose quantiles are off those "
        f"of the draws by {prior.error:.2f} standard deviations at most."
    )
    with Folder(out, RIG) as folder:
        with folder.file("rig", "rig.toml") as temporary:
            rig.write(temporary)
        folder.write_netcdf("posterior", "rig.nc", found)
        folder.write_summary(messages, numbers, found.attrs["message"])
    return RigRun(found, folder.files, numbers, tuple(messages))
