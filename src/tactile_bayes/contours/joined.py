"""Two halves joined at their vertex: profile IV of the paper."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import ArrayLike

from tactile_bayes.contours.base import Contour, Floats, Index, Locus
from tactile_bayes.errors import ContourError

__all__ = ["Joined"]


@dataclass(frozen=True)
class Joined(Contour):
    """The part of `left` that falls and the part of `right` that rises, joined where both are level.

    The radius of curvature may jump there; the slope may not.

    Parameters
    ----------
    left, right : Contour
        Contours whose vertices coincide.

    Raises
    ------
    ContourError
        If the vertices differ by more than rounding.

    Examples
    --------
    >>> from tactile_bayes.contours import Parabola, PowerLaw
    >>> iv = Joined(Parabola(0.5, q=0.3), PowerLaw(1.0, 4, q=0.3))
    >>> iv.height([-1.0, 0.0, 1.0])
    array([0.8, 0.3, 1.3])
    """

    left: Contour
    right: Contour

    def __post_init__(self) -> None:
        (xl, yl), (xr, yr) = self.left.point(0.0), self.right.point(0.0)
        scale = 1.0 + np.abs(xl) + np.abs(yl)
        if not (np.all(np.abs(xl - xr) <= 1e-12 * scale) and np.all(np.abs(yl - yr) <= 1e-12 * scale)):
            raise ContourError(
                f"Joined: the left half is level at ({xl}, {yl}) and the right half at ({xr}, {yr}): "
                "give both halves the same vertex"
            )

    @property
    def _levels(self) -> tuple[Floats, Floats]:
        return self.left.parameter_of_slope(0.0), self.right.parameter_of_slope(0.0)

    @property
    def domain(self) -> tuple[Floats, Floats]:
        level_left, level_right = self._levels
        return self.left.domain[0] - level_left, self.right.domain[1] - level_right

    @property
    def knots(self) -> tuple[Floats, ...]:
        return (np.zeros(()),)

    def locate(self, parameter: ArrayLike) -> Locus:
        p = np.asarray(parameter, dtype=float)
        level_left, level_right = self._levels
        left = self.left.locate(np.minimum(p, 0.0) + level_left)
        right = self.right.locate(np.maximum(p, 0.0) + level_right)
        return Locus(*(np.where(p < 0.0, a, b) for a, b in zip(left, right, strict=True)))

    def parameter_of_slope(self, slope_angle: ArrayLike) -> Floats:
        alpha = np.asarray(slope_angle, dtype=float)
        level_left, level_right = self._levels
        return np.where(
            alpha < 0.0,
            self.left.parameter_of_slope(np.minimum(alpha, 0.0)) - level_left,
            self.right.parameter_of_slope(np.maximum(alpha, 0.0)) - level_right,
        )

    def height(self, x: ArrayLike) -> Floats:
        x = np.asarray(x, dtype=float)
        return np.where(x < self.left.point(0.0)[0], self.left.height(x), self.right.height(x))

    @property
    def shape(self) -> tuple[int, ...]:
        return np.broadcast_shapes(self.left.shape, self.right.shape)

    def broadcast_to(self, shape: tuple[int, ...]) -> Self:
        return type(self)(self.left.broadcast_to(shape), self.right.broadcast_to(shape))

    def take(self, index: Index) -> Self:
        return type(self)(self.left.take(index), self.right.take(index))
