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
from numpy.typing import NDArray
from scipy.special import ellipj, ellipk

from tactile_bayes.arc import ArcSlopes, arc_and_slopes

__all__ = [
    "ARCLENGTH",
    "DRIVE_ANGLE",
    "FORCE",
    "PLACE",
    "PSI1",
    "Touching",
    "TouchingSlopes",
    "place_by_wrench",
    "touching",
    "touching_and_slopes",
]

Floats = NDArray[np.float64]

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


class _Bent(NamedTuple):
    """The rod seen along its direction at the contact: chord along and across, turn, and their slopes."""

    along: Floats
    across: Floats
    turn: Floats
    by_force: tuple[Floats, Floats, Floats]
    by_psi1: tuple[Floats, Floats, Floats]
    by_arclength: tuple[Floats, Floats, Floats]


def _bent(force: Floats, psi1: Floats, arclength: Floats) -> _Bent:
    m = np.sin(0.25 * np.pi - 0.5 * psi1) ** 2
    with np.errstate(invalid="ignore", over="ignore"):
        root = np.sqrt(force)
        load = root * arclength
        possible = (np.abs(psi1) < 0.5 * np.pi) & (load > 0.0) & (arclength > 0.0) & (force < np.inf)
        # With twice K the line of force passes through the pivot.
        possible &= load <= 2.0 * ellipk(np.where(possible, m, 0.5))
    m, load, force = np.where(possible, m, 0.5), np.where(possible, load, 1.0), np.where(possible, force, 1.0)
    root = np.where(possible, root, np.nan)
    arc, by_chi, by_psi1 = arc_and_slopes(ellipj(load, m)[3], m)
    # With the length of the arc held, its amplitude gives way.
    by_load = ArcSlopes(*(slope / by_chi.length for slope in by_chi))
    held = ArcSlopes(*(p - by_psi1.length * q for p, q in zip(by_psi1, by_load, strict=True)))
    per_force = 0.5 * arclength / root
    along, across = arclength - arc.shortfall / root, arc.offset / root
    return _Bent(
        along,
        across,
        arc.turn,
        (
            (0.5 * arc.shortfall / force - by_load.shortfall * per_force) / root,
            (by_load.offset * per_force - 0.5 * arc.offset / force) / root,
            by_load.turn * per_force,
        ),
        (-held.shortfall / root, held.offset / root, held.turn),
        (1.0 - by_load.shortfall, by_load.offset, by_load.turn * root),
    )


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
    return _touching(_bent(*coordinates.T[:3]), coordinates, friction_angle)


def touching_and_slopes(coordinates: Floats, friction_angle: Floats | float = 0.0) -> tuple[Touching, TouchingSlopes]:
    """The same with derivatives by force, ψ1, arc length and drive angle."""
    force, psi1, arclength, drive_angle = coordinates.T
    bent = _bent(force, psi1, arclength)
    rod = _touching(bent, coordinates, friction_angle)
    (_, fx, fy), (x, y, _, _) = rod.loads, rod.place
    tip_angle = drive_angle - bent.turn
    cos, sin = np.cos(tip_angle), np.sin(tip_angle)
    loads, place = np.empty((force.size, 3, 4)), np.empty((force.size, 4, 4))
    loads[:, :, DRIVE_ANGLE] = np.stack([np.zeros_like(fx), -fy, fx], axis=-1)
    place[:, :, DRIVE_ANGLE] = np.stack([-y, x, np.ones_like(x), np.zeros_like(x)], axis=-1)
    by = ((bent.by_force, 0.0), (bent.by_psi1, 1.0), (bent.by_arclength, 0.0))
    for column, ((along, across, turn), leaning) in enumerate(by):
        x_by = along * cos - across * sin + y * turn
        y_by = along * sin + across * cos - x * turn
        beta = -turn - leaning
        fx_by, fy_by = -fy * beta, fx * beta
        if column == FORCE:
            fx_by, fy_by = fx_by + fx / force, fy_by + fy / force
        loads[:, 0, column] = x_by * fy + x * fy_by - y_by * fx - y * fx_by
        loads[:, 1, column], loads[:, 2, column] = fx_by, fy_by
        place[:, 0, column], place[:, 1, column], place[:, 2, column] = x_by, y_by, beta
        place[:, 3, column] = 1.0 if column == ARCLENGTH else 0.0
    return rod, TouchingSlopes(loads, place)


def place_by_wrench(slopes: TouchingSlopes) -> Floats:
    """Derivatives of `PLACE` by drive angle and loads, shape (n, 4, 4): the slopes of Step 2, in closed form.

    Examples
    --------
    >>> _, slopes = touching_and_slopes(np.array([[2.0, 0.3, 0.9, 2.0]]))
    >>> place_by_wrench(slopes)[0, 3].round(3)  # of the arc length
    array([ 0.419,  0.361,  0.416, -0.031])
    """
    free = [FORCE, PSI1, ARCLENGTH]
    by_loads = slopes.place[:, :, free] @ np.linalg.inv(slopes.loads[:, :, free])
    by_angle = slopes.place[:, :, [DRIVE_ANGLE]] - by_loads @ slopes.loads[:, :, [DRIVE_ANGLE]]
    return np.concatenate([by_angle, by_loads], axis=-1)


def _touching(bent: _Bent, coordinates: Floats, friction_angle: Floats | float) -> Touching:
    force, psi1, arclength, drive_angle = coordinates.T
    along, across = bent.along, bent.across
    tip_angle = drive_angle - bent.turn
    beta = tip_angle - psi1
    cos, sin = np.cos(tip_angle), np.sin(tip_angle)
    fx, fy = -force * np.sin(beta), force * np.cos(beta)
    x, y = along * cos - across * sin, along * sin + across * cos
    # In polar coordinates r, ϑ of the contact the volume is r ∂(r, ϑ − α), as all turn with the drive.
    (along_f, across_f, _), (along_1, across_1, _), (along_s, across_s, _) = (
        bent.by_force,
        bent.by_psi1,
        bent.by_arclength,
    )
    return Touching(
        np.stack([x * fy - y * fx, fx, fy]),
        np.stack([x, y, beta - friction_angle, arclength]),
        np.abs(along_f * across_1 - along_1 * across_f + along * along_f + across * across_f),
        np.abs(along_f * across_s - along_s * across_f),
    )
