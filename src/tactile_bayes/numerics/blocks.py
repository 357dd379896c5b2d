"""Blocks of points, to limit the memory of a computation on many of them."""

from __future__ import annotations

import numpy as np

from tactile_bayes.arrays import Index

_MOST = 2_000_000  # largest number of entries in one array of a block: 16 MB, of which a few exist at a time


def blocks(points: int, numbers: int, largest: int | None = None) -> list[Index]:
    """Split the indices of points into blocks of about equal size. Returns shape (n_block,)."""
    most = max(1, _MOST // max(numbers, 1))
    return np.array_split(np.arange(points), max(1, -(-points // min(most, largest or most))))
