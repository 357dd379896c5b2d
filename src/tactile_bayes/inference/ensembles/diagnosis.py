"""Diagnosis of a run: R̂ across ensembles, effective sample sizes, autocorrelation, lost walkers, and modes."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import emcee
import numpy as np
from scipy.sparse.csgraph import connected_components

from tactile_bayes.arrays import Flags, Floats

_TAIL = (0.05, 0.95)  # quantiles that define the effective sample size of the tails
# Distance of a lost walker's largest log-probability below the median of all, at least, and over that of a sixth of
# their values, which is √(d/2) for normal posteriors of d parameters.
_LOST_BELOW, _LOST_OVER_SPREAD = 10.0, 6.0


def lost_walkers(values: Floats) -> Flags:
    """Return True for walkers, (chain, walker), far less probable than the rest, which R̂ would not detect."""
    if not values.shape[1]:
        return np.zeros((len(values), values.shape[2]), dtype=bool)
    low, median = np.quantile(values, [1.0 / 6.0, 0.5])
    return np.asarray(values.max(axis=1) < median - np.maximum(_LOST_BELOW, _LOST_OVER_SPREAD * (median - low)))


_WINDOW = 5.0  # window of the sum of autocorrelations, in autocorrelation times, as in emcee


class Diagnosis:
    """Convergence diagnostics of the second half of a run."""

    def __init__(self, samples: Floats) -> None:
        """Diagnose samples, shape (chain, step, walker, parameter)."""
        from arviz_stats.base.array import array_stats  # loads Matplotlib

        half = samples.shape[1] // 2
        halves = np.concatenate([samples[:, :half], samples[:, half : 2 * half]])
        self.r_hat = _each(array_stats.rhat, walker_major(halves), method="rank")
        laid_out = walker_major(samples)
        self.ess_bulk = _each(array_stats.ess, laid_out, method="bulk")
        self.ess_tail = _each(array_stats.ess, laid_out, method="tail", prob=_TAIL)
        self.ess = np.minimum(self.ess_bulk, self.ess_tail)
        self.worst_r_hat = int(np.argmax(np.where(np.isnan(self.r_hat), np.inf, self.r_hat)))  # number of a parameter
        self.worst_ess = int(np.argmin(np.nan_to_num(self.ess)))

    def satisfies(self, max_r_hat: float, ess: float) -> bool:
        return bool(np.all(self.r_hat < max_r_hat) and np.all(self.ess >= ess))

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
    """Return emcee's τ [steps] of samples (chain, step, walker, parameter), all walkers at once, mean over chains."""
    from arviz_stats.base.array import array_stats  # loads Matplotlib

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


_MIN_DISTANCE = 5.0  # of two ensembles' means, over the larger of their deviations, from which they are separate
_MAX_R_HAT = 1.1  # R̂ of an ensemble's early against its late steps below which it is stationary
_MIN_DRAWS_PER_WALKER = 2.0  # smallest number of effective draws per walker of a stationary ensemble
_MAX_NAMED = 3  # largest number of parameters that the message names for a mode


@dataclass(frozen=True)
class Mode:
    """Mode that holds some of the ensembles."""

    ensembles: tuple[int, ...]  # numbers of the ensembles, counted from 0
    values: Mapping[str, float]  # median of each parameter that separates the modes, the clearest first
    log_probability: float  # mean log-probability over the draws of the mode


def modes_of(samples: Floats, log_probability: Floats, names: Sequence[str]) -> tuple[Mode, ...]:
    """Return the modes of the ensembles, from samples (chain, step, walker, parameter) and log-probabilities. Only if
    each ensemble is stationary, disagreement means several modes rather than a slow run; else there are none."""
    if not _are_stationary(samples):
        return ()
    mean, deviation = samples.mean(axis=(1, 2)), samples.std(axis=(1, 2))  # (chain, parameter)
    larger = np.maximum(deviation[:, None], deviation)
    distance = np.abs(mean[:, None] - mean) / np.where(larger > 0.0, larger, np.inf)  # (chain, chain, parameter)
    count, group_of = connected_components(distance.max(axis=-1) < _MIN_DISTANCE)
    if count < 2:
        return ()
    groups = [tuple(np.flatnonzero(group_of == k).tolist()) for k in range(count)]
    clearest = np.argsort(-distance.max(axis=(0, 1)), kind="stable")
    separating = [i for i in clearest if distance[..., i].max() >= _MIN_DISTANCE]
    return tuple(
        Mode(
            ensembles=group,
            values={names[i]: float(np.median(samples[list(group), ..., i])) for i in separating},
            log_probability=float(log_probability[list(group)].mean()),
        )
        for group in groups
    )


def modes_message(modes: Sequence[Mode]) -> str:
    """Return a message with the ensembles, medians and log-probability of each mode."""
    parts = []
    for mode in modes:
        values = [f"{name} = {value:.6g}" for name, value in mode.values.items()]
        more = [f"{len(values) - _MAX_NAMED} more"] if len(values) > _MAX_NAMED else []
        which = f"{'ensemble' if len(mode.ensembles) == 1 else 'ensembles'} {', '.join(map(str, mode.ensembles))}"
        where = ", ".join(values[:_MAX_NAMED] + more)
        parts.append(f"{which} near {where} (mean log-probability {mode.log_probability:.1f})")
    return (
        f"ensembles sit in {len(modes)} modes and none moves to another: {'; '.join(parts)}; their "
        "probabilities are unknown, and more steps will not help: use priors that admit only one of them"
    )


def _are_stationary(samples: Floats) -> bool:
    """Return True if early and late steps of each ensemble agree, and its walkers have forgotten their positions."""
    if samples.shape[1] < 8:
        return False
    least = _MIN_DRAWS_PER_WALKER * samples.shape[2]
    each = [Diagnosis(ensemble[None]) for ensemble in samples]
    return all(bool(np.all(one.r_hat < _MAX_R_HAT) and np.all(one.ess_bulk >= least)) for one in each)
