"""Draws from a posterior, and how far to trust them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tactile_bayes.arrays import Floats
from tactile_bayes.inference.ensembles.places import Place

__all__ = ["Draws"]


@dataclass(frozen=True, eq=False)
class Draws:
    """Draws from a posterior, and how far to trust them."""

    samples: Floats
    """(chain, draw, parameter): a chain is an ensemble, its draws lie walker-major."""
    log_probability: Floats
    """(chain, draw)."""
    names: tuple[str, ...]
    walkers: int
    steps_kept: int
    """Steps of each walker that are in `samples`: of the second half of those it made, every `every`-th."""
    steps_run: int
    r_hat: Floats
    """Rank-normalised R̂ per parameter across ensembles, each cut in early and late steps: a common drift shows too."""
    ess_bulk: Floats
    """Effective sample size of the bulk, per parameter."""
    ess_tail: Floats
    """The smaller effective sample size of the 5 % and 95 % quantiles, per parameter."""
    acceptance: Floats
    """Share of accepted proposals, per ensemble, over the steps kept."""
    autocorrelation_time: Floats
    """emcee's integrated autocorrelation time [steps] per parameter, mean over ensembles.

    Infinite where a walker is stuck. emcee takes each walker's own mean off, so over few autocorrelation times it
    comes out too small.
    """
    evaluations: int
    """Points at which the log-probability was computed; with a checkpoint, those of earlier calls counted in."""
    seconds: float
    """Time that it took [s]; with a checkpoint, that of the steps made in earlier calls counted in."""
    converged: bool
    message: str
    """In words, how the run ended."""
    stuck: int
    """Number of walkers that did not move in all the steps kept."""
    places: tuple[Place, ...] = ()
    """Where ensembles sit if each has come to rest but not all in one place; else empty."""
    every: int = 1
    """1, or a power of two where the second half of the steps is more than memory should hold."""

    def refuse_interrupted(self, what: str) -> None:
        """Pass an interrupt on that ended the run: for what cannot use a part of it."""
        if "interrupted" in self.message:
            raise KeyboardInterrupt(f"interrupted while sampling {what}: nothing comes of it")

    def evenly(self, most: int) -> NDArray[np.intp]:
        """Places of draws of each chain, at most so many, evenly spread."""
        count = self.samples.shape[1]
        return np.unique(np.linspace(0, count - 1, min(count, most)).astype(np.intp))

    def by_walker(self) -> Floats:
        """The samples as (chain, walker, step, parameter)."""
        chains, _, parameters = self.samples.shape
        return self.samples.reshape(chains, self.walkers, self.steps_kept, parameters)
