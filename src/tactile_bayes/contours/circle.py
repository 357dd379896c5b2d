"""Circles: profile III of the paper."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from tactile_bayes.contours.base import Floats, Locus, Parameter, finite, refuse_unless
from tactile_bayes.contours.oval import Oval

__all__ = ["Circle"]


@dataclass(frozen=True)
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
        If r is not positive, or a parameter is not finite.

    Examples
    --------
    >>> Circle(1.0, q=0.3).radius_of_curvature([-0.5, 0.0, 0.5])
    array([1., 1., 1.])
    """

    r: Parameter
    q: Parameter
    x_c: Parameter = 0.0

    def __post_init__(self) -> None:
        r = np.asarray(self.r)
        refuse_unless((r > 0) & np.isfinite(r), "Circle", "the radius r must be positive and finite", r=r)
        refuse_unless(finite(self.q, self.x_c), "Circle", "q and x_c must be finite", q=self.q, x_c=self.x_c)

    @property
    def half_width(self) -> Floats:
        return np.asarray(self.r, dtype=float)

    def locate(self, parameter: ArrayLike) -> Locus:
        alpha = np.asarray(parameter, dtype=float)
        r, q, x_c = (np.asarray(p, dtype=float) for p in (self.r, self.q, self.x_c))
        x, y, alpha, radius = np.broadcast_arrays(
            x_c + r * np.sin(alpha), q + 2.0 * r * np.sin(0.5 * alpha) ** 2, alpha, r + 0.0 * alpha
        )
        return Locus(x, y, alpha, radius, np.ones_like(alpha))

    def parameter_of_slope(self, slope_angle: ArrayLike) -> Floats:
        alpha = np.asarray(slope_angle, dtype=float)
        return np.where(np.abs(alpha) <= 0.5 * np.pi, alpha, np.nan)

    def height(self, x: ArrayLike) -> Floats:
        offset = np.asarray(x, dtype=float) - self.x_c
        r = np.asarray(self.r, dtype=float)
        with np.errstate(invalid="ignore"):
            return np.asarray(self.q + offset**2 / (r + np.sqrt(r * r - offset * offset)))
