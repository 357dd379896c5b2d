"""Array types for the whole package."""

from __future__ import annotations

from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

__all__ = ["Flags", "Floats", "Index"]

Flags: TypeAlias = NDArray[np.bool_]
"""Truth values of any shape."""

Floats: TypeAlias = NDArray[np.float64]
"""Numbers of any shape."""

Index: TypeAlias = NDArray[np.intp]
"""Whole numbers of any shape that count along an axis."""
