"""Contact of a rod whose rest shape is a circular arc, from its base wrench.

Quantities are dimensionless and relative to the pivot; contacts are forward ones, and the rest curvature κ0 is mirrored
with them. A base wrench determines its contact in closed form. With A = π/4 − ψ/2 and t = s1 − s, as in `pose`, but not
scaled by the arc length,

    sin²A1 = sin²A0 + m0 (m0 − 2 κ0)/(4 f),         κ = κ0 − m0 at the pivot,

and Jacobi's functions of s1 (`jacobi`), for the parameters x = κ0²/4 + f sin²A1 and y = f, follow from both ends by the
subtraction theorem (DLMF 22.8.1 to 22.8.3); with E = κ0²/4 + f sin²A1 cos²A0

    s = (κ0 sin(A0 − A1) + m0 sin A1 cos A0) / (2 E)
    c = (x cos A0 cos A1 + κ κ0 sin A0 sin A1 / 4) / E,       d = (κ κ0 / 4 + f sin A0 sin A1 cos A0 cos A1) / E.

Then s1 is an elliptic integral in Carlson's form. Nothing of this is singular where the force vanishes, or where the
parameter m = x/y is one. The contact is the first point at which the bending moment vanishes with κ' = f cos ψ > 0. If
m0 > 0 the moment vanishes nowhere before. If the line of force has passed the pivot, m0 < 0 and cos ψ0 < 0, as happens
to rods that are curved at rest as a load curves them, it vanishes once before.

A tip that is turned beyond the normal of the contour, ψ1 > π/2, is a contact with κ' < 0 there: that of the mirrored
rod from the pivot or, if m0 > 0, from the point at which the moment has risen through zero.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from tactile_bayes.mechanics.compiler import compiled
from tactile_bayes.mechanics.poses.pose import pose

MOST_LOAD = 1e6  # largest load f s1² and square of the bend κ0 s1: a rod would make a hundred turns
_CLOSE = 0.012  # spread of the arguments of Carlson's R_F for which eight terms of its series (DLMF 19.36.1) are exact


class FoundContact(NamedTuple):
    """Contact that follows from a base wrench, mirrored to a forward one; NaN where there is none. See `Contact`."""

    x: float
    y: float
    slope_angle: float
    arclength: float
    tip_angle: float
    modulus: float


NO_CONTACT = FoundContact(math.nan, math.nan, math.nan, math.nan, math.nan, math.nan)


@compiled
def _halved(s: float, c: float, d: float, x: float, y: float, gap: float) -> tuple[float, float, float]:
    """Jacobi's functions of half the argument, for gap = y − x; s < 0 in the second half of a swing. In this form
    nothing cancels where c = −d, at half a period."""
    if d < 0.0:
        ratio, fall = gap / (c - d), (1.0 - d) / y
        return math.sqrt(fall / (1.0 + c)), math.sqrt(ratio * fall), s * math.sqrt(ratio / (1.0 + c))
    if c < 0.0:
        ratio, fall = -gap / (d - c), (1.0 - c) / x
        return math.sqrt(fall / (1.0 + d)), s * math.sqrt(ratio / (1.0 + d)), math.sqrt(ratio * fall)
    rest_c, rest_d = 1.0 + c, 1.0 + d
    half = math.sqrt((c + d) / rest_c)
    return abs(s) / math.sqrt(rest_c * rest_d), math.sqrt((c + d) / rest_d), half if s > 0.0 else -half


@compiled
def is_moderate(arclength: float, force: float, curvature: float) -> bool:
    """True if a pose can be computed."""
    bend = curvature * arclength
    return force * arclength * arclength < MOST_LOAD and bend * bend < MOST_LOAD and arclength * arclength < MOST_LOAD


@compiled
def _argument(s: float, c: float, d: float, x: float, y: float, gap: float) -> float:
    """Argument of Jacobi's functions, within one swing or half a rotation, from their values."""
    double = 1.0
    while (s < 0.0 or c < 0.0 or d < 0.0) and double < 16.0:
        s, c, d = _halved(s, c, d, x, y, gap)
        double *= 2.0
    p, q, r = c * c, d * d, 1.0
    for _ in range(30):
        c, d, z = math.sqrt(p), math.sqrt(q), math.sqrt(r)
        common = c * d + (c + d) * z
        p, q, r = 0.25 * (p + common), 0.25 * (q + common), 0.25 * (r + common)
        mean = (p + q + r) / 3.0
        a, b = 1.0 - p / mean, 1.0 - q / mean
        if max(abs(a), abs(b), abs(a + b)) < _CLOSE:
            break
    e2, e3 = a * b - (a + b) * (a + b), -a * b * (a + b)
    series = 1.0 + e2 * (e2 * (1.0 / 24.0 - 5.0 / 208.0 * e2 + e3 / 16.0) - 3.0 / 44.0 * e3 - 0.1)
    series += e3 * (1.0 / 14.0 + 3.0 / 104.0 * e3)
    return double * s / math.sqrt(mean) * series


