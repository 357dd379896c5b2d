"""Figure 11: contact points that Step 2 reconstructs from the records, on the true contours."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from tactile_bayes.paper_figures.choice import Choice, Profile
from tactile_bayes.plotting.labels import LABELS, set_unit
from tactile_bayes.plotting.legends import legend_entries, legend_entry, legend_in_rows
from tactile_bayes.plotting.maps import draw_pivot, outline
from tactile_bayes.plotting.marks import BASES, PALETTE, SWEEP_MARKERS
from tactile_bayes.reconstruction import reconstruct

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

__all__ = ["draw_reconstructed_points"]

_COLOURS = {"forward": BASES[3], "backward": BASES[2]}
_X = (-0.92, 0.92)
_Y = (-0.06, 1.0)
"""Limits of every panel [L]: no rod reaches farther."""


def draw_reconstructed_points(profiles: Sequence[Profile], choice: Choice) -> Figure:
    """Draw points of a forward and a backward sweep, and the gap between them, in a panel for each profile."""
    from matplotlib.ticker import MultipleLocator

    figure, grid = choice.map_panels(len(profiles), (_X, _Y), beside=0.4, between=0.3, above=0.8)
    grid[0, 0].xaxis.set_major_locator(MultipleLocator(0.5))
    for ax, profile in zip(grid.ravel(), profiles, strict=True):
        for distance in choice.distances:
            _draw_points(ax, profile, distance, choice)
        draw_pivot(ax, (0.0, 0.0))
        ax.set_title(f"profile {profile}")
    for ax in grid[-1]:
        set_unit(ax.xaxis, LABELS["contact_x"] + " ", "contact_x", {}, np.zeros(1))
    for ax in grid[:, 0]:
        set_unit(ax.yaxis, LABELS["contact_y"] + " ", "contact_y", {}, np.zeros(1))
    groups = [[f"{direction} sweep" for direction in _COLOURS], ["contour", "gap", "pivot"]]
    if not choice.is_column:
        groups = [[*groups[0], *groups[1]]]
    legend_in_rows(figure, legend_entries(*grid.flat), groups, 3 if choice.is_column else 5)
    return figure


def _draw_points(ax: Axes, profile: Profile, distance: float, choice: Choice) -> None:
    made = choice.scan(profile, distance)
    record = made.record
    if choice.load_cell is not None:
        record = choice.load_cell.measure(record, seed=choice.seed)
    contacts = reconstruct(record, load_cell=choice.load_cell)
    ax.plot(*outline(made.contour, *_X), color="0.55", linewidth=0.8, zorder=1.5, label="contour")
    left, right = made.events["backward"].snap_off.contact_x, made.events["forward"].snap_off.contact_x
    if left < right:
        gap: dict[str, Any] = {"color": PALETTE["gap"], "linewidth": 6.0, "solid_capstyle": "butt"}
        ax.plot(*outline(made.contour, left, right), zorder=1.0, label="gap", **gap)
    lowest = outline(made.contour, *_X)[1].min()
    ax.text(0.0, lowest - 0.04, f"$q$ = {distance:g} $L$", ha="center", va="top", fontsize="small")
    x, y = contacts["contact_x"].values, contacts["contact_y"].values
    for direction, colour in _COLOURS.items():
        chosen = (contacts["direction"].values == direction) & np.isfinite(x) & np.isfinite(y)
        points: dict[str, Any] = {"linestyle": "none", "color": colour, "marker": SWEEP_MARKERS[direction]}
        points["markeredgewidth"] = 0.0
        ax.plot(x[chosen], y[chosen], markersize=2.4, zorder=3, **points)
        legend_entry(ax, f"{direction} sweep", markersize=4.5, **points)
