"""Coordinates in which the posterior of a shape-free contour is nearly standard normal, at its mode."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
from scipy.linalg import solve_triangular
from scipy.optimize import minimize

from tactile_bayes.arrays import Floats
from tactile_bayes.inference.contour_model import ContourModel
from tactile_bayes.inference.coordinates import Coordinates
from tactile_bayes.inference.deadline import NEVER, Deadline
from tactile_bayes.inference.densities import untruncated
from tactile_bayes.inference.shape_free_posterior.normal_approximation import NormalApproximation
from tactile_bayes.inference.shape_free_posterior.observations import (
    LinearPrior,
    Observer,
    joined,
    linear_names,
    logarithms,
    scale_names,
    split,
)
from tactile_bayes.numerics.blocks import blocks

_FAR = 4.0  # largest distance of the logarithm of a scale from its starting value; the density is zero beyond
_LARGEST = 50.0  # bound of the logarithm of a radius, far beyond any prior
_ROUNDS = 20  # largest number of linearisations
_GAINED = 0.5  # smallest gain in log-density of a round for another one to follow
_DAMPINGS: Floats = np.power(10.0, np.arange(15))  # dampings of steps that are tried beside the full one
_MAX_LOG_STEP = 0.7  # largest change of the logarithm of a scale in a round
_MIN_BOUND_DISTANCE = 1e-3  # smallest distance of the logarithm of a scale from its bounds
_AT_ONCE = 500  # points whose coordinates are computed at a time
_DRAWS = 4000  # number of draws from a prior for its mean and standard deviation


@dataclass(frozen=True, eq=False)
class Whitening(Coordinates):
    """Logarithms of the scales, and all else standardised by the mean and covariance of a normal approximation there.
    Of what may vanish, by the positive part of that distribution. The fit affects efficiency, not exactness."""

    approximation: NormalApproximation
    scales: Floats  # amplitude, length scale and noise at the centre of the walkers' starting points, shape (bent,)
    mean: Floats  # of the posterior, as the approximation standardises it, shape (d,): zero if that is exact
    root: Floats  # root of their posterior covariance, shape (d, d): one if the approximation is exact

    @property
    def bent(self) -> int:
        """Number of coordinates that are logarithms, the first ones."""
        return self.scales.size

    @cached_property
    def _log_volume(self) -> float:
        return float(np.linalg.slogdet(self.root).logabsdet)

    @property
    def middle(self) -> Floats:
        """Approximate centre of the posterior, shape (coordinates,)."""
        return np.append(np.log(self.scales), np.zeros(self.approximation.prior.mean.size))

    @property
    def centre(self) -> Floats:
        """The model's parameters at that centre, shape (parameters,)."""
        return self.parameters(self.middle[None])[0][0]

    def parameters(self, coordinates: Floats) -> tuple[Floats, Floats]:
        """Return the model's parameters, (n, parameters), and the log of the Jacobian determinant, (n,)."""
        points, growth = np.empty(coordinates.shape), np.empty(len(coordinates))
        for part in blocks(len(coordinates), self.root.size, _AT_ONCE):
            points[part], growth[part] = self._parameters(coordinates[part])
        return points, growth

    def of(self, points: Floats) -> Floats:
        """Return the coordinates of the model's parameters, (n, parameters)."""
        return np.concatenate([self._of(points[part]) for part in blocks(len(points), self.root.size, _AT_ONCE)])

    def _of(self, points: Floats) -> Floats:
        """Return coordinates as `of` does, of all points at once."""
        scales, linear = split(self.approximation.model, points)
        linear = self.approximation.bent(scales, linear, back=True)
        pulled, root = self.approximation.conditional(scales)
        normal = (np.swapaxes(root, 1, 2) @ linear[..., None])[..., 0] - pulled
        numbers = self.approximation.untruncated(pulled, root, normal)
        return np.hstack([np.log(scales), np.linalg.solve(self.root, (numbers - self.mean).T).T])

    @property
    def fitted(self) -> Mapping[str, Floats]:
        return {"mean": self.mean, "root": self.root}

    def adapted(self, draws: Floats) -> Whitening:
        normal = _cross_validated(draws[..., self.bent :])
        return self.standardised(normal.mean, normal.root)

    def standardised(self, mean: Floats, root: Floats) -> Whitening:
        """Return the coordinates in which those after the first `bent` have been standardised by mean and root."""
        return replace(self, mean=self.mean + self.root @ mean, root=self.root @ root)

    def _parameters(self, coordinates: Floats) -> tuple[Floats, Floats]:
        """Return parameters and log-determinants as `parameters` does, of all coordinates at once."""
        bent = self.bent
        middle = np.log(self.scales)
        away = coordinates[:, :bent] - middle
        scales: Floats = np.exp(middle + np.clip(away, -_FAR, _FAR))
        pulled, root = self.approximation.conditional(scales)
        numbers = self.mean + coordinates[:, bent:] @ self.root.T
        normal, growth = self.approximation.truncated(pulled, root, numbers)
        linear = np.asarray(np.linalg.solve(np.swapaxes(root, 1, 2), (pulled + normal)[..., None])[..., 0])
        of_lengths = logarithms(self.approximation.model)
        linear[:, of_lengths] = np.clip(linear[:, of_lengths], -_LARGEST, _LARGEST)
        linear = self.approximation.bent(scales, linear)
        volume = np.log(scales).sum(axis=1) - np.log(np.diagonal(root, axis1=1, axis2=2)).sum(axis=1) + growth
        volume += self._log_volume
        volume[(np.abs(away) > _FAR).any(axis=1)] = -np.inf
        return joined(self.approximation.model, scales, linear), linear[:, of_lengths].sum(axis=1) + volume


