"""The events of a sweep: where contact begins, changes its phase and ends."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from tactile_bayes.mechanics.elastica import Wrench
from tactile_bayes.mechanics.paths import Paths, States
from tactile_bayes.mechanics.phases import TANGENTIAL, TIP
from tactile_bayes.mechanics.reachability import SnapOff
from tactile_bayes.mechanics.rod import Rod
from tactile_bayes.sweep.lab_frame import to_lab_frame
from tactile_bayes.sweep.path import Direction

__all__ = ["Event", "SweepEvents", "events_of"]


@dataclass(frozen=True)
class Event:
    """A distinguished state of a sweep, in the units of the scan.

    Attributes
    ----------
    kind : str
        "tip" or "tangential" at first contact; "tip → tangential" and so on at a change; "fold" (a smooth maximum of
        the drive angle), "corner" (a maximum where the phase changes or the contour's curvature jumps) or "thrust"
        (the line of force has come to pass through the pivot) at snap-off.
    drive_angle, slope_angle : float
        [rad].
    contact_x, contact_y, contact_arclength : float
        Contact point on the object and arc length of the rod up to it [length].
    holding_moment, force_x, force_y : float
        Base wrench.
    """

    kind: str
    drive_angle: float
    slope_angle: float
    contact_x: float
    contact_y: float
    contact_arclength: float
    holding_moment: float
    force_x: float
    force_y: float


@dataclass(frozen=True)
class SweepEvents:
    """Where contact begins, changes its phase and ends in one sweep.

    Attributes
    ----------
    direction : str
        "forward" or "backward".
    base : (float, float)
        The pivot.
    first_contact, snap_off : Event
    transitions : tuple of Event
        Changes of the phase, in the order in which they happen.
    clear : bool
        Whether the straight rod is free of the object after snap-off. If it is not, the rod comes to rest in another
        contact, which no sweep leads to.
    largest_strain : float
        Largest bending strain of the rod up to snap-off, to 1e-4 of it; 0 for a rod without thickness.
    """

    direction: str
    base: tuple[float, float]
    first_contact: Event
    transitions: tuple[Event, ...]
    snap_off: Event
    clear: bool
    largest_strain: float


def events_of(paths: Paths, direction: Direction, base: tuple[float, float], rod: Rod) -> SweepEvents:
    to_tip = paths.change_to_tip[0]
    parameters = np.concatenate([paths.first_parameter, paths.change_parameter[0, 1:], paths.snap_parameter])
    index = np.zeros(parameters.size, dtype=np.intp)
    states = paths.states_at(index, parameters)
    # At first contact the rod is straight and unloaded; rounding may put the point a little out of reach.
    wrench = _at_rest_first(states, bool(to_tip[0]))
    columns = to_lab_frame(paths.sweep_frame, index, states._replace(wrench=wrench), rod)
    words = ["tip" if tip else "tangential" for tip in to_tip]
    kinds = [
        words[0],
        *(f"{before} → {after}" for before, after in pairwise(words)),
        SnapOff(int(paths.snap_off[0])).name.lower(),
    ]
    names = [name for name in Event.__dataclass_fields__ if name != "kind"]
    found = [Event(kind, **{name: float(columns[name][i]) for name in names}) for i, kind in enumerate(kinds)]
    clear = bool(paths.is_clear()[0])
    strain = float(paths.largest_curvature[0]) * 0.5 * rod.diameter / rod.length
    return SweepEvents(direction, base, found[0], tuple(found[1:-1]), found[-1], clear, strain)


def _at_rest_first(states: States, tip: bool) -> Wrench:
    x, y = states.x[0], states.y[0]
    bearing, distance = np.arctan2(y, x), np.hypot(x, y)
    rest = {
        "drive_angle": bearing,
        "tip_angle": bearing,
        "contact_arclength": 1.0 if tip else distance,
        "holding_moment": 0.0,
        "force_x": 0.0,
        "force_y": 0.0,
        "phase": TIP if tip else TANGENTIAL,
    }
    columns = {name: value.copy() for name, value in states.wrench._asdict().items()}
    for name, value in rest.items():
        columns[name][0] = value
    return Wrench(**columns)
