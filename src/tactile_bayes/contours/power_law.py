"""Power laws: the right half of profile IV of the paper."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, Self

import numpy as np
from numpy.typing import ArrayLike

from tactile_bayes.arrays import Floats
from tactile_bayes.contours.base import Locus, Parameter, Vertexed, as_parameter, common_shape, locus_of, refuse_unless
from tactile_bayes.contours.halves import POWER_LAW, Half

_LEAST_EXPONENT, _GREATEST_EXPONENT = 1.1, 50.0

_STEEPEST = 1e300  # greatest factor a that follows from a width, to avoid overflow


@dataclass(frozen=True, eq=False)
class PowerLaw(Vertexed):
    """Power law y = a |x − x_c|ⁿ + q.

    For n > 2 the curvature vanishes at the vertex, and only there. For n < 2 it is infinite there, but the slope is
    continuous, and a rod slides past it. Toward n = 1 the vertex becomes an edge, which `Joined` gives.

    Parameters
    ----------
    a : array_like
        Factor, > 0 [length^(1 − n)].
    n : array_like
        Exponent, from 1.1 to 50.
    q, x_c : array_like
        Height and position of the vertex [length].

    Raises
    ------
    ContourError
        If a is not positive, n is outside its range, a parameter is not finite, or shapes do not broadcast.

    Examples
    --------
    >>> from tactile_bayes.contours import PowerLaw
    >>> PowerLaw(1.0, 4, q=0.3).height([0.0, 0.5])
    array([0.3   , 0.3625])
    >>> PowerLaw(1.0, 1.5, q=0.3).radius_of_curvature(0.0)
    np.float64(0.0)
    """

    sizes: ClassVar = {"a": "a must be positive, else the object is not strictly convex"}

    a: Parameter
    n: Parameter
    q: Parameter
    x_c: Parameter = 0.0

    def __post_init__(self) -> None:
        super().__post_init__()
        least = f"n must be at least {_LEAST_EXPONENT}: below, the vertex is as good as an edge, which Joined can give"
        refuse_unless(np.greater_equal(self.n, _LEAST_EXPONENT), "PowerLaw", least, n=self.n)
        most = f"n must be at most {_GREATEST_EXPONENT:g}: above, the bottom is as good as straight"
        refuse_unless(np.less_equal(self.n, _GREATEST_EXPONENT), "PowerLaw", most, n=self.n)

    @classmethod
    def of_width(cls, w: Parameter, n: Parameter, q: Parameter, x_c: Parameter = 0.0) -> Self:
        """Power law (y − q)/w = (|x − x_c|/w)ⁿ, which is as high above its vertex as it is wide at w.

        Arguments and errors are those of `PowerLaw`, with a width w > 0 [length].

        Examples
        --------
        >>> PowerLaw.of_width(0.5, 3, q=0.3)
        PowerLaw(a=4.0, n=3.0, q=0.3, x_c=0.0)
        """
        w, n = as_parameter("PowerLaw", "w", w), as_parameter("PowerLaw", "n", n)
        common_shape("PowerLaw", w=np.shape(w), n=np.shape(n))
        refuse_unless(np.greater(w, 0.0) & np.isfinite(w), "PowerLaw", "w must be positive and finite", w=w)
        with np.errstate(over="ignore", divide="ignore"):  # where it is narrow, or wide, and n is large
            a = np.clip(np.asarray(w) ** (1.0 - n), 1.0 / _STEEPEST, _STEEPEST)
        return cls(a, n, q, x_c)

    @property
    def w(self) -> Floats:
        """Width w of `of_width` [length]."""
        return np.asarray(np.asarray(self.a) ** (1.0 / (1.0 - np.asarray(self.n))))

    @property
    def half(self) -> Half:
        return Half(POWER_LAW, np.asarray(self.a), np.asarray(self.n))

    @property
    def knots(self) -> tuple[Floats, ...]:
        return (np.zeros(()),)

    def _powers(self) -> tuple[Floats, Floats, Floats]:
        """Exponents of |p| in |x − x_c|, slope and y − q: p is the offset for n ≥ 2, else proportional to the slope."""
        of_offset, of_slope = np.maximum(1.0, 1.0 / (self.n - 1.0)), np.maximum(1.0, self.n - 1.0)
        return of_offset, of_slope, of_offset + of_slope

    @np.errstate(over="ignore", invalid="ignore")
    def locate(self, parameter: ArrayLike) -> Locus:
        p, a, n = self._at("parameter", parameter), self.a, self.n
        of_offset, of_slope, of_height = self._powers()
        size = np.abs(p)
        flat = size ** (of_offset - 1.0)
        steep = size ** (of_slope - 1.0)
        slope = a * n * steep * p
        steepness = 1.0 + slope * slope
        speed, bend = of_offset * flat * np.sqrt(steepness), a * n * of_slope * steep / steepness
        return locus_of(self.x_c + flat * p, self.q + a * size**of_height, np.arctan(slope), speed, bend)

    @np.errstate(over="ignore", invalid="ignore")
    def parameter_of_slope(self, slope_angle: ArrayLike) -> Floats:
        alpha = self._at("slope_angle", slope_angle)
        slope = np.where(np.abs(alpha) < 0.5 * np.pi, np.tan(alpha), np.nan)
        return np.asarray(np.copysign((np.abs(slope) / (self.a * self.n)) ** (1.0 / self._powers()[1]), slope))

    @np.errstate(over="ignore", invalid="ignore")
    def parameter_of_x(self, x: ArrayLike) -> Floats:
        offset = self._at("x", x) - self.x_c
        return np.asarray(np.copysign(np.abs(offset) ** (1.0 / self._powers()[0]), offset))

    @np.errstate(over="ignore", invalid="ignore")
    def height(self, x: ArrayLike) -> Floats:
        return np.asarray(self.q + self.a * np.abs(self._at("x", x) - self.x_c) ** self.n)
