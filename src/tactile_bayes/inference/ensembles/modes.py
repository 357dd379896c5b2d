"""Modes of the posterior: groups of stationary ensembles between which no walker moves."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from arviz_stats.base.array import array_stats

from tactile_bayes.arrays import Flags, Floats

__all__ = ["Mode", "modes_message", "modes_of"]


# Distance of two ensembles' means, over the larger of their standard deviations, from which they are separate.
_MIN_DISTANCE = 5.0
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
    """Return the modes of the ensembles, from samples (chain, step, walker, parameter) and log-probabilities.

    The result is empty if there is only one mode, or if an ensemble is not stationary: only if the early and late steps
    of each ensemble agree, and its walkers have forgotten their positions, does disagreement between ensembles mean
    several modes rather than a slow run.
    """
    if not _are_stationary(samples):
        return ()
    mean, deviation = samples.mean(axis=(1, 2)), samples.std(axis=(1, 2))  # (chain, parameter)
    larger = np.maximum(deviation[:, None], deviation)
    distance = np.abs(mean[:, None] - mean) / np.where(larger > 0.0, larger, np.inf)  # (chain, chain, parameter)
    groups = _connected(distance.max(axis=-1) < _MIN_DISTANCE)
    if len(groups) < 2:
        return ()
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
    _, steps, walkers, parameters = samples.shape
    half = steps // 2
    if half < 4:
        return False
    for ensemble in samples:
        swapped = ensemble.swapaxes(0, 1)  # (walker, step, parameter)
        halves = np.stack([swapped[:, :half], swapped[:, half : 2 * half]]).reshape(2, -1, parameters)
        with np.errstate(divide="ignore", invalid="ignore"):
            r_hat = array_stats.rhat(halves, chain_axis=0, draw_axis=1, method="rank")
            ess = array_stats.ess(swapped.reshape(1, -1, parameters), chain_axis=0, draw_axis=1, method="bulk")
        if not (np.all(r_hat < _MAX_R_HAT) and np.all(ess >= _MIN_DRAWS_PER_WALKER * walkers)):
            return False
    return True


def _connected(near: Flags) -> list[tuple[int, ...]]:
    """Return the groups of ensembles that are near one another, directly or through others."""
    reached = near.copy()
    for k in range(len(near)):
        reached |= np.outer(reached[:, k], reached[k])
    return sorted({tuple(np.flatnonzero(row).tolist()) for row in reached})
