"""The variables of the report's template, section by section."""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray as xr

from tactile_bayes.inference.result import is_streamed
from tactile_bayes.record import carried_sweeps, present_channels
from tactile_bayes.report.background import background_of
from tactile_bayes.report.contour_figure import contour_figure, gap_ends
from tactile_bayes.report.findings import Findings
from tactile_bayes.report.frames import motion_of
from tactile_bayes.report.meanings import FORMULAS, is_direction, meaning_of
from tactile_bayes.report.overlay import note_of, overlay_table
from tactile_bayes.report.readings_figure import readings_figure
from tactile_bayes.report.reproduction import command_of, hindrances, python_lines
from tactile_bayes.report.trust import (
    causes_table,
    check_messages,
    check_table,
    contacts_messages,
    convergence,
    trust_tables,
)
from tactile_bayes.report.wording import PageTable, chance, fixed, percent, sentence, shown_as, spread

_WIDTH = "width of the band"


def page_of(findings: Findings, name: str) -> dict[str, Any]:
    """Return the values of the template's variables; `name` is that of the run."""
    attrs = findings.posterior.attrs
    motion = motion_of(findings.posterior)
    contour, readings = contour_figure(findings), readings_figure(findings, motion)
    channels, stats = present_channels(findings.record), findings.posterior["sample_stats"].to_dataset()
    heads = [
        f"{label} [{unit}]" if unit else label for channel, label, unit in readings.channels if channel in channels
    ]
    travel = [] if readings.travel_unit is None else [f"travel{readings.travel_unit}"]
    first = readings.data["first"]
    return background_of(findings) | {
        "name": name,
        "record_file": str(attrs.get("record_file", "")),
        "family": str(attrs["family"]),
        "formula": FORMULAS.get(attrs["family"], "flanks of two shapes, " + str(attrs["family"])),
        "share": percent(findings.probability),
        "answer": _answer(findings),
        "budget": _budget(findings),
        "dimensionless": attrs["units"] == "dimensionless",
        "contour": contour,
        "band_table": PageTable(
            f"The band at some positions{contour.unit.bracketed}", ["x", "lower", "median", "upper"], contour.rows, 0
        ),
        "overlay": findings.overlay and overlay_table(findings.band, findings.overlay),
        "overlay_notes": [] if findings.overlay is None else note_of(findings.overlay, findings.band),
        "gap": _gap_messages(findings),
        "shapes": _shapes(findings.comparison),
        "parameters": _parameters(findings, mute=True),
        "is_well": _is_well(findings),
        "verdicts": [said for said in findings.checked.messages if said.kind != _WIDTH],
        "width": [said for said in findings.checked.messages if said.kind == _WIDTH],
        "trust": [] if findings.trust is None else str(findings.trust.attrs["words"]).splitlines(),
        "trust_summary": "" if findings.trust is None else str(findings.trust.attrs["summary"]),
        "trust_tables": trust_tables(findings),
        "convergence_head": f"Have the {'particles moved enough' if is_streamed(attrs) else 'ensembles converged'}?",
        "convergence": convergence(findings),
        "check_messages": check_messages(findings),
        "check": check_table(findings),
        "causes": causes_table(findings),
        "contacts": contacts_messages(findings),
        "readings": readings,
        "frame": {key: values[first] for key, values in readings.data["said"].items()},
        "moving": [
            (channel, label, unit, readings.data["said"][channel][first]) for channel, label, unit in readings.channels
        ],
        "motion_every": motion.every,
        "all_readings": PageTable("The readings", ["sample", "sweep", "φ₀ [°]", *travel, *heads], readings.rows, 0),
        "everything": _parameters(findings, mute=False) if any(map(is_direction, stats.parameter.values)) else None,
        "approximations": str(attrs.get("approximations", "")),
        "command": command_of(attrs),
        "python": python_lines(attrs),
        "hindrances": hindrances(findings.posterior, findings.record),
        "data": {"band": contour.band, "frames": readings.data},
    }


def _budget(findings: Findings) -> PageTable | None:
    """Return how much of the band's width each unknown accounts for, the largest share first."""
    budget = findings.budget
    if budget is None:
        return None
    widths = [budget[name] for name in ("half_width", "half_width_if_all_known", "half_width_of_shape")]
    unit = shown_as("contact_x", budget.half_width.attrs, [float(widths[0])])
    rows = [["as it is", "", unit.text(float(widths[0]), 3)]]
    order = np.argsort(-budget["share"].values, kind="stable")
    for name, share, known in zip(
        *(budget[column].values[order] for column in ("unknown", "share", "half_width_if_known")), strict=True
    ):
        rows.append([f"{name} known", percent(round(share, 2)), unit.text(known, 3)])
    rows.append(["all of them known", "", unit.text(float(widths[1]), 3)])
    rows.append(["of the shape alone, up to a shift", "", unit.text(float(widths[2]), 3)])
    heads = ["the band", "share of the variance", f"half width{unit.bracketed}"]
    return PageTable("What sets the width of the band: its median half width along normals", heads, rows)


def _is_well(findings: Findings) -> bool:
    return findings.checked.is_well


