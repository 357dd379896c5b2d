"""Ellipses."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from tactile_bayes.contours.base import Floats, Locus, Parameter, finite, refuse_unless
from tactile_bayes.contours.oval import Oval

__all__ = ["Ellipse"]


@dataclass(frozen=True)
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
        If a half-axis is not positive, or a parameter is not finite.

    Examples
    --------
    >>> Ellipse(2.0, 0.5, q=0.3).radius_of_curvature(0.0)  # a²/b
    np.float64(8.0)
    """

    a: Parameter
    b: Parameter
    q: Parameter
    x_c: Parameter = 0.0

    def __post_init__(self) -> None:
        for name, axis in (("a", np.asarray(self.a)), ("b", np.asarray(self.b))):
            rule = f"the half-axis {name} must be positive and finite"
            refuse_unless((axis > 0) & np.isfinite(axis), "Ellipse", rule, **{name: axis})
        refuse_unless(finite(self.q, self.x_c), "Ellipse", "q and x_c must be finite", q=self.q, x_c=self.x_c)

    @property
    def half_width(self) -> Floats:
        return np.asarray(self.a, dtype=float)

    def locate(self, parameter: ArrayLike) -> Locus:
        t = np.asarray(parameter, dtype=float)  # the eccentric angle from the lowest point
        a, b, q, x_c = (np.asarray(p, dtype=float) for p in (self.a, self.b, self.q, self.x_c))
        sin, cos = np.sin(t), np.cos(t)
        speed2 = (a * cos) ** 2 + (b * sin) ** 2
        x, y, slope, speed, bend = np.broadcast_arrays(
            x_c + a * sin,
            q + 2.0 * b * np.sin(0.5 * t) ** 2,
            np.arctan2(b * sin, a * cos),
            np.sqrt(speed2),
            a * b / speed2,
        )
        return Locus(x, y, slope, speed, bend)

    def parameter_of_slope(self, slope_angle: ArrayLike) -> Floats:
        alpha = np.asarray(slope_angle, dtype=float)
        t = np.arctan2(np.asarray(self.a) * np.sin(alpha), np.asarray(self.b) * np.cos(alpha))
        return np.where(np.abs(alpha) <= 0.5 * np.pi, t, np.nan)

    def height(self, x: ArrayLike) -> Floats:
        offset = np.asarray(x, dtype=float) - self.x_c
        a, b = np.asarray(self.a, dtype=float), np.asarray(self.b, dtype=float)
        with np.errstate(invalid="ignore"):
            return np.asarray(self.q + b * offset**2 / (a * (a + np.sqrt((a - offset) * (a + offset)))))
