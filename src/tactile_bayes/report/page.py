"""The variables of the report's template, section by section."""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray as xr

from tactile_bayes.record import carried_sweeps, present_channels
from tactile_bayes.report.background import background_of
from tactile_bayes.report.contour_figure import contour_figure, gap_ends
from tactile_bayes.report.findings import COMPARISON, Findings
from tactile_bayes.report.overlay import note_of, overlay_table
from tactile_bayes.report.readings_figure import motion_of, readings_figure
from tactile_bayes.report.trust import trust_of
from tactile_bayes.report.wording import (
    FORMULAS,
    PageTable,
    chance,
    fixed,
    is_direction,
    meaning_of,
    percent,
    rows_of,
    sentence,
    shown_as,
    spread,
)
from tactile_bayes.uncertainty.summary import shown_in


def page_of(findings: Findings, name: str) -> dict[str, Any]:
    """Return the values of the template's variables; `name` is that of the run."""
    attrs = findings.posterior.attrs
    motion = motion_of(findings.posterior)
    contour, readings = contour_figure(findings), readings_figure(findings, motion)
    present, parameters = present_channels(findings.record), findings.numbers["quantity"].values
    heads = [f"{label} [{unit}]" if unit else label for name, label, unit in readings.channels if name in present]
    travel = [] if readings.travel_unit is None else [f"travel{readings.travel_unit}"]
    frame = {key: values[readings.data["first"]] for key, values in readings.data["said"].items()}
    heads = ["sample", "sweep", "φ₀ [°]", *travel, *heads]
    positions = f"The band at some positions{contour.unit.bracketed}"
    return {
        **background_of(findings),
        **trust_of(findings),
        "name": name,
        "record_file": str(attrs.get("record_file", "")),
        "family": str(attrs["family"]),
        "formula": FORMULAS.get(attrs["family"], "flanks of two shapes, " + str(attrs["family"])),
        "share": percent(findings.probability),
        "answer": _answer(findings),
        "budget": _budget(findings.budget),
        "dimensionless": attrs["units"] == "dimensionless",
        "contour": contour,
        "band_table": PageTable(positions, ["x", "lower", "median", "upper"], contour.rows, 0),
        "overlay": findings.overlay and overlay_table(findings.band, findings.overlay),
        "overlay_notes": [] if findings.overlay is None else note_of(findings.overlay, findings.band),
        "gap": _gap_messages(findings),
        "shapes": _shapes(findings.comparison),
        "parameters": _parameters(findings, mute=True),
        "readings": readings,
        "frame": frame,
        "moving": [(channel, label, unit, frame[channel]) for channel, label, unit in readings.channels],
        "motion_every": motion.every,
        "all_readings": PageTable("The readings", heads, readings.rows, 0),
        "everything": _parameters(findings, mute=False) if any(map(is_direction, parameters)) else None,
        "approximations": str(attrs.get("approximations", "")),
        "data": {"band": contour.band, "frames": readings.data},
    }


def _budget(budget: xr.Dataset | None) -> PageTable | None:
    """Return how much of the band's width each unknown accounts for, the largest share first."""
    if budget is None:
        return None
    names = ("half_width", "half_width_if_all_known", "half_width_of_shape")
    width, known, shape = (float(budget[name]) for name in names)
    unit = shown_as("contact_x", budget.half_width.attrs, [width])
    ordered = budget.isel(unknown=np.argsort(-budget["share"].values, kind="stable"))
    rows = [
        ["as it is", "", unit.text(width, 3)],
        *(
            [f"{name} known", percent(round(share, 2)), unit.text(narrowed, 3)]
            for name, share, narrowed in rows_of(ordered, "unknown", "share", "half_width_if_known")
        ),
        ["all of them known", "", unit.text(known, 3)],
        ["of the shape alone, up to a shift", "", unit.text(shape, 3)],
    ]
    heads = ["the band", "share of the variance", f"half width{unit.bracketed}"]
    return PageTable("What sets the width of the band: its median half width along normals", heads, rows)


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
    if not findings.checked.is_well:
        return f"{reach} the posterior has a {share} band {widths} Its validity depends on the messages above."
    return f"{reach} the contour is known to within a {share} band {widths}"


def _gap_messages(findings: Findings) -> list[str]:
    """Return sentences on the gap, and on how far convexity confines the contour in it."""
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
    share, has_gap, name = percent(findings.probability), gap_ends(findings) is not None, f" {unit.name}".rstrip()
    of_such, would_be = ("on such a contour ", "would be") if findings.is_rejected else ("", "is")
    if has_gap:
        words = f"the gap, which no sweep touches, {would_be} {middle}{name} wide ({share} from {low} to {high}{name})."
    else:
        words = f"no gap {would_be} left: the sweeps overlap by {middle.removeprefix('−')}{name}."
    said = [sentence(of_such + words)]
    if has_gap and not findings.is_rejected:
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
    ordered = comparison.isel(family=np.argsort(-np.nan_to_num(comparison["probability"].values), kind="stable"))
    rows, bars = [], []
    for name, probability, evidence, p_value, fits, is_sampled in rows_of(ordered, "family", *COMPARISON):
        said = "not sampled" if not is_sampled else "yes" if fits else "no"
        rows.append([name, chance(probability), fixed(evidence, ".1f"), chance(p_value), said])
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
    for r_hat, *sizes, name in rows_of(findings.numbers, "r_hat", "ess_bulk", "ess_tail", "quantity"):
        if not (mute and is_direction(name)):
            cells = parameter_cells(findings.numbers.sel(quantity=name), family)
            rows.append([*cells, fixed(r_hat, ".3f"), *(fixed(size, ".0f") for size in sizes)])
    share = percent(findings.probability)
    heads = ["quantity", "meaning", "unit", "estimate", f"{share} from", "to", "R̂", "ESS bulk", "ESS tails"]
    caption = "Estimates are medians, intervals central" if mute else "All parameters, and the gap"
    return PageTable(caption, heads, rows, 3)


def parameter_cells(row: xr.Dataset, family: str) -> list[str]:
    """Return name, meaning, unit, median and interval of a row of a summary."""
    name, (scale, unit) = str(row["quantity"].values), shown_in(str(row["unit"].values))
    values = [scale * float(row[column]) for column in ("median", "lower", "upper")]
    return [name, meaning_of(name, family), unit, *spread(values, values[2] - values[1])]
