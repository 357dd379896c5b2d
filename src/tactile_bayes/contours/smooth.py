"""Smooth contours of any shape, many at once, from the radius of curvature over the slope angle and the vertex."""

from __future__ import annotations

import functools
from collections.abc import Iterable
from dataclasses import dataclass
from typing import ClassVar, Literal

import numpy as np
from numpy.typing import ArrayLike

from tactile_bayes.arrays import Floats, Index
from tactile_bayes.checks import check_whole_number
from tactile_bayes.contours.base import Locus, Parameter, Tabled
from tactile_bayes.contours.halves import SLOPES, Half, Halves
from tactile_bayes.errors import ContourError
from tactile_bayes.numerics import chebyshev
from tactile_bayes.numerics.roots import falling_root

_UPRIGHT = 0.5 * np.pi
_LARGEST = 100.0  # bound on the logarithm of a radius
_MOST_NODES = 10_000  # largest number of nodes that is given
# Cells of a contour, on each of which it is a polynomial of fifth degree, without and with a flat; even, so that the
# vertex ends a cell.
_CELLS, _CELLS_OF_FLAT = 128, 512
_FLAT_WIDTH = 0.01  # standard deviation of the slope angles of a flat [rad], whose middle rises by 0.3 % of its length


@dataclass(frozen=True, eq=False)
class Smooth(Tabled):
    """Any smooth, strictly convex contour between vertical ends: log ρ(α) is a polynomial, and the vertex is given.

    The contour follows by integration, as that of `ShapeFree`; its own parameter is the slope angle. It is strictly
    convex for all values, and smooth everywhere, so that many contours at once cost little.

    Parameters
    ----------
    log_radius : array_like, shape (..., k)
        Logarithm of the radius of curvature, in the unit of length of q and x_c, at the interpolation nodes
        `Smooth.nodes(k)`; k ≥ 2.
    q, x_c : array_like, shape (...)
        Height and position of the vertex [length].
    flat_length, flat_slope : array_like, shape (...)
        Length [length] and slope angle [rad] of a flat side, over which the contour turns by 0.02 rad; none by default.

    Raises
    ------
    ContourError
        If a value is not finite, or the polynomial overshoots.

    Examples
    --------
    >>> import numpy as np
    >>> from tactile_bayes.contours import Smooth
    >>> circle = Smooth(np.zeros(8), q=0.3)
    >>> circle.point(1.0)[0].round(12), np.sin(1.0).round(12)
    (np.float64(0.841470984808), np.float64(0.841470984808))
    """

    _by_contour: ClassVar = ("log_radius", "q", "x_c", "flat_length", "flat_slope", "_row")

    log_radius: Floats
    q: Parameter
    x_c: Parameter = 0.0
    flat_length: Parameter = 0.0
    flat_slope: Parameter = 0.0

    def __post_init__(self) -> None:
        self._take_arrays(*self._by_contour[:-1])
        values = self.log_radius
        if values.ndim < 1 or values.shape[-1] < 2:
            raise ContourError(f"Smooth: log_radius of shape {values.shape} has not at least 2 values for a contour")
        self._share_shape()
        of_radius = chebyshev.coefficients(self.log_radius.reshape(-1, values.shape[-1]))
        self.__dict__["_table"] = _tabulated(of_radius, np.ravel(self.flat_length), np.ravel(self.flat_slope))

    @staticmethod
    def nodes(count: int) -> Floats:
        """Slope angles at which radii of curvature are given, increasing in (−π/2, π/2), shape (count,) [rad]."""
        check_whole_number("count", count, 2, most=_MOST_NODES)
        return 2.0 * _UPRIGHT * (chebyshev.nodes(count) - 0.5)

    @property
    def domain(self) -> tuple[Floats, Floats]:
        return np.full(self.shape, -_UPRIGHT), np.full(self.shape, _UPRIGHT)

    def end_name(self, side: Literal["left", "right"]) -> str:
        return "where it is vertical"

    @property
    def halves(self) -> Halves:
        half = Half(SLOPES, np.full(self.shape, _UPRIGHT), np.ones(self.shape))
        tables = self.__dict__["_table"][self.__dict__["_row"]]
        return Halves(half, half, np.asarray(self.x_c), np.asarray(self.q), tables=tables)

    @np.errstate(over="ignore", invalid="ignore")
    def locate(self, parameter: ArrayLike) -> Locus:
        alpha, row = np.broadcast_arrays(self._at("parameter", parameter), self.__dict__["_row"])
        table = self.__dict__["_table"]
        cells = table.shape[1] - 1
        way = (alpha + _UPRIGHT) * (cells / (2.0 * _UPRIGHT))
        cell = np.nan_to_num(np.clip(way, 0, cells - 1)).astype(np.intp)
        x, y, x_rate, y_rate = _between(table[row, cell], table[row, cell + 1], way - cell)
        speed = (x_rate * np.cos(alpha) + y_rate * np.sin(alpha)) * (cells / (2.0 * _UPRIGHT))
        return Locus(self.x_c + x, self.q + y, alpha, speed, np.ones_like(alpha))

    def parameter_of_x(self, x: ArrayLike) -> Floats:
        x = self._at("x", x)
        shape = np.broadcast_shapes(self.shape, x.shape)
        row = np.broadcast_to(self.__dict__["_row"], shape).ravel()
        goal = (np.broadcast_to(x, shape) - np.broadcast_to(self.x_c, shape)).ravel()
        table = self.__dict__["_table"]
        cells = table.shape[1] - 1
        first, last = np.zeros(row.size, dtype=np.intp), np.full(row.size, cells)
        for _ in range(cells.bit_length()):
            middle = (first + last) // 2
            beyond = table[row, middle, 0] > goal
            first, last = np.where(beyond, first, middle), np.where(beyond, middle, last)
        there = np.flatnonzero((table[row, 0, 0] <= goal) & (goal <= table[row, -1, 0]))
        row, first, goal = row[there], np.minimum(first[there], cells - 1), goal[there]
        left, right = table[row, first], table[row, first + 1]
        terms = np.stack(_polynomial(left[:, ::2], right[:, ::2]))

        def short_of(i: Index, t: Floats) -> tuple[Floats, Floats]:
            at, rate = _value_and_rate(terms[:, i], t)
            return goal[i] - at, -rate

        found = np.full(beyond.shape, np.nan)
        start = (goal - left[:, 0]) / (right[:, 0] - left[:, 0])
        way = first + falling_root(short_of, np.zeros(there.size), np.ones(there.size), start)
        found[there] = way * (2.0 * _UPRIGHT / cells) - _UPRIGHT
        return found.reshape(shape)


