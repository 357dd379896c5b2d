"""Tiles around values on two axes."""

from __future__ import annotations

import numpy as np

from tactile_bayes.plotting.axes import Floats

__all__ = ["tile_edges"]


def tile_edges(values: Floats) -> Floats:
    """Edges of tiles around values in increasing order: midway between two."""
    if values.size == 1:
        return np.array([0.95, 1.05]) * values
    middle = 0.5 * (values[1:] + values[:-1])
    return np.concatenate([[2.0 * values[0] - middle[0]], middle, [2.0 * values[-1] - middle[-1]]])
