"""A proposal distribution for walkers, and its efficiency for a target."""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Protocol

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_triangular
from scipy.special import logsumexp, ndtr

from tactile_bayes.arrays import Flags, Floats
from tactile_bayes.inference.deadline import NEVER, Deadline
from tactile_bayes.inference.ensembles.target import LogProbability

__all__ = [
    "ANYTHING",
    "WIDENING",
    "Ends",
    "Proposal",
    "Random",
    "approximate",
    "effective",
    "flattened",
    "normalised",
    "refuse_constant",
]

_DEGREES_OF_FREEDOM = 10.0
"""Degrees of freedom of the t distribution: its tails are heavier than normal tails, at little cost."""

WIDENING = 1.1
"""Scale over that of the fitted points: too wide a proposal costs less than too narrow a one."""

_ROUNDS = 8
"""Largest number of rounds of importance sampling."""

_DRAWS = 60
"""Number of draws per parameter in each round."""

_GOOD = 0.6
"""Efficiency from which no further round is made."""

_MAX_REDRAWS = 40
"""Largest number of times that points out of bounds are drawn again."""

_CUTS = np.linspace(-4.0, 1.0, 101)
"""Truncation points of a normal distribution, in standard deviations from its mean: truncation farther below has no
effect, and farther above most draws would be lost."""

_MASS_DRAWS = 4000
"""Number of draws from which the mass of a proposal within the bounds is estimated."""

_MIN_EFFECTIVE = 5
"""Smallest number of effective draws per parameter for a covariance; weights are made more equal to reach it."""


class Random(Protocol):
    """Common methods of NumPy's generators, new and legacy."""

    def standard_normal(self, size: tuple[int, int], /) -> Floats: ...

    def chisquare(self, df: float, size: int, /) -> Floats: ...

    def multinomial(self, n: int, pvals: Floats, /) -> NDArray[np.int_]: ...

    def permutation(self, x: int, /) -> NDArray[np.int_]: ...


@dataclass(frozen=True, eq=False)
class Ends:
    """Bounds of each coordinate of a target, shape (parameters,) each, or () for all coordinates."""

    low: Floats
    high: Floats

    def hold(self, points: Floats) -> Flags:
        """Return True for points, shape (n, parameters), within the bounds."""
        return np.asarray(((points > self.low) & (points < self.high)).all(axis=1))

    def drawn(self, draw: Callable[[int], Floats], count: int) -> Floats:
        """Return draws within the bounds; others are drawn again, up to a largest number of times."""
        points = draw(count)
        for _ in range(_MAX_REDRAWS):
            out = np.flatnonzero(~self.hold(points))
            if not out.size:
                break
            points[out] = draw(out.size)
        return points


ANYTHING = Ends(np.array(-np.inf), np.array(np.inf))


@dataclass(frozen=True, eq=False)
class Proposal:
    """Multivariate Student's t distribution, truncated at the bounds of the target.

    Parameters
    ----------
    mean : ndarray, shape (parameters,)
        Centre.
    root : ndarray, shape (parameters, parameters)
        Lower-triangular Cholesky factor of the scale matrix.
    efficiency : float
        Effective share of draws when weighted by the target: 1 if it is the target's own distribution.
    log_mass : float
        Logarithm of the target's integral over the covered region, up to a constant of the number of parameters.
    ends : Ends
        Bounds of the target.
    """

    mean: Floats
    root: Floats
    efficiency: float = 0.0
    log_mass: float = -np.inf
    ends: Ends = ANYTHING

    @classmethod
    def fitted(cls, points: Floats, weights: Floats | None = None, ends: Ends = ANYTHING) -> Proposal:
        """Fit a proposal to points, shape (n, parameters), with weights of sum one, in any units of the parameters.

        The points are assumed to come from a normal distribution that is truncated at the lower bounds.
        """
        weights = np.full(len(points), 1.0 / len(points)) if weights is None else weights
        mean = weights @ points
        centred = points - mean
        deviation = np.sqrt(weights @ centred**2)
        refuse_constant(deviation, np.abs(mean))
        standard = centred / deviation
        correlation = (weights[:, None] * standard).T @ standard / (1.0 - np.sum(weights**2))
        above = (mean - ends.low) / deviation
        for j in np.flatnonzero(above < -_CUTS[0]):
            shift, extra = _untruncated(above[j], correlation[j, j])
            along = correlation[:, j] / correlation[j, j]
            mean = mean + deviation * along * shift
            correlation = correlation + extra * np.outer(along, along)
        return cls(mean, WIDENING * deviation[:, None] * np.linalg.cholesky(correlation), ends=ends)

    @property
    def digest(self) -> str:
        """Identity of the proposal, as text."""
        return hashlib.sha256(self.mean.tobytes() + self.root.tobytes() + repr(self.efficiency).encode()).hexdigest()

    def draw(self, random: Random, count: int) -> tuple[Floats, Floats]:
        """Return points, shape (count, parameters), and their log-density, up to the constant of `log_density`."""
        points = self.ends.drawn(lambda count: self.draw_unbounded(random, count), count)
        return points, self.log_density(points)

    def draw_unbounded(self, random: Random, count: int) -> Floats:
        """Return points of the distribution without bounds, shape (count, parameters)."""
        normal = random.standard_normal((count, self.mean.size))
        steps = normal / np.sqrt(random.chisquare(_DEGREES_OF_FREEDOM, count) / _DEGREES_OF_FREEDOM)[:, None]
        return np.asarray(self.mean + steps @ self.root.T)

    def log_density(self, points: Floats) -> Floats:
        """Return the log-density without bounds at points, (n, parameters), up to a constant of their number."""
        return _log_density(self.steps(points)) - self._log_volume

    def steps(self, points: Floats) -> Floats:
        """Return the standardised points, shape (n, parameters): relative to the mean, in units of the scale."""
        return np.asarray((points - self.mean) @ self._inverse.T)

    @cached_property
    def _inverse(self) -> Floats:
        return np.asarray(solve_triangular(self.root, np.eye(self.mean.size), lower=True))

    @cached_property
    def _log_volume(self) -> float:
        return float(np.log(np.diag(self.root)).sum())


