"""Smooth contours of any shape, many at once: log radius of curvature over slope angle, and the vertex."""

from __future__ import annotations

import functools
import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from tactile_bayes import chebyshev
from tactile_bayes.contours.base import (
    Contour,
    Floats,
    Index,
    Locus,
    Parameter,
    as_parameter,
    common_shape,
    finite,
    refuse_unless,
)
from tactile_bayes.contours.halves import TABLE, Half, Halves
from tactile_bayes.errors import ContourError

__all__ = ["Smooth"]

_UPRIGHT = 0.5 * np.pi
_LARGEST = 100.0
"""Logarithm of a radius beyond which nothing is gained."""

_CELLS, _ROUGH_CELLS = 512, 128
"""Of a contour, between whose ends it is a polynomial of fifth degree; even, so that the vertex is one of them."""


@dataclass(frozen=True, eq=False)
class Smooth(Contour):
    """Any smooth, strictly convex contour between vertical ends: log ρ(α) is a polynomial, and the vertex is known.

    The contour follows by integration, ξ' = ρ cos α and η' = ρ sin α; its own parameter is the slope angle. It is
    strictly convex whatever the values are. Unlike `ShapeFree` it is smooth throughout, so that many contours at once
    cost little.

    Parameters
    ----------
    log_radius : array_like, shape (..., k)
        Logarithm of the radius of curvature, in the unit of length that q and x_c have, at `Smooth.nodes(k)`, through
        which the polynomial goes; k at least 2.
    q : array_like, shape (...)
        Height of the vertex [length].
    x_c : array_like, shape (...)
        Where the vertex is [length].

    Raises
    ------
    ContourError
        If a value is not finite, or the polynomial runs off.

    Examples
    --------
    >>> circle = Smooth(np.zeros(8), q=0.3)
    >>> circle.point(1.0)[0].round(12), np.sin(1.0).round(12)
    (np.float64(0.841470984808), np.float64(0.841470984808))
    """

    log_radius: Floats
    q: Parameter
    x_c: Parameter = 0.0

    def __post_init__(self) -> None:
        given = {
            name: np.asarray(as_parameter("Smooth", name, getattr(self, name))) for name in ("log_radius", "q", "x_c")
        }
        values = given["log_radius"]
        if values.ndim < 1 or values.shape[-1] < 2:
            raise ContourError(f"Smooth: log_radius of shape {values.shape} has not at least 2 values for a contour")
        shape = common_shape(
            "Smooth", **{"log_radius[..., 0]": values.shape[:-1], "q": given["q"].shape, "x_c": given["x_c"].shape}
        )
        refuse_unless(np.isfinite(values), "Smooth", "log_radius must be finite", log_radius=values)
        refuse_unless(
            finite(given["q"], given["x_c"]), "Smooth", "q and x_c must be finite", q=given["q"], x_c=given["x_c"]
        )
        self.__dict__.update(
            log_radius=np.broadcast_to(values, (*shape, values.shape[-1])),
            q=np.broadcast_to(given["q"], shape),
            x_c=np.broadcast_to(given["x_c"], shape),
            _row=np.arange(math.prod(shape)).reshape(shape),
        )
        self.__dict__["_tables"] = _Tables(self.log_radius.reshape(-1, values.shape[-1]))

    @staticmethod
    def nodes(count: int) -> Floats:
        """Slope angles at which radii of curvature are given, increasing in (−π/2, π/2) [rad]."""
        return 2.0 * _UPRIGHT * (chebyshev.nodes(count) - 0.5)

    @property
    def domain(self) -> tuple[Floats, Floats]:
        return np.full(self.shape, -_UPRIGHT), np.full(self.shape, _UPRIGHT)

    def end_name(self, side: Literal["left", "right"]) -> str:
        return "where it is vertical"

    @property
    def halves(self) -> Halves:
        half = Half(TABLE, np.full(self.shape, _UPRIGHT), np.ones(self.shape))
        tables = self.__dict__["_tables"].of(_ROUGH_CELLS)[self.__dict__["_row"]]
        return Halves(half, half, np.asarray(self.x_c), np.asarray(self.q), has_knot=False, tables=tables)

    def locate(self, parameter: ArrayLike) -> Locus:
        alpha, row = np.broadcast_arrays(np.asarray(parameter, dtype=float), self.__dict__["_row"])
        way = (alpha + _UPRIGHT) * (_CELLS / (2.0 * _UPRIGHT))
        cell = np.clip(way.astype(int), 0, _CELLS - 1)
        table = self.__dict__["_tables"].of(_CELLS)
        x, y, x_rate, y_rate = _between(table[row, cell], table[row, cell + 1], way - cell)
        speed = (x_rate * np.cos(alpha) + y_rate * np.sin(alpha)) * (_CELLS / (2.0 * _UPRIGHT))
        return Locus(self.x_c + x, self.q + y, alpha, speed, np.ones_like(alpha))

    def parameter_of_slope(self, slope_angle: ArrayLike) -> Floats:
        alpha = np.asarray(slope_angle, dtype=float)
        with np.errstate(invalid="ignore"):
            return np.where(np.abs(alpha) <= _UPRIGHT, alpha, np.nan)

    @property
    def shape(self) -> tuple[int, ...]:
        return np.shape(self.q)

    def broadcast_to(self, shape: tuple[int, ...]) -> Smooth:
        return self._each(lambda value: np.broadcast_to(value, (*shape, *value.shape[len(self.shape) :])))

    def take(self, index: Index) -> Smooth:
        return self._each(lambda value: value[index])

    def _each(self, change: Callable[[Floats], Floats]) -> Smooth:
        other = object.__new__(type(self))  # the tables stay one for all
        other.__dict__.update(self.__dict__)
        other.__dict__.update((name, change(self.__dict__[name])) for name in ("log_radius", "q", "x_c", "_row"))
        return other


