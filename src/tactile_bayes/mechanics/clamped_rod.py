"""The curvature at the base of a rod that is clamped there and pushed at a known point.

A thin probe is a contour that has shrunk to a point: the rod touches it tangentially, the force is normal to the rod,
and the position is known. In the frame of the clamp the point lies at distance r, at an angle ϑ from the direction of
the clamp. The moment κ0 = M0/(EI) [1/mm] turns the sensor's suspension by c κ0, so that the angle between the rod's
base and the chord is δ = ϑ − c κ0. In tangential contact without friction (ψ1 = 0, m = 1/2) the elastica is one curve
up to scale, cut off at an amplitude χ, and χ determines both the angle δ and the product κ0 r:

    δ(χ) = turn(χ) − chord angle(χ),     κ0 r = √f r sin χ / Δ     ⟹     κ0 r = g(δ),    g(δ) = 3 δ − … odd
    δ + (c/r) g(δ) = ϑ

The rod's length does not enter, provided that the rod reaches the point, and its stiffness only scales the readings.
g rises to 2.41 at δ = 1.21 rad and turns back at δ = 1.74 rad; up to 1.5 rad it is concave, and Newton's method from
ϑ/(1 + 3c/r) converges to the root from below. The equilibrium is stable while 1 + (c/r) g'(δ) > 0. The linear beam for
comparison is

    κ0 = 3 w / (a² + 3 c a),      a = r cos ϑ, w = r sin ϑ,

from w = F a³/(3 EI) + c (F a/EI) a.
"""

from __future__ import annotations

from functools import cache

import numpy as np
from numpy.typing import ArrayLike
from scipy.interpolate import CubicSpline

from tactile_bayes.arrays import Floats
from tactile_bayes.mechanics.elastica import wrench_from_contact

_MAX_TURN = 1.5  # largest angle δ between chord and base [rad] that is modelled
_MAX_STEPS = 30

_SETTLED = 1e-8  # Newton step after which the remaining error, about its square, is lost in rounding


@cache
def _moment_by_turn() -> CubicSpline:
    """Spline of g(δ) and g'(δ), from tangential contacts at distance 0.3 with the contour's slope as parameter."""
    chord = np.linspace(0.0, 1.0, 1501)[1:]
    wrench = wrench_from_contact(0.3 * np.cos(chord), 0.3 * np.sin(chord), 0.0)
    turn, moment = wrench.drive_angle - chord, 0.3 * wrench.holding_moment
    within = np.append(turn[:-1] <= _MAX_TURN, False)
    last = int(np.argmin(within)) + 1  # one knot beyond the end
    turn, moment = turn[:last], moment[:last]
    turn, moment = np.concatenate([-turn[::-1], [0.0], turn]), np.concatenate([-moment[::-1], [0.0], moment])
    return CubicSpline(turn, np.column_stack([moment, CubicSpline(turn, moment)(turn, 1)]))


def base_curvature(
    along: ArrayLike, across: ArrayLike, compliance: ArrayLike = 0.0, *, small_deflection: bool = False
) -> Floats:
    """Curvature κ0 = M0/(EI) at the base of a clamped rod that a thin probe pushes to a point.

    In the frame of the clamp the point lies along its direction and across it, to the left, in any unit of length. The
    compliance c is the turn of the suspension per base curvature [the same unit]; a small deflection is that of the
    linear beam. NaN where there is no stable equilibrium, or the angle between chord and base exceeds 1.5 rad.

    The tip of a beam of length 40 is pushed aside by 0.4 and by 20; the linear beam has 3 w / a²:

    >>> base_curvature(40.0, [0.4, 20.0]).round(6)
    array([0.00075 , 0.029521])
    >>> base_curvature(40.0, [0.4, 20.0], small_deflection=True).round(6)
    array([0.00075, 0.0375 ])
    """
    a, w, c = np.broadcast_arrays(*(np.asarray(v, dtype=float) for v in (along, across, compliance)))
    if small_deflection:
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.where((a > 0.0) & (c >= 0.0), 3.0 * w / (a * a + 3.0 * c * a), np.nan)
    moment_by_turn = _moment_by_turn()
    r = np.hypot(a, w)
    with np.errstate(divide="ignore", invalid="ignore"):
        softness = np.where((r > 0.0) & (c >= 0.0), c / r, np.nan)
        total = np.arctan2(w, a)
        turn = total / (1.0 + 3.0 * softness)
        for _ in range(_MAX_STEPS):
            turn = np.clip(turn, -_MAX_TURN, _MAX_TURN)
            moment, slope = np.moveaxis(moment_by_turn(turn), -1, 0)
            stiffness = 1.0 + softness * slope
            step = (total - turn - softness * moment) / stiffness
            turn = turn + step
            if not np.any(np.abs(step) > _SETTLED):
                break
        stable = (np.abs(step) <= _SETTLED) & (np.abs(turn) <= _MAX_TURN) & (stiffness > 0.0)
        return np.where(stable, (moment + slope * step) / r, np.nan)
