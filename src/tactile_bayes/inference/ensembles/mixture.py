"""Mixtures of proposal distributions, for targets with several modes or along a bent ridge."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from tactile_bayes.arrays import Floats
from tactile_bayes.inference.ensembles.proposal import (
    ANYTHING,
    WIDENING,
    Ends,
    Proposal,
    Random,
    normalised,
    refuse_constant,
)

__all__ = ["Mixture"]

_ROUNDS = 10
"""Number of rounds of expectation and maximisation."""

_PRIOR_POINTS, _PRIOR_WIDTH = 5.0, 0.3
"""Number of points that the prior of a part's covariance weighs, and its width over that of all points."""


@dataclass(frozen=True, eq=False)
class Mixture:
    """Several proposals, each for a mode of the target, or a piece of its ridge.

    Parameters
    ----------
    parts : tuple of Proposal
    """

    parts: tuple[Proposal, ...]

    @classmethod
    def fitted(cls, points: Floats, bent: Sequence[int], parts: int, ends: Ends = ANYTHING) -> Mixture:
        """Fit a mixture to points, shape (n, parameters), that lie along a bent ridge.

        Its parts are normal distributions of the columns `bent`, found by expectation and maximisation; given these,
        the other columns are the same normal distribution everywhere, with a mean that is linear in them. Parts begin
        as slices of equal numbers along the longest direction.
        """
        deviation = points.std(axis=0)
        refuse_constant(deviation, np.abs(points).max(axis=0))
        mean, standard = points.mean(axis=0), (points - points.mean(axis=0)) / deviation
        slopes = np.linalg.lstsq(standard[:, bent], standard, rcond=None)[0]  # of the columns `bent`, themselves
        rest = standard - standard[:, bent] @ slopes
        left = rest.T @ rest / len(points)
        left[bent] = left[:, bent] = 0.0
        found = []
        for size, middle, covariance in zip(*_pieces(standard[:, bent], parts), strict=True):
            root = WIDENING * deviation[:, None] * np.linalg.cholesky(slopes.T @ covariance @ slopes + left)
            found.append(Proposal(mean + deviation * (middle @ slopes), root, log_mass=float(np.log(size)), ends=ends))
        return cls(tuple(found))

    @property
    def size(self) -> int:
        """Number of coordinates."""
        return self.parts[0].mean.size

    @cached_property
    def shares(self) -> Floats:
        """Shares of the parts, in proportion to the target's integral; equal if no integral is known."""
        masses = np.array([part.log_mass for part in self.parts])
        return normalised(masses if np.any(np.isfinite(masses)) else np.zeros(masses.size))

    @property
    def efficiency(self) -> float:
        """Efficiency of the mixture, as if each part covered its own mode alone."""
        each = np.array([part.efficiency for part in self.parts])
        return float(1.0 / np.sum(self.shares / each)) if np.all(each > 0.0) else 0.0

    def with_efficiency(self, efficiency: float) -> Mixture:
        """Return the mixture with another efficiency for all parts."""
        return Mixture(tuple(replace(part, efficiency=efficiency) for part in self.parts))

    @property
    def digest(self) -> str:
        """Identity of the mixture, as text."""
        return hashlib.sha256("".join(part.digest for part in self.parts).encode()).hexdigest()

    def draw(self, random: Random, count: int) -> tuple[Floats, Floats]:
        """Return points and their log-density, as `Proposal.draw` does."""
        points = self.parts[0].ends.drawn(lambda count: self.draw_unbounded(random, count), count)
        return points, self.log_density(points)

    def draw_unbounded(self, random: Random, count: int) -> Floats:
        """Return points of the mixture without bounds, as `Proposal.draw_unbounded` does."""
        counts = random.multinomial(count, self.shares)
        parts = [part.draw_unbounded(random, int(each)) for part, each in zip(self.parts, counts, strict=True)]
        return np.concatenate(parts)[random.permutation(count)]

    def log_density(self, points: Floats) -> Floats:
        """Return the log-density, as `Proposal.log_density` does."""
        with np.errstate(divide="ignore"):  # a part without mass has no share
            shares = np.log(self.shares)
        each = [share + part.log_density(points) for share, part in zip(shares, self.parts, strict=True)]
        return np.asarray(np.logaddexp.reduce(each))


def _pieces(points: Floats, count: int) -> tuple[Floats, Floats, Floats]:
    """Return shares, (count,), means, (count, k), and covariances, (count, k, k), of a mixture of normal distributions.

    A covariance is drawn toward that of all points, made narrower, by as many points as the prior weighs.
    """
    whole = np.cov(points.T).reshape(2 * points.shape[1:])
    along = points @ np.linalg.eigh(whole)[1][:, -1]
    shares = np.eye(count)[np.argsort(np.argsort(along, kind="stable"), kind="stable") * count // len(points)].T
    for _ in range(_ROUNDS):
        sizes = shares.sum(axis=1) + 1e-9
        means = shares @ points / sizes[:, None]
        off = points - means[:, None]
        covariances = (shares[:, None] * off.swapaxes(1, 2)) @ off
        covariances += _PRIOR_POINTS * _PRIOR_WIDTH**2 * whole
        covariances /= (sizes + _PRIOR_POINTS)[:, None, None]
        roots = np.linalg.cholesky(covariances)
        squares = np.sum(np.square(off @ np.linalg.inv(roots).swapaxes(1, 2)), axis=2)
        volumes = np.log(np.diagonal(roots, axis1=1, axis2=2)).sum(axis=1)
        logs = (np.log(sizes) - volumes)[:, None] - 0.5 * squares
        shares = np.exp(logs - logs.max(axis=0))
        shares /= shares.sum(axis=0)
    return sizes / sizes.sum(), means, covariances
