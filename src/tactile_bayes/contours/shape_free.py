"""Contours of any shape, from the radius of curvature over the slope angle and one point."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, Literal

import numpy as np
from numpy.typing import ArrayLike
from scipy.interpolate import CubicSpline

from tactile_bayes.arrays import Floats
from tactile_bayes.contours.base import Locus, Parameter, Tabled
from tactile_bayes.errors import ContourError
from tactile_bayes.numerics import chebyshev

_LARGEST = 100.0  # bound on the logarithm of a radius, beyond which a spline has overshot
_ORDER = 32  # Chebyshev nodes between two knots; the error is rounding even if radii change twentyfold there


@dataclass(frozen=True, eq=False)
class ShapeFree(Tabled):
    """Any strictly convex contour of finite curvature: log ρ(α) is a cubic spline, and one point is given.

    It follows by integration, ξ' = ρ cos α and η' = ρ sin α; its own parameter is the slope angle.

    Parameters
    ----------
    slope_angles : array_like, shape (k,)
        At least 4 knots of the spline, increasing in [−π/2, π/2] [rad]; the first and the last are the contour's ends.
    log_radius : array_like, shape (..., k)
        Logarithm of the radius of curvature at the knots, in the unit of length of x and y.
    x, y : array_like, shape (...)
        Point at the slope angle `at` [length].
    at : float
        Slope angle of the given point, between the ends [rad].

    Raises
    ------
    ContourError
        If the knots are not increasing angles with a finite value each, or the spline overshoots between them.

    Examples
    --------
    >>> import numpy as np
    >>> from tactile_bayes.contours import ShapeFree
    >>> circle = ShapeFree(np.linspace(-1.5, 1.5, 7), np.zeros(7), x=0.0, y=0.3)
    >>> circle.point(1.0)[0].round(12), np.sin(1.0).round(12)
    (np.float64(0.841470984808), np.float64(0.841470984808))
    """

    _by_contour: ClassVar = ("log_radius", "x", "y", "_row")

    slope_angles: Floats
    log_radius: Floats
    x: Parameter
    y: Parameter
    at: float = 0.0

    def __post_init__(self) -> None:
        self._take_arrays("slope_angles", "log_radius", "x", "y", "at")
        knots, values, at = self.slope_angles, self.log_radius, np.asarray(self.at)
        if knots.ndim != 1 or knots.size < 4 or not np.all(np.diff(knots) > 0.0) or np.any(np.abs(knots) > 0.5 * np.pi):
            raise ContourError("ShapeFree: slope_angles must be at least 4 increasing angles in [−π/2, π/2] radians")
        if values.shape[-1:] != knots.shape:
            raise ContourError(
                f"ShapeFree: log_radius has shape {values.shape}: give a value for each of {knots.size} knots"
            )
        if at.ndim or not knots[0] <= at <= knots[-1]:
            raise ContourError(f"ShapeFree: at = {self.at} is not among the slope angles {knots[0]:g} to {knots[-1]:g}")
        self._share_shape()
        self.__dict__.update(at=float(at), _table=self._integrated())
        x, y = self._evaluate(at)[1:]
        self.__dict__["_table"][..., 1:, 0] += np.stack([self.x - x, self.y - y], axis=-1).reshape(-1, 1, 2)

    def _integrated(self) -> Floats:
        """Chebyshev coefficients of log ρ, x and y on every stretch between knots: (row, stretch, 3, order + 1)."""
        knots, width = self.slope_angles, np.diff(self.slope_angles)
        alpha = knots[:-1, None] + width[:, None] * chebyshev.nodes(_ORDER)
        log_radius = CubicSpline(knots, self.log_radius.reshape(-1, knots.size), axis=-1)(alpha)
        if np.abs(log_radius).max(initial=0.0) > _LARGEST:
            raise ContourError(
                f"ShapeFree: between the knots log_radius reaches {np.abs(log_radius).max():.3g}: knots that "
                "nearly coincide make the spline overshoot; move them apart, or make their values alike"
            )
        radius = np.exp(log_radius)
        rates = np.stack([radius * np.cos(alpha), radius * np.sin(alpha)], axis=2)  # (row, stretch, 2, order)
        path = chebyshev.integral(chebyshev.coefficients(rates)) * width[:, None]
        change = path.sum(axis=0)
        path[0] += np.cumsum(change, axis=1) - change
        spline = chebyshev.coefficients(log_radius)
        spline = np.concatenate([spline, np.zeros_like(spline[:1])])
        table = np.moveaxis(np.concatenate([spline[..., None], path], axis=-1), 0, -1)
        return np.ascontiguousarray(table)

    def _evaluate(self, alpha: Floats) -> tuple[Floats, Floats, Floats]:
        """log ρ, x and y at slope angles."""
        alpha, row = np.broadcast_arrays(alpha, self.__dict__["_row"])
        stretch = np.clip(np.searchsorted(self.slope_angles, alpha, side="right") - 1, 0, self.slope_angles.size - 2)
        z = (alpha - self.slope_angles[stretch]) / np.diff(self.slope_angles)[stretch]
        basis = chebyshev.polynomials(_ORDER + 1, z)
        log_radius, x, y = np.moveaxis((self.__dict__["_table"][row, stretch] @ basis[..., None])[..., 0], -1, 0)
        return log_radius, x, y

    @property
    def domain(self) -> tuple[Floats, Floats]:
        shape = self.shape
        return np.full(shape, self.slope_angles[0]), np.full(shape, self.slope_angles[-1])

    @property
    def knots(self) -> tuple[Floats, ...]:
        return tuple(self.slope_angles[1:-1])

    def end_name(self, side: Literal["left", "right"]) -> str:
        return "the last slope angle for which a radius is given"

    @np.errstate(over="ignore", invalid="ignore")
    def locate(self, parameter: ArrayLike) -> Locus:
        alpha = self._at("parameter", parameter)
        log_radius, x, y = self._evaluate(alpha)
        alpha = np.broadcast_to(alpha, x.shape)
        return Locus(x, y, alpha, np.exp(log_radius), np.ones_like(alpha))
