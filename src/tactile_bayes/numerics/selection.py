"""Selections: some of many points, evenly spread or as often as their weights say."""

from __future__ import annotations

import numpy as np

from tactile_bayes.arrays import Floats, Index


def evenly_spread(points: int, most: int) -> Index:
    """Return the indices of at most so many of the points, evenly spread from the first to the last."""
    return np.unique(np.linspace(0, points - 1, min(points, most)).astype(np.intp))


def resampled(weights: Floats, count: int, rng: np.random.Generator | np.random.RandomState) -> Index:
    """Return `count` increasing indices, each as often as its weight, of any sum, demands, rounded at random. This is
    systematic resampling (Kitagawa 1996, doi 10.2307/1390750)."""
    level = np.cumsum(weights)
    picked = np.searchsorted(level / level[-1], (np.arange(count) + rng.random()) / count)
    return np.minimum(picked, len(weights) - 1)
