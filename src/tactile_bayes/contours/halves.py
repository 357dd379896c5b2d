"""What compiled code has to know of contours: halves with a formula, or a table."""

from __future__ import annotations

from typing import NamedTuple

from tactile_bayes.arrays import Floats

__all__ = ["CELLS", "OVAL", "PARABOLA", "POWER_LAW", "SLOPES", "Half", "Halves"]

PARABOLA, OVAL, POWER_LAW, SLOPES, CELLS = 0, 1, 2, 3, 4


class Half(NamedTuple):
    """One side of a contour from its vertex on, the contour's parameter being zero there."""

    kind: int
    """`PARABOLA`: y = size · x²; `OVAL`: half-axes size (sideways) and shape; `POWER_LAW`: y = size · |x|^shape;
    `SLOPES`, `CELLS`, of both sides: up to the parameter `size`, and the rest is in the tables."""
    size: Floats
    shape: Floats


class Halves(NamedTuple):
    """Both sides of a contour."""

    left: Half
    right: Half
    x: Floats
    """The vertex, or what a table counts from."""
    y: Floats
    tables: Floats | None = None
    """Of contours that have no formula, shape (n, rows, columns). `SLOPES`: at slope angles from −π/2 to π/2, equally
    far apart, the point, its rates over the width of a cell, and the rates of these. `CELLS`: a row a cell, where it
    begins and ends in the contour's own parameter, and Chebyshev coefficients of x, y and slope angle; rows beyond the
    last cell begin at infinity."""
