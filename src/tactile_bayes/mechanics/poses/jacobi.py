"""Jacobi's elliptic functions in a form that is regular for every pair of parameters.

For parameters x, y ≥ 0 let s, c, d be the functions of t with

    s' = c d,    c' = −x s d,    d' = −y s c,        s = 0, c = d = 1 at t = 0,

so that c² + x s² = 1 and d² + y s² = 1. They are sn/√x, cn and dn of √x t for the parameter y/x, and are symmetric
in x and y: neither x = 0 nor y = 0 (circular functions) nor x = y (hyperbolic functions) is a special case. J is the
integral of s² from 0 to t. At t = 1 they are computed by a power series at a small t and the theorems for twice t,

    s(2t) = 2 s c d / D,    1 − c(2t) = 2 x s² d² / D,    1 − d(2t) = 2 y s² c² / D,    J(2t) = 2 J + s² s(2t),

with D = 1 − x y s⁴ (DLMF 22.6.5 to 22.6.7, and 22.16.27 for J), to some rounding errors.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from tactile_bayes.arrays import Floats
from tactile_bayes.mechanics.compiler import compiled, inlined

_TERMS = 7  # terms of the power series
_SMALL = 0.02  # largest parameter, with t scaled to one, for which these suffice: the remainder is below 1e-16


class Jacobi(NamedTuple):
    """The functions at t = 1, or their derivatives by a parameter."""

    s: float
    c: float
    d: float
    r: float  # (1 − d)/y, without cancellation
    j: float


def _power_series() -> tuple[Floats, Floats]:
    """Coefficients of s and J, in powers of x y (rows) and x + y; those of t follow, since terms are homogeneous. Each
    iteration of s'' = −(x + y) s + 2 x y s³ makes one more order exact."""
    rows, columns = _TERMS // 2 + 1, _TERMS
    order = np.add.outer(2 * np.arange(rows), np.arange(columns))  # n of t^(2 n + 1)
    one, total, both = (np.zeros((rows, columns)) for _ in range(3))
    one[0, 0], total[0, 1], both[1, 0] = 1.0, 1.0, 2.0

    def product(a: Floats, b: Floats) -> Floats:
        found = np.zeros((rows, columns))
        for j, i in np.argwhere(a):
            found[j:, i:] += a[j, i] * b[: rows - j, : columns - i]
        return found

    s = one
    for _ in range(_TERMS):
        rate = product(both, product(s, product(s, s))) - product(total, s)
        s = one + rate / np.maximum(2 * order * (2 * order + 1), 1)
    return s, product(s, s) / (2 * order + 3)


_S, _J = _power_series()


@compiled
def _series(table: Floats, total: float, product: float) -> tuple[float, float, float]:
    """Value of a series, and its derivatives by both variables."""
    value, by_total, by_product = 0.0, 0.0, 0.0
    for j in range(table.shape[0] - 1, -1, -1):
        row, row_slope = 0.0, 0.0
        for i in range(_TERMS - 1 - 2 * j, -1, -1):
            row_slope = row_slope * total + row
            row = row * total + table[j, i]
        by_product = by_product * product + value
        value = value * product + row
        by_total = by_total * product + row_slope
    return value, by_total, by_product


_MOST_HALVINGS = 600  # largest number of halvings: enough for any number, and infinite ones are none


@compiled
def _halvings(x: float, y: float) -> int:
    """Number of halvings of t after which the power series suffices."""
    count, largest = 0, max(x, y)
    while largest > _SMALL and count < _MOST_HALVINGS:
        largest *= 0.25
        count += 1
    return count


@compiled
def jacobi(x: float, y: float) -> Jacobi:
    """Functions for the parameters x, y ≥ 0, below a thousand."""
    return jacobi_and_slopes(x, y)[0]


@inlined  # so that its slopes cost nothing where they are not used
def jacobi_and_slopes(x: float, y: float) -> tuple[Jacobi, Jacobi, Jacobi]:
    """Functions for the parameters x, y ≥ 0, and their derivatives by x and by y."""
    count = _halvings(x, y)
    t = 0.5**count
    square = t * t
    total, product = (x + y) * square, x * y * square * square
    s, by_total, by_product = _series(_S, total, product)
    s, by_total, by_product = t * s, t * square * by_total, t * square * square * by_product
    s_x, s_y = by_total + y * by_product, by_total + x * by_product
    j, by_total, by_product = _series(_J, total, product)
    cube = t * square
    j, by_total, by_product = cube * j, cube * square * by_total, cube * square * square * by_product
    j_x, j_y = by_total + y * by_product, by_total + x * by_product
    c, d = math.sqrt(1.0 - x * s * s), math.sqrt(1.0 - y * s * s)
    c_x, c_y = -s * (0.5 * s + x * s_x) / c, -s * x * s_y / c
    d_x, d_y = -s * y * s_x / d, -s * (0.5 * s + y * s_y) / d
    r = s * s / (1.0 + d)
    r_x, r_y = (2.0 * s * s_x - r * d_x) / (1.0 + d), (2.0 * s * s_y - r * d_y) / (1.0 + d)
    for _ in range(count):
        s2, cd, sd, sc = s * s, c * d, s * d, s * c
        share = 2.0 / (1.0 - x * y * s2 * s2)
        share_x = 0.5 * share * share * y * s2 * (s2 + 4.0 * x * s * s_x)
        share_y = 0.5 * share * share * x * s2 * (s2 + 4.0 * y * s * s_y)
        twice = s * cd * share
        twice_x = (s_x * cd + c_x * sd + d_x * sc) * share + s * cd * share_x
        twice_y = (s_y * cd + c_y * sd + d_y * sc) * share + s * cd * share_y
        j_x = 2.0 * (j_x + s * s_x * twice) + s2 * twice_x
        j_y = 2.0 * (j_y + s * s_y * twice) + s2 * twice_y
        j = 2.0 * j + s2 * twice
        r_x = sc * (2.0 * (s_x * c + s * c_x) * share + sc * share_x)
        r_y = sc * (2.0 * (s_y * c + s * c_y) * share + sc * share_y)
        p = sd * sd * share
        p_x = sd * (2.0 * (s_x * d + s * d_x) * share + sd * share_x)
        p_y = sd * (2.0 * (s_y * d + s * d_y) * share + sd * share_y)
        r = sc * sc * share
        c, c_x, c_y = 1.0 - x * p, -p - x * p_x, -x * p_y
        d, d_x, d_y = 1.0 - y * r, -y * r_x, -r - y * r_y
        s, s_x, s_y = twice, twice_x, twice_y
    return Jacobi(s, c, d, r, j), Jacobi(s_x, c_x, d_x, r_x, j_x), Jacobi(s_y, c_y, d_y, r_y, j_y)
