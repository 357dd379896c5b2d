"""Contours for compiled code: halves with a formula, or a table."""

from __future__ import annotations

from typing import NamedTuple

from tactile_bayes.arrays import Floats

PARABOLA, OVAL, POWER_LAW, SLOPES, CELLS = 0, 1, 2, 3, 4


class Half(NamedTuple):
    """One side of a contour from its vertex, where the contour's parameter is zero."""

    # `PARABOLA`: y = size · x²; `OVAL`: half-axes size (horizontal) and shape; `POWER_LAW`: y = size · |x|^shape;
    # `SLOPES`, `CELLS`: `size` is the parameter of the end, and the points are in the tables.
    kind: int
    size: Floats
    shape: Floats


class Halves(NamedTuple):
    """Both sides of a contour."""

    left: Half
    right: Half
    x: Floats  # vertex, or origin of a table
    y: Floats
    # Tables of contours without a formula, shape (n, rows, columns). `SLOPES`: at equidistant slope angles from −π/2 to
    # π/2, the point, its rates over the width of a cell, and the rates of these. `CELLS`: a row for each cell, with its
    # ends in the contour's own parameter and the Chebyshev coefficients of x, y and slope angle; rows beyond the last
    # cell begin at infinity.
    tables: Floats | None = None
