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

__all__ = ["ArcSlopes", "arc_and_slopes", "arc_to"]

Floats = NDArray[np.float64]

_SHORT_COSINE = float(np.cos(1.0))
"""Cosine of the amplitude below which an arc is short: quadrature then, since the closed forms of C and S cancel."""


def _even_rule(count: int) -> tuple[Floats, Floats]:
    """Nodes and weights, columns, for even functions on [0, 1]: half of Gauss and Legendre's on [−1, 1].

    The weights are those that fit the nodes; NumPy's own are off by up to 1e-13.
    """
    nodes = np.polynomial.legendre.leggauss(2 * count)[0][count:]
    even = np.polynomial.legendre.legvander(nodes, 2 * count - 2)[:, ::2]
    return nodes[:, None], np.asarray(np.linalg.solve(even.T, np.eye(count, 1)), dtype=float)


_NODES, _WEIGHTS = _even_rule(10)

_HALVINGS = 5
"""Halvings of F(χ) after the first; what is left is so short that a few terms of a series are exact."""


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


class _Amplitude(NamedTuple):
    """χ and m as the integrands want them, with all digits."""

    sin: Floats
    cos: Floats
    half: Floats
    """sin(χ/2)."""
    m: Floats
    c: Floats
    d2: Floats
    """Δ²."""

    @classmethod
    def of(cls, chi: Floats, m: Floats) -> _Amplitude:
        half, half_cos = np.sin(0.5 * chi), np.cos(0.5 * chi)
        return cls.made_of(2.0 * half * half_cos, (half_cos - half) * (half_cos + half), half, m)

    @classmethod
    def made_of(cls, sin: Floats, cos: Floats, half: Floats, m: Floats) -> _Amplitude:
        return cls(sin, cos, half, m, 2.0 * np.sqrt(m * (1.0 - m)), 1.0 - m * sin * sin)


def arc_to(chi: Floats, m: Floats) -> tuple[Arc, ArcSlopes]:
    """Arc to amplitude χ ∈ [0, 3π/2) of parameter m ∈ (0, 1), one-dimensional arrays, and its derivatives by χ."""
    at = _Amplitude.of(chi, m)
    return _arc(at)[0], _by_chi(at)


def arc_and_slopes(chi: Floats, m: Floats) -> tuple[Arc, ArcSlopes, ArcSlopes]:
    """The same, with the derivatives by ψ1 as well."""
    at = _Amplitude.of(chi, m)
    arc, (F_1, C_1, S_1) = _arc(at, by_psi1=True)
    # (c w)² + (1 − 2 m w)² = Δ²; the turn by ψ1 is 2 [flat · c_1 − c · flat_1] w / Δ².
    w = at.half * at.half
    turn = -2.0 * w * ((1.0 - 2.0 * m) * (1.0 - 2.0 * m * w) + at.c * at.c * w) / at.d2
    return arc, _by_chi(at), ArcSlopes(F_1, C_1, S_1, turn)


def _by_chi(at: _Amplitude) -> ArcSlopes:
    w = at.half * at.half
    cw, d = at.c * w, np.sqrt(at.d2)
    kernel = 2.0 * cw / (at.d2 * d)
    return ArcSlopes(1.0 / d, kernel * cw, kernel * (1.0 - 2.0 * at.m * w), at.c * at.sin / at.d2)


def _arc(at: _Amplitude, by_psi1: bool = False) -> tuple[Arc, Floats]:
    """The arc, and the derivatives of F, C and S by ψ1 if they are wanted."""
    integrals = np.empty((6 if by_psi1 else 3, at.m.size))
    short = at.cos > _SHORT_COSINE
    for chosen, integrate in ((short, _by_quadrature), (~short, _in_closed_form)):
        where = np.flatnonzero(chosen)
        if where.size:
            part = _Amplitude(*(column[where] for column in at))
            for row, values in zip(integrals, integrate(part, by_psi1), strict=True):
                row[where] = values
    F, C, S = integrals[:3]
    w = at.half * at.half
    return Arc(F, C, S, 2.0 * np.arctan2(at.c * w, 1.0 - 2.0 * at.m * w)), integrals[3:]