def _answer(findings: Findings) -> str:
    """Return a sentence on the width of the band, and how far to trust it."""
    band = findings.band
    width = band["upper"].values - band["lower"].values
    unit = shown_as("contact_x", band["x"].attrs, band["x"].values)
    fine = shown_as("contact_x", band["x"].attrs, width[np.isfinite(width)])
    if not np.isfinite(width).any():
        return "No contour of the posterior reaches all of what was touched: there is no band."
    at = float(band["x"].values[np.nanargmax(width)])
    reach = f"From x = {unit.text(float(band['x'].values[0]))} to {unit.full(float(band['x'].values[-1]))}"
    share = percent(findings.probability)
    widths = (
        f"whose median width is {fine.full(float(np.nanmedian(width)), 3)}; it is widest at x = {unit.full(at, 3)}, "
        f"{fine.full(float(np.nanmax(width)), 3)}."
    )
    if findings.is_rejected:
        return (
            f"{reach} the posterior has a {share} band {widths} It would hold if the contour were of this family and "
            "the rig as assumed, but the record contradicts one of the two: the error of the band is unknown."
        )
    if not _is_well(findings):
        return f"{reach} the posterior has a {share} band {widths} Its validity depends on the messages above."
    return f"{reach} the contour is known to within a {share} band {widths}"


def _gap_messages(findings: Findings) -> list[str]:
    edges = findings.edges
    if edges is None and carried_sweeps(findings.record):
        events = findings.posterior["events"].to_dataset()
        ends = [float(events[f"{event}_contact_x"].median()) for event in ("first", "snap_off")]
        unit = shown_as("contact_x", findings.band["x"].attrs, ends)
        return [
            f"The one sweep touches an arc without a gap, from first contact at x = {unit.full(ends[0])} to its last "
            f"contact at x = {unit.full(ends[1])} (medians). What lies beyond these ends it has not touched: there the "
            "contour follows from family and prior."
        ]
    if edges is None:
        return ["There are sweeps in one direction only, so there is no gap between two."]
    width = edges["width"]
    unit = shown_as("contact_x", width.attrs, [abs(float(width.sel(bound="median")))])
    scale = 10.0**unit.power
    values = [float(width.sel(bound=bound)) / scale for bound in ("median", "lower", "upper")]
    middle, low, high = spread(values, values[2] - values[1])
    share = percent(findings.probability)
    would_be = "would be" if findings.is_rejected else "is"
    of_such = "on such a contour " if findings.is_rejected else ""
    if gap_ends(findings) is None:
        overlap = f"{middle.removeprefix('−')} {unit.name}".rstrip()
        words = f"no gap {would_be} left: the sweeps overlap by {overlap}."
    else:
        wide, range_ = f"{middle} {unit.name}".rstrip(), f"{low} to {high} {unit.name}".rstrip()
        words = f"the gap, which no sweep touches, {would_be} {wide} wide ({share} from {range_})."
    said = [sentence(of_such + words)]
    if gap_ends(findings) is not None and not findings.is_rejected:
        certificate = float(np.max(edges["triangle_upper"].values - edges["triangle_lower"].values))
        band = float(edges["band_width"])
        if np.isfinite(certificate) and np.isfinite(band):
            fine = shown_as("contact_x", width.attrs, [certificate])
            said.append(
                f"Given the uncertainty of its ends, convexity alone confines the contour there, with {share}, to "
                f"a strip up to {fine.full(certificate, 2)} wide in y; the band is up to {fine.full(band, 2)} wide."
            )
    status = str(edges["status"].values)
    if status != "ok" and float(edges["share_open"]) > 0.0:
        said.append(sentence(f"{status}."))
    if edges.attrs["gaps"] > 1:
        said.append(f"There are {edges.attrs['gaps']} gaps; this is the widest.")
    return said


def _shapes(comparison: xr.Dataset | None) -> dict[str, Any] | None:
    if comparison is None:
        return None
    order = np.argsort(-np.nan_to_num(comparison["probability"].values), kind="stable")
    rows, bars = [], []
    for k in order:
        row = comparison.isel(family=k)
        name, probability = str(row["family"].values), float(row["probability"])
        fits = "not sampled" if not bool(row["sampled"]) else "yes" if bool(row["fits"]) else "no"
        evidence, p_value = fixed(float(row["log_evidence"]), ".1f"), chance(float(row["p_value"]))
        rows.append([name, chance(probability), evidence, p_value, fits])
        bars.append((name, probability if np.isfinite(probability) else 0.0, chance(probability)))
    heads = ["shape", "probability", "log evidence", "check p", "fits"]
    return {
        "verdict": str(comparison.attrs["verdict"]),
        "table": PageTable("Shapes, given that it is one of them", heads, rows),
        "bars": bars,
    }


def _parameters(findings: Findings, *, mute: bool) -> PageTable:
    family = str(findings.posterior.attrs["family"])
    rows = []
    for name in findings.numbers["quantity"].values:
        if mute and is_direction(name):
            continue
        row = findings.numbers.sel(quantity=name)
        cells = parameter_cells(row, family)
        cells += [fixed(float(row["r_hat"]), ".3f"), *(fixed(float(row[c]), ".0f") for c in ("ess_bulk", "ess_tail"))]
        rows.append(cells)
    share = percent(findings.probability)
    heads = ["quantity", "meaning", "unit", "estimate", f"{share} from", "to", "R̂", "ESS bulk", "ESS tails"]
    caption = "Estimates are medians, intervals central" if mute else "All parameters, and the gap"
    return PageTable(caption, heads, rows, 3)


def parameter_cells(row: xr.Dataset, family: str) -> list[str]:
    """Return name, meaning, unit, median and interval of a row of a summary."""
    name, unit = str(row["quantity"].values), str(row["unit"].values)
    values = [float(row[column]) for column in ("median", "lower", "upper")]
    return [name, meaning_of(name, family), "" if unit == "1" else unit, *spread(values, values[2] - values[1])]
