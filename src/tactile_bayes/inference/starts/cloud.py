"""The distribution of the points from which walkers start around an optimum."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from tactile_bayes.arrays import Floats
from tactile_bayes.inference.deadline import NEVER, Deadline
from tactile_bayes.inference.densities import ANYTHING, Ends, LogProbability

_WIDER = 2.0  # standard deviation of the starting points over that of the posterior
_DEFICIT = 12.0  # log-probability per parameter of a start below the best: three times the mean that _WIDER causes
_ROUNDS = 30  # of the cross-entropy method, at most
_POINTS, _FIRST_POINTS = 60, 600  # in each round per parameter, and at most in the first one, which is enough to judge
_SOME = 0.05  # least share of points with a finite log-probability after the deadline


@dataclass(frozen=True, eq=False)
class Cloud:
    """Distribution of starting points: a normal distribution, and the least log-probability of a start."""

    centre: Floats
    root: Floats  # the covariance is `root @ root.T`
    floor: float  # least log-probability of a start
    ends: Ends = ANYTHING
    is_possible: bool = True  # whether a possible point was found

    @property
    def narrow_covariance(self) -> Floats:
        """Approximate covariance of the posterior, shape (d, d)."""
        return np.asarray(self.root @ self.root.T / _WIDER**2)

    def floor_by(self, deadline: Deadline) -> float:
        """Return the floor; past the deadline it is −inf, since points above it may be rare."""
        return -np.inf if deadline.has_passed else self.floor

    def draw(self, rng: np.random.Generator, count: int) -> Floats:
        """Draw points, shape (count, d)."""
        return self.ends.drawn(
            lambda count: self.centre + rng.normal(size=(count, self.centre.size)) @ self.root.T, count
        )


def gather(
    log_probability: LogProbability,
    centre: Floats,
    covariance: Floats,
    rng: np.random.Generator,
    deadline: Deadline = NEVER,
    ends: Ends = ANYTHING,
) -> Cloud:
    """Return a distribution of starting points that is wider than the posterior and mostly of comparable probability.
    While most points are far less probable than the best, centre and covariance are those of the best fifth."""
    size = centre.size
    top = float(log_probability(centre[None])[0])
    for k in range(_ROUNDS):
        root = square_root(covariance)
        cloud = Cloud(centre, _WIDER * root, -np.inf, ends)
        points = cloud.draw(rng, _POINTS * size if k else min(_POINTS * size, _FIRST_POINTS))
        values = log_probability(points)
        if values.max() > top:
            top = float(values.max())
        floor = top - _DEFICIT * size
        if np.mean(values > floor) > 0.5 or (deadline.has_passed and np.mean(np.isfinite(values)) > _SOME):
            break
        if top == -np.inf and deadline.has_passed:  # there is nothing to gather around
            break
        best = np.argsort(values)[-12 * size :]
        best = best[np.isfinite(values[best])]
        if np.count_nonzero(values > floor) > 2 * size:
            centre, covariance = points[best].mean(axis=0), 0.5 * np.cov(points[best].T)
        else:  # nearly all are far less probable than the best so far
            centre = points[best[-1]] if best.size and values[best[-1]] == top else centre
            covariance = 0.25 * covariance
    floor = float(min(floor, np.quantile(values, 0.8, method="lower")))
    return replace(cloud, floor=floor, is_possible=top > -np.inf)


def square_root(covariance: Floats) -> Floats:
    """Return R with R Rᵀ the covariance, even if rounding has made that singular."""
    scale = np.sqrt(np.diag(covariance))
    values, axes = np.linalg.eigh(covariance / np.outer(scale, scale))
    return scale[:, None] * axes * np.sqrt(np.maximum(values, np.finfo(float).eps))
