"""The proposals by which walkers move."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import emcee
import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_triangular

__all__ = ["FittedMove", "Moves", "NormalMove", "standard_moves", "whitened_moves"]

Floats = NDArray[np.float64]
Moves = Callable[[], list[tuple[Any, float]]]
"""Makes the moves of one ensemble, with their shares."""

_DEGREES_OF_FREEDOM = 10.0
"""Of the t distribution: tails heavier than a normal posterior's, at little cost where it is one."""

_WIDENING = 1.1
"""Scale over that of the walkers it is fitted to: too wide a proposal costs less than too narrow a one."""


_LEAST_NEW = 0.2
"""Share that is new in the shortest step of `NormalMove`."""


class FittedMove(emcee.moves.RedBlueMove):
    """Proposals from Student's t distribution, fitted to the half of the ensemble that does not move meanwhile.

    Where a posterior is nearly normal, a walker forgets where it was in a few steps. The proposal depends on nothing
    that the moving half does, so that the target stays invariant however badly the fit is. Where the other half lies in
    a plane, nothing can be fitted, and nothing moves.

    Proposals of this kind beside those of differential evolution are from Boehl (2022), doi 10.2139/ssrn.4250395, who
    adapts them to the whole run instead.
    """

    def __init__(self, columns: slice = slice(None)) -> None:
        """Of the parameters in `columns`, the others staying as they are."""
        super().__init__()
        self._columns = columns

    def get_proposal(
        self, sample: Floats, complement: Sequence[Floats], random: np.random.RandomState
    ) -> tuple[Floats, Floats]:
        """Places proposed to walkers, (n, parameters), and log of the density back over that of going there, (n,)."""
        moving, others = sample[:, self._columns], np.concatenate(complement)[:, self._columns]
        normal = random.standard_normal(moving.shape)
        steps = normal / np.sqrt(random.chisquare(_DEGREES_OF_FREEDOM, len(moving)) / _DEGREES_OF_FREEDOM)[:, None]
        proposed = sample.copy()
        try:
            mean, root = _fit(others)
        except np.linalg.LinAlgError:
            return proposed, np.full(len(moving), -np.inf)
        here = solve_triangular(root, (moving - mean).T, lower=True).T
        proposed[:, self._columns] = mean + steps @ root.T
        return proposed, _log_density(here) - _log_density(steps)


class NormalMove(emcee.moves.RedBlueMove):
    """Steps that leave a standard normal distribution invariant, of coordinates that the target makes nearly that.

    A step of random length keeps a share of where the walker is and draws the rest anew (Neal 1999; Cotter, Roberts,
    Stuart & White 2013, doi 10.1214/13-STS421); what the target adds to a standard normal one decides alone.
    """

    def __init__(self, columns: slice) -> None:
        """Of the parameters in `columns`, the others staying as they are."""
        super().__init__()
        self._columns = columns

    def get_proposal(
        self, sample: Floats, complement: Sequence[Floats], random: np.random.RandomState
    ) -> tuple[Floats, Floats]:
        """Places proposed to walkers, (n, parameters), and log of the density back over that of going there, (n,)."""
        moving = sample[:, self._columns]
        new = random.uniform(_LEAST_NEW, 1.0, len(moving))[:, None]
        there = np.sqrt(1.0 - new**2) * moving + new * random.standard_normal(moving.shape)
        proposed = sample.copy()
        proposed[:, self._columns] = there
        return proposed, 0.5 * np.sum(there**2 - moving**2, axis=1)


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


def whitened_moves(bent: int) -> list[tuple[Any, float]]:
    """Those of an ensemble in coordinates that are nearly standard normal and independent, but for the first ones."""
    first, rest = slice(0, bent), slice(bent, None)
    return [
        (FittedMove(first), 0.35),
        (NormalMove(rest), 0.5),
        (emcee.moves.DEMove(), 0.12),
        (emcee.moves.DEMove(gamma0=1.0), 0.03),
    ]
