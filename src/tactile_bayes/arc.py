"""A piece of Euler's elastica that begins where its curvature is zero: the rod between contact and pivot.

A force f acts at the contact, and ψ is the rod's slope over the direction across it. With ψ1 = ψ at the contact,
m = (1 − sin ψ1)/2, c = cos ψ1 = 2 √(m (1 − m)) and the Jacobi amplitude χ = am(√f (s1 − s) | m) along the rod,

    tan((ψ − ψ1)/2) = c w / (1 − 2 m w),    w = sin²(χ/2)        how far the rod has turned since the contact
    √f (s1 − s)     = F(χ | m)
    C = ∫ 2 c² w² Δ⁻³ dχ                                         √f times arc minus chord along the contact's direction
    S = ∫ 2 c w (1 − 2 m w) Δ⁻³ dχ,         Δ² = 1 − m sin²χ     √f times the chord across it

C and S have closed forms: with D = (F − E)/m, P = F − sin χ/Δ and Q = 2 w sin χ/Δ − D they are 2 m (P − (1 − 2 m) Q)
and c (P + 2 m Q). Counting from the contact keeps digits: turn, C and S vanish with the load without cancellation.
Legendre's θ at the pivot is linked to χ by tan χ = cot θ / √(1 − m).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.special import ellipk, elliprd, elliprf

__all__ = ["Arc", "ArcSlopes", "arc_and_slopes", "arc_to", "chord_angle", "slack", "slack_slope", "slopes_by_chi"]

Floats = NDArray[np.float64]

_SHORT = 1.0
"""Below this amplitude C and S come from quadrature (their closed form cancels), above it from Carlson's integrals."""

_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(14)


class Arc(NamedTuple):
    """A piece of elastica from the contact to amplitude χ."""

    length: Floats
    """F(χ | m) = √f s1."""
    shortfall: Floats
    """C: length minus chord along the direction at the contact."""
    offset: Floats
    """S: chord across the direction at the contact."""
    turn: Floats
    """ψ − ψ1 in [0, π]."""


class ArcSlopes(NamedTuple):
    """Partial derivatives of an arc."""

    length: Floats
    shortfall: Floats
    offset: Floats
    turn: Floats


def arc_to(chi: Floats, m: Floats) -> tuple[Arc, ArcSlopes]:
    """Arc to amplitude χ ∈ [0, 3π/2) of parameter m ∈ (0, 1), one-dimensional arrays, and its derivatives by χ."""
    arc, by_chi, _ = _evaluate(chi, m, False)
    return arc, by_chi


def arc_and_slopes(chi: Floats, m: Floats) -> tuple[Arc, ArcSlopes, ArcSlopes]:
    """The same, with the derivatives by ψ1 as well."""
    arc, by_chi, by_psi1 = _evaluate(chi, m, True)
    assert by_psi1 is not None
    return arc, by_chi, by_psi1


def slopes_by_chi(chi: Floats, m: Floats) -> ArcSlopes:
    """Derivatives by χ: the integrands."""
    c = 2.0 * np.sqrt(m * (1.0 - m))
    sin, w = np.sin(chi), np.sin(0.5 * chi) ** 2
    d2 = 1.0 - m * sin * sin
    d = np.sqrt(d2)
    return ArcSlopes(1.0 / d, 2.0 * (c * w) ** 2 / (d2 * d), 2.0 * c * w * (1.0 - 2.0 * m * w) / (d2 * d), c * sin / d2)


