"""Power laws: the right half of profile IV of the paper."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from tactile_bayes.contours.base import Floats, Graph, Parameter, finite, refuse_unless

__all__ = ["PowerLaw"]


@dataclass(frozen=True)
class PowerLaw(Graph):
    """y = a |x − x_c|ⁿ + q with n ≥ 2; for n > 2 the curvature vanishes at the vertex, and only there.

    Parameters
    ----------
    a : array_like
        Factor, > 0 [length^(1 − n)].
    n : array_like
        Exponent, ≥ 2.
    q, x_c : array_like
        Height and position of the vertex [length].

    Raises
    ------
    ContourError
        If a is not positive, n is below 2, or a parameter is not finite.

    Examples
    --------
    >>> PowerLaw(1.0, 4, q=0.3).height([0.0, 0.5])
    array([0.3   , 0.3625])
    """

    a: Parameter
    n: Parameter
    q: Parameter
    x_c: Parameter = 0.0

    def __post_init__(self) -> None:
        a, n = np.asarray(self.a), np.asarray(self.n)
        refuse_unless(
            (a > 0) & np.isfinite(a), "PowerLaw", "a must be positive, else the object is not strictly convex", a=a
        )
        refuse_unless(
            (n >= 2) & np.isfinite(n),
            "PowerLaw",
            "n must be at least 2: below, no radius of curvature at the vertex",
            n=n,
        )
        refuse_unless(finite(self.q, self.x_c), "PowerLaw", "q and x_c must be finite", q=self.q, x_c=self.x_c)

    def derivatives(self, x: Floats) -> tuple[Floats, Floats, Floats]:
        a, n = np.asarray(self.a, dtype=float), np.asarray(self.n, dtype=float)
        offset = x - np.asarray(self.x_c)
        size = np.abs(offset)
        return (
            np.asarray(self.q + a * size**n),
            a * n * np.copysign(size ** (n - 1.0), offset),
            a * n * (n - 1.0) * size ** (n - 2.0),
        )

    def parameter_of_slope(self, slope_angle: ArrayLike) -> Floats:
        alpha = np.asarray(slope_angle, dtype=float)
        a, n = np.asarray(self.a, dtype=float), np.asarray(self.n, dtype=float)
        slope = np.where(np.abs(alpha) < 0.5 * np.pi, np.tan(alpha), np.nan)
        return np.asarray(self.x_c + np.copysign((np.abs(slope) / (a * n)) ** (1.0 / (n - 1.0)), slope))
