"""The rig of every contour, as it deviates from the stated one."""

from __future__ import annotations

from typing import Any, NamedTuple

__all__ = ["RigValues"]


class RigValues(NamedTuple):
    """Deviations of a rig from the stated one; numbers, or arrays of shape (n,) with one for every contour."""

    drive_angle_offset: Any = 0.0
    """Encoder offset in addition to that of the load cell's data sheet [rad]."""
    rigidity_scale: Any = 1.0
    """Flexural rigidity over the stated one."""
    suspension_compliance: Any = 0.0
    """Turn of the pivot's suspension per holding moment, in the unit of the record as stated [rad/(EI/L)]."""
    friction: Any = 0.0
    """Coulomb's coefficient."""
    drive_angle_backlash: Any = 0.0
    """Reading of the encoder in forward motion less that in backward motion, in addition to the data sheet [rad]."""
    rest_curvature: Any = 0.0
    """Rest curvature of the rod in addition to the stated one [1/L]."""
    taper: Any = 0.0
    """Taper of the rod in addition to the stated one."""
    stem: Any = 0.0
    """Rigid piece between pivot and rod in addition to the stated one [L]."""
    length: Any = 1.0
    """Length of the rod over the stated one; its rest curvature, and what is added to it, are then per that length."""
    base_shifts: Any = None
    """Shifts of pivots from their recorded positions [length], shape (n, pivots, 2), in the order of the record; pivots
    after the last given one are not shifted."""
