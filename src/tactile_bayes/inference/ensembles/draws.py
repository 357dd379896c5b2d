"""Draws from a posterior, with their convergence diagnostics."""

from __future__ import annotations

from dataclasses import dataclass

from tactile_bayes.arrays import Floats, Index
from tactile_bayes.inference.ensembles.diagnosis import Mode
from tactile_bayes.numerics.selection import evenly_spread

__all__ = ["Draws"]


@dataclass(frozen=True, eq=False)
class Draws:
    """Draws from a posterior, with their convergence diagnostics."""

    samples: Floats  # shape (chain, draw, parameter): a chain is an ensemble, with its draws walker-major
    log_probability: Floats  # shape (chain, draw)
    names: tuple[str, ...]
    walkers: int
    steps_kept: int  # number of steps of each walker in `samples`: every `every`-th of the second half of its steps
    steps_run: int
    r_hat: Floats  # rank-normalised, across ensembles, each split in early and late steps to detect drift
    ess_bulk: Floats  # effective sample size of the bulk, per parameter
    ess_tail: Floats  # the smaller effective sample size of the 5 % and 95 % quantiles, per parameter
    acceptance: Floats  # share of accepted proposals, per ensemble, over the steps kept
    # emcee's integrated autocorrelation time [steps] per parameter, mean over ensembles. It is infinite if a walker is
    # stuck. emcee subtracts each walker's own mean, so that the estimate is too small over few autocorrelation times.
    autocorrelation_time: Floats
    evaluations: int  # points at which the log-probability was computed, in earlier calls with a checkpoint too
    seconds: float  # sampling time [s], including the steps of earlier calls with a checkpoint
    converged: bool
    message: str  # reason for the end of the run, with the worst diagnostics
    stuck: int  # number of walkers that did not move in all the steps kept
    modes: tuple[Mode, ...] = ()  # modes of the ensembles, if each ensemble is stationary but they disagree; else empty
    every: int = 1  # thinning: 1, or a power of two if the second half of the steps would take too much memory

    def refuse_interrupted(self, what: str) -> None:
        """Raise the interrupt that ended the run, for callers that cannot use a part of it."""
        if "interrupted" in self.message:
            raise KeyboardInterrupt(f"interrupted while sampling {what}: there is no result")

    def evenly(self, most: int) -> Index:
        """Return the indices of at most so many draws of each chain, evenly spread."""
        return evenly_spread(self.samples.shape[1], most)

    def by_walker(self) -> Floats:
        """Return the samples as (chain, walker, step, parameter)."""
        chains, _, parameters = self.samples.shape
        return self.samples.reshape(chains, self.walkers, self.steps_kept, parameters)
