"""Figure 11: contact points that Step 2 reconstructs from the records, on the true contours."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from tactile_bayes.paper_figures.choice import Choice, Limits, Profile
from tactile_bayes.plotting.labels import LABELS, set_unit
from tactile_bayes.plotting.legends import legend_entries, legend_entry, legend_in_rows
from tactile_bayes.plotting.maps import draw_path, draw_pivot, outline
from tactile_bayes.plotting.marks import BASES, PALETTE, SWEEP_MARKERS
from tactile_bayes.reconstruction import reconstruct
from tactile_bayes.rig.rig import Rig

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from tactile_bayes.sweep import Scan

_COLOURS = {"forward": BASES[3], "backward": BASES[2]}
_X = (-0.92, 0.92)
_Y = (-0.06, 1.0)  # limits of every panel of rotations [L]: no rod reaches farther
_ROOM = 0.06  # margin around contacts and bases of a drive that carries the base [L]
_BESIDE = 0.2  # room on either side of the vertex, below which distances are written [L]


def draw_reconstructed_points(profiles: Sequence[Profile], choice: Choice) -> Figure:
    """Draw points of a forward and a backward sweep and the gap between them, or of one that carries the base."""
    from matplotlib.ticker import MultipleLocator

    scans = {profile: [choice.scan(profile, distance) for distance in choice.distances] for profile in profiles}
    limits = (_X, _Y) if choice.drive is None else _limits([made for each in scans.values() for made in each])
    figure, grid = choice.map_panels(len(profiles), limits, beside=0.4, between=0.3, above=0.8)
    grid[0, 0].xaxis.set_major_locator(MultipleLocator(0.5))
    for ax, (profile, of_profile) in zip(grid.ravel(), scans.items(), strict=True):
        for distance, made in zip(choice.distances, of_profile, strict=True):
            _draw_points(ax, made, distance, limits[0], choice)
        if choice.drive is None:
            draw_pivot(ax, (0.0, 0.0))
        else:
            path = choice.drive.poses[:, :2]
            draw_path(ax, *path.T)
            draw_pivot(ax, tuple(path[0]), label="base at start")
        ax.set_title(f"profile {profile}")
    for ax in grid[-1]:
        set_unit(ax.xaxis, LABELS["contact_x"] + " ", "contact_x", {}, np.zeros(1))
    for ax in grid[:, 0]:
        set_unit(ax.yaxis, LABELS["contact_y"] + " ", "contact_y", {}, np.zeros(1))
    groups = [
        [f"{direction} sweep" for direction in _COLOURS],
        ["contour", "gap", "pivot", "base path", "base at start"],
    ]
    if not choice.is_column:
        groups = [[*groups[0], *groups[1]]]
    legend_in_rows(figure, legend_entries(*grid.flat), groups, 3 if choice.is_column else 5)
    return figure


def _limits(scans: Sequence[Scan]) -> Limits:
    """Return limits in x and y that hold contacts and bases of all scans, and the vertex of the contour."""
    limits = []
    for axis in "xy":
        names = (f"base_{axis}", f"truth_contact_{axis}")
        values = np.concatenate([made.record[name].values for made in scans for name in names])
        limits.append((float(np.nanmin(values)) - _ROOM, float(np.nanmax(values)) + _ROOM))
    (left, right), height = limits
    return (min(left, -_BESIDE), max(right, _BESIDE)), height


def _draw_points(ax: Axes, made: Scan, distance: float, across: tuple[float, float], choice: Choice) -> None:
    record = made.record
    if choice.load_cell is not None and choice.seed is not None:
        record = choice.load_cell.measure(record, rng=choice.seed)
    contacts = reconstruct(record, Rig(load_cell=choice.load_cell))
    ax.plot(*outline(made.contour, *across), color="0.55", linewidth=0.8, zorder=1.5, label="contour")
    last = {events.direction: events.snap_off.contact_x for events in made.sweeps}
    left, right = last.get("backward", np.inf), last.get("forward", -np.inf)
    if left < right:
        gap: dict[str, Any] = {"color": PALETTE["gap"], "linewidth": 6.0, "solid_capstyle": "butt"}
        ax.plot(*outline(made.contour, left, right), zorder=1.0, label="gap", **gap)
    lowest = outline(made.contour, *across)[1].min()
    ax.text(0.0, lowest - 0.04, f"$q$ = {distance:g} $L$", ha="center", va="top", fontsize="small")
    x, y = contacts["contact_x"].values, contacts["contact_y"].values
    for direction in last:
        chosen = (contacts["direction"].values == direction) & np.isfinite(x) & np.isfinite(y)
        points: dict[str, Any] = {"linestyle": "none", "color": _COLOURS[direction], "marker": SWEEP_MARKERS[direction]}
        points["markeredgewidth"] = 0.0
        ax.plot(x[chosen], y[chosen], markersize=2.4, zorder=3, **points)
        legend_entry(ax, f"{direction} sweep", markersize=4.5, **points)
