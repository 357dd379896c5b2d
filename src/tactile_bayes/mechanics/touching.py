"""The touching rod in coordinates of its own: contact force, direction at the contact, arc length, drive angle.

A forward contact of a uniform rod has, with friction given, four coordinates: the contact force f, ψ1 = φ(s1) − β at
the contact, the arc length s1 and the drive angle φ0; what the base feels and where the contact is are closed forms in
them. Not all four are free. In tip contact s1 = 1 and ψ1 > −δ, in tangential contact ψ1 = −δ and s1 < 1: a contact has
three degrees of freedom, and the two phases are two sheets that meet in the edge s1 = 1, ψ1 = −δ.

Dimensionless, relative to the pivot, forward contacts.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from tactile_bayes.arrays import Floats

__all__ = [
    "ARCLENGTH",
    "DRIVE_ANGLE",
    "FORCE",
    "PLACE",
    "PSI1",
    "Touching",
    "TouchingSlopes",
    "place_by_wrench",
    "touch_room",
    "touching",
    "touching_and_slopes",
]

FORCE, PSI1, ARCLENGTH, DRIVE_ANGLE = range(4)
"""The coordinates, in the order in which derivatives by them stand."""

PLACE = ("contact_x", "contact_y", "slope_angle", "contact_arclength")
"""What `Touching.place` holds, by the names of a record's columns."""


class Touching(NamedTuple):
    """Touching rods; NaN where none has these coordinates."""

    loads: Floats
    """Holding moment and support reaction, shape (3, n)."""
    place: Floats
    """Contact point, slope angle of the contour there, and arc length, shape (4, n)."""
    volume_tip: Floats
    """|∂(contact_x, contact_y, slope_angle)/∂(force, psi1, drive_angle)|, for s1 = 1, shape (n,)."""
    volume_tangential: Floats
    """|∂(contact_x, contact_y, slope_angle)/∂(force, arclength, drive_angle)|, for ψ1 fixed, shape (n,)."""


class TouchingSlopes(NamedTuple):
    """Derivatives by the four coordinates."""

    loads: Floats
    """Shape (n, 3, 4)."""
    place: Floats
    """Shape (n, 4, 4)."""


def touching(coordinates: Floats, friction_angle: Floats | float = 0.0) -> Touching:
    """What the base of touching rods feels, and where they touch.

    Parameters
    ----------
    coordinates : ndarray, shape (n, 4)
        Contact force f > 0, ψ1 ∈ (−π/2, π/2), arc length s1 > 0, and slope φ0 at the pivot.
    friction_angle : ndarray, shape (n,), or float
        δ = arctan μ [rad].

    Examples
    --------
    >>> rod = touching(np.array([[2.0, 0.3, 1.0, 2.0]]))
    >>> rod.place.round(4).ravel()
    array([0.1457, 0.9536, 0.8156, 1.    ])
    """
    return _touches(coordinates, friction_angle, 0)[0]


def touching_and_slopes(coordinates: Floats, friction_angle: Floats | float = 0.0) -> tuple[Touching, TouchingSlopes]:
    """The same with derivatives by force, ψ1, arc length and drive angle."""
    return _touches(coordinates, friction_angle, len(coordinates))


def _touches(coordinates: Floats, friction_angle: Floats | float, slopes: int) -> tuple[Touching, TouchingSlopes]:
    from tactile_bayes.mechanics.touches import touches  # numba takes a second to load

    count = len(coordinates)
    coordinates = np.ascontiguousarray(coordinates, dtype=float)
    delta = np.array(np.broadcast_to(friction_angle, (count,)), dtype=float)
    loads, place, volumes = np.empty((3, count)), np.empty((4, count)), np.empty((2, count))
    by = TouchingSlopes(np.empty((slopes, 3, 4)), np.empty((slopes, 4, 4)))
    touches(coordinates, delta, loads, place, volumes, *by, *touch_room())
    return Touching(loads, place, *volumes), by


def touch_room() -> tuple[Floats, Floats]:
    """Arrays for `touches.touch` to write in."""
    return np.empty((5, 6)), np.empty(20)


def place_by_wrench(coordinates: Floats) -> Floats:
    """Derivatives of `PLACE` by drive angle and loads, shape (n, 4, 4): the slopes of Step 2, in closed form.

    Examples
    --------
    >>> place_by_wrench(np.array([[2.0, 0.3, 0.9, 2.0]]))[0, 3].round(3)  # of the arc length
    array([ 0.419,  0.361,  0.416, -0.031])
    """
    from tactile_bayes.mechanics.touches import wrench_slopes  # numba takes a second to load

    slopes = np.empty((len(coordinates), 4, 4))
    wrench_slopes(np.ascontiguousarray(coordinates, dtype=float), *touch_room(), slopes)
    return slopes
