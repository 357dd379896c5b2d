"""Trust in a run: convergence, the check of the record, and the fit of single samples, in sentences and tables."""

from __future__ import annotations

from collections import Counter
from typing import Any

import numpy as np
import xarray as xr

from tactile_bayes.calibration.summary import CLAIMS
from tactile_bayes.diagnostics.predictive_check import DISCREPANCIES
from tactile_bayes.inference.result import is_streamed
from tactile_bayes.reconstruction import AXIAL_ALARM
from tactile_bayes.record import carried_sweeps, present_channels
from tactile_bayes.report.findings import Findings
from tactile_bayes.report.readings_figure import channel_names
from tactile_bayes.report.wording import PageTable, chance, fixed, percent, rows_of, sentence, shown_as
from tactile_bayes.tasks.documents import read_json

_COVERAGE = ("coverage", "coverage_error", "coverage_replicates")
_WIDTH = "width of the band"  # kind of a finding that is none against the result


def trust_of(findings: Findings) -> dict[str, Any]:
    """Return what is said on trust, by names in the template."""
    found, said = findings.trust, findings.checked.messages
    attrs = {"words": "", "summary": ""} if found is None else found.attrs
    moved_enough = "particles moved enough" if is_streamed(findings.posterior.attrs) else "ensembles converged"
    return {
        "is_well": findings.checked.is_well,
        "verdicts": [finding for finding in said if finding.kind != _WIDTH],
        "width": [finding for finding in said if finding.kind == _WIDTH],
        "trust": str(attrs["words"]).splitlines(),
        "trust_summary": str(attrs["summary"]),
        "trust_tables": [] if found is None else _trust_tables(found),
        "convergence_head": f"Have the {moved_enough}?",
        "convergence": _convergence(findings),
        "check_messages": _check_messages(findings),
        "check": _check_table(findings),
        "causes": _causes_table(findings),
        "contacts": contacts_messages(findings),
    }


def _convergence(findings: Findings) -> list[str]:
    """Return sentences on the end of the run and on its ensembles."""
    attrs, stats = findings.posterior.attrs, findings.posterior["sample_stats"].to_dataset()
    said = [sentence(f"{attrs['message']}.")]
    chains, rates = stats.sizes["chain"], stats["acceptance_rate"].values
    if np.isnan(rates).all():  # of a stream, or of another sampler
        return said
    return [
        *said,
        f"{chains} independent ensembles of {int(stats.attrs['walkers'])} walkers made {chains * stats.sizes['draw']} "
        f"draws; they accepted {', '.join(percent(round(rate, 2)) for rate in rates)} of their proposals.",
    ]


def _trust_tables(found: xr.Dataset) -> list[PageTable]:
    """Return the tables of `tactile-bayes trust`: parts, claims, other assumptions, effect of the prior."""
    parts = []
    for name, p_value, sd, moves in rows_of(found, "part", "part_p_value", "part_sd", "moves"):
        sizes, most = np.abs(moves), ["", ""]
        if np.isfinite(sizes).any():
            most = [fixed(float(np.nanmax(sizes)), ".1f"), str(found["parameter"].values[np.nanargmax(sizes)])]
        parts.append([name, chance(p_value), fixed(sd, ".1f"), *most])
    heads = ["this part alone", "p", "off by [sd]", "moves by [sd]", "most"]
    tables = [PageTable("Prediction of the rest of the record by each part", heads, parts)]
    if "claim" in found.dims:
        claims = [
            [CLAIMS[name], f"{percent(round(share, 3))} ± {percent(round(error, 3))}", str(int(count))]
            for name, share, error, count in rows_of(found, "claim", *_COVERAGE)
        ]
        stated = f"stated with {percent(float(found.attrs['probability']))}"
        tables.append(PageTable("Records like this one, simulated and inferred", [stated, "holds in", "of"], claims))
    if "assumption" in found.dims:
        others = [
            [name, fixed(in_gap, ".2f"), fixed(beside, ".2f"), "yes" if fits else "no"]
            for name, in_gap, beside, fits in rows_of(found, "assumption", "moved_in_gap", "moved_beside", "fits")
        ]
        heads = ["assumption instead", "in the gap", "beside it", "fits"]
        tables.append(PageTable("Distance that the median of the band moves, over its width", heads, others))
    rows = [
        [name, *(fixed(value, ".3f") for value in row), by]
        for name, row, by in rows_of(found, "quantity", "sensitivity", "set_by")
    ]
    heads = ["quantity", "contour's prior", "rig's prior", "record", "set by"]
    return [*tables, PageTable("Sensitivity to prior and record (0.05 matters)", heads, rows)]


