"""Coverage: p values and what they notice, against sums of the binomial distribution and simulation."""

import math

import numpy as np
import pytest

from tactile_bayes.calibration.summary import coverage_p_value, noticed_coverage

LEVEL, POWER = 1e-3, 0.9


def binomial(count, probability):
    """Probabilities of 0, 1, …, count, from factorials."""
    return np.array(
        [math.comb(count, k) * probability**k * (1.0 - probability) ** (count - k) for k in range(count + 1)]
    )


def p_values(count, probability, is_whole):
    return coverage_p_value(np.arange(count + 1) / count, count, probability, is_whole=is_whole)


def power(count, probability, coverage, is_whole):
    """Probability that the test finds a fault, where a claim holds as a whole with another probability."""
    return float(binomial(count, coverage) @ (p_values(count, probability, is_whole) <= LEVEL))


def test_p_values_of_whole_claims_are_twice_a_binomial_tail():
    """Of the coverage next to the share that a hundredth more or less allows."""
    found = p_values(50, 0.9, True)
    low, high = binomial(50, 0.89), binomial(50, 0.91)
    np.testing.assert_allclose(found[[30, 44]], [2.0 * low[:31].sum(), min(1.0, 2.0 * low[:45].sum())], rtol=1e-12)
    np.testing.assert_allclose(found[50], 2.0 * high[50], rtol=1e-12)
    assert coverage_p_value(0.9, 50, 0.9, is_whole=True) == 1.0
    assert coverage_p_value(0.905, 50, 0.9, is_whole=True) == 1.0


def test_p_values_of_shares_are_the_bound():
    """Hoeffding's, written as a power."""
    found = float(coverage_p_value(0.7, 40, 0.9, is_whole=False))
    np.testing.assert_allclose(found, 2.0 * ((0.89 / 0.7) ** 0.7 * (0.11 / 0.3) ** 0.3) ** 40, rtol=1e-12)
    assert np.all(p_values(40, 0.9, False) >= p_values(40, 0.9, True) * (1.0 - 1e-12))
    # Of what is stated with 99.5 % a hundredth more is everything.
    assert coverage_p_value(1.0, 1000, 0.995, is_whole=True) == 1.0
    assert coverage_p_value(0.0, 1000, 0.005, is_whole=True) == 1.0


@pytest.mark.parametrize("is_whole", [True, False])
@pytest.mark.parametrize(("count", "probability"), [(20, 0.5), (100, 0.9), (200, 0.9)])
def test_coverages_next_to_a_right_one_are_noticed_as_often_as_stated(count, probability, is_whole):
    """By a sum over all outcomes; those of the other side count as well, with less than the level."""
    for coverage in noticed_coverage(count, probability, LEVEL, POWER, is_whole=is_whole):
        assert abs(power(count, probability, coverage, is_whole) - POWER) < LEVEL
        nearer = coverage + 0.01 * np.sign(probability - coverage)
        assert power(count, probability, nearer, is_whole) < POWER


def test_what_no_number_of_successes_shows_is_noticed_by_none():
    """All of 20 hold once in seven times where nine of ten are to."""
    below, above = noticed_coverage(20, 0.9, LEVEL, POWER, is_whole=True)
    assert 0.3 < below < 0.6
    assert np.isnan(above)
    assert np.isnan(noticed_coverage(3, 0.5, LEVEL, POWER, is_whole=True)).all()
