"""The findings of a run: its results and what follows from them, for a report."""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import xarray as xr

from tactile_bayes.assessment.trust import draws_digest
from tactile_bayes.diagnostics.result_check import Check, budget_if_any, check, probability_of
from tactile_bayes.errors import InferenceError
from tactile_bayes.inference.experiment import contact_points
from tactile_bayes.inference.result import read_result, record_of
from tactile_bayes.load_cell.zero_load import quiet_zero_load
from tactile_bayes.record import record_hash
from tactile_bayes.record.netcdf import read_netcdf
from tactile_bayes.report.contour_figure import ContourFindings
from tactile_bayes.runs.folder import posterior_in
from tactile_bayes.uncertainty.band import contour_band
from tactile_bayes.uncertainty.overlay import read_overlay
from tactile_bayes.uncertainty.predictive_interval import predictive_interval
from tactile_bayes.uncertainty.rod_reach import reach
from tactile_bayes.uncertainty.summary import gap_if_any, summary

FINDING_STEPS = 4  # number of steps that `findings_of` reports: posterior, contacts, check, and all the rest
_GROUPS = ("posterior", "sample_stats", "posterior_predictive", "events", "observed_data", "constant_data", "prior")
_SAID = ("family", "units", "friction", "nuisances", "priors", "settings", "seed", "message", "data_sha256")
COMPARISON = ("probability", "log_evidence", "p_value", "fits", "sampled")


@dataclass(frozen=True)
class Findings(ContourFindings):
    """Content of a report, besides that of the figures of the contour."""

    interval: xr.Dataset  # posterior predictive, of the readings
    numbers: xr.Dataset  # parameters, from `uncertainty.summary`
    budget: xr.Dataset | None  # of the band's width; None if there is no band
    checked: Check
    zero: xr.Dataset  # unloaded stretches, from `zero_load`
    comparison: xr.Dataset | None  # of families
    trust: xr.Dataset | None  # from `tactile-bayes trust`
    posterior_sha256: str  # digest of the file
    record_sha256: str  # digest of the record in it, from `record_hash`

    @property
    def is_rejected(self) -> bool:
        """True if the record fails its check, so that the contour must not be used."""
        attrs = {} if self.checked.predictive is None else self.checked.predictive.attrs
        return not attrs.get("passed", True) and not attrs["not_checked"]


def findings_of(
    run: Path,
    compare: Path | None = None,
    progress: Callable[[int], object] = lambda done: None,
    overlay: Path | None = None,
) -> Findings:
    """Read a run, and compute the content of its report.

    Everything follows from posterior.nc, which also holds the record; the tables that `infer` writes beside it hold the
    same numbers.
    """
    path = posterior_in(run)
    sha256, posterior = hashlib.sha256(path.read_bytes()).hexdigest(), contour_posterior(path)
    record = record_of(posterior)
    comparison = _comparison_in(run, compare, str(posterior.attrs["data_sha256"]))
    trust = _trust_in(run, posterior)
    probability = probability_of(posterior)
    other = None if overlay is None else read_overlay(overlay, posterior, probability)
    progress(1)
    contacts = contact_points(record, posterior)
    progress(2)
    checked = check(posterior, contacts, trust)
    progress(3)
    edges = gap_if_any(posterior, probability)
    zero = quiet_zero_load(record)
    x = reach(posterior)
    found = Findings(
        posterior=posterior,
        record=record,
        contacts=contacts,
        band=contour_band(posterior, x, probability),
        shape=contour_band(posterior, x, probability, align="translation"),
        interval=predictive_interval(posterior, probability),
        edges=edges,
        numbers=summary(posterior, probability, edges),
        budget=checked.budget if checked.is_well else budget_if_any(posterior),
        checked=checked,
        zero=zero,
        comparison=comparison,
        trust=trust,
        posterior_sha256=sha256,
        record_sha256=record_hash(record),
        probability=probability,
        overlay=other,
    )
    progress(FINDING_STEPS)
    return found


def contour_posterior(path: Path) -> xr.DataTree:
    """Read a result of `infer_contour`, and refuse anything else."""
    posterior = read_result(path)
    lacks = [name for name in _GROUPS if name not in posterior.children]
    lacks += [name for name in _SAID if name not in posterior.attrs]
    if lacks:
        raise InferenceError(
            f"{path} is a posterior, but not of a contour (it has no {', '.join(lacks)}): give a folder of "
            "`tactile-bayes infer`"
        )
    return posterior


def _trust_in(run: Path, posterior: xr.DataTree) -> xr.Dataset | None:
    path = run / "trust.nc"
    if not path.is_file():
        return None
    again = "run `tactile-bayes trust` again, or remove it"
    found = read_netcdf(path, xr.open_dataset, lambda what: InferenceError(f"{path} {what}: {again}"))
    if found.attrs.get("draws_sha256") != draws_digest(posterior):
        raise InferenceError(f"{path} is of another posterior: {again}")
    return found


def _comparison_in(run: Path, compare: Path | None, data_sha256: str) -> xr.Dataset | None:
    path = (compare or run) / "comparison.nc"
    correction = "give --compare the folder that `tactile-bayes compare RECORD --out FOLDER` has written"
    if not path.is_file():
        if compare is None:
            return None
        raise InferenceError(f"{compare} holds no comparison.nc: {correction}")
    found = read_netcdf(path, xr.open_dataset, lambda what: InferenceError(f"{path} {what}: compare again"))
    if "family" not in found.dims or not {*COMPARISON} <= set(found.data_vars) or "verdict" not in found.attrs:
        raise InferenceError(f"{path} is no comparison of shapes: {correction}")
    if "data_sha256" not in found.attrs:
        if compare is None:
            return None
        raise InferenceError(
            f"{path} does not state which record it is of: compare again, the record of the run with the same options"
        )
    if found.attrs["data_sha256"] != data_sha256:
        raise InferenceError(
            f"{path} is of another record, or of another rod, than the run: compare the record of the run, with the "
            "same options"
        )
    return found
