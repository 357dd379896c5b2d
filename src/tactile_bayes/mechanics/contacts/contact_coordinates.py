"""Contact coordinates: contact force, direction at the contact, arc length, drive angle.

A forward contact of a uniform rod with given friction and constant rest curvature has four coordinates: the contact
force f, ψ1 = φ(s1) − β at the contact, the arc length s1, and the drive angle φ0. Base wrench and contact point are
closed forms in them. Not all four are free: in tip contact s1 = 1 and ψ1 > −δ, in tangential contact ψ1 = −δ and
s1 < 1. A contact therefore has three degrees of freedom, and the two phases are two sheets that meet in the edge
s1 = 1, ψ1 = −δ.

Quantities are dimensionless and relative to the pivot; contacts are forward ones.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from tactile_bayes.arrays import Floats
from tactile_bayes.mechanics.rods.profile import Rods, rods_of

FORCE, PSI1, ARCLENGTH, DRIVE_ANGLE = range(4)  # indices of the coordinates, also of derivatives by them
# Rows of `ContactStates.place`, by the names of a record's columns.
PLACE = ("contact_x", "contact_y", "slope_angle", "contact_arclength")


class ContactStates(NamedTuple):
    """Contacts with given coordinates; NaN where there is none."""

    loads: Floats  # holding moment [EI/L] and support reaction [EI/L²], shape (3, n)
    place: Floats  # contact point [L], slope angle of the contour there [rad], and arc length [L], shape (4, n)
    volume_tip: Floats  # |∂(contact_x, contact_y, slope_angle)/∂(force, psi1, drive_angle)| at s1 = 1, shape (n,)
    # |∂(contact_x, contact_y, slope_angle)/∂(force, arclength, drive_angle)| at a fixed ψ1, shape (n,).
    volume_tangential: Floats


class ContactStateSlopes(NamedTuple):
    """Derivatives by the four coordinates."""

    loads: Floats  # shape (n, 3, 4)
    place: Floats  # shape (n, 4, 4)


def contact_states(
    coordinates: Floats, friction_angle: Floats | float = 0.0, rods: Rods | ArrayLike = 0.0
) -> ContactStates:
    """Base wrench and place of contacts with given coordinates, in rows: contact force f > 0 [EI/L²], ψ1 ∈ (−π/2, π/2)
    [rad], arc length s1 > 0 [L], and slope φ0 at the pivot [rad]; for rods, or rest curvatures of arcs.

    >>> contact_states(np.array([[2.0, 0.3, 1.0, 2.0]])).place.round(4).ravel()
    array([0.1457, 0.9536, 0.8156, 1.    ])
    """
    return contact_states_and_slopes(coordinates, friction_angle, rods, with_slopes=False)[0]


def contact_states_and_slopes(
    coordinates: Floats,
    friction_angle: Floats | float = 0.0,
    rods: Rods | ArrayLike = 0.0,
    *,
    with_slopes: bool = True,
) -> tuple[ContactStates, ContactStateSlopes]:
    """Contacts with given coordinates, and their derivatives by these, or none; see `contact_states`."""
    from tactile_bayes.mechanics.contacts.contact_map import write_contact_states
    from tactile_bayes.mechanics.poses.beam import varied_of  # numba takes a second to load

    count = len(coordinates)
    slopes = count if with_slopes else 0
    coordinates = np.ascontiguousarray(coordinates, dtype=float)
    delta = np.array(np.broadcast_to(friction_angle, (count,)), dtype=float)
    curvature, profile, stem = rods_of(rods, count)
    loads, place, volumes = np.empty((3, count)), np.empty((4, count)), np.empty((2, count))
    by = ContactStateSlopes(np.empty((slopes, 3, 4)), np.empty((slopes, 4, 4)))
    write_contact_states(
        coordinates, delta, curvature, varied_of(profile), stem, loads, place, volumes, *by, contact_workspace()
    )
    return ContactStates(loads, place, *volumes), by


def contact_workspace() -> Floats:
    """Array for `contact_map.contact_state` to write to."""
    return np.empty((5, 6))


def place_by_wrench(coordinates: Floats, rods: Rods | ArrayLike = 0.0) -> Floats:
    """Derivatives of `PLACE` by drive angle and loads, shape (n, 4, 4): those of Step 2, in closed form."""
    from tactile_bayes.mechanics.contacts.contact_map import wrench_slopes
    from tactile_bayes.mechanics.poses.beam import varied_of  # numba takes a second to load

    slopes = np.empty((len(coordinates), 4, 4))
    curvature, profile, stem = rods_of(rods, len(coordinates))
    coordinates = np.ascontiguousarray(coordinates, dtype=float)
    wrench_slopes(coordinates, curvature, varied_of(profile), stem, contact_workspace(), slopes)
    return slopes
