"""Consecutive steps of all ensembles, and the number of steps after which the run is judged."""

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
"""Steps at one diagnosis over steps at the one before: all diagnoses together then cost five times the last."""


@dataclass(frozen=True, eq=False)
class Block:
    """Consecutive steps of all ensembles, and the random numbers by which they go on."""

    samples: Floats
    """(chain, step, walker, parameter)."""
    log_probability: Floats
    """(chain, step, walker)."""
    random_states: tuple[RandomState, ...]
    """Of each ensemble after the last step; with that step's samples, all that the next step depends on."""
    whole: bool = True
    """Whether no interrupt came, after which the ensembles do not go on."""

    @property
    def steps(self) -> int:
        return self.samples.shape[1]


class WalkingEnsembles:
    """All ensembles, in step."""

    def __init__(
        self, target: LogProbability, moves: Moves, points: Floats, values: Floats, randoms: Sequence[RandomState]
    ) -> None:
        """`points`: (chain, walker, parameter), where they go on; `values`: (chain, walker), the target there."""
        self._shape = chains, walkers, parameters = points.shape
        self._moves = Abreast([moves() for _ in randoms], [random.numbers() for random in randoms])
        sampler: Any = emcee.EnsembleSampler(
            chains * walkers, parameters, target, moves=[(self._moves, 1.0)], vectorize=True
        )
        sampler.log_prob_fn = target  # without emcee's wrapper, which prints when the target raises
        # Starting points are checked before; those of a run that goes on are where it was, whatever emcee thinks.
        self._states = sampler.sample(
            emcee.State(points.reshape(-1, parameters), log_prob=values.ravel(), copy=True),
            iterations=None,
            store=False,
            skip_initial_state_check=True,
        )

    def make_block(self, steps: int, deadline: float = math.inf) -> Block:
        """Make steps; at least one, but fewer than asked for once the clock passes the deadline, or if an interrupt
        comes, after which there are no more.
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
    """The number of steps at which a run that has made `steps` is judged next, however it came there."""
    look = block_steps
    while look <= steps:
        look += max(block_steps, math.ceil((_GROWTH - 1.0) * look))
    return look
