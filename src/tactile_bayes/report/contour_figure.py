"""Figures of the inferred contour: a map, and the band enlarged, with the grid points for the page's script."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
import xarray as xr
from markupsafe import Markup

from tactile_bayes.arrays import Floats
from tactile_bayes.inference.experiment import found_rig
from tactile_bayes.plotting.maps import contacts_within
from tactile_bayes.record import bases_of, carried_sweeps
from tactile_bayes.report.drawing import Plot, dots, element, figure, legend
from tactile_bayes.report.overlay import put_overlay, put_overlay_band
from tactile_bayes.report.wording import Shown, percent, shown_as, spread
from tactile_bayes.uncertainty.overlay import Overlay

_DETAIL_HEIGHT = 230.0
_TABLED = 21

# Half widths of the band to which an overlay extends the enlarged drawing, which it may leave.
_MOST_OFF, _SIGNS = 5.0, np.array([-1.0, 1.0])


@dataclass(frozen=True)
class ContourFindings:
    """Content of the figures."""

    posterior: xr.DataTree  # as stored, with the record
    record: xr.Dataset
    contacts: xr.Dataset | None  # None if a load channel is missing
    band: xr.Dataset
    edges: xr.Dataset | None  # the gap; None if there are sweeps in one direction only
    probability: float  # of bands and intervals
    overlay: Overlay | None  # another contour, laid over it
    shape: xr.Dataset | None  # the band of the shape alone


class ContourFigure(NamedTuple):
    """Drawings and data of the contour for a page."""

    map: Markup
    detail: Markup
    legend: Markup
    band: Mapping[str, Any]  # grid points in both drawings, and the text for each
    rows: list[list[str]]  # x, lower, median, upper at some grid points, as text in the unit shown
    unit: Shown


def gap_ends(findings: ContourFindings) -> tuple[float, float] | None:
    """Return x of the gap's ends, in the record's unit of length, if there is a gap."""
    if findings.edges is None:
        return None
    left, right = (float(findings.edges[side].sel(bound="median")) for side in ("left", "right"))
    return (left, right) if left < right else None


def contour_figure(findings: ContourFindings) -> ContourFigure:
    """Draw the inferred contour."""
    x, lower, median, upper = (findings.band[name].values for name in ("x", "lower", "median", "upper"))
    bases = np.array(bases_of(found_rig(findings.record, findings.posterior).record))  # as contacts have them
    unit = shown_as("contact_x", findings.band["lower"].attrs, np.concatenate([x, bases.ravel()]))
    ends = gap_ends(findings)
    overview, height, entries = _overview(findings, bases, unit, ends)
    detail, more = _detail(findings, overview.x_label, unit, ends)

    rows = _rows(x, lower, median, upper, unit)
    words = _said(rows, percent(findings.probability), unit)
    places = {
        "x": [detail.x.at(value) for value in x],
        "mapX": [overview.x.at(value) for value in x],
        "mapY": [overview.y.at(value) if np.isfinite(value) else -20 for value in median],
        "said": words,
        "first": int(np.argmin(np.abs(x - (np.mean(ends) if ends else np.mean(x))))),
    }
    between = f"from {unit.text(float(x[0]))} to {unit.full(float(x[-1]))}"
    description = (
        f"Map of the contour {between}. The band is widest at {words[int(np.argmax(np.nan_to_num(upper - lower)))]}. "
        f"{'A gap lies between ' + unit.text(ends[0]) + ' and ' + unit.full(ends[1]) + '.' if ends else ''}"
    )
    enlarged = f"The band measured from its median, {between}; the same numbers are in the table below."
    title, clips = "Contour, with band, contact points, gap and pivot", ("contour-clip", "detail-clip")
    chosen = np.linspace(0, x.size - 1, _TABLED).round().astype(int)
    return ContourFigure(
        figure("contour-map", title, description, height, *overview.drawn(clips[0])),
        figure("band-detail", "The band, enlarged", enlarged, _DETAIL_HEIGHT, *detail.drawn(clips[1])),
        legend([*entries, *more]),
        places,
        [rows[i] for i in chosen],
        unit,
    )


def _overview(
    findings: ContourFindings, bases: Floats, unit: Shown, ends: tuple[float, float] | None
) -> tuple[Plot, float, list[tuple[str, str]]]:
    """Return the map, its height, and the entries of its legend."""
    x, lower, median, upper = (findings.band[name].values for name in ("x", "lower", "median", "upper"))
    plot, height = Plot.map_of(np.r_[x, bases[:, 0]], np.r_[median, bases[:, 1]], unit)
    entries = [("key-band", f"{percent(findings.probability)} band"), ("key-median", "median")]
    if ends:
        plot.stretch(*ends, "gap")
        entries.append(("key-gap", "gap, touched by neither sweep"))
    plot.area(x, lower, upper, "band")
    plot.path(x, median, "median")
    if (contacts := findings.contacts) is not None:
        good = contacts_within(contacts, x[0], x[-1])
        for phase, name in (("tip", "tip contact"), ("tangential", "tangential contact")):
            some = contacts.isel(sample=good & (contacts["contact_phase"].values == phase))
            if count := some.sizes["sample"]:
                places = plot.x(some["contact_x"].values), plot.y(some["contact_y"].values)
                plot.put(dots(*places, 2.2, f"contact {phase}", square=phase == "tangential"))
                entries.append((f"key-{phase}", f"{name} ({count})"))
    if findings.overlay is not None:
        put_overlay(plot, findings.overlay)
        entries.append(("key-overlay", findings.overlay.name))
    plot.put_pivots(bases)
    word = "base, at the beginning" if carried_sweeps(findings.record) else "pivot" if len(bases) == 1 else "pivots"
    diamond = element("path", d="M-7 0L0 -7L7 0L0 7Z")
    plot.put(element("g", diamond, id="band-mark", class_="place js-only", transform="translate(-20 -20)"))
    last = ("key-pivot", word), ("key-place js-only", "place along x, chosen below or beside")
    return plot, height, [*entries, *last]


def _detail(
    findings: ContourFindings, x_label: str, unit: Shown, ends: tuple[float, float] | None
) -> tuple[Plot, list[tuple[str, str]]]:
    """Return the band, enlarged and measured from its median, and the entries of its legend."""
    band, overlay, shape = findings.band, findings.overlay, findings.shape
    x, median = band["x"].values, band["median"].values
    off = np.stack([band["lower"].values - median, band["upper"].values - median])
    other = None if overlay is None else overlay.polyline.height(x, median) - median
    fine = shown_as("contact_x", band["lower"].attrs, off)
    shown = off if other is None else np.stack([*off, np.clip(other, *(_MOST_OFF * np.nanmax(np.abs(off)) * _SIGNS))])
    labels = x_label, f"y − median{fine.bracketed}"
    plot = Plot.around(x, shown, labels, _DETAIL_HEIGHT, (unit.power, fine.power))
    if ends:
        plot.stretch(*ends, "gap")
    plot.area(x, off[0], off[1], "band")
    if shape is not None:
        plot.area(x, shape["lower"] - shape["median"], shape["upper"] - shape["median"], "shape")
    plot.path(x, np.zeros_like(x), "median")
    if overlay is not None and other is not None:
        put_overlay_band(plot, overlay, x, median)
        plot.path(x, other, "overlay")
    rule = {"y1": plot.y.end, "y2": plot.y.start, "x1": -20, "x2": -20}
    plot.put(element("line", id="band-rule", class_="rule js-only", **rule))
    return plot, [] if shape is None else [("key-shape", "that of the shape alone, up to a shift")]


def _rows(x: Floats, lower: Floats, median: Floats, upper: Floats, unit: Shown) -> list[list[str]]:
    """Return x, lower edge, median and upper edge of the band, with as many decimals as the band's width allows."""
    scale = 10.0**unit.power
    places = spread(x / scale, float(np.ptp(x)) / x.size / scale)
    return [
        [place, *spread(numbers / scale, float(numbers[2] - numbers[0]) / scale)]
        for place, numbers in zip(places, np.stack([lower, median, upper], axis=-1), strict=True)
    ]


def _said(rows: list[list[str]], share: str, unit: Shown) -> list[str]:
    name = f"\u00a0{unit.name}" if unit.name else ""
    return [
        f"x = {at}{name}: no band, some contours end before"
        if low == "–"
        else f"x = {at}{name}: y from {low} to {high}{name} with {share}, median {middle}{name}"
        for at, low, middle, high in rows
    ]
