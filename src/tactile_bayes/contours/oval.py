"""Ovals: what circles and ellipses share."""

from __future__ import annotations

from abc import abstractmethod
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from tactile_bayes.contours.base import Contour, Floats, Parameter

__all__ = ["Oval"]


class Oval(Contour):
    """Lower half of an oval; its parameter is the eccentric angle, counted from the lowest point."""

    x_c: Parameter

    @property
    @abstractmethod
    def half_width(self) -> Floats:
        """Horizontal half-axis."""

    @property
    def domain(self) -> tuple[Floats, Floats]:
        upright = np.full(self.shape, 0.5 * np.pi)
        return -upright, upright

    def end_name(self, side: Literal["left", "right"]) -> str:
        return "where it stands upright"

    def parameter_of_x(self, x: ArrayLike) -> Floats:
        with np.errstate(invalid="ignore"):
            return np.asarray(np.arcsin((np.asarray(x, dtype=float) - self.x_c) / self.half_width))
