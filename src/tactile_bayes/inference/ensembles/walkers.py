"""Starting points of walkers, their random numbers, and their target: checked and counted."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import emcee
import numpy as np
from numpy.typing import ArrayLike

from tactile_bayes.arrays import Floats
from tactile_bayes.errors import InferenceError, ParameterError
from tactile_bayes.inference.densities import LogProbability
from tactile_bayes.inference.ensembles.settings import SamplerSettings, refuse_few_walkers
from tactile_bayes.numerics.random_numbers import Seed, spawn

__all__ = [
    "CheckedTarget",
    "RandomState",
    "checked_start",
    "first_random_state",
    "generator_at",
    "scatter_walkers",
    "state_of",
]


RandomState = tuple[Any, ...]  # of NumPy's Mersenne Twister, which emcee's moves use, as from `get_state`


def first_random_state(seed: np.random.SeedSequence) -> RandomState:
    return state_of(np.random.RandomState(np.random.MT19937(seed)))


def state_of(random: np.random.RandomState) -> RandomState:
    return tuple(random.get_state(legacy=True))


def generator_at(state: RandomState) -> np.random.RandomState:
    """Return a generator that continues from a state."""
    random = np.random.RandomState()
    random.set_state(state)
    return random


class CheckedTarget:
    """The log-probability with its values checked and its evaluations counted."""

    def __init__(self, log_probability: LogProbability, names: Sequence[str]) -> None:
        self.log_probability = log_probability
        self.names = names
        self.evaluations = 0

    def __call__(self, points: Floats) -> Floats:
        values = np.asarray(self.log_probability(points), dtype=float)
        if values.shape != points.shape[:1]:
            raise InferenceError(
                f"the log-probability of {points.shape[0]} points came back with shape {values.shape}: it has to take "
                f"an array (n, {len(self.names)}) and return one of shape (n,)"
            )
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


def checked_start(start: ArrayLike, names: Sequence[str], settings: SamplerSettings) -> Floats:
    """Return starting points, shape (ensembles, walkers, parameters), and refuse unsuitable ones."""
    points = np.array(start, dtype=float)
    if points.ndim != 3 or points.shape[0] != settings.ensembles or points.shape[2] != len(names):
        raise ParameterError(
            f"start has shape {points.shape}: it has to be (ensembles, walkers, parameters) = "
            f"({settings.ensembles}, walkers, {len(names)})"
        )
    walkers = points.shape[1]
    if settings.walkers is not None and walkers != settings.walkers:
        raise ParameterError(f"start has {walkers} walkers in an ensemble, but the settings ask for {settings.walkers}")
    if walkers % 2:
        raise ParameterError(f"start has {walkers} walkers in an ensemble: give an even number, it moves by halves")
    refuse_few_walkers(walkers, len(names))
    if not np.all(np.isfinite(points)):
        raise InferenceError(f"{np.count_nonzero(~np.isfinite(points))} numbers of start are not finite")
    for k, ensemble in enumerate(points):
        if not emcee.ensemble.walkers_independent(ensemble):
            raise InferenceError(
                f"the walkers of ensemble {k} start in a plane (or all at one point), which they could never leave: "
                "scatter them in every direction of parameter space"
            )
    return points


def scatter_walkers(
    log_probability: LogProbability,
    draw: Callable[[np.random.Generator, int], Floats],
    *,
    parameters: int,
    seed: Seed,
    settings: SamplerSettings | None = None,
    max_rounds: int = 100,
) -> Floats:
    """Return starting points for `sample`: random points, redrawn until each has a finite log-probability.

    Returns shape (ensembles, walkers, parameters).
    """
    settings = SamplerSettings() if settings is None else settings
    walkers = settings.walkers_for(parameters)
    # The second half, so that the streams differ from those that the same seed gives to the ensembles themselves.
    seeds = spawn(seed, 2 * settings.ensembles)[settings.ensembles :]
    start = np.empty((settings.ensembles, walkers, parameters))
    for k, each in enumerate(seeds):
        rng = np.random.default_rng(each)
        found, drawn = 0, 0
        while found < walkers:
            if drawn >= max_rounds * walkers:
                raise InferenceError(
                    f"only {found} of {drawn} random starting points have a finite log-probability and {walkers} are "
                    "needed: draw them closer to a point that is known to be possible"
                )
            points = np.asarray(draw(rng, walkers), dtype=float)
            points = points[np.isfinite(log_probability(points))][: walkers - found]
            start[k, found : found + len(points)] = points
            found, drawn = found + len(points), drawn + walkers
    return start
