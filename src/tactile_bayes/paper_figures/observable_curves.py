"""Figures 3 to 6: moment and forces at the base along a sweep, for several distances of the object."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr

from tactile_bayes.arrays import Floats
from tactile_bayes.paper_figures.choice import Choice, Direction, Profile
from tactile_bayes.plotting.drive_axis import DriveAxis, drive_axis
from tactile_bayes.plotting.labels import LABELS, set_unit
from tactile_bayes.plotting.legends import legend_entries, legend_entry, legend_in_rows
from tactile_bayes.plotting.marks import PHASES
from tactile_bayes.plotting.sweep_lines import EVENT_MARKERS, draw_events, phase_runs, with_events
from tactile_bayes.record import CHANNELS, travels_of
from tactile_bayes.sweep import Carried, Motion, scan

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from tactile_bayes.sweep import Scan, SweepEvents

_LINES = {"forward": "-", "backward": (0, (3.0, 1.2))}
_WIDTHS = {"tip": 0.8, "tangential": 1.7}
_BETWEEN = 48  # number of points of a line between two events, beside those of the drive's steps
_SAME = 1e-12  # change of a pose up to which it is left out beside the one before [L and rad]
_SHRUNK = 0.75  # size of the many event markers, over their usual size


def draw_observable_curves(profile: Profile, direction: Direction, choice: Choice) -> Figure:
    """Draw moment and forces along the drive: a colour for each distance, thin lines in tip contact.

    Lines extend from first contact to snap-off, both included. Toward events, where loads may change with the square
    root of the remaining angle or travel, their points are denser than the drive's steps.
    """
    from matplotlib import colormaps
    from matplotlib.figure import Figure
    from matplotlib.ticker import MaxNLocator, MultipleLocator

    figure = Figure(figsize=(choice.width, 5.6), layout="constrained")
    panels = figure.subplots(3, 1, sharex=True)
    shades = colormaps["viridis"](np.linspace(0.0, 0.85, len(choice.distances)))
    directions: set[str] = set()
    for distance, colour in zip(choice.distances, shades, strict=True):
        made = choice.scan(profile, distance, direction)
        for number, events in enumerate(made.sweeps):
            sweep = _finer(made, number, choice.drive)
            along = drive_axis(sweep)
            for ax, channel in zip(panels, CHANNELS, strict=True):
                _draw_sweep(ax, sweep, along, events, channel, tuple(colour))
        legend_entry(panels[0], _distance_in_words(distance), color=colour, linewidth=1.7)
        directions |= {sweep.direction for sweep in made.sweeps}
    for way in sorted(directions, reverse=True) if "backward" in directions else ():
        legend_entry(panels[0], way, color="0.35", linestyle=_LINES[way], linewidth=1.2)
    for phase, words in PHASES.items():
        legend_entry(panels[0], words, color="0.35", linewidth=_WIDTHS[phase])
    for ax, channel in zip(panels, CHANNELS, strict=True):
        ax.axhline(0.0, color="0.85", linewidth=0.8, zorder=0)
        ax.yaxis.set_major_locator(MaxNLocator(5))
        set_unit(ax.yaxis, f"{LABELS[channel]}\n", channel, {}, np.zeros(1))
    along.label(panels[-1].xaxis, with_ticks=False)
    if along.kind == "angle":
        panels[-1].xaxis.set_major_locator(MultipleLocator(30.0))
    figure.align_ylabels(list(panels))
    groups = [
        [_distance_in_words(distance) for distance in choice.distances],
        [*_LINES, *PHASES.values()],
        list(EVENT_MARKERS),
    ]
    legend_in_rows(figure, legend_entries(*panels), groups, 2 if choice.is_column else 4)
    return figure


def _distance_in_words(distance: float) -> str:
    return f"$q$ = {distance:g} $L$"


def _finer(made: Scan, number: int, drive: Carried | None) -> xr.Dataset:
    """Return samples of a sweep at the drive's steps and between events, denser toward these."""
    events = made.sweeps[number]
    marked = [events.first_contact, *events.transitions, events.snap_off]
    ends = np.array([event.travel for event in marked])
    share = 0.5 * (1.0 - np.cos(np.pi * np.arange(1, _BETWEEN) / _BETWEEN))
    between = ends[:-1, None] + np.diff(ends)[:, None] * share
    steps = travels_of(made.record)[made.record["sweep"].values == number]
    travels = np.append(steps[(steps > ends.min()) & (steps < ends.max())], between)
    if drive is not None:
        return scan(made.contour, drive=_by_way_of(travels, drive)).record
    way: Direction = "forward" if events.direction == "forward" else "backward"
    return scan(made.contour, direction=way, drive_angles=travels).record


def _by_way_of(travels: Floats, drive: Carried) -> Motion:
    """Return the same path of the base with further poses, at travels."""
    order = np.argsort(np.append(drive.travels, travels), kind="stable")
    poses = np.append(drive.poses, drive.at(travels), axis=0)[order]
    moved = np.abs(np.diff(poses, axis=0)).sum(axis=1) > _SAME
    return Motion(*poses[np.append(True, moved)].T)


def _draw_sweep(ax: Axes, sweep: xr.Dataset, along: DriveAxis, events: SweepEvents, channel: str, colour: Any) -> None:
    touching = sweep["truth_contact_phase"].values != "none"
    phase = sweep["truth_contact_phase"].values[touching].astype(object)
    is_travel = along.kind == "travel"
    place, value = along.values[touching], sweep[channel].values[touching]
    place, value, phase = with_events(place, value, phase, events, channel, "fixed", travels=is_travel)
    line: dict[str, Any] = {"color": colour, "linestyle": _LINES[events.direction], "zorder": 2.5}
    for run in phase_runs(phase):
        ax.plot(place[run], value[run], linewidth=_WIDTHS[str(phase[run.start])], **line)
    draw_events(ax, events, channel, "fixed", _SHRUNK, travels=is_travel, markeredgewidth=0.7)
