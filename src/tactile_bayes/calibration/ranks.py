"""Ranks of truths among draws: whether they are uniform, as those of a right posterior are."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.special import bdtr

__all__ = ["expected_shares", "simultaneous_band", "uniformity_p_value"]

Floats = NDArray[np.float64]

_SIMULATIONS = 20_000
"""Sets of uniform ranks, by which it is judged how unusual one is."""

_AT_ONCE = 2000


def uniformity_p_value(ranks: ArrayLike, top: int) -> float:
    """Probability that uniform ranks, from 0 to `top`, are as far from uniform as these.

    At each rank the share of ranks up to it is binomial; what counts is the least probable of these shares, as in
    simultaneous bands for empirical distributions (Säilynoja, Bürkner & Vehtari 2022, doi 10.1007/s11222-022-10090-6).

    Parameters
    ----------
    ranks : array_like of int, shape (n,)
    top : int
        Largest possible rank, the number of draws.

    Examples
    --------
    >>> uniformity_p_value(np.arange(100), top=99), uniformity_p_value(np.arange(100) // 2, top=99) < 1e-3
    (1.0, True)
    """
    counts = np.bincount(np.asarray(ranks, dtype=np.intp), minlength=top + 1)
    least = _least_probability(np.cumsum(counts)[None, :-1], int(counts.sum()))[0]
    null = _null(int(counts.sum()), top)
    return float((1 + np.searchsorted(null, least, side="right")) / (1 + null.size))


def expected_shares(top: int) -> Floats:
    """Expected share of ranks up to 0, 1, …, top − 1, shape (top,)."""
    return np.arange(1, top + 1) / (top + 1.0)


def simultaneous_band(count: int, top: int, probability: float) -> tuple[Floats, Floats]:
    """Between what the shares of `expected_shares` lie with a probability, all of them at once; shapes (top,)."""
    null = _null(count, top)
    # The largest level that sets of uniform ranks fall short of no more often than they may.
    level = float(null[min(int((1.0 - probability) * null.size), null.size - 1)])
    counts = np.arange(count + 1)
    inside = _tails(counts[:, None], count, expected_shares(top)) >= level
    return np.argmax(inside, axis=0) / count, (count - np.argmax(inside[::-1], axis=0)) / count


def _tails(below: NDArray[np.intp], count: int, shares: Floats) -> Floats:
    """Twice the smaller tail of the binomial distribution of numbers of ranks up to somewhere."""
    at_most = bdtr(below, count, shares)
    at_least = 1.0 - np.where(below > 0, bdtr(np.maximum(below - 1, 0), count, shares), 0.0)
    return np.asarray(2.0 * np.minimum(at_most, at_least))


def _least_probability(below: NDArray[np.intp], count: int) -> Floats:
    """Of rows of numbers of ranks up to 0, 1, …, top − 1, shape (rows, top): twice the least tail, shape (rows,)."""
    return np.asarray(_tails(below, count, expected_shares(below.shape[1])).min(axis=1))


@lru_cache(maxsize=8)
def _null(count: int, top: int) -> Floats:
    """The statistic of uniform ranks, sorted; always of the same random numbers."""
    rng = np.random.default_rng(2022)
    parts = []
    for _ in range(_SIMULATIONS // _AT_ONCE):
        counts = rng.multinomial(count, np.full(top + 1, 1.0 / (top + 1)), size=_AT_ONCE)
        parts.append(_least_probability(np.cumsum(counts, axis=1)[:, :-1], count))
    return np.sort(np.concatenate(parts))
