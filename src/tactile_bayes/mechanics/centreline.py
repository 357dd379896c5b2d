"""The shape of the deformed rod from its base wrench, in closed form.

Quantities are dimensionless and relative to the pivot, as in `elastica`. Between pivot and contact the rod is a piece
of elastica (`arc`): its amplitude at arc length s is χ = am(√f (s1 − s) | m), and the chord from there to the
contact is (F − C, S)/√f along and across the direction at the contact. Beyond the contact the rod is straight.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike
from scipy.special import ellipj

from tactile_bayes.arrays import Floats
from tactile_bayes.errors import ParameterError
from tactile_bayes.mechanics.elastica import contact_from_wrench

__all__ = ["rod_shape"]


def rod_shape(
    drive_angle: ArrayLike,
    holding_moment: ArrayLike,
    force_x: ArrayLike,
    force_y: ArrayLike,
    *,
    points: int = 101,
    side: ArrayLike | None = None,
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

    Returns
    -------
    x, y : ndarray, shape (..., points)
        Coordinates relative to the pivot [L]. Where the force is zero or the wrench NaN, the rod is not loaded and
        straight. Where the curvature has no zero, no contact makes such a wrench, and the coordinates are NaN.

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
    from tactile_bayes.mechanics.contact_map import chords  # numba takes a second to load

    if points < 2:
        raise ParameterError(f"points is {points!r}: a rod is drawn with at least 2 points, pivot and tip")
    moment = np.asarray(holding_moment, dtype=float)
    if side is None:
        side = np.where(moment < 0.0, -1.0, 1.0)
    states = np.broadcast_arrays(*(np.asarray(a, dtype=float) for a in (drive_angle, moment, force_x, force_y, side)))
    shape = states[0].shape
    phi0, moment, fx, fy, sign = (a.ravel() for a in states)
    mirrored = sign < 0.0
    phi0 = np.where(mirrored, np.pi - phi0, phi0)
    moment, fx = sign * moment, sign * fx

    s = np.linspace(0.0, 1.0, points)
    force = np.hypot(fx, fy)
    x, y = np.cos(phi0)[:, None] * s, np.sin(phi0)[:, None] * s
    loaded = (force > 0.0) & np.isfinite(moment)
    contact = contact_from_wrench(phi0, moment, fx, fy, side=1.0)
    # A force at the pivot itself, without moment, leaves the rod straight too: there is a modulus, but no arc.
    bent = loaded & (contact.contact_arclength > 0.0)
    impossible = loaded & ~(contact.modulus < 1.0)
    x[impossible] = y[impossible] = np.nan

    root = np.sqrt(force[bent])[:, None]
    m = contact.modulus[bent][:, None]
    s1, tip_angle = contact.contact_arclength[bent][:, None], contact.tip_angle[bent][:, None]
    left = np.maximum(s1 - s, 0.0)
    chi = ellipj(root * left, m)[3]
    chord = np.empty((2, chi.size))
    chords(chi.ravel(), np.broadcast_to(m, chi.shape).ravel(), chord)
    shortfall, offset = chord.reshape(2, *chi.shape) / root
    # The pivot is the first point, of arc length 0.
    along, across = s - (shortfall[:, :1] - shortfall), offset[:, :1] - offset
    cos, sin = np.cos(tip_angle), np.sin(tip_angle)
    x[bent] = along * cos - across * sin
    y[bent] = along * sin + across * cos
    full = (*shape, points)
    return (np.where(mirrored, -1.0, 1.0)[:, None] * x).reshape(full), y.reshape(full)
