"""Where the walkers start: a robust optimum found from the record alone, and how far to scatter around it."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from tactile_bayes.errors import InferenceError

__all__ = ["Optimum", "best_optimum"]

Floats = NDArray[np.float64]
Residuals = Callable[[Floats], Floats]

_BRAVE = 2.0
"""Residual in standard deviations from which on a sample pulls less than by its square."""


class Optimum(NamedTuple):
    """A robust least-squares solution."""

    point: Floats
    covariance: Floats
    """From the Jacobian, as if noise were as stated."""
    residuals: Floats
    cost: float


def best_optimum(residuals: Residuals, candidates: Floats, spread: Floats) -> Optimum:
    """Robust least squares from each of several candidates; the best of them.

    Parameters
    ----------
    residuals : callable
        From points (n, d) to residuals in standard deviations (n, k).
    candidates : ndarray, shape (m, d)
    spread : ndarray, shape (d,)
        Scale on which each parameter varies a priori.
    """
    best: Optimum | None = None
    for candidate in candidates:
        found = _descend(residuals, candidate, spread)
        if best is None or found.cost < best.cost:
            best = found
    if best is None:
        raise InferenceError("no contour was found that the rod can reach: are base, rod and units right?")
    return best


def _descend(residuals: Residuals, start: Floats, spread: Floats) -> Optimum:
    def one(point: Floats) -> Floats:
        return residuals(point[None])[0]

    def jacobian(point: Floats) -> Floats:
        """Central differences; loads are interpolated, so the step must not be too small."""
        step = 1e-4 * spread
        moves = np.concatenate([np.diag(step), -np.diag(step)])
        values = residuals(point + moves)
        return np.asarray((values[: step.size] - values[step.size :]).T / (2.0 * step))

    solution = least_squares(one, start, jacobian, loss="soft_l1", f_scale=_BRAVE, x_scale=spread, max_nfev=60)
    slope = np.asarray(solution.jac)
    information = slope.T @ slope + np.diag(spread**-2.0)
    return Optimum(solution.x, np.linalg.inv(information), one(solution.x), float(solution.cost))
