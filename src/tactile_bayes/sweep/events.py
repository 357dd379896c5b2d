"""The events of a sweep: first contact, changes of the phase, and snap-off."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from tactile_bayes.mechanics.branches.line import lines_through
from tactile_bayes.mechanics.paths import ContactMode, Paths
from tactile_bayes.mechanics.reachability import SnapOff
from tactile_bayes.mechanics.rods.rod import Rod
from tactile_bayes.sweep.columns import to_lab_frame
from tactile_bayes.sweep.drive import Carried, Direction, Drive


@dataclass(frozen=True)
class Event:
    """A distinguished state of a sweep, in the units of the scan.

    Attributes
    ----------
    kind : str
        At first contact "tip" or "tangential". At a change "tip → tangential" and so on; "stick" where the slip
        vanishes and friction holds the contact, and "slip right" or "slip left" where it no longer does, after the
        sense in which the rod then slips along the contour. At snap-off "fold" (a smooth maximum of the drive angle, or
        of the travel), "corner" (a maximum where the phase changes or the contour's curvature jumps), "thrust" (the
        line of force passes through the pivot) or "jump" (friction lets the contact neither slide nor stick). A rod
        that is curved or carried may also leave the contour without a jump ("release"), and one that is carried still
        touch it at the end of the drive ("never").
    phase : str
        Contact from then on, "tip" or "tangential"; at snap-off, up to then.
    travel : float
        Position along the drive: the drive angle of a rotation [rad], or the distance moved by the base [length].
    drive_angle, slope_angle : float
        Drive angle, and slope angle of the contour at the contact [rad].
    base_x, base_y : float
        The pivot, or the base where it is then [length].
    contact_x, contact_y, contact_arclength : float
        Contact point on the object and arc length of the rod up to it [length].
    holding_moment, force_x, force_y : float
        Base wrench [N m and N, or EI/L and EI/L²].
    """

    kind: str
    phase: str
    travel: float
    drive_angle: float
    base_x: float
    base_y: float
    slope_angle: float
    contact_x: float
    contact_y: float
    contact_arclength: float
    holding_moment: float
    force_x: float
    force_y: float


@dataclass(frozen=True)
class SweepEvents:
    """Events of one sweep.

    Attributes
    ----------
    direction : str
        "forward" or "backward".
    base : (float, float)
        The pivot, or where the drive begins [length].
    first_contact, snap_off : Event
    transitions : tuple of Event
        Changes of the phase, and of sliding and sticking, in their order.
    clear : bool
        Whether the unloaded rod is clear of the object after snap-off. If it is not, the rod comes to rest in another
        contact, which no sweep reaches.
    touches_again : float
        Travel at which a drive that carries the base brings the rod, clear after snap-off, to the object again
        [length], and beyond which its state is not computed; NaN if it does not.
    largest_strain : float
        Largest bending strain of the rod up to snap-off, with a relative error of 1e-4; 0 for a rod without thickness.
    """

    direction: str
    base: tuple[float, float]
    first_contact: Event
    transitions: tuple[Event, ...]
    snap_off: Event
    clear: bool
    touches_again: float
    largest_strain: float

    def __eq__(self, other: object) -> bool:
        """Return True for the same events, though a NaN is no number: Python 3.13 compares fields one by one."""
        return isinstance(other, SweepEvents) and repr(self) == repr(other)

    def __hash__(self) -> int:
        return hash(repr(self))


_PHASES = {True: "tip", False: "tangential"}


def _change(before: ContactMode, after: ContactMode) -> str:
    if before.tip != after.tip:
        return f"{_PHASES[before.tip]} → {_PHASES[after.tip]}"
    return "stick" if after.sticks else f"slip {'right' if after.to_right else 'left'}"


def events_of(paths: Paths, direction: Direction, drive: Drive, rod: Rod) -> SweepEvents:
    modes = paths.modes()[0]
    held = [0] if modes[0].sticks else []
    order = np.array([0, *held, *range(1, len(modes) + 1)])
    index = np.zeros(order.size, dtype=np.intp)
    states = paths.event_states().take(index, order)
    columns = to_lab_frame(paths.sweep_frame, index, states, rod)
    if np.any(paths.sweeps.compliance):  # the rod at its base has another direction than the drive
        driven = paths.drive_angles_at(paths.event_travels()[0, order])
        columns["drive_angle"] = np.pi - driven if direction == "backward" else driven
    clear, again = bool(paths.is_clear()[0]), np.nan
    if isinstance(drive, Carried):
        internal = lines_through(drive.poses, rod.length, backward=direction == "backward").travels
        columns["travel"] = np.interp(paths.event_travels()[0, order], internal, drive.travels)
        if paths.clear_angle[0] > paths.snap_angle[0]:
            clear, again = True, float(np.interp(paths.clear_angle[0], internal, drive.travels))
        columns["base_x"], columns["base_y"], _ = drive.at(columns["travel"]).T
        base = (float(drive.poses[0, 0]), float(drive.poses[0, 1]))
    else:
        base, columns["travel"] = drive.base, columns["drive_angle"]
        columns["base_x"], columns["base_y"] = (np.full(index.size, value) for value in base)
    kinds = [
        _PHASES[modes[0].tip],
        *("stick" for _ in held),
        *(_change(before, after) for before, after in pairwise(modes)),
        SnapOff(int(paths.snap_off[0])).name.lower(),
    ]
    phases = [_PHASES[modes[min(k, len(modes) - 1)].tip] for k in order]
    names = [name for name in Event.__dataclass_fields__ if name not in ("kind", "phase")]
    found = [
        Event(kind, phase, **{name: float(columns[name][i]) for name in names})
        for i, (kind, phase) in enumerate(zip(kinds, phases, strict=True))
    ]
    strain = float(paths.largest_curvature[0]) * 0.5 * rod.diameter / rod.length
    return SweepEvents(direction, base, found[0], tuple(found[1:-1]), found[-1], clear, again, strain)
