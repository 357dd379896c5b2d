"""Ensembles that have come to rest in different places: modes between which no walker goes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from arviz_stats.base.array import array_stats
from numpy.typing import NDArray

from tactile_bayes.arrays import Floats

__all__ = ["Place", "places_in_words", "places_of"]


_APART = 5.0
"""Distance of two ensembles' means, in the larger of their standard deviations, from which they are apart."""

_AT_REST = 1.1
"""R̂ of an ensemble's early against its late steps, below which it stays where it is."""

_DRAWS_PER_WALKER = 2.0
"""Effective draws that the mean walker of an ensemble at rest has made there."""

_MOST_TOLD = 3
"""Parameters that are named in words."""


@dataclass(frozen=True)
class Place:
    """Where some of the ensembles sit, apart from the others."""

    ensembles: tuple[int, ...]
    """Which, counted from 0."""
    values: Mapping[str, float]
    """Median of each parameter that tells the places apart, the clearest first."""
    log_probability: float
    """Mean over the draws there."""


def places_of(samples: Floats, log_probability: Floats, names: Sequence[str]) -> tuple[Place, ...]:
    """Places of the ensembles, from samples (chain, step, walker, parameter) and their (chain, step, walker).

    None if there is but one, or if an ensemble is still on its way: each has to agree with itself, early against late
    steps, and to have forgotten where its walkers were, before it makes sense to say that they disagree. So a run that
    is merely slow is not taken for one with several modes.
    """
    if not _at_rest(samples):
        return ()
    mean, deviation = samples.mean(axis=(1, 2)), samples.std(axis=(1, 2))  # (chain, parameter)
    larger = np.maximum(deviation[:, None], deviation)
    distance = np.abs(mean[:, None] - mean) / np.where(larger > 0.0, larger, np.inf)  # (chain, chain, parameter)
    groups = _connected(distance.max(axis=-1) < _APART)
    if len(groups) < 2:
        return ()
    clearest = np.argsort(-distance.max(axis=(0, 1)), kind="stable")
    telling = [i for i in clearest if distance[..., i].max() >= _APART]
    return tuple(
        Place(
            ensembles=group,
            values={names[i]: float(np.median(samples[list(group), ..., i])) for i in telling},
            log_probability=float(log_probability[list(group)].mean()),
        )
        for group in groups
    )


def places_in_words(places: Sequence[Place]) -> str:
    told = []
    for place in places:
        values = [f"{name} = {value:.6g}" for name, value in place.values.items()]
        more = [f"{len(values) - _MOST_TOLD} more"] if len(values) > _MOST_TOLD else []
        which = f"{'ensemble' if len(place.ensembles) == 1 else 'ensembles'} {', '.join(map(str, place.ensembles))}"
        where = ", ".join(values[:_MOST_TOLD] + more)
        told.append(f"{which} near {where} (mean log-probability {place.log_probability:.1f})")
    return (
        f"ensembles sit in {len(places)} places and none of them leaves its own: {'; '.join(told)}; their shares "
        "of the probability are unknown and more steps will not tell: use priors that leave one of them"
    )


def _at_rest(samples: Floats) -> bool:
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
        if not (np.all(r_hat < _AT_REST) and np.all(ess >= _DRAWS_PER_WALKER * walkers)):
            return False
    return True


def _connected(near: NDArray[np.bool_]) -> list[tuple[int, ...]]:
    """Groups of ensembles that are near one another, be it by way of others."""
    reached = near.copy()
    for k in range(len(near)):
        reached |= np.outer(reached[:, k], reached[k])
    return sorted({tuple(np.flatnonzero(row).tolist()) for row in reached})
