"""Chebyshev series on [0, 1], which compiled code evaluates, and the point at which one falls through a value."""

from __future__ import annotations

from tactile_bayes.arrays import Floats
from tactile_bayes.mechanics.compiler import compiled
from tactile_bayes.mechanics.newton import newton_step


@compiled
def weighted(rows: Floats, weights: Floats, out: Floats) -> None:
    """Write Σ weights[i] · rows[i], in an inner loop whose order is free."""
    out[:] = 0.0
    for i in range(weights.size):
        weight = weights[i]
        for j in range(out.size):
            out[j] += weight * rows[i, j]


@compiled
def value(coefficients: Floats, z: float) -> float:
    """Value of a series by Clenshaw's recurrence, bracketed for the shortest latency between steps."""
    twice = 4.0 * z - 2.0
    now, before = 0.0, 0.0
    for k in range(coefficients.size - 1, 0, -1):
        now, before = (coefficients[k] - before) + twice * now, now
    return (coefficients[0] - before) + 0.5 * twice * now


@compiled
def two_values(one: Floats, other: Floats, z: float) -> tuple[float, float]:
    """Values of two series at once, which takes no longer than one."""
    twice = 4.0 * z - 2.0
    a, a_before, b, b_before = 0.0, 0.0, 0.0, 0.0
    for k in range(one.size - 1, 0, -1):
        a, a_before = (one[k] - a_before) + twice * a, a
        b, b_before = (other[k] - b_before) + twice * b, b
    return (one[0] - a_before) + 0.5 * twice * a, (other[0] - b_before) + 0.5 * twice * b


@compiled
def at_all(rows: Floats, twice: Floats, count: int, now: Floats, before: Floats, out: Floats) -> None:
    """Write the values of series, one in each row, at many z, given as 4 z − 2. `now` and `before` hold the Chebyshev
    polynomials of all z; `out` has at least the shape (rows, count)."""
    for j in range(count):
        before[j], now[j] = 1.0, 0.5 * twice[j]
    for c in range(rows.shape[0]):
        for j in range(count):
            out[c, j] = rows[c, 0] + rows[c, 1] * now[j]
    for k in range(2, rows.shape[1]):
        for j in range(count):
            new = twice[j] * now[j] - before[j]
            before[j] = now[j]
            now[j] = new
        for c in range(rows.shape[0]):
            coefficient = rows[c, k]
            for j in range(count):
                out[c, j] += coefficient * now[j]


@compiled
def tail(coefficients: Floats) -> float:
    """Estimate of the error of a series."""
    return max(abs(coefficients[-1]), abs(coefficients[-2]))


@compiled
def change_of(coefficients: Floats) -> float:
    """Largest coefficient except the first."""
    largest = 0.0
    for k in range(1, coefficients.size):
        largest = max(largest, abs(coefficients[k]))
    return largest


@compiled
def crossing(
    function: Floats, slope: Floats, wanted: float, left: float, right: float, z: float, last_step: float
) -> float:
    """Point at which a series falls through a value from left to right, or, with left > right, from right to left.
    Newton's method within a bracket, until a step is a given share of the bracket."""
    before = abs(right - left)
    settled = last_step * before
    for _ in range(100):
        at_z, rate = two_values(function, slope, z)
        missing = at_z - wanted
        new, left, right, before = newton_step(z, missing, rate, left, right, before)
        step = abs(new - z)
        z = new
        if not step > settled or missing == 0.0:
            break
    return z


@compiled
def copy_rows(rows: Floats, out: Floats) -> None:
    """Copy one array of two axes to another."""
    for c in range(rows.shape[0]):
        for k in range(rows.shape[1]):
            out[c, k] = rows[c, k]
