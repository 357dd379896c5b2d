"""Consecutive steps of all ensembles, and the numbers of steps at which a run is diagnosed."""

from __future__ import annotations

import math
import time
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import emcee
import numpy as np

from tactile_bayes.arrays import Floats
from tactile_bayes.inference.ensembles.moves import Abreast, Moves
from tactile_bayes.inference.ensembles.target import LogProbability
from tactile_bayes.inference.ensembles.walkers import RandomState

__all__ = ["Block", "WalkingEnsembles", "next_look"]


_GROWTH = 1.25
"""Ratio of the steps at two successive diagnoses: all diagnoses together then cost five times the last."""


@dataclass(frozen=True, eq=False)
class Block:
    """Consecutive steps of all ensembles, and the random states with which they continue."""

    samples: Floats
    """Shape (chain, step, walker, parameter)."""
    log_probability: Floats
    """Shape (chain, step, walker)."""
    random_states: tuple[RandomState, ...]
    """Random state of each ensemble after the last step; with that step's samples it determines the next step."""
    whole: bool = True
    """False if an interrupt ended the block; the ensembles then do not continue."""

    @property
    def steps(self) -> int:
        return self.samples.shape[1]


class WalkingEnsembles:
    """All ensembles, sampled in step."""

    def __init__(
        self, target: LogProbability, moves: Moves, points: Floats, values: Floats, randoms: Sequence[RandomState]
    ) -> None:
        """Start from points, shape (chain, walker, parameter), with target values, shape (chain, walker)."""
        self._shape = chains, walkers, parameters = points.shape
        self._moves = Abreast([moves() for _ in randoms], [random.numbers() for random in randoms])
        sampler: Any = emcee.EnsembleSampler(
            chains * walkers, parameters, target, moves=[(self._moves, 1.0)], vectorize=True
        )
        sampler.log_prob_fn = target  # without emcee's wrapper, which prints when the target raises
        # Starting points are checked before; those of a resumed run are kept, even if emcee would refuse them.
        self._states = sampler.sample(
            emcee.State(points.reshape(-1, parameters), log_prob=values.ravel(), copy=True),
            iterations=None,
            store=False,
            skip_initial_state_check=True,
        )

    def make_block(self, steps: int, deadline: float = math.inf) -> Block:
        """Make steps: at least one, but fewer than asked for after the deadline [s, monotonic clock] or an interrupt.

        After an interrupt the ensembles make no further steps.
        """
        chains, walkers, parameters = self._shape
        samples, values = np.empty((chains, steps, walkers, parameters)), np.empty((chains, steps, walkers))
        made, randoms, whole = 0, tuple[RandomState, ...](), True
        try:
            while made < steps and not (made and time.monotonic() > deadline):
                state = next(self._states)
                samples[:, made] = state.coords.reshape(self._shape)
                values[:, made] = state.log_prob.reshape(chains, walkers)
                randoms = tuple(RandomState.of(random) for random in self._moves.randoms)
                made += 1
        except KeyboardInterrupt:
            whole = False
        return Block(samples[:, :made], values[:, :made], randoms, whole)


def next_look(steps: int, block_steps: int) -> int:
    """Return the number of steps at which a run that has made `steps` is diagnosed next."""
    look = block_steps
    while look <= steps:
        look += max(block_steps, math.ceil((_GROWTH - 1.0) * look))
    return look
