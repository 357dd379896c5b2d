"""Convergence diagnostics of a run: R̂ across ensembles, effective sample sizes, autocorrelation, lost walkers."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import emcee
import numpy as np
from arviz_stats.base.array import array_stats

from tactile_bayes.arrays import Flags, Floats

__all__ = ["Diagnosis", "autocorrelation_time", "lost_walkers", "walker_major"]


_TAIL = (0.05, 0.95)  # quantiles that define the effective sample size of the tails
_LOST_BELOW = 10.0  # distance of a lost walker's largest log-probability below the median of all walkers


def lost_walkers(values: Floats) -> Flags:
    """Return True for walkers far less probable than the rest, shape (chain, walker), from their log-probabilities.

    R̂ and effective sample size do not detect one of them among a hundred, and it would dominate the tails of the
    result. Fewer than one in thousands of draws from a posterior is so improbable, and practically never the most
    probable of a walker's many draws.
    """
    if not values.shape[1]:
        return np.zeros((len(values), values.shape[2]), dtype=bool)
    return np.asarray(values.max(axis=1) < np.median(values) - _LOST_BELOW)


_WINDOW = 5.0  # window of the sum of autocorrelations, in autocorrelation times, as in emcee


class Diagnosis:
    """Convergence diagnostics of the second half of a run."""

    def __init__(self, samples: Floats) -> None:
        """Diagnose samples, shape (chain, step, walker, parameter)."""
        half = samples.shape[1] // 2
        halves = np.concatenate([samples[:, :half], samples[:, half : 2 * half]])
        self.r_hat = _each(array_stats.rhat, walker_major(halves), method="rank")
        laid_out = walker_major(samples)
        self.ess_bulk = _each(array_stats.ess, laid_out, method="bulk")
        self.ess_tail = _each(array_stats.ess, laid_out, method="tail", prob=_TAIL)

    @property
    def worst_r_hat(self) -> int:
        return int(np.argmax(np.where(np.isnan(self.r_hat), np.inf, self.r_hat)))

    @property
    def worst_ess(self) -> int:
        return int(np.argmin(np.nan_to_num(self.ess)))

    @property
    def ess(self) -> Floats:
        return np.minimum(self.ess_bulk, self.ess_tail)

    def satisfies(self, max_r_hat: float, min_ess: float) -> bool:
        return bool(np.all(self.r_hat < max_r_hat) and np.all(self.ess >= min_ess))

    def message(self, names: Sequence[str]) -> str:
        i, j = self.worst_r_hat, self.worst_ess
        if np.isnan(self.r_hat[i]) or np.isnan(self.ess[j]):
            return "too few draws for R̂ and effective sample sizes"
        return (
            f"largest R̂ {self.r_hat[i]:.4f} ({names[i]}), smallest effective sample size {self.ess[j]:.0f} ({names[j]})"
        )


def _each(statistic: Callable[..., Floats], draws: Floats, **options: object) -> Floats:
    """Return a statistic of ArviZ for each parameter of (chain, draw, parameter); NaN with too few draws."""
    if draws.shape[1] < 8:
        return np.full(draws.shape[-1], np.nan)
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray(statistic(draws, chain_axis=0, draw_axis=1, **options), dtype=float)


def walker_major(samples: Floats) -> Floats:
    """Lay out samples (chain, step, walker, …) as (chain, walker · step, …)."""
    swapped = np.swapaxes(samples, 1, 2)
    return np.ascontiguousarray(swapped).reshape(swapped.shape[0], -1, *swapped.shape[3:])


def autocorrelation_time(samples: Floats) -> Floats:
    """Return emcee's τ [steps] of samples (chain, step, walker, parameter), averaged over chains.

    All walkers are computed at once: `emcee.autocorr.integrated_time` takes them one by one, as slow as a short run.
    """
    chains, steps, _, parameters = samples.shape
    if steps < 2:
        return np.full(parameters, np.nan)
    still = np.all(samples == samples[:, :1], axis=1).any(axis=1)  # (chain, parameter)
    times = np.full((chains, parameters), np.inf)
    for chain, j in zip(*np.nonzero(~still), strict=True):
        decay = array_stats.autocorr(samples[chain, :, :, j].T).mean(axis=0)
        sums = 2.0 * np.cumsum(decay) - 1.0
        times[chain, j] = sums[emcee.autocorr.auto_window(sums, _WINDOW)]
    return np.asarray(times.mean(axis=0))
