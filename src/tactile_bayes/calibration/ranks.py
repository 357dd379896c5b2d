"""Ranks of truths among draws: a test of uniformity, and the errors of a posterior that it detects."""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from scipy import stats
from scipy.optimize import brentq
from scipy.special import bdtr, gammaln, log_ndtr, xlogy

from tactile_bayes.arrays import Floats, Index

_SIMULATIONS = 20_000  # number of simulated sets of uniform ranks, the null distribution of the test
_BLOCK_SIZE = 2000  # number of sets that are simulated at a time
_FARTHEST = 10.0  # largest shift, and largest factor of the standard deviation, in the search for detected errors
_TOLERANCE = 1e-4  # tolerance of shifts, and of logarithms of factors


class NoticedRanks(NamedTuple):
    """Smallest errors of a posterior that its ranks show with a given probability; NaN if none is detected."""

    shift: float  # shift of the posterior, to either side, in its standard deviations
    narrow: float  # factor > 1 by which its standard deviation is too small
    wide: float  # factor > 1 by which its standard deviation is too large


def uniformity_p_value(ranks: ArrayLike, top: int) -> float:
    """Return the probability that uniform ranks, from 0 to `top`, are as far from uniform as these, shape (n,).

    The statistic is the least probable binomial share of ranks up to one (doi 10.1007/s11222-022-10090-6).
    """
    below = np.cumsum(np.bincount(np.asarray(ranks, dtype=np.intp), minlength=top + 1))
    least, null = _least_probability(below[:-1], int(below[-1])), _null(int(below[-1]), top)
    return float((1 + np.searchsorted(null, least, side="right")) / (1 + null.size))


def expected_shares(top: int) -> Floats:
    """Return the expected share of ranks up to 0, 1, …, top − 1, shape (top,)."""
    return np.arange(1, top + 1) / (top + 1.0)


def simultaneous_band(count: int, top: int, probability: float) -> tuple[Floats, Floats]:
    """Return the simultaneous band of the empirical distribution of uniform ranks. Returns shape (top,)."""
    null = _null(count, top)
    # The largest level below which no more sets of uniform ranks fall than the probability allows.
    level = float(null[min(int((1.0 - probability) * null.size), null.size - 1)])
    inside = _tails(count, top) >= level
    return np.argmax(inside, axis=0) / count, (count - np.argmax(inside[::-1], axis=0)) / count


@lru_cache(maxsize=8)
def noticed_ranks(count: int, top: int, level: float, power: float) -> NoticedRanks:
    """Return the errors of a normal posterior from which on `uniformity_p_value` is at most `level` so often."""

    def smallest(shift: float, log_scale: float) -> float:
        """Return the smallest detected error on the line from no error to the farthest."""

        def excess(share: float) -> float:
            probabilities = _rank_probabilities(top, share * shift, float(np.exp(share * log_scale)))
            return _power(count, probabilities, level) - power

        farthest = max(abs(shift), abs(log_scale))
        return farthest * brentq(excess, 0.0, 1.0, xtol=_TOLERANCE / farthest) if excess(1.0) >= 0.0 else np.nan

    factor = float(np.log(_FARTHEST))
    return NoticedRanks(smallest(_FARTHEST, 0.0), *np.exp([smallest(0.0, factor), smallest(0.0, -factor)]).tolist())


def _rank_probabilities(top: int, shift: float, scale: float) -> Floats:
    """Return the probabilities of ranks of truths z ~ N(shift, scale²) among standard normal draws, shape (top + 1,).

    P(rank = r) = E[C(top, r) Φ(z)ʳ (1 − Φ(z))ᵗᵒᵖ⁻ʳ], by the trapezoidal rule.
    """
    t = np.linspace(-8.0, 8.0, 1601)[:, None]
    z, ranks = shift + scale * t, np.arange(top + 1)
    of_choices = gammaln(top + 1) - gammaln(ranks + 1) - gammaln(top - ranks + 1)
    given_truth = np.exp(of_choices + ranks * log_ndtr(z) + (top - ranks) * log_ndtr(-z))
    return np.asarray(stats.norm.pdf(t[:, 0]) @ given_truth / stats.norm.pdf(t).sum())


def _power(count: int, probabilities: Floats, level: float) -> float:
    """Return the exact probability that `uniformity_p_value` of ranks with these probabilities is at most a level.

    Numbers of ranks up to each rank are a Markov chain, sums of Poisson numbers given their total.
    """
    top = probabilities.size - 1
    null = _null(count, top)
    fewest = int(level * (1 + null.size)) - 1
    if fewest < 0:  # no p-value is so small
        return 0.0
    counts = np.arange(count + 1)
    inside = _tails(count, top) >= null[fewest]
    first, reached = 0, np.ones(1)  # the least possible number, and the probabilities from it on
    for rank in range(top):
        allowed = np.flatnonzero(inside[first:, rank]) + first
        more = _poisson(counts[: allowed[-1] + 1 - first], count * probabilities[rank])
        reached = np.convolve(reached, more)[allowed[0] - first : allowed[-1] + 1 - first]
        first = allowed[0]
    rest = _poisson(count - first - np.arange(reached.size), count * probabilities[top])
    return float(1.0 - reached @ rest / _poisson(np.array(count), count))


def _poisson(numbers: Index, mean: float) -> Floats:
    """Return Poisson probabilities, whose checks in `scipy.stats` take longer than they do; 0 for negative numbers."""
    possible = np.maximum(numbers, 0)
    return np.where(numbers < 0, 0.0, np.exp(xlogy(possible, mean) - mean - gammaln(possible + 1)))


@lru_cache(maxsize=8)
def _tails(count: int, top: int) -> Floats:
    """Return twice the smaller binomial tail of 0, 1, …, `count` ranks up to each rank, shape (count + 1, top)."""
    at_most = bdtr(np.arange(count + 1)[:, None], count, expected_shares(top))
    at_least = 1.0 - np.vstack([np.zeros(top), at_most[:-1]])
    return np.asarray(2.0 * np.minimum(at_most, at_least))


def _least_probability(below: Index, count: int) -> Floats:
    """Return twice the least tail over all ranks, shape (...), from numbers of ranks, shape (..., top)."""
    top = below.shape[-1]
    return np.asarray(_tails(count, top)[below, np.arange(top)].min(axis=-1))


@lru_cache(maxsize=8)
def _null(count: int, top: int) -> Floats:
    """Return the sorted statistics of simulated uniform ranks, always from the same random numbers."""
    rng = np.random.default_rng(2022)
    parts = []
    for _ in range(_SIMULATIONS // _BLOCK_SIZE):
        counts = rng.multinomial(count, np.full(top + 1, 1.0 / (top + 1)), size=_BLOCK_SIZE)
        parts.append(_least_probability(np.cumsum(counts, axis=1)[:, :-1], count))
    return np.sort(parts, axis=None)
