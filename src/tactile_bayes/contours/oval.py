"""Ovals: circles, of which one is profile III of the paper, and ellipses."""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import dataclass
from typing import ClassVar, Literal

import numpy as np
from numpy.typing import ArrayLike

from tactile_bayes.arrays import Floats
from tactile_bayes.contours.base import Locus, Parameter, Vertexed, locus_of
from tactile_bayes.contours.halves import OVAL, Half


class _Oval(Vertexed):
    """Lower half of an oval; its parameter is the eccentric angle from the lowest point."""

    @property
    @abstractmethod
    def half_axes(self) -> tuple[Parameter, Parameter]:
        """Horizontal and vertical half-axis."""

    @property
    def domain(self) -> tuple[Floats, Floats]:
        upright = np.full(self.shape, 0.5 * np.pi)
        return -upright, upright

    @property
    def half(self) -> Half:
        return Half(OVAL, *(np.asarray(axis) for axis in self.half_axes))

    def end_name(self, side: Literal["left", "right"]) -> str:
        return "where it is vertical"

    @np.errstate(over="ignore", invalid="ignore")
    def parameter_of_x(self, x: ArrayLike) -> Floats:
        return np.asarray(np.arcsin((self._at("x", x) - self.x_c) / self.half_axes[0]))

    @np.errstate(over="ignore", invalid="ignore")
    def height(self, x: ArrayLike) -> Floats:
        offset = self._at("x", x) - self.x_c
        a, b = self.half_axes
        sunk = offset**2 / (a + np.sqrt((a - offset) * (a + offset)))
        return np.asarray(self.q + b / a * sunk)


@dataclass(frozen=True, eq=False)
class Circle(_Oval):
    """Lower half of a circle, y = q + r − √(r² − (x − x_c)²); it ends where it is vertical, at x = x_c ± r.

    Parameters
    ----------
    r : array_like
        Radius, > 0 [length].
    q, x_c : array_like
        Height and position of the lowest point [length].

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

    sizes: ClassVar = {"r": "the radius r must be positive and finite"}

    r: Parameter
    q: Parameter
    x_c: Parameter = 0.0

    @property
    def half_axes(self) -> tuple[Parameter, Parameter]:
        return self.r, self.r

    @np.errstate(over="ignore", invalid="ignore")
    def locate(self, parameter: ArrayLike) -> Locus:
        alpha = self._at("parameter", parameter)
        x, y = self.x_c + self.r * np.sin(alpha), self.q + 2.0 * self.r * np.sin(0.5 * alpha) ** 2
        return locus_of(x, y, alpha, self.r + 0.0 * alpha, np.ones(alpha.shape))

    def parameter_of_slope(self, slope_angle: ArrayLike) -> Floats:
        return self._own("slope_angle", slope_angle)


@dataclass(frozen=True, eq=False)
class Ellipse(_Oval):
    """Lower half of an ellipse, (x − x_c)²/a² + (y − q − b)²/b² = 1; it ends where it is vertical, at x = x_c ± a.

    Parameters
    ----------
    a, b : array_like
        Horizontal and vertical half-axis, > 0 [length].
    q, x_c : array_like
        Height and position of the lowest point [length].

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

    sizes: ClassVar = {name: f"the half-axis {name} must be positive and finite" for name in "ab"}

    a: Parameter
    b: Parameter
    q: Parameter
    x_c: Parameter = 0.0

    @property
    def half_axes(self) -> tuple[Parameter, Parameter]:
        return self.a, self.b

    @np.errstate(over="ignore", invalid="ignore")
    def locate(self, parameter: ArrayLike) -> Locus:
        t = self._at("parameter", parameter)  # the eccentric angle from the lowest point
        a, b = self.a, self.b
        sin, cos = np.sin(t), np.cos(t)
        speed2 = (a * cos) ** 2 + (b * sin) ** 2
        x, y = self.x_c + a * sin, self.q + 2.0 * b * np.sin(0.5 * t) ** 2
        return locus_of(x, y, np.arctan2(b * sin, a * cos), np.sqrt(speed2), a * b / speed2)

    def parameter_of_slope(self, slope_angle: ArrayLike) -> Floats:
        alpha = self._at("slope_angle", slope_angle)
        with np.errstate(invalid="ignore"):
            t = np.arctan2(self.a * np.sin(alpha), self.b * np.cos(alpha))
        return np.where(np.abs(alpha) <= 0.5 * np.pi, t, np.nan)
