"""Blocks of points that memory can hold."""

import numpy as np
import pytest

from tactile_bayes.numerics import blocks as module
from tactile_bayes.numerics.blocks import blocks


@pytest.mark.parametrize(
    ("points", "numbers", "largest"),
    [(0, 5, None), (1, 10**9, None), (1000, 3_000, None), (1000, 1, 200), (7, 10**6, 3)],
)
def test_blocks_are_all_points_in_order_and_none_is_too_large(points, numbers, largest):
    found = blocks(points, numbers, largest)
    np.testing.assert_array_equal(np.concatenate(found), np.arange(points))
    most = max(block.size for block in found)
    assert most * numbers <= module._MOST or most <= 1
    assert largest is None or most <= largest
    assert len(found) <= 1 or min(block.size for block in found) > 0
