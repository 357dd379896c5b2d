"""Ranks among draws: how unusual they are, against simulation and another implementation."""

import math

import numpy as np
import pytest
from arviz_stats.ecdf_utils import simulate_confidence_bands
from scipy.special import ndtr

from tactile_bayes.calibration.ranks import (
    _SIMULATIONS,
    _null,
    _power,
    _rank_probabilities,
    expected_shares,
    noticed_ranks,
    simultaneous_band,
    uniformity_p_value,
)

LEAST = 1.0 / (_SIMULATIONS + 1)  # the smallest p-value there is


def uniform(sets, count, top, seed):
    return np.random.default_rng(seed).integers(top + 1, size=(sets, count))


def p_values(sets, top):
    return np.array([uniformity_p_value(ranks, top) for ranks in sets])


def shares_of(sets, top):
    """Share of ranks up to 0, 1, …, top − 1 in each set, shape (sets, top)."""
    return np.array([np.mean(ranks[:, None] <= np.arange(top), axis=0) for ranks in sets])


def five_errors(probability, count):
    """Of a share that is counted; a normal number is so far out once in two million."""
    return 5.0 * math.sqrt(probability * (1.0 - probability) / count)


@pytest.mark.parametrize(("count", "top"), [pytest.param(100, 99, marks=pytest.mark.slow), (37, 9)])
def test_p_values_of_uniform_ranks_are_uniform(count, top):
    """False alarm 1e-6 for each share. Ties make p-values larger, but hardly."""
    found = p_values(uniform(400, count, top, seed=count), top)
    for level in (0.05, 0.2, 0.5):
        assert abs(np.mean(found <= level) - level) <= five_errors(level, found.size)


@pytest.mark.parametrize(("count", "top", "probability"), [(100, 99, 0.95), (37, 9, 0.9)])
def test_band_holds_uniform_ranks_with_its_probability_and_as_the_p_value_says(count, top, probability):
    """A set leaves the band if, and only if, its p-value is at most what the band leaves out.

    False alarm 1e-6; the simulations behind the band have an error, too.
    """
    sets = uniform(1000, count, top, seed=3)
    low, high = simultaneous_band(count, top, probability)
    assert low.shape == high.shape == (top,)
    shares = shares_of(sets, top)
    held = np.all((low <= shares) & (shares <= high), axis=1)
    error = math.hypot(five_errors(probability, held.size), five_errors(probability, _SIMULATIONS))
    assert abs(held.mean() - probability) <= error
    np.testing.assert_array_equal(~held, p_values(sets, top) <= 1.0 - probability)


def test_level_agrees_with_arviz():
    """Of another implementation of the same bands: how improbable a share may be at a place of its own.

    Arviz cuts shares times their number to integers, which is exact for a power of two. Its quantile of 2000
    simulations lies where ours have the same share, within 5 standard errors of both.
    """
    count, top, simulations = 64, 19, 2000
    ours = _null(count, top)
    probability, places = 0.95, expected_shares(top)
    theirs = 1.0 - simulate_confidence_bands(count, 1, places, probability, simulations, np.random.default_rng(1))
    error = math.hypot(five_errors(probability, simulations), five_errors(probability, ours.size))
    assert np.mean(ours < theirs - 1e-12) <= 1.0 - probability + error
    assert np.mean(ours <= theirs + 1e-12) >= 1.0 - probability - error


def test_extremes():
    assert uniformity_p_value(np.arange(100), 99) == 1.0
    for rank in (0, 99):
        assert uniformity_p_value(np.full(100, rank), 99) == LEAST
    assert uniformity_p_value(np.repeat([0, 99], 50), 99) == LEAST
    assert uniformity_p_value(np.arange(1000) % 2, 1) == 1.0
    assert uniformity_p_value(np.ones(1000, dtype=bool), 1) == LEAST
    assert uniformity_p_value([True, False] * 50, 1) == 1.0
    # A single rank in the middle is nothing unusual; one at an end is, with a probability of two in a hundred.
    assert uniformity_p_value([50], 99) > 0.9
    assert abs(uniformity_p_value([0], 99) - 0.02) <= five_errors(0.02, _SIMULATIONS)


def test_order_does_not_matter_and_numbers_are_the_same_again():
    ranks = uniform(1, 60, 4, seed=2)[0]
    first = uniformity_p_value(ranks, 4)
    _null.cache_clear()
    assert uniformity_p_value(ranks[::-1], 4) == first
    assert uniformity_p_value(list(map(int, ranks)), 4) == first


def test_rank_probabilities_of_one_draw():
    """The truth is the larger one with Φ(shift / √(1 + scale²)), as the difference of two normal numbers is normal."""
    for shift, scale in ((0.7, 1.0), (-0.4, 2.5), (1.1, 0.3)):
        found = _rank_probabilities(1, shift, scale)
        np.testing.assert_allclose(found[1], ndtr(shift / math.hypot(1.0, scale)), rtol=1e-10)
        np.testing.assert_allclose(found.sum(), 1.0, rtol=1e-12)


def test_power_of_few_ranks_is_a_sum_over_all_of_them():
    law, level = np.array([0.1, 0.2, 0.3, 0.4]), 0.2
    sets = np.stack(np.meshgrid(*4 * [np.arange(4)]), axis=-1).reshape(-1, 4)
    expected = np.sum(np.prod(law[sets], axis=1)[p_values(sets, 3) <= level])
    np.testing.assert_allclose(_power(4, law, level), expected, atol=1e-12)
    assert 0.0 < expected < 1.0


@pytest.mark.parametrize("kind", ["shift", "narrow", "wide"])
def test_what_is_noticed_is_noticed_as_often_in_simulation(kind):
    """Of normal posteriors with 99 draws each; false alarm 1e-6 each."""
    count, level, power, sets = 60, 1e-3, 0.9, 1000
    error = getattr(noticed_ranks(count, 99, level, power), kind)
    shift, scale = {"shift": (error, 1.0), "narrow": (0.0, error), "wide": (0.0, 1.0 / error)}[kind]
    rng = np.random.default_rng(8)
    truths = shift + scale * rng.normal(size=(sets, count))
    found = p_values(rng.binomial(99, ndtr(truths)), 99)  # the number of draws below a truth
    assert abs(np.mean(found <= level) - power) <= five_errors(power, sets)


def test_what_is_noticed_by_none():
    """With 20 ranks posteriors can be as wide as they like; and no p value is below that of all simulations."""
    few = noticed_ranks(20, 99, 1e-3, 0.9)
    assert few.shift > 1.0
    assert few.narrow > 2.0
    assert np.isnan(few.wide)
    assert np.isnan(noticed_ranks(60, 99, 0.5 * LEAST, 0.9)).all()


def test_expected_shares_are_those_of_uniform_ranks():
    np.testing.assert_allclose(expected_shares(99), shares_of([np.arange(100)], 99)[0], rtol=1e-14)
