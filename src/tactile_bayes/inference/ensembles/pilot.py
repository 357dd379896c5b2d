"""Short pilot runs, which learn coordinates in which a posterior is nearly normal."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import replace

import numpy as np

from tactile_bayes.arrays import Floats
from tactile_bayes.inference.deadline import NEVER, Deadline
from tactile_bayes.inference.ensembles.block import Block, make_block
from tactile_bayes.inference.ensembles.coordinates import Proposing, in_coordinates
from tactile_bayes.inference.ensembles.diagnosis import autocorrelation_time
from tactile_bayes.inference.ensembles.moves import Moves
from tactile_bayes.inference.ensembles.proposal import Mixture, Proposal
from tactile_bayes.inference.ensembles.straightened import Straightened
from tactile_bayes.inference.ensembles.target import LogProbability
from tactile_bayes.inference.ensembles.walkers import RandomState, first_random_state

__all__ = ["learn_coordinates", "pilot_normal"]

_STEPS = (60, 120, 240, 480, 960)
"""Number of steps of each stage, which samples in the best coordinates so far."""

_STEPS_OF_NORMAL = 40
"""Number of steps of a pilot run in coordinates that are nearly standard normal."""

_MOVES_PER_DRAW = 4.0
"""Number of accepted moves of a walker there after which its position is a draw of its own."""

_MAX_DRAWS = 3000
"""Largest number of draws from each half of the walkers to which the coordinates of a stage are fitted."""

_GOOD_QUALITY = 0.25
"""Quality of a proposal from which no further stage is made; it is 0.4 for a normal posterior."""

_QUALITY_DRAWS = 400
"""Number of draws from the posterior, and from the proposal, by which the quality is estimated."""

_MIN_ACCEPTANCE = 0.02
"""Lower bound of the acceptance probability at any point, since there are other moves."""


def learn_coordinates(
    log_probability: LogProbability,
    base: Proposing,
    start: Floats,
    scale: Floats,
    rng: np.random.Generator,
    deadline: Deadline = NEVER,
) -> Proposing:
    """Return coordinates with a proposal in them, learned in stages that sample in the best coordinates so far.

    The quality of a proposal is estimated at positions of the walkers: its own draws would miss the same parts of the
    target as the proposal, and a narrow one would look good.

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
        density = in_coordinates(log_probability, best)
        coordinates = best.of(points)
        block = _pilot(density, best.moves(), coordinates, steps, random, deadline)
        (random,) = block.random_states
        late = block.samples[:, block.steps // 2 :]
        points = best.parameters(late[0, -1])[0]
        every = [best.parameters(walker)[0] for walker in np.swapaxes(late[0], 0, 1)]
        share = 1.0 / max(1.0, float(np.median(autocorrelation_time(late))))
        half = len(every) // 2
        some, others = (rng.permutation(np.concatenate(part))[:_MAX_DRAWS] for part in (every[:half], every[half:]))
        quality = 0.0
        if best.proposal is not None:
            quality = _quality(log_probability, best, np.concatenate([some, others]), rng)
            best = best.with_proposal(best.proposal.with_efficiency(quality))
        if quality < _GOOD_QUALITY and not deadline.has_passed:
            with suppress(np.linalg.LinAlgError):  # too few walkers have moved for a fit
                found = _quality(log_probability, _straightened(base, some, scale, share), others, rng)
                if found > quality:
                    quality = found
                    best = _straightened(base, np.concatenate([some, others]), scale, share, found)
        if quality >= _GOOD_QUALITY or deadline.has_passed:
            break
    return best


def pilot_normal(
    density: LogProbability,
    moves: Moves,
    start: Floats,
    columns: slice,
    rng: np.random.Generator,
    deadline: Deadline = NEVER,
) -> tuple[Floats, Floats, Floats]:
    """Return mean, (k,), and root, (k, k), of the covariance of some coordinates, and last positions, (walkers, d).

    These coordinates should be nearly standard normal: of the covariance only principal axes count whose variances
    differ from one by more than the number of draws explains (Marchenko & Pastur 1967, doi
    10.1070/SM1967v001n04ABEH001994), less the bias of their size (Baik & Silverstein 2006, doi
    10.1016/j.jmva.2005.08.003).

    Parameters
    ----------
    density : callable
        Log-density of coordinates, (n, d) to (n,).
    moves : sequence of moves with their shares
    start : ndarray, shape (walkers, d)
        Starting points of an even number of walkers, in coordinates.
    columns : slice
        The k coordinates.
    rng : np.random.Generator
    deadline : Deadline
        After it, the walkers make one more step.
    """
    random = first_random_state(np.random.SeedSequence(int(rng.integers(2**63))))
    block = _pilot(density, moves, start, _STEPS_OF_NORMAL, random, deadline)
    late = block.samples[:, block.steps // 2 :, :, columns]
    draws = late.reshape(-1, late.shape[-1])
    variances, axes = np.linalg.eigh(np.cov(draws.T))
    moves_of_walker = np.mean(np.any(np.diff(late[0], axis=0) != 0.0, axis=-1)) * late.shape[1]
    independent = late.shape[2] * max(1.0, moves_of_walker / _MOVES_PER_DRAW)
    ratio = variances.size / independent
    unlike = np.abs(np.sqrt(variances) - 1.0) > np.sqrt(ratio)
    variances, axes = variances[unlike], axes[:, unlike]
    twice = variances + 1.0 - ratio
    true = 0.5 * (twice + np.sign(variances - 1.0) * np.sqrt(np.maximum(twice**2 - 4.0 * variances, 0.0)))
    root = np.eye(draws.shape[1]) + axes * (np.sqrt(true) - 1.0) @ axes.T
    return draws.mean(axis=0), root, block.samples[0, -1]


def _pilot(
    density: LogProbability, moves: Moves, start: Floats, steps: int, random: RandomState, deadline: Deadline
) -> Block:
    """Return the steps of one ensemble; an interrupt is raised."""
    first = Block(start[None, None], density(start)[None, None], (random,))
    block = make_block(density, moves, first, steps, deadline.moment)
    if not block.whole:
        raise KeyboardInterrupt
    return block


def _straightened(base: Proposing, draws: Floats, scale: Floats, share: float, efficiency: float = 0.0) -> Straightened:
    """Return coordinates fitted to draws, with a proposal; a share of the draws counts as independent."""
    found = Straightened.fitted(base, draws, scale, share * len(draws))
    return replace(found, proposal=Mixture((replace(Proposal.fitted(found.of(draws)), efficiency=efficiency),)))


def _quality(log_probability: LogProbability, coordinates: Proposing, draws: Floats, rng: np.random.Generator) -> float:
    """Return one over the mean number of proposals until acceptance, averaged over draws from the posterior."""
    target, proposal = in_coordinates(log_probability, coordinates), coordinates.proposal
    assert proposal is not None
    proposed, density = proposal.draw(rng, _QUALITY_DRAWS)
    there = target(proposed) - density
    chosen = coordinates.of(draws[rng.permutation(len(draws))[:_QUALITY_DRAWS]])
    here = target(chosen) - proposal.log_density(chosen)
    here = here[np.isfinite(here)]  # rounding in the coordinates may put a draw beyond the edge of the possible
    accepted = np.exp(np.minimum(0.0, there - here[:, None])).mean(axis=1)
    return float(1.0 / np.mean(1.0 / np.maximum(accepted, _MIN_ACCEPTANCE)))