def _tabulated(coefficients: Floats, flat_length: Floats, flat_slope: Floats) -> Floats:
    """Table at the ends of cells, (n, cells + 1, 6), as in `Halves`, from coefficients of log ρ, (k, n). The integral
    over a cell has an error of seventh order in its width."""
    cells = _CELLS_OF_FLAT if np.any(flat_length) else _CELLS
    alpha, values, slopes = _grid(coefficients.shape[0], cells)
    log_radius = coefficients.T @ values
    if np.abs(log_radius).max(initial=0.0) > _LARGEST:
        raise ContourError(
            f"Smooth: log_radius reaches {np.abs(log_radius).max():.3g}: give values that belong to a smooth "
            "curve, or fewer"
        )
    width = 2.0 * _UPRIGHT / cells
    radius = width * np.exp(log_radius)
    change = radius[:, ::2] * (coefficients.T @ slopes) * width
    if np.any(flat_length):
        away = (alpha - flat_slope[:, None]) / _FLAT_WIDTH
        flat = flat_length[:, None] * np.exp(-0.5 * away**2) * (width / (_FLAT_WIDTH * np.sqrt(2.0 * np.pi)))
        radius += flat
        change -= (flat * away)[:, ::2] * (width / _FLAT_WIDTH)
    table = np.empty((len(radius), cells + 1, 6))
    for axis, (along, turn) in enumerate(((np.cos(alpha), -np.sin(alpha)), (np.sin(alpha), np.cos(alpha)))):
        rate = radius * along
        bend = change * along[::2] + width * radius[:, ::2] * turn[::2]
        ends, middles = rate[:, ::2], rate[:, 1::2]
        steps = (7.0 * (ends[:, :-1] + ends[:, 1:]) + 16.0 * middles) / 30.0 + (bend[:, :-1] - bend[:, 1:]) / 60.0
        table[:, 0, axis] = 0.0
        np.cumsum(steps, axis=1, out=table[:, 1:, axis])
        table[..., axis] -= table[:, [cells // 2], axis]
        table[..., 2 + axis], table[..., 4 + axis] = ends, bend
    return table


@functools.cache
def _grid(count: int, cells: int) -> tuple[Floats, Floats, Floats]:
    """Slope angles at ends and middles of cells, Chebyshev polynomials there, and their derivatives at the ends."""
    z = np.linspace(0.0, 1.0, 2 * cells + 1)
    slopes = chebyshev.evaluate(chebyshev.derivative(np.eye(count)), z[::2, None]).T
    return 2.0 * _UPRIGHT * (z - 0.5), chebyshev.basis(count, z), slopes / (2.0 * _UPRIGHT)


def _between(left: Floats, right: Floats, t: Floats) -> tuple[Floats, Floats, Floats, Floats]:
    """x, y and their rates at a share t of a cell, by polynomials of fifth degree between its ends."""
    (x, x_rate), (y, y_rate) = (_value_and_rate(_polynomial(left[..., k::2], right[..., k::2]), t) for k in range(2))
    return x, y, x_rate, y_rate


def _polynomial(left: Floats, right: Floats) -> tuple[Floats, ...]:
    """Six coefficients, (...), from value, rate and bend at the ends, (..., 3)."""
    start, rate, bend = np.moveaxis(left, -1, 0)
    rise = right[..., 0] - start - rate - 0.5 * bend
    rate_rise = right[..., 1] - rate - bend
    bend_rise = right[..., 2] - bend
    c = 10.0 * rise - 4.0 * rate_rise + 0.5 * bend_rise
    d = -15.0 * rise + 7.0 * rate_rise - bend_rise
    e = 6.0 * rise - 3.0 * rate_rise + 0.5 * bend_rise
    return start, rate, 0.5 * bend, c, d, e


def _value_and_rate(terms: Iterable[Floats], t: Floats) -> tuple[Floats, Floats]:
    start, rate, half_bend, c, d, e = terms
    value = start + t * (rate + t * (half_bend + t * (c + t * (d + t * e))))
    return value, rate + t * (2.0 * half_bend + t * (3.0 * c + t * (4.0 * d + t * 5.0 * e)))
