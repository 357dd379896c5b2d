"""Blocks of points, to limit the memory of a computation on many of them."""

from __future__ import annotations

import numpy as np

from tactile_bayes.arrays import Index

__all__ = ["blocks"]

_MOST = 2_000_000
"""Largest number of entries in one array of a block: 16 MB, of which a few exist at a time."""


def blocks(points: int, numbers: int, largest: int | None = None) -> list[Index]:
    """Split the indices of points into blocks of about equal size.

    Parameters
    ----------
    points : int
        Number of points.
    numbers : int
        Numbers for each point in the largest array of the computation.
    largest : int, optional
        Largest number of points in a block.

    Returns
    -------
    list of ndarray of int, shape (n_block,)
        At least one block, which is empty if there are no points.

    Examples
    --------
    >>> [block.tolist() for block in blocks(5, numbers=1_000_000)]
    [[0, 1], [2, 3], [4]]
    """
    most = max(1, _MOST // max(numbers, 1))
    return np.array_split(np.arange(points), max(1, -(-points // min(most, largest or most))))
