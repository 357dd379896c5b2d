"""Blocks: many points, but no more of them at a time than memory should hold."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

__all__ = ["blocks"]

_MOST = 2_000_000
"""Numbers in one array of a block: 16 MB, of which a few are alive at a time."""


def blocks(points: int, numbers: int, largest: int | None = None) -> list[NDArray[np.intp]]:
    """Indices of points in blocks of about equal size.

    Parameters
    ----------
    points : int
        How many there are.
    numbers : int
        Of each point, in the largest array that is made of it.
    largest : int, optional
        Points in a block, whatever their numbers.

    Returns
    -------
    list of ndarray
        At least one, which is empty if there are no points.

    Examples
    --------
    >>> [block.tolist() for block in blocks(5, numbers=1_000_000)]
    [[0, 1], [2, 3], [4]]
    """
    most = max(1, _MOST // max(numbers, 1))
    return np.array_split(np.arange(points), max(1, -(-points // min(most, largest or most))))
