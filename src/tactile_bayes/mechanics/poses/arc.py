"""A piece of Euler's elastica that begins where its curvature is zero: the rod between contact and pivot.

A force f acts at the contact, and ψ is the rod's slope over the direction across it. With ψ1 = ψ at the contact,
m = (1 − sin ψ1)/2, c = cos ψ1 = 2 √(m (1 − m)) and the Jacobi amplitude χ = am(√f (s1 − s) | m) along the rod,

    tan((ψ − ψ1)/2) = c w / (1 − 2 m w),    w = sin²(χ/2)        turn of the rod since the contact
    √f (s1 − s)     = F(χ | m)
    C = ∫ 2 c² w² Δ⁻³ dχ                                         √f times arc minus chord along the contact's direction
    S = ∫ 2 c w (1 − 2 m w) Δ⁻³ dχ,         Δ² = 1 − m sin²χ     √f times the chord across it

C and S have closed forms: with D = (F − E)/m, P = F − sin χ/Δ and Q = 2 w sin χ/Δ − D they are 2 m (P − (1 − 2 m) Q)
and c (P + 2 m Q). Arc length is counted from the contact, so that turn, C and S vanish with the load without
cancellation. Legendre's θ at the pivot and χ are related by tan χ = cot θ / √(1 − m).

F and D are computed by duplication in Carlson's symmetric forms (Numer. Algorithms 10 (1995) 13, doi
10.1007/BF02198293), and those of short arcs by Gauss–Legendre quadrature.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from tactile_bayes.arrays import Floats
from tactile_bayes.mechanics.compiler import compiled, inlined

# Cosine of the amplitude below which an arc is short: the closed forms of C and S cancel there; quadrature is used.
SHORT_COSINE = math.cos(1.0)
_HALVINGS = 5  # halvings of F(χ) after the first; a few terms of a series are exact for the remainder
_FLAT = 1e-6  # parameter m below which the derivative of D is that at m = 0


def _even_rule(count: int) -> tuple[Floats, Floats]:
    """Squares of the nodes and weights for even functions on [0, 1]: half of the Gauss–Legendre rule on [−1, 1]. The
    weights are computed from the nodes; those of NumPy are off by up to 1e-13."""
    nodes = np.polynomial.legendre.leggauss(2 * count)[0][count:]
    even = np.polynomial.legendre.legvander(nodes, 2 * count - 2)[:, ::2]
    return nodes**2, np.asarray(np.linalg.solve(even.T, np.eye(count, 1))[:, 0], dtype=np.float64)


_SQUARES, _WEIGHTS = _even_rule(10)


class Arc(NamedTuple):
    """Piece of elastica from the contact to the amplitude χ, or its derivatives by one variable."""

    length: float  # f(χ | m) = √f s1
    shortfall: float  # C, the length minus the chord along the direction at the contact
    offset: float  # S, the chord across the direction at the contact
    turn: float  # ψ − ψ1 in [0, π]


class _Amplitude(NamedTuple):
    """χ and m in the form that the integrands take, without loss of digits."""

    sin: float
    cos: float
    half: float  # sin(χ/2)
    m: float
    c: float
    d2: float  # Δ²


@compiled
def _amplitude(chi: float, m: float) -> _Amplitude:
    half, half_cos = math.sin(0.5 * chi), math.cos(0.5 * chi)
    sin, cos = 2.0 * half * half_cos, (half_cos - half) * (half_cos + half)
    return _Amplitude(sin, cos, half, m, 2.0 * math.sqrt(m * (1.0 - m)), 1.0 - m * sin * sin)


@compiled
def arc_at(sin: float, cos: float, m: float) -> Arc:
    """Arc to the amplitude χ ∈ [0, π] with this sine and cosine, for the parameter m ∈ (0, 1)."""
    twice = 2.0 + 2.0 * abs(cos)
    half = sin / math.sqrt(twice) if cos > 0.0 else 0.5 * math.sqrt(twice)
    return _arc(_Amplitude(sin, cos, half, m, 2.0 * math.sqrt(m * (1.0 - m)), 1.0 - m * sin * sin))


@compiled
def arc_to(chi: float, m: float) -> tuple[Arc, Arc]:
    """Arc to the amplitude χ ∈ [0, 3π/2) for the parameter m ∈ (0, 1), and its derivatives by χ."""
    at = _amplitude(chi, m)
    return _arc(at), _by_chi(at)


@compiled
def slopes_by_chi(chi: float, m: float) -> Arc:
    """Derivatives of the arc by χ alone; see `arc_to`."""
    return _by_chi(_amplitude(chi, m))


@compiled
def arc_and_slopes(chi: float, m: float) -> tuple[Arc, Arc, Arc]:
    """Arc to the amplitude χ, and its derivatives by χ and by ψ1; see `arc_to`."""
    at = _amplitude(chi, m)
    F, C, S, F_1, C_1, S_1 = _integrals(at)
    # (c w)² + (1 − 2 m w)² = Δ²; the turn by ψ1 is 2 [flat · c_1 − c · flat_1] w / Δ².
    w = at.half * at.half
    turn = -2.0 * w * ((1.0 - 2.0 * m) * (1.0 - 2.0 * m * w) + at.c * at.c * w) / at.d2
    return Arc(F, C, S, _turn(at)), _by_chi(at), Arc(F_1, C_1, S_1, turn)


@compiled
def _arc(at: _Amplitude) -> Arc:
    F, C, S, _, _, _ = _integrals(at)
    return Arc(F, C, S, _turn(at))


@compiled
def _turn(at: _Amplitude) -> float:
    w = at.half * at.half
    return 2.0 * math.atan2(at.c * w, 1.0 - 2.0 * at.m * w)


@compiled
def _by_chi(at: _Amplitude) -> Arc:
    """Derivatives by χ: the integrands."""
    w = at.half * at.half
    cw, d = at.c * w, math.sqrt(at.d2)
    kernel = 2.0 * cw / (at.d2 * d)
    return Arc(1.0 / d, kernel * cw, kernel * (1.0 - 2.0 * at.m * w), at.c * at.sin / at.d2)


@inlined  # so that derivatives cost nothing where they are not used
def _integrals(at: _Amplitude) -> tuple[float, float, float, float, float, float]:
    """F, C and S, and their derivatives by ψ1, with dm/dψ1 = −c/2 and dc/dψ1 = −p; p = sin ψ1."""
    return _short(at) if at.cos > SHORT_COSINE else _long(at)


@inlined
def _short(at: _Amplitude) -> tuple[float, float, float, float, float, float]:
    """Integrals of a short arc, by quadrature."""
    m, c = at.m, at.c
    F, first, second, third, fourth, fifth = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    square = at.half * at.half
    for i in range(_SQUARES.size):
        h = _SQUARES[i] * square
        d2 = 1.0 - 4.0 * m * h * (1.0 - h)
        kernel = _WEIGHTS[i] / math.sqrt((1.0 - h) * d2)
        F += kernel
        kernel *= h / d2  # Δ⁻³ dχ, times h
        first += kernel
        second += kernel * h
        kernel *= h / d2  # Δ⁻⁵ dχ, times h²
        third += kernel
        fourth += kernel * h
        fifth += kernel * h * h
    step = 2.0 * at.half
    F, first, second = step * F, step * first, step * second
    leaning = first - 2.0 * m * second
    p = 1.0 - 2.0 * m
    first_m, second_m = 6.0 * step * (third - fourth), 6.0 * step * (fourth - fifth)
    C_1 = -c * (4.0 * p * second + c * c * second_m)
    S_1 = -2.0 * p * leaning - c * c * (first_m - 2.0 * second - 2.0 * m * second_m)
    return F, 2.0 * c * c * second, 2.0 * c * leaning, -c * (first - second), C_1, S_1


@inlined
def _long(at: _Amplitude) -> tuple[float, float, float, float, float, float]:
    """Integrals of a long arc, in closed form."""
    sin, m, c = at.sin, at.m, at.c
    p, w = 1.0 - 2.0 * m, at.half * at.half
    F, D = _legendre(at)
    slope = sin / math.sqrt(at.d2)
    P, Q = F - slope, 2.0 * w * slope - D
    F_m = (F - D - slope * at.cos) / (2.0 * (1.0 - m))
    D_m = (F_m - 0.5 * D) / m
    if m < _FLAT:
        D_m = (12.0 * F - 8.0 * math.sin(2.0 * F) + math.sin(4.0 * F)) / 64.0
    cube = slope * slope * slope
    P_m, Q_m = F_m - 0.5 * cube, cube * w - D_m
    C_1 = -c * (P - p * Q + m * (P_m + 2.0 * Q - p * Q_m))
    S_1 = -p * (P + 2.0 * m * Q) - 0.5 * c * c * (P_m + 2.0 * Q + 2.0 * m * Q_m)
    return F, 2.0 * m * (P - p * Q), c * (P + 2.0 * m * Q), -0.5 * c * F_m, C_1, S_1


@compiled
def _legendre(at: _Amplitude) -> tuple[float, float]:
    """F and D = (F − E)/m, by one duplication for both. F is R_F and D is R_D/3 of (cos²χ, Δ², 1)/sin²χ. The first
    halving takes the roots with their signs and therefore holds for amplitudes beyond π/2 too; in this form it does not
    cancel at π."""
    d = math.sqrt(at.d2)
    falling = (1.0 - at.m) / (d - at.cos) if at.cos < 0.0 else (d + at.cos) / (at.sin * at.sin)
    inverse, rest = 0.5 / (at.half * at.half), 1.0 + d
    x = at.sin * math.sqrt(inverse * falling)
    x2, y2, z2 = x * x, falling * rest, inverse * rest
    y, z = math.sqrt(y2), math.sqrt(z2)
    D, scale = at.sin / z2, 2.0
    for _ in range(_HALVINGS):
        common = x * (y + z) + y * z
        x2, y2, z2 = x2 + common, y2 + common, z2 + common
        D += scale / (z * z2)
        scale *= 2.0
        x, y, z = math.sqrt(x2), math.sqrt(y2), math.sqrt(z2)

    mean = (x2 + y2 + z2) / 3.0
    a, b = 1.0 - x2 / mean, 1.0 - y2 / mean
    ab, total = a * b, a + b
    e2, e3 = ab - total * total, -ab * total
    F = scale / math.sqrt(mean) * (1.0 + e2 * (e2 / 24.0 - 3.0 / 44.0 * e3 - 0.1) + e3 / 14.0)
    mean = (x2 + y2 + 3.0 * z2) / 5.0
    a, b = 1.0 - x2 / mean, 1.0 - y2 / mean
    ab, g = a * b, (a + b) / -3.0
    gg = g * g
    e2, e3, e4 = ab - 6.0 * gg, (3.0 * ab - 8.0 * gg) * g, (ab - gg) * gg
    D += (
        scale
        / (3.0 * mean * math.sqrt(mean))
        * (1.0 + e2 * (9.0 / 88.0 * e2 - 3.0 / 14.0) + e3 / 6.0 - 9.0 / 22.0 * e4)
    )
    return F, D


@compiled
def chord_direction(arc: Arc) -> float:
    """Angle of the chord to the direction at the contact [rad]."""
    return math.atan2(arc.offset, arc.length - arc.shortfall)


@compiled
def chord_direction_rate(arc: Arc, by: Arc) -> float:
    """Derivative of `chord_direction`."""
    along = arc.length - arc.shortfall
    across = along * by.offset - arc.offset * (by.length - by.shortfall)
    return across / (along * along + arc.offset * arc.offset)


@compiled
def chord_deficit(arc: Arc) -> float:
    """Chord deficit √(1 − r²) of a rod of length one with the chord r, without cancellation."""
    F, C, S = arc.length, arc.shortfall, arc.offset
    return math.sqrt(max(2.0 * F * C - C * C - S * S, 0.0)) / F


@compiled
def chord_deficit_rate(arc: Arc, value: float, by: Arc) -> float:
    F, C, S = arc.length, arc.shortfall, arc.offset
    half = (F - C) * by.shortfall + C * by.length - S * by.offset
    return (half / (value * F) - value * by.length) / F
