"""Halves of contours that have a formula: what compiled code has to know."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

__all__ = ["OVAL", "PARABOLA", "POWER_LAW", "Half", "Halves"]

Floats = NDArray[np.float64]

PARABOLA, OVAL, POWER_LAW = 0, 1, 2


class Half(NamedTuple):
    """One side of a contour from its vertex on, the contour's parameter being zero there."""

    kind: int
    """`PARABOLA`: y = size · x²; `OVAL`: half-axes size (sideways) and shape; `POWER_LAW`: y = size · |x|^shape."""
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
