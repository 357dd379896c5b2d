"""The calibration of a rig on a gauge, in one folder."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import xarray as xr

from tactile_bayes.checks import check_probability
from tactile_bayes.contours import Contour
from tactile_bayes.diagnostics.verdicts import verdicts
from tactile_bayes.errors import InferenceError
from tactile_bayes.inference.contour import infer_rig
from tactile_bayes.inference.parameters.rig_prior import rig_prior
from tactile_bayes.load_cell import LoadCell
from tactile_bayes.runs.folder import Folder, Run
from tactile_bayes.runs.names import RIG
from tactile_bayes.uncertainty.summary import summary

__all__ = ["RigRun", "calibrate_rig_into"]


@dataclass(frozen=True)
class RigRun(Run[xr.DataTree]):
    """Result of `calibrate_rig_into`.

    Attributes
    ----------
    summary : xr.Dataset
        From `summary`.
    messages : tuple of str
        The verdicts on each record, and what `infer --rig` takes over.
    """

    summary: xr.Dataset
    messages: tuple[str, ...]


def calibrate_rig_into(
    out: str | os.PathLike[str],
    records: Sequence[tuple[xr.Dataset, LoadCell | None]],
    *,
    contour: Contour,
    probability: float = 0.95,
    rig: xr.DataTree | None = None,
    **options: Any,
) -> RigRun:
    """Infer a rig from records of one gauge, one after the other, and write the result.

    Parameters
    ----------
    out : path-like
        Folder for rig.nc, summary.txt (which begins with the verdicts) and summary.csv; created if missing. Files of
        these names in it are replaced.
    records : sequence of (xr.Dataset, LoadCell or None)
        Records of the gauge, each with the load cell that is stated beside it; at least one.
    contour, rig, options
        Arguments and options of `infer_rig`.
    probability : float
        Probability of the intervals in the summary, in (0, 1).

    Returns
    -------
    RigRun
        The posterior after the last record, and the files.

    Raises
    ------
    RecordError, ParameterError, InferenceError
        As in `infer_rig`.
    """
    check_probability("probability", probability)
    messages = list[str]()
    for number, (measured, cell) in enumerate(records, start=1):
        found = infer_rig(measured, contour=contour, load_cell=cell, rig=rig, **options)
        which = f"Record {number}: " if len(records) > 1 else ""
        messages += [f"{which}{verdict}" for verdict in verdicts(found)]
        rig = found
    numbers = summary(found, probability)
    messages.append(_taken_over(found))
    with Folder(out, RIG) as folder:
        folder.write_netcdf("rig", "rig.nc", found)
        table = numbers.to_dataframe().to_string()
        folder.write_lines("verdicts", "summary.txt", (*messages, "", table, "", found.attrs["message"]))
        folder.write_table("summary", "summary.csv", numbers)
    return RigRun(found, folder.files, numbers, tuple(messages))


def _taken_over(rig: xr.DataTree) -> str:
    try:
        prior = rig_prior(rig)
    except InferenceError as error:
        return f"No other record can use this rig: {error}"
    return (
        f"infer --rig takes over {', '.join(prior.priors)}, as a density whose quantiles are off those of the draws by "
        f"{prior.error:.2f} standard deviations at most."
    )
