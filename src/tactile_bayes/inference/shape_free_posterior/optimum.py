"""The posterior mode of a shape-free contour and its rig."""

from __future__ import annotations

import numpy as np
from scipy.optimize import minimize

from tactile_bayes.arrays import Floats
from tactile_bayes.inference.contour_model import ContourModel
from tactile_bayes.inference.deadline import NEVER, Deadline
from tactile_bayes.inference.shape_free_posterior.columns import joined, linear_names, scale_names, split
from tactile_bayes.inference.shape_free_posterior.normal_approximation import NormalApproximation
from tactile_bayes.inference.shape_free_posterior.observations import LinearPrior
from tactile_bayes.inference.shape_free_posterior.observer import Observer
from tactile_bayes.inference.shape_free_posterior.whitening import Whitening

_ROUNDS = 20  # largest number of linearisations
_GAINED = 0.5  # smallest gain in log-density of a round for another one to follow
_DAMPINGS: Floats = np.power(10.0, np.arange(15))  # dampings of steps that are tried beside the full one
_MAX_LOG_STEP = 0.7  # largest change of the logarithm of a scale in a round
_MIN_BOUND_DISTANCE = 1e-3  # smallest distance of the logarithm of a scale from its bounds
_DRAWS = 4000  # number of draws from a prior for its mean and standard deviation


def whitening_at(model: ContourModel, point: Floats, rng: np.random.Generator, deadline: Deadline = NEVER) -> Whitening:
    """Return whitening coordinates at the posterior's mode, which is sought from a point, shape (parameters,).

    Damped Gauss–Newton steps alternate with the most probable scales, and snap-offs that are missed become sharper.
    """
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
        density -= 0.5 * (np.square(tried - prior.mean) * prior.precision).sum(axis=1)
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
    """Return the most probable scales near the given ones.

    White noise is at least half the scatter: less would stop a search far from the mode at the first bend of its ridge.
    """
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
        least[noise] = np.clip(np.log(0.5 * approximation.scatter), least[noise], most[noise])
    return np.exp(
        minimize(cost, here, method="L-BFGS-B", bounds=list(zip(least.tolist(), most.tolist(), strict=True))).x
    )


def _linear_prior(model: ContourModel, rng: np.random.Generator) -> LinearPrior:
    draws = [np.asarray(model.priors[name].rvs(_DRAWS, random_state=rng)) for name in linear_names(model)]
    draws[0] = np.log(draws[0])
    return LinearPrior(np.mean(draws, axis=1), np.var(draws, axis=1) ** -1)
