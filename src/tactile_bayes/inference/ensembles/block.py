"""Consecutive steps of all ensembles, and the number of steps after which the run is judged."""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tactile_bayes.inference.ensembles.moves import Moves
from tactile_bayes.inference.ensembles.target import LogProbability, Together
from tactile_bayes.inference.ensembles.walkers import RandomState, walking_ensemble

__all__ = ["Block", "WalkingEnsembles", "next_look"]


Floats = NDArray[np.float64]

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
    """All ensembles, each in a thread of its own, in step; a context, at whose end they are gone."""

    def __init__(
        self, target: LogProbability, moves: Moves, points: Floats, values: Floats, randoms: Sequence[RandomState]
    ) -> None:
        """`points`: (chain, walker, parameter), where they go on; `values`: (chain, walker), the target there."""
        self._shape = points.shape
        self._together = Together(target, len(points))
        self._ensembles = [
            walking_ensemble(place, value, self._together.target_of(k), random, moves())
            for k, (place, value, random) in enumerate(zip(points, values, randoms, strict=True))
        ]
        self._pool = ThreadPoolExecutor(len(points))

    def __enter__(self) -> WalkingEnsembles:
        return self

    def __exit__(self, *_: object) -> None:
        self._pool.shutdown()

    def make_block(self, steps: int, deadline: float = math.inf) -> Block:
        """Make steps; at least one, but fewer than asked for once the clock passes the deadline, or if an interrupt
        comes, after which there are no more.
        """
        chains, walkers, parameters = self._shape
        samples, values = np.empty((chains, steps, walkers, parameters)), np.empty((chains, steps, walkers))
        made, randoms, whole = 0, tuple[RandomState, ...](), True
        try:
            while made < steps and not (made and time.monotonic() > deadline):
                waiting = [self._pool.submit(self._together.step, states) for states in self._ensembles]
                failures = [failure for failure in (one.exception() for one in waiting) if failure is not None]
                for failure in sorted(failures, key=lambda f: isinstance(f, threading.BrokenBarrierError)):
                    raise failure
                states = [one.result() for one in waiting]
                for k, state in enumerate(states):
                    samples[k, made], values[k, made] = state.coords, state.log_prob
                randoms = tuple(RandomState(*state.random_state) for state in states)
                made += 1
        except KeyboardInterrupt:
            self._together.abort()  # an ensemble may wait for others that were never asked to step
            whole = False
        return Block(samples[:, :made], values[:, :made], randoms, whole)


def next_look(steps: int, block_steps: int) -> int:
    """The number of steps at which a run that has made `steps` is judged next, however it came there."""
    look = block_steps
    while look <= steps:
        look += max(block_steps, math.ceil((_GROWTH - 1.0) * look))
    return look
