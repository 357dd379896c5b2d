"""Starting points of walkers, their random numbers, and their target: checked and counted."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from tactile_bayes.arrays import Floats
from tactile_bayes.errors import InferenceError
from tactile_bayes.inference.densities import LogProbability
from tactile_bayes.inference.ensembles.settings import SamplerSettings
from tactile_bayes.numerics.random_numbers import Seed, spawn

_MAX_ROUNDS = 100  # of draws, as many in each as there are walkers
RandomState = tuple[Any, ...]  # of NumPy's Mersenne Twister, which emcee's moves use, as from `get_state`


def first_random_state(seed: np.random.SeedSequence) -> RandomState:
    return tuple(np.random.RandomState(np.random.MT19937(seed)).get_state())


def generator_at(state: RandomState) -> np.random.RandomState:
    """Return a generator that continues from a state."""
    random = np.random.RandomState()
    random.set_state(state)
    return random


@dataclass
class CheckedTarget:
    """The log-probability with its values checked and its evaluations counted."""

    log_probability: LogProbability
    names: Sequence[str]
    evaluations: int = 0

    def __call__(self, points: Floats) -> Floats:
        values = np.asarray(self.log_probability(points), dtype=float)
        self.evaluations += values.size
        wrong = np.isnan(values) | (values == np.inf)
        if np.any(wrong):
            i = int(np.argmax(wrong))
            where = ", ".join(f"{name} = {value!r}" for name, value in zip(self.names, points[i].tolist(), strict=True))
            raise InferenceError(
                f"the log-probability is {values[i]} at {where}: it has to be a number, or −inf where the point is "
                "impossible"
            )
        return values


def scatter_walkers(
    log_probability: LogProbability,
    draw: Callable[[np.random.Generator, int], Floats],
    *,
    parameters: int,
    seed: Seed,
    settings: SamplerSettings,
    floor: Callable[[], float] = lambda: -np.inf,
) -> Floats:
    """Return random starting points, (ensembles, walkers, parameters), of a log-probability above a floor."""
    walkers = settings.walkers_for(parameters)
    # The second half, so that the streams differ from those that the same seed gives to the ensembles themselves.
    seeds = spawn(seed, 2 * settings.ensembles)[settings.ensembles :]
    start = np.empty((settings.ensembles, walkers, parameters))
    for k, each in enumerate(seeds):
        rng = np.random.default_rng(each)
        found, drawn = 0, 0
        while found < walkers:
            if drawn >= _MAX_ROUNDS * walkers:
                raise InferenceError(
                    f"only {found} of {drawn} random starting points have a finite log-probability and {walkers} are "
                    "needed: draw them closer to a point that is known to be possible"
                )
            points = np.asarray(draw(rng, walkers), dtype=float)
            points = points[log_probability(points) > floor()][: walkers - found]
            start[k, found : found + len(points)] = points
            found, drawn = found + len(points), drawn + walkers
    return start
