"""Contours with tables, which are shared by all contours that are taken from them."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, ClassVar, Self

import numpy as np

from tactile_bayes.arrays import Floats
from tactile_bayes.contours.base import Contour, as_parameter, common_shape, finite, refuse_unless


class Tabled(Contour):
    """Contours with tables of a row for each; `_row` is its index, so that `take` need not copy the tables."""

    # Names of the arrays with an entry for each contour, `log_radius` first and `_row` last.
    _by_contour: ClassVar[tuple[str, ...]]

    log_radius: Floats

    def _take_arrays(self, *names: str) -> None:
        """Convert parameters to arrays of numbers."""
        family = type(self).__name__
        self.__dict__.update({n: np.asarray(as_parameter(family, n, getattr(self, n))) for n in names})

    def _share_shape(self) -> None:
        """Broadcast the arrays with an entry for each contour to one shape, and number the contours."""
        family, values = type(self).__name__, self.log_radius
        others = {name: self.__dict__[name] for name in self._by_contour[1:-1]}
        shapes = {"log_radius[..., 0]": values.shape[:-1], **{name: v.shape for name, v in others.items()}}
        shape = common_shape(family, **shapes)
        refuse_unless(np.isfinite(values), family, "log_radius must be finite", log_radius=values)
        refuse_unless(finite(*others.values()), family, f"{' and '.join(others)} must be finite", **others)
        self.__dict__.update({name: np.broadcast_to(v, shape) for name, v in others.items()})
        self.__dict__["log_radius"] = np.broadcast_to(values, (*shape, values.shape[-1]))
        self.__dict__["_row"] = np.arange(math.prod(shape)).reshape(shape)

    @property
    def shape(self) -> tuple[int, ...]:
        return np.shape(self.__dict__["_row"])

    def _each(self, change: Callable[[Any], Floats]) -> Self:
        other = object.__new__(type(self))  # the tables are shared
        other.__dict__.update(self.__dict__)
        other.__dict__.update((name, change(self.__dict__[name])) for name in self._by_contour)
        return other
