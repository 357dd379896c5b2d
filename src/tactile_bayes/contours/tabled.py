"""Contours of which something is tabulated, once for all that are taken from them."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, ClassVar, Self

import numpy as np

from tactile_bayes.contours.base import Contour, Floats

__all__ = ["Tabled"]


class Tabled(Contour):
    """Contours with tables that have a row for each; `_row` says which, so that the tables need not be taken along."""

    _by_contour: ClassVar[tuple[str, ...]]
    """Names of what has an entry for each contour, `_row` among them."""

    @property
    def shape(self) -> tuple[int, ...]:
        return np.shape(self.__dict__["_row"])

    def _each(self, change: Callable[[Any], Floats]) -> Self:
        other = object.__new__(type(self))  # the tables stay one for all
        other.__dict__.update(self.__dict__)
        other.__dict__.update((name, change(self.__dict__[name])) for name in self._by_contour)
        return other
