"""Lines of a sweep over the drive angle: complete up to its events, and one for each phase of contact."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tactile_bayes.plotting.axes import Floats
from tactile_bayes.record import CHANNELS, Frame, turned
from tactile_bayes.sweep_events import Event, SweepEvents

__all__ = ["EVENT_MARKERS", "events_by_label", "load_of", "phase_runs", "with_events"]

Phases = NDArray[np.object_]

EVENT_MARKERS: Mapping[str, Mapping[str, Any]] = {
    "first contact": {"marker": "o", "markerfacecolor": "white", "markersize": 4.5},
    "phase change": {"marker": "D", "markersize": 4.0},
    "snap-off": {"marker": "X", "markersize": 7.0, "markeredgecolor": "white"},
}


def events_by_label(events: SweepEvents) -> dict[str, tuple[Event, ...]]:
    """Those that there are, by what they are called in a legend."""
    marked = {
        "first contact": (events.first_contact,),
        "phase change": events.transitions,
        "snap-off": (events.snap_off,),
    }
    return {label: of_label for label, of_label in marked.items() if of_label}


def with_events(
    angle: Floats, value: Floats, phase: Phases, events: SweepEvents, channel: str, frame: Frame
) -> tuple[Floats, Floats, Phases]:
    """Samples of a channel with those at the events among them, in the order in which the drive comes by."""
    marked = [events.first_contact, *events.transitions, events.snap_off]
    following = [event.kind.split(" → ")[-1] for event in marked[:-1]]
    angle = np.append(angle, [event.drive_angle for event in marked])
    value = np.append(value, [load_of(event, channel, frame) for event in marked])
    phase = np.append(phase, [*following, following[-1]])
    order = np.argsort(angle if events.direction == "forward" else -angle, kind="stable")
    return angle[order], value[order], phase[order]


def phase_runs(phase: Phases) -> Iterator[slice]:
    """Stretches of one phase, each up to the first state of the next, unless the rod has let go in between."""
    starts = np.flatnonzero(np.append(True, phase[1:] != phase[:-1]))
    for start, stop in zip(starts, np.append(starts[1:], phase.size), strict=True):
        joined = stop < phase.size and phase[stop] != "none"
        yield slice(int(start), int(stop) + 1 if joined else int(stop))


def load_of(event: Event, channel: str, frame: Frame) -> float:
    """A load of an event in the frame of a record; events are in the fixed one."""
    loads = {name: getattr(event, name) for name in CHANNELS}
    if frame == "turning":
        loads["force_x"], loads["force_y"] = turned(event.force_x, event.force_y, event.drive_angle)
    return float(loads[channel])
