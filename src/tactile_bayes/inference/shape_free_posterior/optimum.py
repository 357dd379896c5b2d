"""Where a contour of any shape and all else that is not known explain a record best."""

from __future__ import annotations

import numpy as np
from scipy.optimize import minimize

from tactile_bayes.arrays import Floats
from tactile_bayes.inference.contour_model import ContourModel
from tactile_bayes.inference.deadline import NEVER, Deadline
from tactile_bayes.inference.shape_free_posterior.normal_approximation import (
    LinearPrior,
    NormalApproximation,
    Observer,
    joined,
    linear_names,
    scale_names,
    split,
)
from tactile_bayes.inference.shape_free_posterior.whitening import Whitening

__all__ = ["whitening_at"]

_ROUNDS = 20
"""Times that the place where loads are made linear moves, at most."""

_GAINED = 0.5
"""Log-density below which a round has gained nothing."""

_SHORTER = np.append(0.0, 0.5 ** np.arange(8))
"""Steps that are tried, over that to where linear loads say that the posterior is."""

_BOLD = 0.7
"""By how much the logarithm of a scale may change in a round."""

_INSIDE = 1e-3
"""By how much the logarithm of a scale stays off its end."""

_DRAWS = 4000
"""From a prior, for its mean and standard deviation."""


def whitening_at(model: ContourModel, point: Floats, rng: np.random.Generator, deadline: Deadline = NEVER) -> Whitening:
    """Coordinates that belong to the posterior's centre, which is sought from a point, shape (parameters,).

    Gauss's and Newton's steps, shortened as long as they lead down, alternate with the likeliest scales, of which
    linear loads give the evidence in closed form. A snap-off that is not where the record has it is insisted upon.
    Past the deadline, the best place so far is the centre.
    """
    observer, prior = Observer(model), _linear_prior(model, rng)
    (scales,), (linear,) = split(model, point[None])
    best, found = -np.inf, (-np.inf, scales, linear)
    for _ in range(_ROUNDS):
        approximation = NormalApproximation(observer, prior, scales, linear)
        scales = _likeliest(model, approximation, scales)
        tried = linear + _SHORTER[:, None] * (approximation.mean(scales) - linear)
        density = observer.log_density(joined(np.tile(scales, (len(tried), 1)), tried))
        density -= 0.5 * (np.square(tried - prior.mean) * prior.precision).sum(axis=1)
        linear, before, best = tried[np.argmax(density)], best, float(density.max())
        if best - before < _GAINED or deadline.has_passed:
            here = joined(scales[None], linear[None])
            probability = float(model.log_probability(here)[0])
            if probability <= found[0]:
                break
            found, best = (probability, scales, linear), -np.inf
            if deadline.has_passed or not observer.insist(here):
                break
    _, scales, linear = found
    return Whitening(NormalApproximation(observer, prior, scales, linear), scales)


def _likeliest(model: ContourModel, approximation: NormalApproximation, scales: Floats) -> Floats:
    """Not far from those that are given."""
    names = scale_names(model)
    columns = [model.names.index(name) for name in names]

    def cost(logarithms: Floats) -> float:
        there = np.exp(logarithms)
        prior = sum(float(model.priors[name].logpdf(value)) for name, value in zip(names, there, strict=True))
        return -approximation.log_evidence(there) - prior - logarithms.sum()

    here = np.log(scales)
    with np.errstate(divide="ignore"):
        least = np.maximum(np.log(model.low[columns]) + _INSIDE, here - _BOLD)
        most = np.minimum(np.log(model.high[columns]) - _INSIDE, here + _BOLD)
    return np.exp(
        minimize(cost, here, method="L-BFGS-B", bounds=list(zip(least.tolist(), most.tolist(), strict=True))).x
    )


def _linear_prior(model: ContourModel, rng: np.random.Generator) -> LinearPrior:
    draws = [np.asarray(model.priors[name].rvs(_DRAWS, random_state=rng)) for name in linear_names(model)]
    draws[0] = np.log(draws[0])
    return LinearPrior(np.mean(draws, axis=1), np.var(draws, axis=1) ** -1)
