"""The shape of the deformed rod from its base wrench, in closed form.

Quantities are dimensionless and relative to the pivot, as in `elastica`. Between pivot and contact the rod is a piece
of elastica, and its point at arc length s is the pivot of a rod of length s1 − s with the same contact (`pose`). Beyond
the contact it has its rest curvature. A rigid stem only moves where it begins.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from tactile_bayes.arrays import Floats
from tactile_bayes.errors import ParameterError
from tactile_bayes.mechanics.elastica import contact_from_wrench, lever_of_stem
from tactile_bayes.mechanics.rods.profile import Profile, Rods

__all__ = ["rod_shape"]


def rod_shape(
    drive_angle: ArrayLike,
    holding_moment: ArrayLike,
    force_x: ArrayLike,
    force_y: ArrayLike,
    *,
    points: int = 101,
    side: ArrayLike | None = None,
    rest_curvature: ArrayLike = 0.0,
    rods: Rods | None = None,
) -> tuple[Floats, Floats]:
    """Centreline of the rod from pivot to tip: x' = cos φ, y' = sin φ, φ'' = f cos(φ − β) (equation 27).

    Merker et al. 2018, doi 10.1155/2018/1613945, solved in closed form.

    Parameters
    ----------
    drive_angle, holding_moment, force_x, force_y : array_like
        Slope of the rod at the pivot [rad] and the wrench there (moment EI/L, force EI/L²); they broadcast.
    points : int
        Number of points of the rod, at arc lengths `numpy.linspace(0, 1, points)`; at least 2. Give more if rods look
        polygonal.
    side : array_like of +1 or −1, optional
        +1 for contacts of a forward sweep, −1 for those of a backward one; by default the sign of the holding moment.
    rest_curvature : array_like
        Curvature of the unloaded rod in the laboratory frame, a circular arc; > 0 counter-clockwise [1/L].
    rods : Rods, optional
        Rods in place of arcs, mirrored to those of forward contacts.

    Returns
    -------
    x, y : ndarray, shape (..., points), or one more if there is a stem
        Coordinates relative to the pivot [L], of which the first is the pivot. Where the force is zero or the wrench
        NaN, the rod is not loaded and has its rest shape. Where the bending moment has no zero, no contact makes such a
        wrench, and the coordinates are NaN.

    Raises
    ------
    ParameterError
        If there are fewer than 2 points.

    Examples
    --------
    >>> from tactile_bayes.mechanics.elastica import wrench_from_contact
    >>> w = wrench_from_contact(0.2, 0.6, 0.1)
    >>> x, y = rod_shape(w.drive_angle, w.holding_moment, w.force_x, w.force_y, points=5)
    >>> x.round(3), y.round(3)
    (array([ 0.   , -0.203, -0.221, -0.042,  0.2  ]), array([0.   , 0.135, 0.375, 0.541, 0.6  ]))
    """
    from tactile_bayes.mechanics.poses.pose import write_poses  # numba takes a second to load

    if points < 2:
        raise ParameterError(f"points is {points!r}: a rod is drawn with at least 2 points, pivot and tip")
    moment = np.asarray(holding_moment, dtype=float)
    if side is None:
        side = np.where(moment < 0.0, -1.0, 1.0)
    given = drive_angle, moment, force_x, force_y, side, rest_curvature
    states = np.broadcast_arrays(*(np.asarray(a, dtype=float) for a in given))
    shape = states[0].shape
    phi0, moment, fx, fy, sign, curvature = (a.ravel() for a in states)
    sign = np.where(sign < 0.0, -1.0, 1.0)
    phi0 = np.where(sign < 0.0, np.pi - phi0, phi0)
    moment, fx, curvature = sign * moment, sign * fx, sign * curvature
    stem = 0.0
    if rods is not None:
        curvature, stem = np.broadcast_to(rods.curvature, shape).ravel(), rods.stem
    if stem:
        moment = moment - lever_of_stem(stem, phi0, fx, fy)

    s, full = np.linspace(0.0, 1.0, points), (*shape, points)
    if rods is not None and rods.profile is not None:
        x, y = _along(np.stack([phi0, moment, fx, fy, curvature], axis=-1), rods.profile, s)
        return _on_stem(stem, phi0, sign, x, y, full)
    force = np.hypot(fx, fy)
    x, y = _unloaded(phi0[:, None], s, curvature[:, None])
    loaded = (force > 0.0) & np.isfinite(moment)
    contact = contact_from_wrench(phi0, moment, fx, fy, side=1.0, rest_curvature=curvature)
    # A force at the pivot itself, without moment, leaves the rod in its rest shape too: it has a modulus, but no arc.
    bent = loaded & (contact.contact_arclength > 0.0)
    impossible = loaded & ~bent & ~(contact.modulus < 1.0)
    x[impossible] = y[impossible] = np.nan

    beta, s1, tip_angle = (
        a[bent][:, None] for a in (contact.slope_angle, contact.contact_arclength, contact.tip_angle)
    )
    curvature, force = curvature[bent][:, None], force[bent][:, None]
    # The pivot is the first point, of arc length 0.
    columns = np.broadcast_arrays(tip_angle - beta, np.maximum(s1 - s, 0.0), force, curvature)
    pose = np.empty((2, columns[0].size))
    write_poses(np.stack([a.ravel() for a in columns], axis=-1), pose)
    u, v = pose.reshape(2, *columns[0].shape)
    u, v = u[:, :1] - u, v[:, :1] - v
    cos, sin = np.cos(beta), np.sin(beta)
    beyond_x, beyond_y = _unloaded(tip_angle, np.maximum(s - s1, 0.0), curvature)
    x[bent] = u * cos - v * sin + beyond_x
    y[bent] = u * sin + v * cos + beyond_y
    return _on_stem(stem, phi0, sign, x, y, full)


def _on_stem(
    stem: float, phi0: Floats, sign: Floats, x: Floats, y: Floats, shape: tuple[int, ...]
) -> tuple[Floats, Floats]:
    """Move points of rods from the pivot to the end of the stem, put the pivot before them, and mirror them back."""
    if stem:
        x, y = x + stem * np.cos(phi0)[:, None], y + stem * np.sin(phi0)[:, None]
        x, y = (np.concatenate([np.zeros_like(of[:, :1]), of], axis=1) for of in (x, y))
        shape = (*shape[:-1], shape[-1] + 1)
    return (sign[:, None] * x).reshape(shape), y.reshape(shape)


def _along(wrenches: Floats, profile: Profile, s: Floats) -> tuple[Floats, Floats]:
    """Points of a rod that varies along its length, from wrenches mirrored to forward ones and the side."""
    from tactile_bayes.mechanics.contacts.states import profile_shapes
    from tactile_bayes.mechanics.poses.beam import varied  # numba takes a second to load

    x, y = np.empty((2, len(wrenches), s.size))
    profile_shapes(wrenches, varied(profile), s, x, y)
    return x, y


def _unloaded(angle: Floats, arclength: Floats, curvature: Floats) -> tuple[Floats, Floats]:
    """Points of arcs from the origin, where they have the slope `angle`."""
    half = 0.5 * curvature * arclength
    chord = arclength * np.sinc(half / np.pi)
    return chord * np.cos(angle + half), chord * np.sin(angle + half)
