"""Coordinates in which a posterior that lies along a bent ridge is nearly normal."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tactile_bayes.inference.deadline import NEVER, Deadline
from tactile_bayes.inference.ensembles.coordinates import Coordinates, in_coordinates
from tactile_bayes.inference.ensembles.moves import standard_moves
from tactile_bayes.inference.ensembles.proposal import GOOD, Mixture, Proposal, approximate, effective, flattened
from tactile_bayes.inference.ensembles.target import LogProbability

__all__ = ["Straightened", "straightened"]

Floats = NDArray[np.float64]

_MOST_WIDE = 5
"""Directions along which a ridge may be bent."""

_DRAWS, _ROUNDS = 2000, 4
_HELD = 0.1
"""Effective share of draws that bends are fitted to, at least; weights are made more equal until they are as many."""

_SURE = 3.0
"""Standard errors that a bend has to be: what is uncertain would bend the coordinates anew."""


@dataclass(frozen=True, eq=False)
class Straightened:
    """Principal directions, wide ones first, each along parabolas of those before it; volumes stay as they are.

    Where loads are thousands of times their noise, a record tells most directions to a ten-thousandth, and a few hardly
    more than the prior: stiffness, lever. Along these few the others move by second order further than they are wide.

    Parameters
    ----------
    base : Coordinates
        Those that are turned and straightened.
    mean : ndarray, shape (d,)
    root : ndarray, shape (d, d)
        Directions, a column each; one step along each is about a standard deviation.
    bends : ndarray, shape (d, wide (wide + 1) / 2)
        By how much directions move with the products of the wide ones before them; zero for others.
    wide : int
    proposal : Mixture, optional
        Of coordinates, that comes near the posterior.
    """

    base: Coordinates
    mean: Floats
    root: Floats
    bends: Floats
    wide: int
    proposal: Mixture | None = None

    @property
    def digest(self) -> str:
        arrays = (self.mean, self.root, self.bends)
        content = b"".join(np.ascontiguousarray(a, dtype="<f8").tobytes() for a in arrays)
        proposal = "" if self.proposal is None else self.proposal.digest
        return f"straightened {hashlib.sha256(content).hexdigest()}, {self.base.digest}, proposal {proposal}"

    def parameters(self, coordinates: Floats) -> tuple[Floats, Floats]:
        turned = coordinates + _products(coordinates[:, : self.wide]) @ self.bends.T
        return self.base.parameters(self.mean + turned @ self.root.T)

    def of(self, points: Floats) -> Floats:
        """Coordinates of points, shape (..., parameters)."""
        flat = points.reshape(-1, points.shape[-1])
        straight = np.array(np.linalg.solve(self.root, (self.base.of(flat) - self.mean).T).T, dtype=np.float64)
        for k in range(1, self.wide):
            straight[:, k] -= _products(straight[:, : self.wide]) @ self.bends[k]
        straight[:, self.wide :] -= _products(straight[:, : self.wide]) @ self.bends[self.wide :].T
        return np.asarray(straight.reshape(points.shape))

    def moves(self) -> list[tuple[Any, float]]:
        return standard_moves(self.proposal)


def straightened(
    log_probability: LogProbability,
    base: Coordinates,
    proposal: Proposal,
    scale: Floats,
    rng: np.random.Generator,
    deadline: Deadline = NEVER,
) -> Straightened | None:
    """Coordinates, and a proposal in them, that are the more efficient the better the ridge is straightened.

    Parameters
    ----------
    log_probability : callable
        Of parameters.
    base : Coordinates
    proposal : Proposal
        In the base's coordinates, where the posterior is about.
    scale : ndarray, shape (d,)
        On which each of the base's coordinates varies a priori: wide is what is wide on it.
    rng : np.random.Generator
    deadline : Deadline
        Past it there is no further round.

    Returns
    -------
    Straightened or None
        None if the proposal as it is does better.
    """
    wide = min(_MOST_WIDE, proposal.mean.size // 2)
    best: Straightened | None = None
    efficiency = proposal.efficiency
    within: Coordinates = base
    near = proposal
    for number in range(_ROUNDS):
        points, density = near.draw(rng, _DRAWS)
        surplus = in_coordinates(log_probability, within)(points) - density
        weights = flattened(surplus, _HELD * len(points))
        mean: Floats = weights @ points
        covariance: Floats = (weights[:, None] * (points - mean)).T @ (points - mean)
        # Straightened ones are straightened again: their order stays, wide ones first.
        root = np.asarray(np.linalg.cholesky(covariance)) if number else _principal(covariance, scale)
        within = _fitted(within, mean, root, points, weights, wide)
        target = in_coordinates(log_probability, within)
        near = approximate(target, np.zeros(scale.size), np.eye(scale.size), rng, deadline)
        if near.efficiency > efficiency:
            efficiency, best = near.efficiency, replace(within, proposal=Mixture((near,)))
        if deadline.has_passed or near.efficiency >= GOOD:
            break
    return best


def _principal(covariance: Floats, scale: Floats) -> Floats:
    """Principal directions, a column each, the widest on the scale first."""
    sizes, axes = np.linalg.eigh(covariance / np.outer(scale, scale))
    order = np.argsort(-sizes)
    return np.asarray(scale[:, None] * axes[:, order] * np.sqrt(np.maximum(sizes[order], np.finfo(float).tiny)))


def _fitted(base: Coordinates, mean: Floats, root: Floats, points: Floats, weights: Floats, wide: int) -> Straightened:
    """To weighted points in the base's coordinates."""
    straight = np.array(np.linalg.solve(root, (points - mean).T).T, dtype=np.float64)
    count = effective(weights)
    bends = np.zeros((mean.size, wide * (wide + 1) // 2))
    for k in range(1, mean.size):
        before = min(k, wide)
        terms = np.flatnonzero(np.triu_indices(wide)[1] < before)
        products = _products(straight[:, :wide])[:, terms]
        design = np.hstack([np.ones((len(points), 1)), straight[:, :before], products])
        gram = count * (weights[:, None] * design).T @ design + np.eye(design.shape[1])
        solved = np.linalg.solve(gram, count * (weights * straight[:, k]) @ design)
        left = weights @ np.square(straight[:, k] - design @ solved)
        certain = np.abs(solved) > _SURE * np.sqrt(left * np.diag(np.linalg.inv(gram)))
        bends[k, terms] = np.where(certain, solved, 0.0)[1 + before :]
        straight[:, k] -= products @ bends[k, terms]
    return Straightened(base, mean, root, bends, wide)


def _products(values: Floats) -> Floats:
    """Products of pairs of columns."""
    one, other = np.triu_indices(values.shape[1])
    return values[:, one] * values[:, other]
