"""Tests of coverage: the p-value of an observed coverage, and the smallest deviations that a test detects."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike
from scipy import stats
from scipy.special import betaincinv, rel_entr

from tactile_bayes.arrays import Floats

_MARGIN = 0.01  # error in probability that is allowed for quantiles of some hundred draws


def coverage_p_value(share: ArrayLike, count: int, probability: float, *, is_whole: bool) -> Floats:
    """Return an upper bound on the probability that an observed coverage is as far from the stated one by chance."""
    share = np.asarray(share, dtype=float)
    limit = np.clip(share, probability - _MARGIN, min(probability + _MARGIN, 1.0))
    is_tested = (share != limit) & (limit > 0.0) & (limit < 1.0)
    if is_whole:
        held = np.rint(share * count)
        one_sided = np.where(share > limit, stats.binom.sf(held - 1, count, limit), stats.binom.cdf(held, count, limit))
    else:
        one_sided = np.exp(-count * (rel_entr(share, limit) + rel_entr(1.0 - share, 1.0 - limit)))
    return np.where(is_tested, np.minimum(1.0, 2.0 * one_sided), 1.0)


def noticed_coverage(
    count: int, probability: float, level: float, power: float, *, is_whole: bool
) -> tuple[float, float]:
    """Return the coverages nearest to a stated one, below and above, that a test detects with the probability `power`.

    A claim that holds at a share of the grid points is taken to hold at all or none of them, the largest variance.
    """
    held = np.arange(count + 1)
    is_fault = coverage_p_value(held / count, count, probability, is_whole=is_whole) <= level
    low, high = held[is_fault & (held < probability * count)], held[is_fault & (held > probability * count)]
    # With c, P(held ≤ k) = 1 − I_c(k + 1, n − k) and P(held ≥ k) = I_c(k, n − k + 1).
    below = float(betaincinv(low[-1] + 1, count - low[-1], 1.0 - power)) if low.size else np.nan
    above = float(betaincinv(high[0], count - high[0] + 1, power)) if high.size else np.nan
    return below, above