def approximate(
    log_probability: LogProbability,
    centre: Floats,
    covariance: Floats,
    rng: np.random.Generator,
    deadline: Deadline = NEVER,
    ends: Ends = ANYTHING,
) -> Proposal:
    """Approximate a target by rounds of adaptive importance sampling, from a guess at mean and covariance.

    The mean has shape (parameters,), the covariance (parameters, parameters), in the parameters' own units.
    The proposal of a round is fitted to the draws of the round before, weighted by the target; the most efficient round
    gives the result (Oh & Berger 1992, doi 10.1080/00949659208810407; Cappé, Guillin, Marin & Robert 2004, doi
    10.1198/106186004X12803). After the deadline there is no further round.
    """
    proposal = Proposal(centre, WIDENING * np.asarray(np.linalg.cholesky(covariance)), ends=ends)
    best = proposal
    for _ in range(_ROUNDS):
        if deadline.has_passed:
            break
        points, density = proposal.draw(rng, _DRAWS * centre.size)
        surplus = log_probability(points) - density
        if not np.isfinite(surplus).sum() > _MIN_EFFECTIVE * centre.size:
            break
        efficiency = effective(normalised(surplus)) / len(points)
        if efficiency > best.efficiency:
            log_mass = float(logsumexp(surplus) - np.log(len(points)))
            if ends is not ANYTHING:
                within = ends.hold(proposal.draw_unbounded(rng, _MASS_DRAWS)).mean()
                log_mass += float(np.log(max(within, 1.0 / _MASS_DRAWS)))
            best = replace(proposal, efficiency=efficiency, log_mass=log_mass)
        if best.efficiency >= _GOOD:
            break
        try:
            proposal = Proposal.fitted(points, flattened(surplus, _MIN_EFFECTIVE * centre.size), ends)
        except np.linalg.LinAlgError:
            break
    return best


def refuse_constant(deviation: Floats, size: Floats) -> None:
    """Raise numpy.linalg.LinAlgError if a deviation, shape (d,), is no more than rounding of numbers of a size."""
    if not np.all(deviation > 1e-12 * size):
        raise np.linalg.LinAlgError("a parameter is the same in all points")


def flattened(surplus: Floats, least: float) -> Floats:
    """Return weights from their logarithms, shape (n,), made more equal until `least` of them are effective."""
    power = 1.0
    while effective(weights := normalised(power * surplus)) < least:
        power *= 0.8
    return weights


def normalised(surplus: Floats) -> Floats:
    """Return weights of sum one from their logarithms, shape (n,)."""
    with np.errstate(invalid="ignore"):  # −inf less the largest remains −inf
        weights = np.exp(surplus - surplus.max())
    return np.asarray(weights / weights.sum())


def _untruncated(above: float, variance: float) -> tuple[float, float]:
    """Return the changes of mean and variance that undo the truncation of a normal distribution.

    Its lower bound lies `above` below the truncated mean; all numbers are in truncated standard deviations.
    """
    mills = np.exp(-0.5 * _CUTS**2) / (np.sqrt(2.0 * np.pi) * ndtr(-_CUTS))
    narrow = np.sqrt(1.0 - mills * (mills - _CUTS))
    cut = np.interp(-above, -(mills - _CUTS) / narrow, _CUTS)
    scale = 1.0 / np.interp(cut, _CUTS, narrow)
    return float(-above - cut * scale), float(variance * (scale**2 - 1.0))


def effective(weights: Floats) -> float:
    """Return the effective number of weights of sum one, shape (n,)."""
    return float(1.0 / np.sum(weights**2))


def _log_density(steps: Floats) -> Floats:
    """Return the log-density of the t distribution with mean 0 and unit scale, up to a constant."""
    squares = np.sum(steps**2, axis=1)
    density: Floats = -0.5 * (_DEGREES_OF_FREEDOM + steps.shape[1]) * np.log1p(squares / _DEGREES_OF_FREEDOM)
    return density
