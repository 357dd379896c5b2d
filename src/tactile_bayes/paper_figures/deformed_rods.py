"""Figures 7 to 10: the deformed rod along a sweep."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from tactile_bayes.mechanics.centreline import rod_shape
from tactile_bayes.paper_figures.choice import Choice, Direction, Limits, Profile
from tactile_bayes.plotting.legends import legend_entries, legend_in_rows
from tactile_bayes.plotting.marks import PHASES
from tactile_bayes.plotting.rod_map import rods
from tactile_bayes.plotting.sweep_lines import ENDINGS
from tactile_bayes.record import CHANNELS

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from tactile_bayes.sweep import Scan

_LEGEND = (
    [*PHASES.values(), "contour", "pivot", "base path", "base at start"],
    ["first contact", "phase change", "snap-off", *ENDINGS.values()],
)

_ROOM = 0.05  # margin around the rods [L]


def draw_deformed_rods(profile: Profile, direction: Direction, choice: Choice) -> Figure:
    """Draw deformed rods in a panel for each distance and sweep, all at one scale."""
    from matplotlib.ticker import MaxNLocator

    scans = [choice.scan(profile, distance, direction) for distance in choice.distances]
    sweeps = [(made, number) for made in scans for number in range(len(made.sweeps))]
    figure, grid = choice.map_panels(len(sweeps), _limits(sweeps), beside=0.45, between=0.38, above=0.7, widest=3.6)
    columns = grid.shape[1]
    found: dict[str, Any] = {}
    grid[0, 0].xaxis.set_major_locator(MaxNLocator(6, steps=[1, 2, 5, 10]))  # sparse: panels are neighbours
    for ax, (made, number) in zip(grid.ravel(), sweeps, strict=False):
        rods(made, sweep=number, count=choice.rods, ax=ax)
        found |= legend_entries(ax)
        ax.get_legend().remove()
        way = made.sweeps[number].direction if choice.drive is None else "carried"
        ax.set_title(f"{way}, $q$ = {_distance(made):g} $L$")
    for place, ax in enumerate(grid.ravel()):
        if place >= len(sweeps):
            ax.remove()
            continue
        is_lowest, is_first = place + columns >= len(sweeps), place % columns == 0
        ax.tick_params(labelbottom=is_lowest, labelleft=is_first)
        if not is_lowest:
            ax.set_xlabel("")
        if not is_first:
            ax.set_ylabel("")
    legend_in_rows(figure, found, _LEGEND, 2 if choice.is_column else 5)
    return figure


def _limits(sweeps: list[tuple[Scan, int]]) -> Limits:
    """Return limits in x and y that hold all rods and bases of all sweeps."""
    corners = []
    for made, number in sweeps:
        record, events = made.record, made.sweeps[number]
        of_sweep = record["sweep"].values == number
        chosen = of_sweep & (record["truth_contact_phase"].values != "none")
        names = ("base_x", "base_y", "drive_angle", *CHANNELS)
        ends = [events.first_contact, *events.transitions, events.snap_off]
        at_ends = [[getattr(event, name) for event in ends] for name in names]
        states = [np.append(record[name].values[chosen], at) for name, at in zip(names, at_ends, strict=True)]
        shapes = rod_shape(*states[2:], side=1 if events.direction == "forward" else -1)
        bounds = []
        for name, base, shape in zip(names[:2], states[:2], shapes, strict=True):
            values = np.append(base[:, None] + shape, record[name].values[of_sweep])
            bounds += [values.min(), values.max()]
        corners.append(bounds)
    (left, _, bottom, _), (_, right, _, top) = np.min(corners, axis=0), np.max(corners, axis=0)
    return (float(left) - _ROOM, float(right) + _ROOM), (float(bottom) - _ROOM, float(top) + _ROOM)


def _distance(made: Scan) -> float:
    """Return the height of the contour above the pivot."""
    return float(np.asarray(made.contour.height(0.0)))
