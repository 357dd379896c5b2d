"""The evidence of a family of contours: how likely a record is before any contour of it is preferred."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from scipy.special import logsumexp

from tactile_bayes.arrays import Floats
from tactile_bayes.inference.contour import Sampled
from tactile_bayes.inference.contour_model import ContourModel
from tactile_bayes.inference.ensembles import in_coordinates
from tactile_bayes.inference.evidence import bridge_evidence
from tactile_bayes.inference.matched_priors import widened
from tactile_bayes.inference.priors import Prior

__all__ = ["WIDTHS", "ContourEvidence", "contour_evidence"]

WIDTHS = (0.5, 1.0, 2.0)
"""Of the priors of sizes, exponents, amplitude and length scale: factors on what is stated."""

_DRAWS = 8000
"""Of the posterior that are used, evenly spread: what neighbours add is little."""

_PRIOR_DRAWS, _OTHER_DRAWS = 4000, 1000
"""From the prior, and from one of another width, for the share of contours within reach."""


class ContourEvidence(NamedTuple):
    """Of one family, the logarithm of the density of the record under its prior."""

    log_evidence: Floats
    """For each of `WIDTHS`, shape (3,)."""
    standard_error: float
    overlap: float
    """See `Evidence`."""


def contour_evidence(model: ContourModel, sampled: Sampled, rng: np.random.Generator) -> ContourEvidence:
    """Evidence by bridge sampling, in the coordinates in which walkers walked.

    The prior is that of contours within reach, which is what the generator draws from, so that the integral over all
    contours is divided by the share that are. With priors of other widths, the evidence follows from the same draws.

    Parameters
    ----------
    model : ContourModel
    sampled : Sampled
        Its posterior.
    rng : np.random.Generator

    Raises
    ------
    InferenceError
        If the draws are too few or the posterior is nothing like a normal one, so that the integral is not to be had.
    """
    coordinates, (chains, _, size) = sampled.coordinates, sampled.draws.samples.shape
    kept = sampled.draws.evenly(_DRAWS // chains)
    points = sampled.draws.samples[:, kept].reshape(-1, size)
    places = coordinates.of(points)
    _, growth = coordinates.parameters(places)
    bridge = bridge_evidence(
        in_coordinates(model.log_probability, coordinates),
        places.reshape(chains, -1, size),
        sampled.draws.log_probability[:, kept] + growth.reshape(chains, -1),
        rng,
    )
    own = {name: model.priors[name] for name in model.family.parameters}
    logs, share = [], 0.0
    for width in WIDTHS:
        others = widened(own, width)
        change = np.zeros(len(points))
        for name, prior in others.items():
            if prior is not own[name]:
                values = points[:, model.names.index(name)]
                change += prior.logpdf(values) - own[name].logpdf(values)
        reached = _share_within_reach(model, others, rng, _PRIOR_DRAWS if width == 1.0 else _OTHER_DRAWS)
        share = reached if width == 1.0 else share
        logs.append(bridge.log_evidence + logsumexp(change) - np.log(change.size) - np.log(reached))
    error = np.hypot(bridge.standard_error, np.sqrt((1.0 - share) / (share * _PRIOR_DRAWS)))
    return ContourEvidence(np.array(logs), float(error), bridge.overlap)


def _share_within_reach(
    model: ContourModel, priors: Mapping[str, Prior], rng: np.random.Generator, count: int
) -> float:
    """Of contours from a prior, at least the share that one of them would be."""
    every = {**model.priors, **priors}
    points = np.stack([every[name].rvs(count, random_state=rng) for name in model.names], axis=1)
    points = points[((points > model.low) & (points < model.high)).all(axis=1)]
    usable = model.likelihood.usable(model.contours(points), model.rig(points))
    return max(int(usable.sum()), 1) / count
