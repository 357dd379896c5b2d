"""Loaded states of sweeps with a rod whose rest shape is a circular arc."""

import numpy as np

from tactile_bayes.contours.sweep_frame import SweepFrame
from tactile_bayes.mechanics.paths import trace


def loaded_states(contour, backward, curvature, friction, angles):
    """Indices of the contours, and the states in contact at drive angles, both in the sweep frame."""
    count = len(backward)
    zero = np.zeros(count)
    frame = SweepFrame(contour.broadcast_to((count,)), zero, zero, 1.0, 0.0, np.asarray(backward), curvature)
    paths = trace(frame, friction_angle=np.arctan(friction), drive_angles=angles)
    index, _, states = paths.loaded_states()
    return index, states
