"""Sweeps along the drive: readings, lines complete up to the events, and panels of channels."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from tactile_bayes.arrays import Floats
from tactile_bayes.plotting.legends import legend_above, legend_entries
from tactile_bayes.plotting.marks import PALETTE, SWEEP_MARKERS
from tactile_bayes.record import CHANNELS, Frame, turned
from tactile_bayes.sweep import Event, SweepEvents

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Phases = NDArray[np.object_]

EVENT_MARKERS: Mapping[str, Mapping[str, Any]] = {
    "first contact": {"marker": "o", "markerfacecolor": "white", "markersize": 4.5},
    "phase change": {"marker": "D", "markersize": 4.0},
    "snap-off": {"marker": "X", "markersize": 7.0, "markeredgecolor": "white"},
    "release": {"marker": "v", "markersize": 7.0, "markeredgecolor": "white"},
}
# Labels of the end of contact other than by a snap-off, by its kind.
ENDINGS: Mapping[str, str] = {"release": "release", "never": "end of the drive"}


def reading_style(direction: str, colour: str) -> dict[str, Any]:
    """Return the style of single readings of a sweep."""
    style = {"marker": SWEEP_MARKERS[direction], "markersize": 2.6, "color": colour}
    return style | {"linestyle": "none", "markerfacecolor": "none", "markeredgewidth": 0.6}


def draw_events(
    ax: Axes,
    events: SweepEvents,
    channel: str,
    frame: Frame,
    size: float = 1.0,
    *,
    travels: bool = False,
    **style: Any,
) -> None:
    """Mark first contact, phase changes and snap-off or release, with markers of `size` times their usual size.

    They are marked at drive angles [degrees], or at travels of the base. A drive that ends in contact has neither.
    """
    ending = ENDINGS.get(events.snap_off.kind, "snap-off")
    marked = {
        "first contact": (events.first_contact,),
        "phase change": events.transitions,
        ending: (events.snap_off,) if ending in EVENT_MARKERS else (),
    }
    for label, of_label in marked.items():
        if of_label:
            angles = [_place_of(event, travels) for event in of_label]
            values = [_load_of(event, channel, frame) for event in of_label]
            look = {**style, **EVENT_MARKERS[label], "color": PALETTE["change"], "linestyle": "none", "zorder": 4}
            look["markersize"] *= size
            ax.plot(angles, values, label=label, **look)


def with_events(
    angle: Floats,
    value: Floats,
    phase: Phases,
    events: SweepEvents,
    channel: str,
    frame: Frame,
    *,
    travels: bool = False,
) -> tuple[Floats, Floats, Phases]:
    """Return the samples of a channel and its values at the events, in the order of the drive.

    They are at drive angles [degrees], or at travels of the base.
    """
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
    legend_above(
        panels[0],
        min(columns, len(entries)),
        {label: entries[label] for label in sorted(entries, key=order)},
        **options,
    )
