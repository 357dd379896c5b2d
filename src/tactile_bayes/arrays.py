"""Types of arrays, and of what draws them, for the whole package."""

from __future__ import annotations

from typing import Any, Protocol, TypeAlias

import numpy as np
from numpy.typing import NDArray

# Truth values, numbers, and whole numbers that count along an axis, of any shape.
Flags: TypeAlias = NDArray[np.bool_]
Floats: TypeAlias = NDArray[np.float64]
Index: TypeAlias = NDArray[np.intp]


class RandomSource(Protocol):
    """Source of random numbers: a `Generator`, or many side by side."""

    def standard_normal(self, size: tuple[int, ...], /) -> Any: ...
    def chisquare(self, df: float, size: tuple[int, ...], /) -> Any: ...
