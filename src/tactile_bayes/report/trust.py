"""Trust in a run: convergence, the check of the record, and the fit of single samples, in sentences and tables."""

from __future__ import annotations

from collections import Counter

import numpy as np

from tactile_bayes.calibration.summary import CLAIMS
from tactile_bayes.diagnostics.predictive_check import DISCREPANCIES
from tactile_bayes.inference.result import is_streamed
from tactile_bayes.reconstruction import AXIAL_ALARM
from tactile_bayes.record import CHANNELS, carried_sweeps, present_channels
from tactile_bayes.report.findings import Findings
from tactile_bayes.report.readings_figure import channel_names
from tactile_bayes.report.wording import PageTable, chance, fixed, percent, sentence, shown_as
from tactile_bayes.tasks.documents import read_json


def convergence(findings: Findings) -> list[str]:
    """Return sentences on the end of the run and on its ensembles."""
    attrs, stats = findings.posterior.attrs, findings.posterior["sample_stats"].to_dataset()
    said = [sentence(f"{attrs['message']}.")]
    if is_streamed(attrs):
        return said
    draws = stats.sizes["chain"] * stats.sizes["draw"]
    said.append(
        f"{stats.sizes['chain']} independent ensembles of {int(stats.attrs['walkers'])} walkers made {draws} draws; "
        f"they accepted {', '.join(percent(round(float(rate), 2)) for rate in stats['acceptance_rate'].values)} of "
        "their proposals."
    )
    return said


def trust_tables(findings: Findings) -> list[PageTable]:
    """Return the tables of `tactile-bayes trust`: parts, claims, effect of the prior; none if it was not run."""
    found = findings.trust
    if found is None:
        return []
    parts = []
    for name in found["part"].values:
        row = found.sel(part=name)
        moves = row["moves"].values
        most = "" if np.isnan(moves).all() else str(found["parameter"].values[np.nanargmax(np.abs(moves))])
        by = fixed(float(np.nanmax(np.abs(moves))), ".1f") if most else ""
        parts.append([str(name), chance(float(row["part_p_value"])), fixed(float(row["part_sd"]), ".1f"), by, most])
    heads = ["this part alone", "p", "off by [sd]", "moves by [sd]", "most"]
    tables = [PageTable("Prediction of the rest of the record by each part", heads, parts)]
    if "claim" in found.dims:
        claims = [
            [CLAIMS[str(name)], f"{percent(round(share, 3))} ± {percent(round(error, 3))}", str(int(count))]
            for name, share, error, count in zip(
                found["claim"].values,
                found["coverage"].values,
                found["coverage_error"].values,
                found["coverage_replicates"].values,
                strict=True,
            )
        ]
        stated = f"stated with {percent(float(found.attrs['probability']))}"
        tables.append(PageTable("Records like this one, simulated and inferred", [stated, "holds in", "of"], claims))
    if "assumption" in found.dims:
        others = [
            [
                str(row["assumption"].values),
                *(fixed(float(row[f"moved_{region}"]), ".2f") for region in ("in_gap", "beside")),
                "yes" if int(row["fits"]) else "no",
            ]
            for row in (found.isel(assumption=k) for k in range(found.sizes["assumption"]))
        ]
        heads = ["assumption instead", "in the gap", "beside it", "fits"]
        tables.append(PageTable("Distance that the median of the band moves, over its width", heads, others))
    rows = [
        [str(name), *(fixed(float(value), ".3f") for value in row), str(by)]
        for name, row, by in zip(
            found["quantity"].values, found["sensitivity"].values, found["set_by"].values, strict=True
        )
    ]
    heads = ["quantity", "contour's prior", "rig's prior", "record", "set by"]
    return [*tables, PageTable("Sensitivity to prior and record (0.05 matters)", heads, rows)]


def check_messages(findings: Findings) -> list[str]:
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
    outside, record = [], findings.record
    words = channel_names(record)
    for name in present_channels(record):
        values = record[name].values
        lower, upper = (findings.interval[f"{name}_{edge}"].values for edge in ("lower", "upper"))
        count = int(np.count_nonzero((values < lower) | (values > upper)))
        outside.append(f"{count} of {values.size} in {words[name]}")
    expected = percent(round(1.0 - findings.probability, 9))
    said.append(
        f"Outside its {percent(findings.probability)} intervals are {', '.join(outside)}; {expected} would be usual."
    )
    return said


def check_table(findings: Findings) -> PageTable | None:
    """Return the misfit by channel; None if there are too few draws."""
    check = findings.checked.predictive
    if check is None:
        return None
    record, rows = findings.record, []
    words, carried = channel_names(record), carried_sweeps(record)
    for name in check["channel"].values:
        of_channel = check.sel(channel=name)
        unit = shown_as(name, record[name].attrs, [float(of_channel["worst_residual"])])
        sweep = int(of_channel["worst_sweep"])
        low, high = sorted(np.degrees([float(of_channel["worst_from"]), float(of_channel["worst_to"])]))
        stretch = f"{low:.0f}° to {high:.0f}°".replace("-", "−")
        if sweep in carried:
            travels = [float(of_channel[f"worst_{end}_travel"]) for end in ("from", "to")]
            length = shown_as("contact_x", record["base_x"].attrs, travels)
            stretch = f"{length.text(travels[0], 3)} to {length.full(travels[1], 3)} of travel"
        rows.append(
            [
                words[str(name)],
                *(chance(float(of_channel["p_value"].sel(discrepancy=d))) for d in DISCREPANCIES),
                f"sweep {sweep}, {stretch}",
                unit.full(float(of_channel["worst_residual"]), 2),
            ]
        )
    heads = ["channel", *DISCREPANCIES, "worst stretch", "off there by"]
    return PageTable("Misfit by channel: shares of predicted records that are at least as discrepant", heads, rows)


def causes_table(findings: Findings) -> PageTable | None:
    """Return what may be wrong where the record contradicts the model; None if nothing was tried."""
    if "causes" not in findings.posterior.children:
        return None
    causes = findings.posterior["causes"].to_dataset()
    if "misread" in causes.attrs:
        return None
    rows = [
        [str(name), fixed(float(gain), ".0f"), "yes" if describes else "no", str(remedy)]
        for name, gain, describes, remedy in zip(
            *(causes[column].values for column in ("cause", "log_evidence", "describes", "remedy")), strict=True
        )
    ]
    return PageTable("What may be wrong", ["cause", "log-evidence", "describes the record", "infer with"], rows)


def contacts_messages(findings: Findings) -> list[str]:
    """Return sentences on the statuses of single samples, and on the agreement of their four numbers with a rod."""
    contacts = findings.contacts
    if contacts is None:
        words = channel_names(findings.record)
        missing = [words[name] for name in CHANNELS if name not in present_channels(findings.record)]
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
        known = "inferred" if "friction" in read_json(findings.posterior.attrs["nuisances"], "nuisances") else "stated"
        said.append(
            "In tangential contact the force along the rod at the pivot follows from the moment, and from the friction "
            f"that was {known}: the mean deviates by {fixed(score, '+.2f')} standard errors, {_agreement(score)}."
        )
    return said


def _agreement(score: float) -> str:
    if score < -AXIAL_ALARM:
        return "too small, as with friction"
    if score > AXIAL_ALARM:
        return "too large: check the zero of the drive angle, the axes of the forces, and the rod"
    return "so that the force along the rod agrees with the moment"
