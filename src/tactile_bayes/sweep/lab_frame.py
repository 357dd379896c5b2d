"""States in the laboratory frame: its signs for both directions, and the rod's units."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from tactile_bayes.arrays import Floats, Index
from tactile_bayes.contours.sweep_frame import SweepFrame
from tactile_bayes.mechanics.paths import States
from tactile_bayes.rig.stated import Units


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