class _Pendulum(NamedTuple):
    """The elastica through the pivot, as the motion of a pendulum from the pivot on, and its turning point."""

    sin0: float
    cos0: float
    square: float  # sin²A1 and cos²A1
    complement: float
    excess: float  # sin²A1 − sin²A0
    at_rest: float  # κ0²/4
    gap: float  # y − x


@compiled
def _pendulum(psi0: float, moment: float, force: float, curvature: float) -> _Pendulum:
    quarter = 0.25 * math.pi - 0.5 * (psi0 - 2.0 * math.pi * math.floor((psi0 + 0.5 * math.pi) / (2.0 * math.pi)))
    sin0, cos0 = math.sin(quarter), math.cos(quarter)
    excess = 0.25 * moment * (moment - 2.0 * curvature) / force
    root = math.sqrt(abs(excess))
    if excess > 0.0:
        square, complement = sin0 * sin0 + excess, (cos0 - root) * (cos0 + root)
    else:
        square, complement = (abs(sin0) - root) * (abs(sin0) + root), cos0 * cos0 - excess
    at_rest = 0.25 * curvature * curvature
    return _Pendulum(sin0, cos0, square, complement, excess, at_rest, force * complement - at_rest)


@compiled
def _reaches_contact(swing: _Pendulum, moment: float, force: float, curvature: float) -> bool:
    """Return whether the moment rises through zero somewhere."""
    if not (0.0 < force < math.inf and swing.at_rest < math.inf and swing.square > 0.0 and swing.complement > 0.0):
        return False
    # A pendulum that turns over does so in one sense.
    if not (swing.gap > 0.0 or (curvature - moment) * curvature > 0.0):
        return False
    return moment > 0.0 or swing.sin0 < 0.0


@compiled
def _length(swing: _Pendulum, moment: float, force: float, curvature: float) -> float:
    """Arc length from the pivot to the contact."""
    sin0, cos0, at_pivot = swing.sin0, swing.cos0, curvature - moment
    if swing.gap <= 0.0 and curvature > 0.0 and sin0 < 0.0:
        sin0, cos0 = -sin0, -cos0
    sin1, cos1, x = math.sqrt(swing.square), math.sqrt(swing.complement), swing.at_rest + force * swing.square
    one, other = sin0 * cos1, sin1 * cos0
    apart = -swing.excess / (one + other) if one * other > 0.0 else one - other
    scale = swing.at_rest + force * other * other
    return _argument(
        0.5 * (curvature * apart + moment * other) / scale,
        (x * cos0 * cos1 + 0.25 * at_pivot * curvature * sin0 * sin1) / scale,
        (0.25 * at_pivot * curvature + force * one * other) / scale,
        x,
        force,
        swing.gap,
    )


@compiled
def arc_contact(phi0: float, moment: float, fx: float, fy: float, delta: float, curvature: float) -> FoundContact:
    """Contact that follows from a base wrench, without integration or root search; see `contact_from_wrench`."""
    force, beta = math.sqrt(fx * fx + fy * fy), math.atan2(-fx, fy)
    swing = _pendulum(phi0 - beta, moment, force, curvature)
    modulus = swing.square + swing.at_rest / force if force > 0.0 else math.nan
    arclength = math.nan
    if _reaches_contact(swing, moment, force, curvature):
        arclength = _length(swing, moment, force, curvature)
    if not is_moderate(arclength, force, curvature):
        return FoundContact(math.nan, math.nan, math.nan, math.nan, math.nan, modulus)
    psi1 = 0.5 * math.pi - 2.0 * math.atan2(math.sqrt(swing.square), math.sqrt(swing.complement))
    here = pose(psi1, arclength, force, curvature)
    u, v = moment / force, here.v
    x, y = (u * fy + v * fx) / force, (v * fy - u * fx) / force
    return FoundContact(x, y, beta - delta, arclength, phi0 - here.turn, modulus)


@compiled
def arc_zeros(
    phi0: float, moment: float, fx: float, fy: float, delta: float, curvature: float
) -> tuple[FoundContact, FoundContact]:
    """Points at which the moment first rises and first falls through zero; see `states.contact_pair`."""
    rising = arc_contact(phi0, moment, fx, fy, delta, curvature)
    if moment > 0.0:
        return rising, _mirrored(_beyond(_mirrored(rising), -fx, fy, -curvature))
    falling = _mirrored(arc_contact(math.pi - phi0, -moment, -fx, fy, -delta, -curvature))
    if math.isnan(rising.arclength):
        rising = _beyond(falling, fx, fy, curvature)
    return rising, falling


@compiled
def _mirrored(found: FoundContact) -> FoundContact:
    x, y, slope_angle, arclength, tip_angle, modulus = found
    return FoundContact(-x, y, -slope_angle, arclength, math.pi - tip_angle, modulus)


@compiled
def _beyond(zero: FoundContact, fx: float, fy: float, curvature: float) -> FoundContact:
    """Point at which the moment rises through zero, beyond one at which it falls."""
    if not zero.arclength <= 1.0:
        return NO_CONTACT
    x, y, _, arclength, tip_angle, modulus = arc_contact(zero.tip_angle, 0.0, fx, fy, 0.0, curvature)
    return FoundContact(zero.x + x, zero.y + y, zero.slope_angle, zero.arclength + arclength, tip_angle, modulus)
