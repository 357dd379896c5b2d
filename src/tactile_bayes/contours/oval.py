"""Ovals: what circles and ellipses share."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping
from typing import ClassVar, Literal

import numpy as np
from numpy.typing import ArrayLike

from tactile_bayes.contours.base import Contour, Floats, Parameter, finite, refuse_unless
from tactile_bayes.contours.halves import OVAL, Half, Halves

__all__ = ["Oval"]


class Oval(Contour):
    """Lower half of an oval; its parameter is the eccentric angle, counted from the lowest point."""

    sizes: ClassVar[Mapping[str, str]]
    """What its positive parameters are, by name."""

    q: Parameter
    x_c: Parameter

    def __post_init__(self) -> None:
        super().__post_init__()
        family = type(self).__name__
        for name, what in self.sizes.items():
            size = getattr(self, name)
            rule = f"the {what} {name} must be positive and finite"
            refuse_unless(np.greater(size, 0.0) & np.isfinite(size), family, rule, **{name: size})
        refuse_unless(finite(self.q, self.x_c), family, "q and x_c must be finite", q=self.q, x_c=self.x_c)

    @property
    @abstractmethod
    def half_axes(self) -> tuple[Parameter, Parameter]:
        """The horizontal and the vertical one."""

    @property
    def domain(self) -> tuple[Floats, Floats]:
        upright = np.full(self.shape, 0.5 * np.pi)
        return -upright, upright

    @property
    def halves(self) -> Halves:
        half = Half(OVAL, *(np.asarray(axis) for axis in self.half_axes))
        return Halves(half, half, np.asarray(self.x_c), np.asarray(self.q))

    def end_name(self, side: Literal["left", "right"]) -> str:
        return "where it stands upright"

    def parameter_of_x(self, x: ArrayLike) -> Floats:
        with np.errstate(invalid="ignore"):
            return np.asarray(np.arcsin((np.asarray(x, dtype=float) - self.x_c) / self.half_axes[0]))

    def height(self, x: ArrayLike) -> Floats:
        offset = np.asarray(x, dtype=float) - self.x_c
        a, b = self.half_axes
        with np.errstate(invalid="ignore"):
            sunk = offset**2 / (a + np.sqrt((a - offset) * (a + offset)))
        return np.asarray(self.q + b / a * sunk)
