"""Circles: profile III of the paper."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import ArrayLike

from tactile_bayes.contours.base import Floats, Locus, Parameter, alike
from tactile_bayes.contours.oval import Oval

__all__ = ["Circle"]


@dataclass(frozen=True, eq=False)
class Circle(Oval):
    """Lower half of a circle, y = q + r − √(r² − (x − x_c)²); it ends where it stands upright, at x = x_c ± r.

    Parameters
    ----------
    r : array_like
        Radius, > 0 [length].
    q : array_like
        Height of the lowest point [length].
    x_c : array_like
        Position of the lowest point [length].

    Raises
    ------
    ContourError
        If r is not positive, a parameter is not finite, or shapes do not broadcast.

    Examples
    --------
    >>> from tactile_bayes.contours import Circle
    >>> Circle(1.0, q=0.3).radius_of_curvature([-0.5, 0.0, 0.5])
    array([1., 1., 1.])
    """

    sizes: ClassVar = {"r": "radius"}

    r: Parameter
    q: Parameter
    x_c: Parameter = 0.0

    @property
    def half_axes(self) -> tuple[Parameter, Parameter]:
        return self.r, self.r

    def locate(self, parameter: ArrayLike) -> Locus:
        alpha = np.asarray(parameter, dtype=float)
        x, y = self.x_c + self.r * np.sin(alpha), self.q + 2.0 * self.r * np.sin(0.5 * alpha) ** 2
        x, y, alpha, radius = alike(x, y, alpha, self.r + 0.0 * alpha)
        return Locus(x, y, alpha, radius, np.ones_like(alpha))

    def parameter_of_slope(self, slope_angle: ArrayLike) -> Floats:
        alpha = np.asarray(slope_angle, dtype=float)
        return np.where(np.abs(alpha) <= 0.5 * np.pi, alpha, np.nan)