class _Tables:
    """Point seen from the vertex, and its first and second rates over the cell, at the ends of every cell."""

    def __init__(self, log_radius: Floats) -> None:
        """Of contours, shape (n, k)."""
        self._coefficients = chebyshev.coefficients(log_radius)
        self._made: dict[int, Floats] = {}

    def of(self, cells: int) -> Floats:
        """Shape (n, cells + 1, 6): x, y, their rates and the rates of these."""
        if cells not in self._made:
            self._made[cells] = self._make(cells)
        return self._made[cells]

    def _make(self, cells: int) -> Floats:
        alpha, values, slopes = _grid(self._coefficients.shape[0], cells)
        log_radius = self._coefficients.T @ values
        if np.abs(log_radius).max(initial=0.0) > _LARGEST:
            raise ContourError(
                f"Smooth: log_radius runs off to {np.abs(log_radius).max():.3g}: give values that belong to a smooth "
                "curve, or fewer"
            )
        width = 2.0 * _UPRIGHT / cells
        radius = width * np.exp(log_radius)
        change = radius * (self._coefficients.T @ slopes) * width
        cos, sin = np.cos(alpha), np.sin(alpha)
        table = np.empty((*radius.shape, 6))
        for axis, (rate, bend) in enumerate(
            ((radius * cos, change * cos - width * radius * sin), (radius * sin, change * sin + width * radius * cos))
        ):
            steps = 0.5 * (rate[:, :-1] + rate[:, 1:]) + (bend[:, :-1] - bend[:, 1:]) / 12.0
            way = np.concatenate([np.zeros_like(steps[:, :1]), np.cumsum(steps, axis=1)], axis=1)
            table[..., axis] = way - way[:, [cells // 2]]
            table[..., 2 + axis], table[..., 4 + axis] = rate, bend
        return table


@functools.cache
def _grid(count: int, cells: int) -> tuple[Floats, Floats, Floats]:
    """Slope angles at the ends of cells, and there Chebyshev's polynomials and their slopes, (count, cells + 1)."""
    z = np.linspace(0.0, 1.0, cells + 1)
    values = chebyshev.basis(count, z)
    slopes = chebyshev.evaluate(chebyshev.derivative(np.eye(count)), z[:, None]).T
    return 2.0 * _UPRIGHT * (z - 0.5), values, slopes / (2.0 * _UPRIGHT)


def _between(left: Floats, right: Floats, t: Floats) -> tuple[Floats, Floats, Floats, Floats]:
    """x, y and their rates at a share t of a cell, from what is known at its ends: polynomials of fifth degree."""
    out = []
    for axis in range(2):
        start, rate, bend = (left[..., axis + k] for k in (0, 2, 4))
        rise = right[..., axis] - start - rate - 0.5 * bend
        rate_rise = right[..., axis + 2] - rate - bend
        bend_rise = right[..., axis + 4] - bend
        c = 10.0 * rise - 4.0 * rate_rise + 0.5 * bend_rise
        d = -15.0 * rise + 7.0 * rate_rise - bend_rise
        e = 6.0 * rise - 3.0 * rate_rise + 0.5 * bend_rise
        out.append(start + t * (rate + t * (0.5 * bend + t * (c + t * (d + t * e)))))
        out.append(rate + t * (bend + t * (3.0 * c + t * (4.0 * d + t * 5.0 * e))))
    x, x_rate, y, y_rate = out
    return x, y, x_rate, y_rate
