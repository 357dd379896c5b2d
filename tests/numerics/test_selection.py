"""Selections of points."""

import numpy as np
import pytest

from tactile_bayes.numerics.selection import evenly_spread, resampled


@pytest.mark.parametrize(("points", "most"), [(0, 3), (10, 0), (1, 1), (3, 5), (7, 7), (10, 2), (1000, 37)])
def test_a_selection_is_as_large_as_it_may_be_and_even(points, most):
    found = evenly_spread(points, most)
    assert found.size == min(points, most)
    if found.size > 1:
        steps = np.diff(found)
        assert (found[0], found[-1]) == (0, points - 1)
        assert 0 < steps.max() <= steps.min() + 1


def test_points_are_resampled_as_often_as_their_weights_say():
    """Each as its share of the draws, rounded up or down; on average exactly so, within four standard errors."""
    weights, rng = np.array([0.1, 0.0, 3.0, 1.0, 2.2]), np.random.default_rng(1)
    counts = np.array([np.bincount(resampled(weights, 10, rng), minlength=5) for _ in range(2000)])
    expected = 10 * weights / weights.sum()
    assert np.all(np.abs(counts - expected) < 1.0)
    assert np.all(np.abs(counts.mean(axis=0) - expected) <= 4.0 * 0.5 / np.sqrt(2000))