def whitening_at(model: ContourModel, point: Floats, rng: np.random.Generator, deadline: Deadline = NEVER) -> Whitening:
    """Return whitening coordinates at the posterior's mode, which is sought from a point, shape (parameters,). Damped
    Gauss–Newton steps alternate with the most probable scales, and snap-offs that are missed become sharper."""
    observer, prior = Observer(model), _linear_prior(model, rng)
    (scales,), (linear,) = split(model, point[None])
    best, found = -np.inf, (-np.inf, scales, linear)
    for _ in range(_ROUNDS):
        approximation = NormalApproximation(observer, prior, scales, linear)
        scales = _likeliest(model, approximation, scales)
        here = approximation.nearest(scales)
        steps = np.vstack([here, approximation.mean(scales), approximation.damped(scales, here, _DAMPINGS)])
        several = np.tile(scales, (len(steps), 1))
        tried = approximation.bent(several, steps)
        density = observer.log_density(joined(model, several, tried))
        density -= 0.5 * np.square((tried - prior.mean) @ prior.root.T).sum(axis=1)
        linear, before, best = tried[np.argmax(density)], best, float(density.max())
        if best - before < _GAINED or deadline.has_passed:
            here = joined(model, scales[None], linear[None])
            probability = float(model.log_probability(here)[0])
            if probability <= found[0]:
                break
            found, best = (probability, scales, linear), -np.inf
            if deadline.has_passed or not observer.narrow_snap_offs(here):
                break
    _, scales, linear = found
    size = prior.mean.size
    return Whitening(NormalApproximation(observer, prior, scales, linear), scales, np.zeros(size), np.eye(size))


def _likeliest(model: ContourModel, approximation: NormalApproximation, scales: Floats) -> Floats:
    """Return the most probable scales near the given ones, with white noise of half the scatter at least. Less would
    stop a search far from the mode at the first bend of its ridge."""
    names = scale_names(model)
    columns = [model.names.index(name) for name in names]

    def cost(logarithms: Floats) -> float:
        there = np.exp(logarithms)
        prior = sum(float(model.priors[name].logpdf(value)) for name, value in zip(names, there, strict=True))
        return -approximation.log_evidence(there) - prior - logarithms.sum()

    here = np.log(scales)
    with np.errstate(divide="ignore"):
        least = np.maximum(np.log(model.low[columns]) + _MIN_BOUND_DISTANCE, here - _MAX_LOG_STEP)
        most = np.minimum(np.log(model.high[columns]) - _MIN_BOUND_DISTANCE, here + _MAX_LOG_STEP)
        noise = approximation.white
        least[noise] = np.clip(np.log(0.5 * approximation.observations.scatter), least[noise], most[noise])
    bounds = list(zip(least.tolist(), most.tolist(), strict=True))
    return np.exp(minimize(cost, here, method="L-BFGS-B", bounds=bounds).x)


