"""Readings along the drive: their coordinate, lines complete up to the events, and panels of channels."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from tactile_bayes.arrays import Floats, Index
from tactile_bayes.plotting.labels import DRIVE_ANGLE, legend_above, legend_entries, set_unit
from tactile_bayes.plotting.style import PALETTE, SWEEP_MARKERS
from tactile_bayes.record import CHANNELS, Frame, carried_sweeps, travels_of, turned
from tactile_bayes.sweep import Event, SweepEvents

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.axis import Axis

# Widths [degrees] between which an axis of angles has ticks at multiples of 15° or 30°.
_SHORTEST, _LONGEST = 60.0, 400.0
Phases = NDArray[np.object_]
EVENT_MARKERS: Mapping[str, Mapping[str, Any]] = {
    "first contact": {"marker": "o", "markerfacecolor": "white", "markersize": 4.5},
    "phase change": {"marker": "D", "markersize": 4.0},
    "snap-off": {"marker": "X", "markersize": 7.0, "markeredgecolor": "white"},
    "release": {"marker": "v", "markersize": 7.0, "markeredgecolor": "white"},
}
# Labels of the end of contact other than by a snap-off, by its kind.
ENDINGS: Mapping[str, str] = {"release": "release", "never": "end of the drive"}


@dataclass(frozen=True)
class DriveAxis:
    """Coordinate of samples: drive angle, travel if all sweeps carry the base, number of the sample if some do."""

    kind: Literal["angle", "travel", "sample"]
    values: Floats  # shape (samples,): degrees, lengths in the record's unit, or numbers of samples
    travels: Floats  # shape (samples,), from `travels_of`
    starts: Floats  # numbers between sweeps, if they are drawn side by side
    attrs: dict[Any, Any]

    def place_of(self, events: xr.Dataset, name: str, rows: Index) -> float:
        """Return where an event of the sweep with these samples is drawn, by its drive angle or travel; NaN without."""
        if self.kind == "angle":
            return float(np.degrees(events[f"{name}_drive_angle"].values.mean()))
        travel = float(events[f"{name}_travel"].values.mean())
        if self.kind == "travel" or not np.isfinite(travel):
            return travel
        order = rows[np.argsort(self.travels[rows], kind="stable")]
        return float(np.interp(travel, self.travels[order], self.values[order]))

    def draw_below(self, ax: Axes) -> None:
        """Draw the line of zero readings, and lines between sweeps that are side by side."""
        ax.axhline(0.0, color="0.85", linewidth=0.8, zorder=0)
        for start in self.starts:
            ax.axvline(start, color="0.6", linewidth=0.8, zorder=0)

    def label(self, axis: Axis, *, with_ticks: bool = True) -> None:
        """Label an axis with what it shows and its unit, with ticks at round angles."""
        if self.kind == "travel":
            set_unit(axis, "travel of the base ", "base_x", self.attrs, self.values)
            return
        axis.set_label_text(DRIVE_ANGLE if self.kind == "angle" else "sample")
        low, high = axis.get_view_interval()
        if with_ticks and self.kind == "angle" and _SHORTEST < high - low < _LONGEST:
            from matplotlib.ticker import MultipleLocator

            axis.set_major_locator(MultipleLocator(15.0 if high - low < 150.0 else 30.0))


def drive_axis(record: xr.Dataset) -> DriveAxis:
    """Return the coordinate over which a record is drawn."""
    carried, sweep = carried_sweeps(record), record["sweep"].values
    attrs = dict(record["base_x"].attrs)
    travels, none = travels_of(record), np.empty(0)
    if not carried:
        return DriveAxis("angle", np.degrees(travels), travels, none, attrs)
    if set(np.unique(sweep).tolist()) == set(carried):
        return DriveAxis("travel", travels, travels, none, attrs)
    starts: Floats = np.flatnonzero(np.diff(sweep) != 0).astype(float) + 0.5
    return DriveAxis("sample", np.arange(sweep.size, dtype=float), travels, starts, attrs)


def reading_style(direction: str, colour: str) -> dict[str, Any]:
    """Return the style of single readings of a sweep."""
    style = {"marker": SWEEP_MARKERS[direction], "markersize": 2.6, "color": colour}
    return style | {"linestyle": "none", "markerfacecolor": "none", "markeredgewidth": 0.6}


def draw_events(
    ax: Axes, events: SweepEvents, channel: str, frame: Frame, size: float = 1.0, *, travels: bool = False, **style: Any
) -> None:
    """Mark first contact, phase changes and snap-off or release at drive angles [degrees], or at travels."""
    ending = ENDINGS.get(events.snap_off.kind, "snap-off")
    marked = {
        "first contact": (events.first_contact,),
        "phase change": events.transitions,
        ending: (events.snap_off,) if ending in EVENT_MARKERS else (),
    }
    for label, of_label in marked.items():
        if of_label:
            places = [_place_of(event, travels) for event in of_label]
            values = [_load_of(event, channel, frame) for event in of_label]
            look = {**style, **EVENT_MARKERS[label], "color": PALETTE["change"], "linestyle": "none", "zorder": 4}
            ax.plot(places, values, label=label, **look | {"markersize": size * look["markersize"]})


def with_events(
    angle: Floats, value: Floats, phase: Phases, events: SweepEvents, channel: str, frame: Frame, travels: bool = False
) -> tuple[Floats, Floats, Phases]:
    """Return samples of a channel, and its values at the events, at drive angles [degrees] or travels, in order."""
    marked = [events.first_contact, *events.transitions, events.snap_off]
    following = [event.phase for event in marked[:-1]]
    angle = np.append(angle, [_place_of(event, travels) for event in marked])
    value = np.append(value, [_load_of(event, channel, frame) for event in marked])
    phase = np.append(phase, [*following, following[-1]])
    order = np.argsort(angle if travels or events.direction == "forward" else -angle, kind="stable")
    return angle[order], value[order], phase[order]


def phase_runs(phase: Phases) -> Iterator[slice]:
    """Yield stretches of one phase, each up to the first state of the next, unless the rod has let go in between."""
    starts = np.flatnonzero(np.append(True, phase[1:] != phase[:-1]))
    for start, stop in zip(starts, np.append(starts[1:], phase.size), strict=True):
        joined = stop < phase.size and phase[stop] != "none"
        yield slice(int(start), int(stop) + 1 if joined else int(stop))


def _place_of(event: Event, travels: bool) -> float:
    return event.travel if travels else float(np.degrees(event.drive_angle))


def _load_of(event: Event, channel: str, frame: Frame) -> float:
    """Return a load of an event in the frame of a record; events are in the fixed frame."""
    loads = {name: getattr(event, name) for name in CHANNELS}
    if frame == "turning":
        loads["force_x"], loads["force_y"] = turned(event.force_x, event.force_y, event.drive_angle)
    return float(loads[channel])


def finish_channels(panels: Iterable[Axes], order: Callable[[str], int], columns: int, **options: Any) -> None:
    """Give panels few ticks, and the first panel a legend for all of them, ordered by label."""
    from matplotlib.ticker import MaxNLocator

    panels = list(panels)
    for panel in panels:
        if len(panel.get_yticks()):
            panel.yaxis.set_major_locator(MaxNLocator(4))
    entries = legend_entries(*panels)
    ordered = {label: entries[label] for label in sorted(entries, key=order)}
    legend_above(panels[0], min(columns, len(entries)), ordered, **options)
