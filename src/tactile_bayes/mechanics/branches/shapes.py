"""Contours in the form that the compiled forward model takes."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from tactile_bayes.arrays import Floats
from tactile_bayes.contours.cells import in_cells

if TYPE_CHECKING:
    from tactile_bayes.contours.base import Contour
    from tactile_bayes.mechanics.branches.sweeps import Shapes

__all__ = ["shapes_of"]


def shapes_of(contours: Contour, low: Floats | None = None, high: Floats | None = None) -> Shapes:
    """Contours with parameters of shape (n,), by their formula, or by tables from parameter `low` to `high`."""
    from tactile_bayes.mechanics.branches.sweeps import Shapes  # numba takes a second to load

    halves = contours.halves
    if halves is None:
        assert low is not None
        assert high is not None
        halves = in_cells(contours, low, high)
    count = contours.shape[0] if contours.shape else halves.x.size
    columns = np.empty((count, 6))
    for k, column in enumerate((*halves.left[1:], *halves.right[1:], halves.x, halves.y)):
        columns[:, k] = column
    tables = np.empty((count, 0, 0)) if halves.tables is None else np.ascontiguousarray(halves.tables)
    knots = np.empty((count, len(contours.knots)))
    for k, knot in enumerate(contours.knots):
        knots[:, k] = knot
    knots.sort(axis=1)
    return Shapes((halves.left.kind, halves.right.kind), columns, tables, knots)
