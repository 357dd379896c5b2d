"""Figures of several runs: their contours on one map, and their bands measured from one contour."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
import xarray as xr
from markupsafe import Markup

from tactile_bayes.arrays import Floats
from tactile_bayes.plotting.maps import contacts_within
from tactile_bayes.report.drawing import Plot, dots, figure, legend
from tactile_bayes.report.overlay import put_overlay
from tactile_bayes.report.wording import shown_as
from tactile_bayes.uncertainty.overlay import Overlay

_COLOURS = 6  # number of colours; of more runs, each has a panel of its own
_PARTS = ("lower", "median", "upper")
_HEIGHT = 260.0


class RunsFigure(NamedTuple):
    """Drawings of several runs for a page."""

    map: Markup
    panels: list[tuple[str, Markup]]  # bands measured from the reference: of all runs, without a name, or of each
    legend: Markup
    reference: str


def runs_figure(
    bands: Mapping[str, xr.Dataset], contacts: Mapping[str, xr.Dataset], overlay: Overlay | None, reference: Overlay
) -> RunsFigure:
    """Draw the bands of runs over each other, and measured from a reference: the overlay, or one of the runs."""
    are_few = len(bands) <= _COLOURS
    colours = {name: f"run-{number if are_few else 0}" for number, name in enumerate(bands)}
    entries = [(f"key-run {colour}", name) for name, colour in colours.items()]
    if not are_few:
        entries = [("key-run run-0", "runs"), ("key-other", "other runs, in each panel")]
    x, median = (np.concatenate([band[part].values for band in bands.values()]) for part in ("x", "median"))
    attrs = next(iter(bands.values()))["x"].attrs
    unit = shown_as("contact_x", attrs, x)
    overview, height = Plot.map_of(x, median, unit)
    for name, band in bands.items():
        _put_band(overview, band["x"].values, [band[part].values for part in _PARTS], colours[name])
        if are_few and name in contacts:
            _put_contacts(overview, contacts[name], band["x"].values, colours[name])
    if overlay is not None:
        put_overlay(overview, overlay)
        entries.append(("key-overlay", overlay.name))

    offsets = {name: _offsets(band, reference) for name, band in bands.items()}
    places = np.concatenate([np.tile(band["x"].values, 3) for band in bands.values()])
    shown = np.concatenate([np.ravel(offsets[name]) for name in bands])
    fine = shown_as("contact_x", attrs, shown)
    labels = overview.x_label, f"y − {reference.name}{fine.bracketed}"
    panels = []
    for number, names in enumerate([list(bands)] if are_few else [[name] for name in bands]):
        plot = Plot.around(places, shown, labels, _HEIGHT, (unit.power, fine.power))
        for other in bands:
            if other not in names:
                plot.path(bands[other]["x"].values, offsets[other][1], "other")
        plot.path([plot.x.low, plot.x.high], [0.0, 0.0], "zero" if overlay is None else "overlay")
        for name in names:
            _put_band(plot, bands[name]["x"].values, offsets[name], colours[name])
        title = f"Bands of {', '.join(names)}, measured from {reference.name}"
        words = "The widths of the bands, and their distances from that contour, are in the table."
        drawing = figure(f"runs-{number}", title, words, _HEIGHT, *plot.drawn(f"runs-clip-{number}"))
        panels.append(("" if are_few else names[0], drawing))
    title, words = "Contours of the runs", f"Map of the contours of {', '.join(bands)} over each other."
    drawing = figure("runs-map", title, words, height, *overview.drawn("runs-map-clip"))
    return RunsFigure(drawing, panels, legend(entries), reference.name)


def _offsets(band: xr.Dataset, reference: Overlay) -> list[Floats]:
    """Return lower edge, median and upper edge of a band, measured from a reference."""
    base = reference.polyline.height(band["x"].values, band["median"].values)
    return [band[part].values - base for part in _PARTS]


def _put_band(plot: Plot, x: Floats, edges: Sequence[Floats], colour: str) -> None:
    plot.area(x, edges[0], edges[2], f"run-band {colour}")
    plot.path(x, edges[1], f"run-median {colour}")


def _put_contacts(plot: Plot, contacts: xr.Dataset, x: Floats, colour: str) -> None:
    good = contacts.isel(sample=contacts_within(contacts, x[0], x[-1]))
    at_x, at_y = plot.x(good["contact_x"].values), plot.y(good["contact_y"].values)
    plot.put(dots(at_x, at_y, 1.8, f"run-contact {colour}", square=False))
