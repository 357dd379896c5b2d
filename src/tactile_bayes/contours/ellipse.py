"""Ellipses."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import ArrayLike

from tactile_bayes.contours.base import Floats, Locus, Parameter, alike
from tactile_bayes.contours.oval import Oval

__all__ = ["Ellipse"]


@dataclass(frozen=True, eq=False)
class Ellipse(Oval):
    """Lower half of an ellipse, (x − x_c)²/a² + (y − q − b)²/b² = 1; it ends where it stands upright, at x = x_c ± a.

    Parameters
    ----------
    a : array_like
        Horizontal half-axis, > 0 [length].
    b : array_like
        Vertical half-axis, > 0 [length].
    q : array_like
        Height of the lowest point [length].
    x_c : array_like
        Position of the lowest point [length].

    Raises
    ------
    ContourError
        If a half-axis is not positive, a parameter is not finite, or shapes do not broadcast.

    Examples
    --------
    >>> from tactile_bayes.contours import Ellipse
    >>> Ellipse(2.0, 0.5, q=0.3).radius_of_curvature(0.0)  # a²/b
    np.float64(8.0)
    """

    sizes: ClassVar = {"a": "half-axis", "b": "half-axis"}

    a: Parameter
    b: Parameter
    q: Parameter
    x_c: Parameter = 0.0

    @property
    def half_axes(self) -> tuple[Parameter, Parameter]:
        return self.a, self.b

    def locate(self, parameter: ArrayLike) -> Locus:
        t = np.asarray(parameter, dtype=float)  # the eccentric angle from the lowest point
        a, b = self.a, self.b
        sin, cos = np.sin(t), np.cos(t)
        speed2 = (a * cos) ** 2 + (b * sin) ** 2
        x, y, slope, speed, bend = alike(
            self.x_c + a * sin,
            self.q + 2.0 * b * np.sin(0.5 * t) ** 2,
            np.arctan2(b * sin, a * cos),
            np.sqrt(speed2),
            a * b / speed2,
        )
        return Locus(x, y, slope, speed, bend)

    def parameter_of_slope(self, slope_angle: ArrayLike) -> Floats:
        alpha = np.asarray(slope_angle, dtype=float)
        t = np.arctan2(self.a * np.sin(alpha), self.b * np.cos(alpha))
        return np.where(np.abs(alpha) <= 0.5 * np.pi, t, np.nan)
