"""Selections: some of many points, evenly spread."""

from __future__ import annotations

import numpy as np

from tactile_bayes.arrays import Index

__all__ = ["evenly_spread"]


def evenly_spread(points: int, most: int) -> Index:
    """Return the indices of at most so many of the points, evenly spread from the first to the last.

    Examples
    --------
    >>> evenly_spread(9, 5), evenly_spread(3, 5)
    (array([0, 2, 4, 6, 8]), array([0, 1, 2]))
    """
    return np.unique(np.linspace(0, points - 1, min(points, most)).astype(np.intp))
