"""Coverage: whether what is stated with a probability holds as often, and how far off it must be to be noticed."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike
from scipy import stats
from scipy.special import betaincinv, rel_entr

from tactile_bayes.arrays import Floats

__all__ = ["coverage_p_value", "noticed_coverage"]

_MARGIN = 0.01
"""What quantiles of some hundred draws may miss of a probability."""


def coverage_p_value(share: ArrayLike, count: int, probability: float, *, is_whole: bool) -> Floats:
    """Probability, at most, that the mean of right shares is as far from what it is to be.

    Parameters
    ----------
    share : array_like
        Mean over replicates of the share in which a claim holds in each.
    count : int
        Number of replicates.
    probability : float
        That is stated; a hundredth more or less is right as well.
    is_whole : bool
        Whether the claim holds or fails as a whole in each replicate. Then the p value is the binomial one; else it is
        the bound for any numbers between 0 and 1 (Hoeffding 1963, doi 10.1080/01621459.1963.10500830, theorem 1), as
        places of one replicate are held together.

    Examples
    --------
    >>> coverage_p_value([0.9, 0.5], 20, 0.9, is_whole=True).round(4)
    array([1., 0.])
    """
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
    """Coverages next to a stated one, below and above, that a test at a level notices with the probability `power`.

    The number of replicates in which a claim holds is binomial, and the coverages follow from that exactly. Of a claim
    that holds at a share of places, it is taken for all or none of them, which spreads the most. NaN where no coverage
    is noticed so often.

    Examples
    --------
    >>> [round(coverage, 3) for coverage in noticed_coverage(200, 0.9, 0.001, 0.9, is_whole=True)]
    [0.77, 0.984]
    """
    held = np.arange(count + 1)
    is_fault = coverage_p_value(held / count, count, probability, is_whole=is_whole) <= level
    low, high = held[is_fault & (held < probability * count)], held[is_fault & (held > probability * count)]
    # With c, P(held ≤ k) = 1 − I_c(k + 1, n − k) and P(held ≥ k) = I_c(k, n − k + 1).
    below = float(betaincinv(low[-1] + 1, count - low[-1], 1.0 - power)) if low.size else np.nan
    above = float(betaincinv(high[0], count - high[0] + 1, power)) if high.size else np.nan
    return below, above