def _evaluate(chi: Floats, m: Floats, by_direction: bool) -> tuple[Arc, ArcSlopes, ArcSlopes | None]:
    p, c = 1.0 - 2.0 * m, 2.0 * np.sqrt(m * (1.0 - m))
    sin, cos = np.sin(chi), np.cos(chi)
    w = np.sin(0.5 * chi) ** 2
    d2 = 1.0 - m * sin * sin
    d = np.sqrt(d2)
    d3 = d2 * d
    flat = 1.0 - 2.0 * m * w

    # Legendre's F and D by Carlson's forms, which keep all digits for small amplitudes and small m.
    beyond = np.flatnonzero(chi > 0.5 * np.pi)
    reach = sin.copy()
    reach[beyond] *= -1.0
    cos2 = cos * cos
    F = reach * elliprf(cos2, d2, 1.0)
    D = reach**3 * elliprd(cos2, d2, 1.0) / 3.0
    if beyond.size:
        mb = m[beyond]
        F[beyond] += 2.0 * ellipk(mb)
        D[beyond] += 2.0 * elliprd(0.0, 1.0 - mb, 1.0) / 3.0
    P, Q = F - sin / d, 2.0 * sin * w / d - D
    C, S = 2.0 * m * (P - p * Q), c * (P + 2.0 * m * Q)

    short = np.flatnonzero(chi < _SHORT)
    if short.size:
        xs, ms, cs, ps = (a[short][:, None] for a in (chi, m, c, p))
        h = np.sin(0.25 * xs * (1.0 + _NODES)) ** 2
        g = 4.0 * h * (1.0 - h)
        i2 = 1.0 / (1.0 - ms * g)
        kernel = h * i2 * np.sqrt(i2) * (_WEIGHTS * xs)
        thrust = 1.0 - 2.0 * ms * h
        C[short] = (kernel * h).sum(-1) * c[short] ** 2
        S[short] = (kernel * thrust).sum(-1) * c[short]

    arc = Arc(F, C, S, 2.0 * np.arctan2(c * w, flat))
    by_chi = slopes_by_chi(chi, m)
    if not by_direction:
        return arc, by_chi, None

    # By ψ1, with dm/dψ1 = −c/2 and dc/dψ1 = −p.
    F_m = (F - D - sin * cos / d) / (2.0 * (1.0 - m))
    with np.errstate(divide="ignore", invalid="ignore"):
        D_m = (F_m - 0.5 * D) / m
    tiny = np.flatnonzero(m < 1e-6)
    if tiny.size:
        x = chi[tiny]
        D_m[tiny] = (12.0 * x - 8.0 * np.sin(2.0 * x) + np.sin(4.0 * x)) / 64.0
    P_m = F_m - 0.5 * sin**3 / d3
    Q_m = sin**3 * w / d3 - D_m
    C_1 = -c * (P - p * Q + m * (P_m + 2.0 * Q - p * Q_m))
    S_1 = -p * (P + 2.0 * m * Q) - 0.5 * c * c * (P_m + 2.0 * Q + 2.0 * m * Q_m)
    if short.size:
        growth = 1.5 * g * i2  # ∂ log Δ⁻³ / ∂m
        C_1[short] = (-0.5 * cs * kernel * h * (4.0 * ps + cs * cs * growth)).sum(-1)
        S_1[short] = (kernel * (-ps * thrust - 0.5 * cs * cs * (growth * thrust - 2.0 * h))).sum(-1)
    # (c w)² + (1 − 2 m w)² = Δ²; the turn by ψ1 is 2 [flat · c_1 − c · flat_1] w / Δ².
    return arc, by_chi, ArcSlopes(-0.5 * c * F_m, C_1, S_1, -2.0 * w * (p * flat + c * c * w) / d2)


def chord_angle(arc: Arc, slopes: ArcSlopes) -> tuple[Floats, Floats]:
    """Angle of the chord over the direction at the contact, and its derivative."""
    along = arc.length - arc.shortfall
    angle = np.arctan2(arc.offset, along)
    across = along * slopes.offset - arc.offset * (slopes.length - slopes.shortfall)
    with np.errstate(invalid="ignore"):
        return angle, across / (along**2 + arc.offset**2)


def slack(arc: Arc) -> Floats:
    """√(1 − r²) for a rod of length one, r its chord; without cancellation."""
    F, C, S = arc.length, arc.shortfall, arc.offset
    with np.errstate(invalid="ignore"):
        return np.sqrt(np.maximum(2.0 * F * C - C * C - S * S, 0.0)) / F


def slack_slope(arc: Arc, slack: Floats, slopes: ArcSlopes) -> Floats:
    F, C, S = arc.length, arc.shortfall, arc.offset
    half = (F - C) * slopes.shortfall + C * slopes.length - S * slopes.offset
    return (half / (slack * F) - slack * slopes.length) / F
