"""The part of a sweep along which friction opposes the slip of the rod."""

from __future__ import annotations

import numpy as np

from tactile_bayes.mechanics.paths import Paths
from tactile_bayes.mechanics.phases import TANGENTIAL

__all__ = ["sliding_from"]

_LOOKS = 400
"""Travels from first contact to snap-off at which contacts are compared."""

_ROUNDING = 1e-12
"""Slip between two of them [L] that rounding may cause."""


def sliding_from(paths: Paths) -> float:
    """Return the travel in the sweep frame from which friction opposes the slip along one path; NaN if it does not.

    A rod that is curved toward the object is first straightened, and slides outward: friction has the wrong sense up to
    there. A state of sliding has no memory, so that those after it are right.
    """
    travels = np.linspace(paths.first_angle[0], paths.snap_angle[0], _LOOKS + 1)
    if paths.friction_angle[0] == 0.0:
        return float(travels[0])
    states = paths.states(np.zeros(travels.size, dtype=np.intp), travels)
    frame, alpha = paths.sweep_frame, states.slope_angle
    standoff = float(np.max(frame.standoff)) / float(np.max(frame.length))
    middle, arclength = 0.5 * (alpha[1:] + alpha[:-1]), states.wrench.contact_arclength
    moved = np.diff(states.x + standoff * np.sin(alpha)) * np.cos(middle)
    moved += np.diff(states.y - standoff * np.cos(alpha)) * np.sin(middle)
    lying = states.wrench.phase == TANGENTIAL
    slip = moved - np.where(lying[1:] & lying[:-1], np.diff(arclength), 0.0)
    wrong = np.sign(paths.changes[0, 0, 5]) * slip > _ROUNDING
    if not wrong.any():
        return float(travels[0])
    last = int(np.flatnonzero(wrong)[-1])
    return float(travels[last + 2]) if wrong[: last + 1].all() and last + 2 < _LOOKS else np.nan