def _linear_prior(model: ContourModel, rng: np.random.Generator) -> LinearPrior:
    names, joint = linear_names(model), model.unknowns.joint
    draws = [np.asarray(model.priors[name].rvs(_DRAWS, random_state=rng)) for name in names]
    jointly = [] if joint is None else [names.index(name) for name in joint.priors]
    if joint is not None:
        for k, column in zip(jointly, joint.draw(rng, _DRAWS).T, strict=True):
            draws[k] = column
    for k in logarithms(model):
        draws[k] = np.log(draws[k])
    mean, deviation = np.mean(draws, axis=1), np.std(draws, axis=1)
    for k in range(len(names) - int(np.count_nonzero(model.may_vanish)), len(names)):
        shift, more = untruncated(mean[k] / deviation[k], 1.0)
        mean[k], deviation[k] = mean[k] + shift * deviation[k], np.sqrt(1.0 + more) * deviation[k]
    correlation = np.eye(len(names))
    if jointly:
        correlation[np.ix_(jointly, jointly)] = np.corrcoef([draws[k] for k in jointly])
    root = solve_triangular(np.linalg.cholesky(correlation), np.diag(1.0 / deviation), lower=True)
    return LinearPrior(mean, deviation, root)


_MIN_VARIANCE = 1e-3  # of these coordinates that is believed


class _Normal(NamedTuple):
    """Normal distribution of coordinates that should be nearly standard normal."""

    mean: Floats
    root: Floats

    @classmethod
    def fitted(cls, draws: Floats, independent: float) -> _Normal:
        """Return the distribution fitted to draws, (n, k), as many of which as said are independent. Only principal
        axes count whose variances differ from one by more than that number explains (Marchenko & Pastur 1967, doi
        10.1070/SM1967v001n04ABEH001994), less their bias (Baik & Silverstein 2006, doi 10.1016/j.jmva.2005.08.003)."""
        variances, axes = np.linalg.eigh(np.cov(draws.T))
        variances = np.maximum(variances, _MIN_VARIANCE)  # if few walkers have moved
        ratio = variances.size / independent
        unlike = np.abs(np.sqrt(variances) - 1.0) > np.sqrt(ratio)
        variances, axes = variances[unlike], axes[:, unlike]
        twice = variances + 1.0 - ratio
        true = 0.5 * (twice + np.sign(variances - 1.0) * np.sqrt(np.maximum(twice**2 - 4.0 * variances, 0.0)))
        root = np.sqrt(np.maximum(true, _MIN_VARIANCE))
        return cls(draws.mean(axis=0), np.eye(draws.shape[1]) + axes * (root - 1.0) @ axes.T)

    def gain(self, draws: Floats) -> float:
        """Return by how much the mean log-density of draws, (n, k), exceeds that of the standard normal one."""
        squares = np.mean(np.sum(draws**2 - self.standard(draws) ** 2, axis=1))
        return float(0.5 * squares - np.linalg.slogdet(self.root).logabsdet)

    def standard(self, points: Floats) -> Floats:
        """Return points, (…, k), standardised by this distribution."""
        return np.asarray(np.linalg.solve(self.root, (points - self.mean)[..., None])[..., 0])


def _cross_validated(draws: Floats) -> _Normal:
    """Return a normal distribution fitted to draws (walkers, steps, k). How
    many draws are independent is the number with which a fit to each half of the walkers suits the other best."""
    halves = [half.reshape(-1, draws.shape[-1]) for half in np.array_split(draws, 2)]
    gains = {}
    for number in len(draws) * 2.0 ** np.arange(-1, 8):
        fits = [_Normal.fitted(half, 0.5 * number) for half in halves]
        gains[number] = float(np.mean([fit.gain(other) for fit, other in zip(fits, halves[::-1], strict=True)]))
    best = max(gains, key=gains.__getitem__)
    return _Normal.fitted(np.concatenate(halves), best)