def _by_quadrature(at: _Amplitude, by_psi1: bool) -> list[Floats]:
    """F, C and S, and their derivatives by ψ1 with dm/dψ1 = −c/2 and dc/dψ1 = −p, of a short arc; p = sin ψ1."""
    m, c = at.m, at.c
    h = _NODES**2 * (at.half * at.half)
    cos2 = 1.0 - h
    d2 = h * cos2
    d2 *= 4.0 * m
    np.subtract(1.0, d2, out=d2)
    cos2 *= d2
    kernel = _WEIGHTS / np.sqrt(cos2, out=cos2)
    step = 2.0 * at.half
    F = step * kernel.sum(0)
    kernel /= d2  # Δ⁻³ dχ, and below times powers of h
    kernel *= h
    first = step * kernel.sum(0)
    fifth = kernel / d2 if by_psi1 else kernel
    kernel *= h
    second = step * kernel.sum(0)
    leaning = first - 2.0 * m * second
    C, S = 2.0 * c * c * second, 2.0 * c * leaning
    if not by_psi1:
        return [F, C, S]
    moments = []  # of h²Δ⁻⁵, h³Δ⁻⁵, h⁴Δ⁻⁵
    for _ in range(3):
        fifth *= h
        moments.append(step * fifth.sum(0))
    p = 1.0 - 2.0 * m
    first_m, second_m = 6.0 * (moments[0] - moments[1]), 6.0 * (moments[1] - moments[2])
    C_1 = -c * (4.0 * p * second + c * c * second_m)
    S_1 = -2.0 * p * leaning - c * c * (first_m - 2.0 * second - 2.0 * m * second_m)
    return [F, C, S, -c * (first - second), C_1, S_1]


def _in_closed_form(at: _Amplitude, by_psi1: bool) -> list[Floats]:
    """The same of a long arc."""
    sin, m, c = at.sin, at.m, at.c
    p, w, d = 1.0 - 2.0 * m, at.half * at.half, np.sqrt(at.d2)
    F, D = _legendre(at, d)
    slope = sin / d
    P, Q = F - slope, 2.0 * w * slope - D
    C, S = 2.0 * m * (P - p * Q), c * (P + 2.0 * m * Q)
    if not by_psi1:
        return [F, C, S]
    F_m = (F - D - slope * at.cos) / (2.0 * (1.0 - m))
    with np.errstate(divide="ignore", invalid="ignore"):
        D_m = (F_m - 0.5 * D) / m
    tiny = np.flatnonzero(m < 1e-6)
    if tiny.size:
        chi = F[tiny]
        D_m[tiny] = (12.0 * chi - 8.0 * np.sin(2.0 * chi) + np.sin(4.0 * chi)) / 64.0
    cube = slope**3
    P_m, Q_m = F_m - 0.5 * cube, cube * w - D_m
    C_1 = -c * (P - p * Q + m * (P_m + 2.0 * Q - p * Q_m))
    S_1 = -p * (P + 2.0 * m * Q) - 0.5 * c * c * (P_m + 2.0 * Q + 2.0 * m * Q_m)
    return [F, C, S, -0.5 * c * F_m, C_1, S_1]


def _legendre(at: _Amplitude, d: Floats) -> tuple[Floats, Floats]:
    """F and D = (F − E)/m by duplication, which they share, in Carlson's form.

    F is R_F and D is R_D/3 of (cos²χ, Δ², 1)/sin²χ. The first halving takes the roots with their signs, and so serves
    amplitudes beyond π/2 as well; written out, it does not cancel at π.
    """
    roots, squares = np.empty((2, 3, at.m.size))
    x, y, z = roots
    x2, y2, z2 = squares
    falling = np.where(at.cos < 0.0, (1.0 - at.m) / (d - at.cos), (d + at.cos) / at.sin**2)
    inverse, rest = 0.5 / (at.half * at.half), 1.0 + d
    x[:], y2[:], z2[:] = at.sin * np.sqrt(inverse * falling), falling * rest, inverse * rest
    x2[:] = x * x
    np.sqrt(squares[1:], out=roots[1:])
    D, scale = at.sin / z2, 2.0
    for _ in range(_HALVINGS):
        squares += x * (y + z) + y * z
        D += scale / (z * z2)
        scale *= 2.0
        np.sqrt(squares, out=roots)

    mean = (x2 + y2 + z2) / 3.0
    a, b = 1.0 - squares[:2] / mean
    ab, sum_ = a * b, a + b
    e2, e3 = ab - sum_ * sum_, -ab * sum_
    F = scale / np.sqrt(mean) * (1.0 + e2 * (e2 / 24.0 - 3.0 / 44.0 * e3 - 0.1) + e3 / 14.0)
    mean = (x2 + y2 + 3.0 * z2) / 5.0
    a, b = 1.0 - squares[:2] / mean
    ab, g = a * b, (a + b) / -3.0
    gg = g * g
    e2, e3, e4 = ab - 6.0 * gg, (3.0 * ab - 8.0 * gg) * g, (ab - gg) * gg
    D += scale / (3.0 * mean * np.sqrt(mean)) * (1.0 + e2 * (9.0 / 88.0 * e2 - 3.0 / 14.0) + e3 / 6.0 - 9.0 / 22.0 * e4)
    return F, D
