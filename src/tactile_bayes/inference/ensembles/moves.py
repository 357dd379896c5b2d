"""The proposals by which walkers move."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import emcee
import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_triangular

__all__ = ["FittedMove", "standard_moves"]

Floats = NDArray[np.float64]

_DEGREES_OF_FREEDOM = 10.0
"""Of the t distribution: tails heavier than a normal posterior's, at little cost where it is one."""

_WIDENING = 1.1
"""Scale over that of the walkers it is fitted to: too wide a proposal costs less than too narrow a one."""


class FittedMove(emcee.moves.RedBlueMove):
    """Proposals from Student's t distribution, fitted to the half of the ensemble that does not move meanwhile.

    Where a posterior is nearly normal, a walker forgets where it was in a few steps. The proposal depends on nothing
    that the moving half does, so that the target stays invariant however badly the fit is. Where the other half lies in
    a plane, nothing can be fitted, and nothing moves.

    Proposals of this kind beside those of differential evolution are from Boehl (2022), doi 10.2139/ssrn.4250395, who
    adapts them to the whole run instead.
    """

    def get_proposal(
        self, sample: Floats, complement: Sequence[Floats], random: np.random.RandomState
    ) -> tuple[Floats, Floats]:
        """Places proposed to walkers, (n, parameters), and log of the density back over that of going there, (n,)."""
        others = np.concatenate(complement)
        shape = sample.shape
        normal = random.standard_normal(shape)
        steps = normal / np.sqrt(random.chisquare(_DEGREES_OF_FREEDOM, shape[0]) / _DEGREES_OF_FREEDOM)[:, None]
        try:
            mean, root = _fit(others)
        except np.linalg.LinAlgError:
            return sample.copy(), np.full(shape[0], -np.inf)
        here = solve_triangular(root, (sample - mean).T, lower=True).T
        return mean + steps @ root.T, _log_density(here) - _log_density(steps)


def _fit(points: Floats) -> tuple[Floats, Floats]:
    """Mean and root of the scale matrix, whatever the units of the parameters."""
    mean, deviation = points.mean(axis=0), points.std(axis=0)
    if not np.all(deviation > 0.0):
        raise np.linalg.LinAlgError("a parameter is the same in all points")
    standard = (points - mean) / deviation
    root = np.linalg.cholesky(standard.T @ standard / (len(points) - 1))
    return mean, _WIDENING * deviation[:, None] * root


def _log_density(steps: Floats) -> Floats:
    """Of the t distribution with mean 0 and unit scale, up to a constant."""
    squares = np.sum(steps**2, axis=1)
    density: Floats = -0.5 * (_DEGREES_OF_FREEDOM + steps.shape[1]) * np.log1p(squares / _DEGREES_OF_FREEDOM)
    return density


def standard_moves() -> list[tuple[Any, float]]:
    """Moves of one ensemble and their shares, new ones for each ensemble, since a move keeps its scale between calls.

    Fitted proposals where the posterior is nearly normal; differences of two other walkers, scaled and now and then
    unscaled, where it is not. All cut the ensemble in two halves, which `Together` counts on.
    """
    return [(FittedMove(), 0.7), (emcee.moves.DEMove(), 0.27), (emcee.moves.DEMove(gamma0=1.0), 0.03)]
