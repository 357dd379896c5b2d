"""Chebyshev series on [0, 1]: their values, roots, and coefficients from values at nodes."""

from __future__ import annotations

import functools
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from tactile_bayes import chebyshev
from tactile_bayes.mechanics.compiler import compiled, inlined

__all__ = [
    "Nodes",
    "at_all",
    "change_of",
    "crossing",
    "nodes_of",
    "tail",
    "three_at_all",
    "value",
    "value_and_slope",
    "weighted",
]

Floats = NDArray[np.float64]


class Nodes(NamedTuple):
    """What belongs to interpolation with so many nodes."""

    nodes: Floats
    fit: Floats
    """Coefficients for a one at each node, a row each."""
    slopes: Floats
    """Those of the derivative of each polynomial."""
    grid: Floats
    """Where it is asked whether a series still grows."""
    on_grid: Floats
    """Each polynomial there."""


@functools.cache
def nodes_of(order: int) -> Nodes:
    unit, grid = np.eye(order), np.linspace(0.0, 1.0, 2 * order + 1)
    return Nodes(
        chebyshev.nodes(order),
        np.ascontiguousarray(chebyshev.coefficients(unit).T),
        np.ascontiguousarray(np.vstack([chebyshev.derivative(unit), np.zeros(order)]).T),
        grid,
        chebyshev.basis(order, grid),
    )


@inlined
def weighted(rows: Floats, weights: Floats, out: Floats) -> None:
    """Σ weights[i] · rows[i], an inner loop that has no order to keep."""
    out[:] = 0.0
    for i in range(weights.size):
        weight = weights[i]
        for j in range(out.size):
            out[j] += weight * rows[i, j]


@compiled
def value(coefficients: Floats, z: float) -> float:
    """By Clenshaw's recurrence."""
    twice = 4.0 * z - 2.0
    now, before = 0.0, 0.0
    for k in range(coefficients.size - 1, 0, -1):
        now, before = coefficients[k] + twice * now - before, now
    return coefficients[0] + 0.5 * twice * now - before


@inlined
def value_and_slope(one: Floats, other: Floats, z: float) -> tuple[float, float]:
    """Two series at once, which takes no longer than one."""
    twice = 4.0 * z - 2.0
    a, a_before, b, b_before = 0.0, 0.0, 0.0, 0.0
    for k in range(one.size - 1, 0, -1):
        a, a_before = one[k] + twice * a - a_before, a
        b, b_before = other[k] + twice * b - b_before, b
    return one[0] + 0.5 * twice * a - a_before, other[0] + 0.5 * twice * b - b_before


@compiled
def at_all(coefficients: Floats, twice: Floats, count: int, now: Floats, before: Floats) -> None:
    """A series at many z, given as 4 z − 2, side by side in the inner loop; the values are in `now`."""
    for j in range(count):
        now[j], before[j] = 0.0, 0.0
    for k in range(coefficients.size - 1, 0, -1):
        for j in range(count):
            new = coefficients[k] + twice[j] * now[j] - before[j]
            before[j] = now[j]
            now[j] = new
    for j in range(count):
        now[j] = coefficients[0] + 0.5 * twice[j] * now[j] - before[j]


@compiled
def three_at_all(rows: Floats, twice: Floats, count: int, now: Floats, before: Floats, out: Floats) -> None:
    """Three series, those in the rows after the first, at many z, given as 4 z − 2: Chebyshev's polynomials go by in
    `now` and `before`, side by side for all z, and the sums are in `out`, shape (3, at least count)."""
    order = rows.shape[1]
    for j in range(count):
        before[j], now[j] = 1.0, 0.5 * twice[j]
        out[0, j] = rows[1, 0] + rows[1, 1] * now[j]
        out[1, j] = rows[2, 0] + rows[2, 1] * now[j]
        out[2, j] = rows[3, 0] + rows[3, 1] * now[j]
    for k in range(2, order):
        a, b, c = rows[1, k], rows[2, k], rows[3, k]
        for j in range(count):
            new = twice[j] * now[j] - before[j]
            before[j] = now[j]
            now[j] = new
            out[0, j] += a * new
            out[1, j] += b * new
            out[2, j] += c * new


@inlined
def tail(coefficients: Floats) -> float:
    """About how far a series is from what it interpolates."""
    return max(abs(coefficients[-1]), abs(coefficients[-2]))


@inlined
def change_of(coefficients: Floats) -> float:
    """The largest coefficient but the first."""
    largest = 0.0
    for k in range(1, coefficients.size):
        largest = max(largest, abs(coefficients[k]))
    return largest


@compiled
def crossing(
    function: Floats, slope: Floats, wanted: float, left: float, right: float, z: float, last_step: float
) -> float:
    """Where a series takes a value from above on its way from left to right, or, with left > right, from right to left.

    Newton kept in its bracket, until a step is as small a share of that as given.
    """
    before = abs(right - left)
    settled = last_step * before
    for _ in range(100):
        at_z, rate = value_and_slope(function, slope, z)
        missing = at_z - wanted
        if missing > 0.0:
            left = z
        else:
            right = z
        new = z - missing / rate
        # Steps that do not shrink by half go round in circles, for instance about a kink.
        if (new - left) * (new - right) <= 0.0 and abs(new - z) <= 0.5 * before:
            before = abs(new - z)
        elif missing == 0.0:
            break
        else:
            new = 0.5 * (left + right)
            before = abs(right - left)
        step = abs(new - z)
        z = new
        if not step > settled or missing == 0.0:
            break
    return z
