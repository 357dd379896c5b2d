"""Parabolas: profiles I and II of the paper."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import ArrayLike

from tactile_bayes.arrays import Floats
from tactile_bayes.contours.base import Locus, Parameter, Vertexed, locus_of
from tactile_bayes.contours.halves import PARABOLA, Half


@dataclass(frozen=True, eq=False)
class Parabola(Vertexed):
    """Parabola y = a (x − x_c)² + q.

    Parameters
    ----------
    a : array_like
        Half the curvature at the vertex, > 0 [1/length].
    q, x_c : array_like
        Height and position of the vertex [length].

    Raises
    ------
    ContourError
        If a is not positive (the object would not be convex), a parameter is not finite, or shapes do not broadcast.

    Examples
    --------
    >>> import numpy as np
    >>> from tactile_bayes.contours import Parabola
    >>> x, y = Parabola(0.5, q=0.3).point(np.pi / 4)
    >>> x.round(12), y.round(12)
    (np.float64(1.0), np.float64(0.8))
    """

    sizes: ClassVar = {"a": "a must be positive, else the object is not strictly convex"}

    a: Parameter
    q: Parameter
    x_c: Parameter = 0.0

    @property
    def domain(self) -> tuple[Floats, Floats]:
        steepest = np.full(self.shape, np.nextafter(0.5 * np.pi, 0.0))
        return -steepest, steepest

    @property
    def half(self) -> Half:
        return Half(PARABOLA, np.asarray(self.a), np.ones(()))

    @np.errstate(over="ignore", invalid="ignore")
    def locate(self, parameter: ArrayLike) -> Locus:
        alpha = self._at("parameter", parameter)
        t = np.tan(alpha)
        offset, square = t / (2.0 * self.a), 1.0 + t * t
        x, y, radius = self.x_c + offset, self.q + 0.5 * t * offset, square * np.sqrt(square) / (2.0 * self.a)
        return locus_of(x, y, alpha, radius, np.ones(alpha.shape))

    def parameter_of_slope(self, slope_angle: ArrayLike) -> Floats:
        return self._own("slope_angle", slope_angle)

    def parameter_of_x(self, x: ArrayLike) -> Floats:
        return np.asarray(np.arctan(2.0 * self.a * (self._at("x", x) - self.x_c)))

    @np.errstate(over="ignore", invalid="ignore")
    def height(self, x: ArrayLike) -> Floats:
        return np.asarray(self.a * (self._at("x", x) - self.x_c) ** 2 + self.q)
