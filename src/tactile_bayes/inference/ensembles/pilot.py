"""A short pilot run that learns coordinates in which a posterior is nearly normal, and a proposal in them."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import replace

import numpy as np

from tactile_bayes.arrays import Floats
from tactile_bayes.inference.deadline import NEVER, Deadline
from tactile_bayes.inference.ensembles.block import Block, make_block
from tactile_bayes.inference.ensembles.coordinates import Proposing, in_coordinates
from tactile_bayes.inference.ensembles.diagnosis import autocorrelation_time
from tactile_bayes.inference.ensembles.proposal import Mixture, Proposal
from tactile_bayes.inference.ensembles.straightened import Straightened
from tactile_bayes.inference.ensembles.target import LogProbability
from tactile_bayes.inference.ensembles.walkers import first_random_state

__all__ = ["learned"]

_STEPS = (60, 120, 240, 480, 960)
"""Number of steps of each stage, which samples in the best coordinates so far."""

_KEPT = 3000
"""Largest number of draws of a stage from each half of the walkers, to which coordinates are fitted."""

_GOOD = 0.25
"""Quality at which learning stops; that of a normal posterior is 0.4."""

_JUDGED = 400
"""Number of draws of the posterior, and of the proposal, by which the proposal is judged."""

_LEAST = 0.02
"""Lower bound of the acceptance from any point, since there are other moves."""


def learned(
    log_probability: LogProbability,
    base: Proposing,
    start: Floats,
    scale: Floats,
    rng: np.random.Generator,
    deadline: Deadline = NEVER,
) -> Proposing:
    """Return coordinates with a proposal in them, learned in stages that sample in the best coordinates so far.

    A proposal judged by its own draws looks good if it is so narrow that they miss a part of the target; here it is
    judged by positions of the walkers.

    Parameters
    ----------
    log_probability : callable
        Log-density of parameters, (n, d) to (n,).
    base : Logarithms
        Coordinates, with a proposal if one is known.
    start : ndarray, shape (walkers, d)
        Starting points of an even number of walkers, in parameters.
    scale : ndarray, shape (d,)
        Prior scale of each of the base's coordinates.
    rng : np.random.Generator
    deadline : Deadline
        After it, the walkers make one more step, and there is no further stage.
    """
    best: Proposing = base
    points = start
    random = first_random_state(np.random.SeedSequence(int(rng.integers(2**63))))
    for steps in _STEPS:
        walked = in_coordinates(log_probability, best)
        places = best.of(points)
        first = Block(places[None, None], walked(places)[None, None], (random,))
        block = make_block(walked, best.moves(), first, steps, deadline.moment)
        if not block.whole:
            raise KeyboardInterrupt
        (random,) = block.random_states
        late = block.samples[:, block.steps // 2 :]
        points = best.parameters(late[0, -1])[0]
        every = [best.parameters(walker)[0] for walker in np.swapaxes(late[0], 0, 1)]
        share = 1.0 / max(1.0, float(np.median(autocorrelation_time(late))))
        half = len(every) // 2
        some, others = (rng.permutation(np.concatenate(part))[:_KEPT] for part in (every[:half], every[half:]))
        most = 0.0
        if best.proposal is not None:
            most = _quality(log_probability, best, np.concatenate([some, others]), rng)
            best = best.with_proposal(best.proposal.with_efficiency(most))
        if most < _GOOD and not deadline.has_passed:
            with suppress(np.linalg.LinAlgError):  # too few have moved for anything to be fitted
                quality = _quality(log_probability, _straightened(base, some, scale, share), others, rng)
                if quality > most:
                    most = quality
                    best = _straightened(base, np.concatenate([some, others]), scale, share, quality)
        if most >= _GOOD or deadline.has_passed:
            break
    return best


def _straightened(base: Proposing, draws: Floats, scale: Floats, share: float, efficiency: float = 0.0) -> Straightened:
    """Return coordinates fitted to draws, of which a share is independent, and a proposal in them."""
    found = Straightened.fitted(base, draws, scale, share * len(draws))
    return replace(found, proposal=Mixture((replace(Proposal.fitted(found.of(draws)), efficiency=efficiency),)))


def _quality(log_probability: LogProbability, coordinates: Proposing, draws: Floats, rng: np.random.Generator) -> float:
    """Return one over the mean number of proposals until one is accepted, averaged over draws of the posterior."""
    target, proposal = in_coordinates(log_probability, coordinates), coordinates.proposal
    assert proposal is not None
    proposed, density = proposal.draw(rng, _JUDGED)
    there = target(proposed) - density
    chosen = coordinates.of(draws[rng.permutation(len(draws))[:_JUDGED]])
    here = target(chosen) - proposal.log_density(chosen)
    accepted = np.exp(np.minimum(0.0, there - here[:, None])).mean(axis=1)
    return float(1.0 / np.mean(1.0 / np.maximum(accepted, _LEAST)))
