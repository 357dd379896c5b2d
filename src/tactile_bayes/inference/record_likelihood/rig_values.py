"""The rig of every contour, as it deviates from the stated one."""

from __future__ import annotations

from typing import Any, NamedTuple


class RigValues(NamedTuple):
    """Deviations of a rig from the stated one; numbers, or arrays of shape (n,) with one for every contour."""

    drive_angle_offset: Any = 0.0  # encoder offset in addition to that of the load cell's data sheet [rad]
    rigidity_scale: Any = 1.0  # flexural rigidity over the stated one
    suspension_compliance: Any = 0.0  # turn of the pivot's suspension per holding moment [rad/(EI/L) as stated]
    contact_compliance: Any = 0.0  # way of the object per normal force [L/(EI/L²) as stated]
    friction: Any = 0.0  # Coulomb's coefficient
    drive_angle_backlash: Any = 0.0  # forward less backward reading, in addition to the data sheet [rad]
    rest_curvature: Any = 0.0  # rest curvature of the rod in addition to the stated one [1/L]
    taper: Any = 0.0  # taper of the rod in addition to the stated one
    stem: Any = 0.0  # rigid piece between pivot and rod in addition to the stated one [L]
    length: Any = 1.0  # over the stated one; its rest curvature, and what is added to it, are then per that length
    # Amplitudes of the modes of the rest curvature, shape (n, MOST_MODES); none by default.
    rest_shape: Any = None
    # Shifts of pivots from their recorded positions [length], shape (n, pivots, 2), in the order of the record; pivots
    # after the last given one are not shifted.
    base_shifts: Any = None
