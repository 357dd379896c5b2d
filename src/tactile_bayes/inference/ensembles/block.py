"""Consecutive steps of all ensembles, and the numbers of steps at which a run is diagnosed."""

from __future__ import annotations

import math
import time
from dataclasses import dataclass

import numpy as np

from tactile_bayes.arrays import Floats
from tactile_bayes.inference.densities import LogProbability
from tactile_bayes.inference.ensembles.moves import Moves, step_ensembles
from tactile_bayes.inference.ensembles.walkers import RandomState

__all__ = ["Block", "make_block", "next_diagnosis"]


_GROWTH = 1.25  # ratio of the steps at two successive diagnoses: all diagnoses together then cost five times the last


@dataclass(frozen=True, eq=False)
class Block:
    """Consecutive steps of all ensembles, and the random states with which they continue."""

    samples: Floats  # shape (chain, step, walker, parameter)
    log_probability: Floats  # shape (chain, step, walker)
    # Random state of each ensemble after the last step; with that step's samples it determines the next step.
    random_states: tuple[RandomState, ...]
    whole: bool = True  # false if an interrupt ended the block; the ensembles then do not continue

    @property
    def steps(self) -> int:
        return self.samples.shape[1]


def make_block(target: LogProbability, moves: Moves, last: Block, steps: int, deadline: float = math.inf) -> Block:
    """Make the steps after a block, which are determined by its last one.

    The block has at least one step, but fewer than asked for after the deadline [s, monotonic clock] or an interrupt.
    """
    points, values = last.samples[:, -1], last.log_probability[:, -1]
    randoms = [state.generator() for state in last.random_states]
    states = last.random_states
    samples, log_probability = (np.empty((len(a), steps, *a.shape[1:])) for a in (points, values))
    made, whole = 0, True
    try:
        while made < steps and not (made and time.monotonic() > deadline):
            points, values = step_ensembles(target, moves, randoms, points, values)
            samples[:, made], log_probability[:, made] = points, values
            states = tuple(RandomState.of(random) for random in randoms)
            made += 1
    except KeyboardInterrupt:
        whole = False
    return Block(samples[:, :made], log_probability[:, :made], states, whole)


def next_diagnosis(steps: int, block_steps: int) -> int:
    """Return the number of steps at which a run that has made `steps` is diagnosed next."""
    due = block_steps
    while due <= steps:
        due += max(block_steps, math.ceil((_GROWTH - 1.0) * due))
    return due
