"""Halves of contours that have a formula: what compiled code has to know."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

__all__ = ["OVAL", "PARABOLA", "POWER_LAW", "TABLE", "Half", "Halves"]

Floats = NDArray[np.float64]

PARABOLA, OVAL, POWER_LAW, TABLE = 0, 1, 2, 3


class Half(NamedTuple):
    """One side of a contour from its vertex on, the contour's parameter being zero there."""

    kind: int
    """`PARABOLA`: y = size · x²; `OVAL`: half-axes size (sideways) and shape; `POWER_LAW`: y = size · |x|^shape;
    `TABLE`, of both sides: up to the slope angle `size`, shape 1, and the rest is in the tables."""
    size: Floats
    shape: Floats


class Halves(NamedTuple):
    """Both sides of a contour that is level at its vertex."""

    left: Half
    right: Half
    x: Floats
    """The vertex."""
    y: Floats
    has_knot: bool
    """Whether the contour may not be smooth at the vertex."""
    tables: Floats | None = None
    """Of contours that have no formula, shape (n, cells + 1, 6): at slope angles from −π/2 to π/2, equally far apart,
    the point seen from the vertex, its rates over the width of a cell, and the rates of these."""
