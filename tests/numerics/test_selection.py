"""Selections of points."""

import numpy as np
import pytest

from tactile_bayes.numerics.selection import evenly_spread


@pytest.mark.parametrize(("points", "most"), [(0, 3), (10, 0), (1, 1), (3, 5), (7, 7), (10, 2), (1000, 37)])
def test_a_selection_is_as_large_as_it_may_be_and_even(points, most):
    found = evenly_spread(points, most)
    assert found.size == min(points, most)
    if found.size > 1:
        steps = np.diff(found)
        assert (found[0], found[-1]) == (0, points - 1)
        assert 0 < steps.max() <= steps.min() + 1
