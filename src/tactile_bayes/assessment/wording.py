"""Conclusion and sentences on the trust in a posterior."""

from __future__ import annotations

from collections.abc import Collection

import numpy as np
import xarray as xr

from tactile_bayes.assessment.sampling_error import WANTED_SHARE
from tactile_bayes.diagnostics.result_check import HOLDS, NOT

_PRIOR = "holds, but the prior sets the gap"
UNCONVERGED = (
    "The posterior has not converged, so that replicates and other assumptions are left out: infer it again for longer."
)

_LARGEST = 2.0  # change of a parameter, in standard deviations, from which it is named
_WHERE = {"in_gap": "in the gap", "beside": "beside the gap"}
_SETS = {
    "record": "is set by the record",
    "both": "depends on the record, and on the prior as well",
    "prior": "is set by the prior",
}


def conclusion(
    found: xr.Dataset, check: xr.Dataset, parts: xr.Dataset, calibrated: xr.Dataset | None, is_converged: bool
) -> tuple[str, str]:
    """Return the conclusion, and a sentence with its reasons."""
    share = f"{found.attrs['probability']:.3g}"
    reasons = []
    if not check.attrs["passed"]:
        reasons.append(f"the record is unlike those that the posterior predicts (p = {_p(check.overall_p_value)})")
    if not parts.attrs["passed"]:
        reasons.append(_worst_part(parts))
    if calibrated is not None and calibrated.attrs["conclusion"] == "not calibrated":
        reasons.append("intervals do not hold for records like this one, so that sampler or likelihood is at fault")
    if not is_converged:
        reasons.append("the ensembles have not converged")
    if reasons:
        return NOT, f"Do not rely on the band, because {'; '.join(reasons)}."
    if "band in_gap" in found.quantity and str(found.set_by.sel(quantity="band in_gap").values) == "prior":
        return _PRIOR, (
            f"The band of probability {share} holds beside the gap, as far as this record shows, but in the gap it is "
            "set by the prior: it is as right as the prior is there."
        )
    return HOLDS, f"The band of probability {share} holds, as far as this record shows."


def _worst_part(parts: xr.Dataset) -> str:
    worst = parts.isel(part=int(np.argmin(parts["p_value"].values)))
    name, deviations = str(worst["part"].values), float(worst["sd"])
    if name == "noise":
        return f"the noise is not as stated ({deviations:.1f} standard deviations)"
    moves = worst["moves"]
    by_size = sorted(zip(parts["parameter"].values, moves.values, strict=True), key=lambda each: -abs(each[1]))
    named = [f"{parameter} by {move:+.1f}" for parameter, move in by_size[:2] if abs(move) > _LARGEST]
    further = f", where the rest moves {' and '.join(named)} standard deviations" if named else ""
    return (
        f"the parts of the record contradict one another: the {name} alone predicts the rest wrongly by "
        f"{deviations:.1f} standard deviations (p = {_p(parts['overall_p_value'])} for all parts){further}"
    )


def sentences(
    found: xr.Dataset, parts: xr.Dataset, calibrated: xr.Dataset | None, mute: Collection[str] = ()
) -> list[str]:
    """Return sentences on parts, prior, assumptions, calibration and sampling; `mute` parameters are not named."""
    said = [_of_parts(parts), *_of_prior(found, mute), *_of_assumptions(found)]
    if calibrated is not None:
        verdict = str(calibrated.attrs["verdict"])
        said.append(f"For objects and rigs like this one: {verdict[:1].lower()}{verdict[1:]}")
        for region, where in _WHERE.items():
            if int(calibrated["corrected"].sel(region=region)):
                factor = f"{float(calibrated['factor'].sel(region=region)):.2f}"
                wider = f"its half widths are multiplied by {factor}"
                said.append(f"Corrected: the band {where} is too narrow here, and {wider}.")
    largest = float(np.nanmax(found["share"].values))
    enough = f"{int(found['draws'])} draws, {float(found['effective_draws']):.0f} effective ones at its ends"
    if largest > WANTED_SHARE:
        enough += f"; for a tenth, draw {int(found['draws_needed'])}"
    return [*said, f"The sampling error of the ends of the band is at most {largest:.1%} of its width ({enough})."]


def _of_parts(parts: xr.Dataset) -> str:
    deviations = zip(parts["part"].values, parts["sd"].values, strict=True)
    named = ", ".join(f"{name} {sd:.1f}" for name, sd in deviations if name != "noise")
    agree = "agree" if parts.attrs["passed"] else "disagree"
    return (
        f"The parts of the record {agree} (p = {_p(parts['overall_p_value'])}, of {parts.attrs['records']} "
        f"predicted records): each alone predicts the rest with an error, in standard deviations, of {named}."
    )


def _of_prior(found: xr.Dataset, mute: Collection[str]) -> list[str]:
    said = []
    for region, where in _WHERE.items():
        if f"band {region}" in found.quantity:
            row, which = found.sel(quantity=f"band {region}"), ""
            set_by = str(row["set_by"].values)
            if set_by != "record":
                of_contour, of_rig = (float(row["sensitivity"].sel(component=c)) for c in ("contour", "rig"))
                which = f", that of the {'contour' if of_contour >= of_rig else 'rig'}"
            said.append(f"The band {where} {_SETS[set_by]}{which}.")
    names = found["quantity"].values[found["set_by"].values == "prior"].tolist()
    by_prior = [name for name in names if not name.startswith("band ") and name not in mute]
    if by_prior:
        said.append(f"Set by the prior: {', '.join(by_prior)}.")
    return said


def _of_assumptions(found: xr.Dataset) -> list[str]:
    if "assumption" not in found.dims:
        return []
    left = found.isel(assumption=np.flatnonzero(found["fits"].values))
    count = found.sizes["assumption"]
    if not left.sizes["assumption"]:
        return [f"The record rejects all of the {count} other assumptions that were tried."]
    said = [f"Of {count} other assumptions, the record does not reject {left.sizes['assumption']}."]
    for region, where in (("in_gap", "in the gap"), ("beside", "beside it")):
        moved = left[f"moved_{region}"].dropna("assumption")
        if moved.size:
            most, name = float(moved.max()), moved.idxmax().item()
            said.append(f"Most of all, “{name}” moves the median of the band {where}: by {most:.2f} of its width.")
    return said


def _p(value: xr.DataArray) -> str:
    return f"{float(value):.2g}"
