"""The shape of the deformed rod from its base wrench; quantities as in `elastica`."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from tactile_bayes.arrays import Floats
from tactile_bayes.errors import ParameterError
from tactile_bayes.mechanics.elastica import lever_of_stem
from tactile_bayes.mechanics.rods.profile import Rods


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

    Merker et al. 2018, doi 10.1155/2018/1613945, in closed form. The wrench is as in `contact_from_wrench`, and so is
    the side; `rods`, mirrored to those of forward contacts, may take the place of arcs. Returns x and y [L] from the
    pivot, shape (..., points), or one more if there is a stem. Where the force is zero or the wrench NaN, the rod has
    its rest shape; where no contact makes such a wrench, it is NaN.
    """
    from tactile_bayes.mechanics.contacts.states import write_shapes
    from tactile_bayes.mechanics.poses.beam import varied_of  # numba takes a second to load

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
    if rods is None:
        rods = Rods(curvature.reshape(shape))
    rods = rods._replace(curvature=np.array(np.broadcast_to(rods.curvature, shape), dtype=float).ravel())
    moment = moment - lever_of_stem(rods.stem, phi0, fx, fy)
    x, y = np.empty((2, phi0.size, points))
    wrenches = np.stack([phi0, moment, fx, fy], axis=-1)
    write_shapes(wrenches, rods.curvature, varied_of(rods.profile), np.linspace(0.0, 1.0, points), x, y)
    if rods.stem:  # it moves where the rod begins; the pivot is before it
        x, y = x + rods.stem * np.cos(phi0)[:, None], y + rods.stem * np.sin(phi0)[:, None]
        x, y = (np.concatenate([np.zeros_like(of[:, :1]), of], axis=1) for of in (x, y))
    shape = (*shape, x.shape[1])
    return (sign[:, None] * x).reshape(shape), y.reshape(shape)
