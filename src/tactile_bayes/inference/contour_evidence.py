"""The evidence of a family of contours."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from tactile_bayes.arrays import Floats
from tactile_bayes.inference.contour import Sampled
from tactile_bayes.inference.contour_model import ContourModel
from tactile_bayes.inference.coordinates.base import in_coordinates
from tactile_bayes.inference.evidence import bridge_evidence
from tactile_bayes.inference.importance import weighed
from tactile_bayes.inference.parameters.priors import widened

WIDTHS = (0.5, 1.0, 2.0)  # factors on the widths of the priors of sizes, exponents, amplitude and length scale
_POSTERIOR_DRAWS = 8000  # that are used, evenly spread, since neighbours add little
_PRIOR_DRAWS, _OTHER_DRAWS = 4000, 1000  # for the share within reach, with the prior and with one of another width


class ContourEvidence(NamedTuple):
    """Evidence of one family."""

    log_evidence: Floats  # for each of `WIDTHS`, (3,)
    standard_error: float
    overlap: float  # as of `Evidence`


def contour_evidence(model: ContourModel, sampled: Sampled, rng: np.random.Generator) -> ContourEvidence:
    """Return the evidence of a model by bridge sampling, with the prior restricted to contours within reach.

    With priors of other widths, the evidence follows from the same draws by importance weights.
    """
    coordinates, (chains, _, size) = sampled.coordinates, sampled.draws.samples.shape
    kept = sampled.draws.evenly(_POSTERIOR_DRAWS // chains)
    points = sampled.draws.samples[:, kept].reshape(-1, size)
    transformed = coordinates.of(points)
    _, growth = coordinates.parameters(transformed)
    bridge = bridge_evidence(
        in_coordinates(model.log_probability, coordinates),
        transformed.reshape(chains, -1, size),
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
        reached = model.share_within_reach(rng, _PRIOR_DRAWS if width == 1.0 else _OTHER_DRAWS, others)
        share = reached if width == 1.0 else share
        logs.append(bridge.log_evidence + weighed(change)[1] - np.log(reached))
    error = np.hypot(bridge.standard_error, np.sqrt((1.0 - share) / (share * _PRIOR_DRAWS)))
    return ContourEvidence(np.array(logs), float(error), bridge.overlap)