def _check_messages(findings: Findings) -> list[str]:
    """Return sentences on the check of the record."""
    check = findings.checked.predictive
    if check is None:
        return ["There are too few draws for a check of the record."]
    if check.attrs["not_checked"]:
        return [f"The record was not checked against the predictions: {check.attrs['not_checked']}."]
    outcome = "passes" if check.attrs["passed"] else "FAILS"
    said = [
        f"The record {outcome} the check against {check.attrs['predictions']} records that the posterior predicts: "
        f"p = {chance(float(check['overall_p_value']))}, the share of all, this one included, that are at least "
        "as far off."
    ]
    outside, words = [], channel_names(findings.record)
    for name in present_channels(findings.record):
        values = findings.record[name].values
        lower, upper = (findings.interval[f"{name}_{edge}"].values for edge in ("lower", "upper"))
        count = int(np.count_nonzero((values < lower) | (values > upper)))
        outside.append(f"{count} of {values.size} in {words[name]}")
    share, expected = percent(findings.probability), percent(round(1.0 - findings.probability, 9))
    return [*said, f"Outside its {share} intervals are {', '.join(outside)}; {expected} would be usual."]


def _check_table(findings: Findings) -> PageTable | None:
    """Return the misfit by channel; None if there are too few draws."""
    check = findings.checked.predictive
    if check is None:
        return None
    record, rows = findings.record, []
    words, carried = channel_names(record), carried_sweeps(record)
    for name in check["channel"].values.tolist():
        of_channel = check.sel(channel=name)
        residual, sweep = float(of_channel["worst_residual"]), int(of_channel["worst_sweep"])
        low, high = sorted(np.degrees([float(of_channel["worst_from"]), float(of_channel["worst_to"])]))
        stretch = f"{low:.0f}° to {high:.0f}°".replace("-", "−")
        if sweep in carried:
            travels = [float(of_channel[f"worst_{end}_travel"]) for end in ("from", "to")]
            length = shown_as("contact_x", record["base_x"].attrs, travels)
            stretch = f"{length.text(travels[0], 3)} to {length.full(travels[1], 3)} of travel"
        off = shown_as(name, record[name].attrs, [residual]).full(residual, 2)
        p_values = of_channel["p_value"].sel(discrepancy=list(DISCREPANCIES)).values.tolist()
        rows.append([words[name], *map(chance, p_values), f"sweep {sweep}, {stretch}", off])
    heads = ["channel", *DISCREPANCIES, "worst stretch", "off there by"]
    return PageTable("Misfit by channel: shares of predicted records that are at least as discrepant", heads, rows)


def _causes_table(findings: Findings) -> PageTable | None:
    """Return what may be wrong where the record contradicts the model; None if nothing was tried."""
    if "causes" not in findings.posterior.children:
        return None
    causes = findings.posterior["causes"].to_dataset()
    if "misread" in causes.attrs:
        return None
    columns = ("cause", "log_evidence", "describes", "sought", "remedy")
    rows = [
        [name, fixed(gain, ".0f"), ("yes" if describes else "no") if sought else "not tried", remedy]
        for name, gain, describes, sought, remedy in rows_of(causes, *columns)
    ]
    return PageTable("What may be wrong", ["cause", "log-evidence", "describes the record", "infer with"], rows)


def contacts_messages(findings: Findings) -> list[str]:
    """Return sentences on the statuses of single samples, and on the agreement of their four numbers with a rod."""
    contacts = findings.contacts
    if contacts is None:
        present = present_channels(findings.record)
        missing = [words for name, words in channel_names(findings.record).items() if name not in present]
        were = "was" if len(missing) == 1 else "were"
        return [f"Contact points take all three channels, and {' and '.join(missing)} {were} not measured."]
    fates = Counter(contacts["status"].values.tolist()).most_common()
    said = ["Single samples: " + ", ".join(f"{count} {fate}" for fate, count in fates) + "."]
    attrs = contacts.attrs
    probability, score = (float(attrs.get(key, np.nan)) for key in ("misfit_probability", "axial_score"))
    if np.isfinite(probability) and findings.checked.knows_misfit:
        noise, but = "noise", ""
        if findings.is_rejected:
            noise = "noise of the inferred scale"
            but = ": this noise includes what the contour does not explain, so that this is no evidence"
        said.append(
            f"Four numbers determine three of a contact; the remaining misfit sums to {float(attrs['misfit_sum']):.4g} "
            f"over {int(attrs['misfit_samples'])} samples, which {noise} explains with probability "
            f"{chance(probability)}{but}."
        )
    if np.isfinite(score):
        agreement = "so that the force along the rod agrees with the moment"
        if abs(score) > AXIAL_ALARM:
            large = "too large: check the zero of the drive angle, the axes of the forces, and the rod"
            agreement = "too small, as with friction" if score < 0.0 else large
        known = "inferred" if "friction" in read_json(findings.posterior.attrs["nuisances"], "nuisances") else "stated"
        said.append(
            "In tangential contact the force along the rod at the pivot follows from the moment, and from the friction "
            f"that was {known}: the mean deviates by {fixed(score, '+.2f')} standard errors, {agreement}."
        )
    return said
