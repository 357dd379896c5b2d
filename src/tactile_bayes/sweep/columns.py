"""Columns of sweeps: states in the laboratory frame, with its signs for both directions and the rod's units."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tactile_bayes.arrays import Floats, Index
from tactile_bayes.contours.sweep_frame import SweepFrame
from tactile_bayes.mechanics.paths import Paths, States
from tactile_bayes.mechanics.phases import NONE
from tactile_bayes.mechanics.rods.rod import Rod
from tactile_bayes.record import CHANNELS
from tactile_bayes.rig.stated import Units

# Columns of samples; loads are 0 out of contact, the others NaN.
SAMPLE_COLUMNS = (*CHANNELS, "contact_x", "contact_y", "slope_angle", "contact_arclength", "tip_angle")
EVENT_COLUMNS = ("drive_angle", "slope_angle", "contact_x", "contact_y")


class ManyUnits(NamedTuple):
    """Units of the rods of many sweeps, each a number for all or an array of shape (n,)."""

    length_unit: Any
    moment_unit: Any
    force_unit: Any

    @classmethod
    def of_rod(cls, rod: Rod) -> ManyUnits:
        return cls(rod.length_unit, rod.moment_unit, rod.force_unit)

    def of(self, index: Index) -> ManyUnits:
        return ManyUnits(*(value[index] if isinstance(value, np.ndarray) else value for value in self))


def to_lab_frame(sweep_frame: SweepFrame, index: Index, states: States, rod: Units) -> dict[str, NDArray[Any]]:
    """Convert states to the laboratory frame, with units. Shapes: index (...) → (...)."""
    mirrored = sweep_frame.mirrored[index]
    sign = np.where(mirrored, -1.0, 1.0)
    length = sweep_frame.length_at(index)
    wrench = states.wrench

    def turned(angle: Floats) -> Floats:
        return np.where(mirrored, np.pi - angle, angle)

    return {
        "drive_angle": turned(wrench.drive_angle),
        "holding_moment": sign * wrench.holding_moment * rod.moment_unit + 0.0,  # never −0
        "force_x": sign * wrench.force_x * rod.force_unit + 0.0,
        "force_y": wrench.force_y * rod.force_unit,
        "contact_arclength": wrench.contact_arclength * length,
        "contact_phase": wrench.phase,
        "contact_x": sweep_frame.base_x[index] + sign * states.x * length,
        "contact_y": sweep_frame.base_y[index] + states.y * length,
        "tip_angle": turned(wrench.tip_angle),
        "slope_angle": sign * states.slope_angle,
    }


def sweep_samples(paths: Paths, units: ManyUnits, index: Index, sample: Index | None = None) -> dict[str, NDArray[Any]]:
    """Loads and contacts at the drive angles with which paths were traced, shape (*index.shape, k), or at one of them
    each, shape (*index.shape,)."""
    each, chosen = (index[..., None], slice(None)) if sample is None else (index, sample)
    states = paths.sampled_states(index, chosen)
    found = to_lab_frame(paths.sweep_frame, each, states, units.of(each))
    for name in CHANNELS:
        np.copyto(found[name], 0.0, where=states.wrench.phase == NONE)
    return {name: found[name] for name in (*SAMPLE_COLUMNS, "contact_phase")}


def sweep_events(paths: Paths, units: ManyUnits) -> Mapping[str, Mapping[str, Floats]]:
    """`EVENT_COLUMNS` of "first_contact" and "snap_off" in the laboratory frame, shape (n,); NaN without contact."""
    index, states = np.arange(paths.sweep_frame.size), paths.event_states()
    events = {}
    for name, angle, event in (
        ("first_contact", paths.first_angle, np.zeros_like(paths.phases)),
        ("snap_off", paths.snap_angle, paths.phases),
    ):
        found = to_lab_frame(paths.sweep_frame, index, states.take(index, event), units.of(index))
        events[name] = {column: found[column] for column in EVENT_COLUMNS}
        if paths.lines is None:
            events[name]["drive_angle"] = np.where(paths.sweep_frame.mirrored, np.pi - angle, angle)
    return events


def phases_of(paths: Paths) -> list[str]:
    """Phases of every sweep in order, as "A-B-A": A is tip contact and B tangential; "a" and "b", contact that sticks;
    "" without any."""
    names = {(True, False): "A", (False, False): "B", (True, True): "a", (False, True): "b"}
    return ["-".join(names[one.tip, one.sticks] for one in of_path) for of_path in paths.modes()]
