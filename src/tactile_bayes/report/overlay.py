"""Another contour on a page: its line in a drawing, and its distance as text."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

import numpy as np
import xarray as xr

from tactile_bayes.arrays import Floats
from tactile_bayes.report.drawing import Plot
from tactile_bayes.report.wording import PageTable, Shown, percent, shown_as
from tactile_bayes.tasks import write_atomically
from tactile_bayes.uncertainty.overlay import Distance, Overlay, overlay_distance

# Heads of `distance_cells`, with places for the unit.
DISTANCE_HEADS = ["rms distance{}", "largest{}", "inside the band"]


class Laid(NamedTuple):
    """Distances of runs from a contour laid over them."""

    unit: str  # "m", or "1" for rod lengths
    distances: dict[str, Distance]

    @classmethod
    def over(cls, bands: Mapping[str, xr.Dataset], overlay: Overlay) -> Laid:
        """Return the distances of runs by their names and bands."""
        unit = str(next(iter(bands.values()))["x"].attrs["units"])
        return cls(unit, {name: overlay_distance(band, overlay) for name, band in bands.items()})

    def words(self, of: str) -> list[str]:
        """Return a sentence on each run; the name is that of the overlay."""
        return [f"{name} from {of}: {self._said(found)}" for name, found in self.distances.items()]

    def _said(self, found: Distance) -> str:
        if np.isnan(found.rms):
            return "nothing of the contour is covered, check unit and frame"
        fine = shown_as("contact_x", {"units": self.unit}, [found.largest])
        rms, largest, inside = distance_cells(found, fine)
        return f"rms distance {rms}, largest {largest}{fine.bracketed}, {inside} inside the band"


def draw_overlay(name: str, band: xr.Dataset, contacts: xr.Dataset | None, overlay: Overlay, path: Path) -> None:
    """Write a figure of a run's band and another contour: above as they are, below the heights over that contour."""
    from tactile_bayes.plotting import overlaid
    from tactile_bayes.plotting.style import own_style, save_figure
    from tactile_bayes.runs.folder import panels

    points = {} if contacts is None else {name: contacts}
    with own_style():
        (above,), (below,) = panels(2, 1, 7.0, 7.0)
        overlaid({name: band}, contacts=points, overlay=overlay, ax=above)
        overlaid({name: band}, overlay=overlay, enlarged=True, ax=below)
        with write_atomically(path) as temporary:
            save_figure(above.figure, temporary, "png")


def put_overlay(plot: Plot, overlay: Overlay) -> None:
    """Put another contour, of a run with its band, into a map."""
    if overlay.band is not None:
        x, lower, upper = (overlay.band[part].values for part in ("x", "lower", "upper"))
        plot.area(x, lower, upper, "overlay-band")
    for piece in overlay.polyline.pieces:
        x, y = _thinned(plot, piece).T
        plot.path(x, y, "overlay")


def put_overlay_band(plot: Plot, overlay: Overlay, x: Floats, base: Floats) -> None:
    """Put the band of another run into a drawing in which y is measured from a contour of heights base at x."""
    if overlay.band is not None:
        edges = (overlay.band[part].values for part in ("lower", "upper"))
        ends = {"left": np.nan, "right": np.nan}
        lower, upper = (np.interp(x, overlay.band["x"].values, edge, **ends) - base for edge in edges)
        plot.area(x, lower, upper, "overlay-band")


def _thinned(plot: Plot, piece: Floats) -> Floats:
    """Return the points of a piece that differ in a drawing by a unit of it."""
    steps = np.hypot(np.diff(plot.x(piece[:, 0])), np.diff(plot.y(piece[:, 1])))
    along = np.floor(np.concatenate([[0.0], np.cumsum(steps)]))
    kept = np.r_[True, np.diff(along) > 0.0]
    kept[-1] = True
    return np.asarray(piece[kept])


def distance_cells(distance: Distance, unit: Shown) -> list[str]:
    """Return root mean square and largest distance, and the share inside the band."""
    inside = "–" if np.isnan(distance.share_inside) else percent(round(distance.share_inside, 3))
    return [unit.text(distance.rms, 3), unit.text(distance.largest, 3), inside]


def overlay_table(band: xr.Dataset, overlay: Overlay) -> PageTable:
    """Return the distance of a contour from another one as a table of one row."""
    found = overlay_distance(band, overlay)
    unit = shown_as("contact_x", band["x"].attrs, band["x"].values)
    fine = shown_as("contact_x", band["x"].attrs, [found.largest])
    heads = [head.format(fine.bracketed) for head in DISTANCE_HEADS]
    heads = ["overlaid", *heads, f"largest at x{unit.bracketed}", "both from", "to"]
    places = [unit.text(value) for value in (found.at, found.left, found.right)]
    row = [overlay.name, *distance_cells(found, fine), *places]
    return PageTable(f"Distance of the median from {overlay.name}", heads, [row])


def note_of(overlay: Overlay, band: xr.Dataset) -> list[str]:
    """Return how the overlay is to be read: its frame, its unit, and whether it covers anything."""
    said = [
        f"{overlay.name} is drawn in the laboratory frame of the record. Distances are of the median, normal to it and "
        "where both are; “inside the band” is the share of positions x at which it is in the pointwise band."
    ]
    if overlay.is_unit_assumed:
        unit = "metres" if band["x"].attrs.get("units") == "m" else "rod lengths"
        said.append(f"The file states no unit: its numbers are taken as {unit}, the unit of the record.")
    if np.isnan(overlay_distance(band, overlay).rms):
        said.append("It covers nothing of the contour: check its unit and its frame.")
    return said
