"""Contours from measured points, which are first tested for bends of the wrong sign, and for two bands."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import factorial
from typing import Literal, NamedTuple

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import ArrayLike
from scipy.interpolate import BSpline, PPoly
from scipy.linalg import null_space
from scipy.optimize import minimize_scalar, nnls
from scipy.special import stdtrit
from threadpoolctl import threadpool_limits

from tactile_bayes.arrays import Floats
from tactile_bayes.checks import check_kind, check_numbers
from tactile_bayes.contours.base import Graph, Parameter, Single, as_parameter
from tactile_bayes.errors import ContourError

_FEWEST = 6  # least number of different x: four for a cubic, and two for the scatter
_MOST_PIECES = 100

_FLOOR = 1e-3  # least curvature of a fit, as a share of the points' mean curvature
_TINY = np.finfo(float).tiny
_STRAIGHT = "; a contour must be curved: measure a longer stretch or more points, of the lower boundary only"
FALSE_ALARM = 1e-3  # probability that the points of a convex contour are refused
_LEAST_BEND = 3.0  # least upward bend of all points together, in standard errors
# Number of neighbouring points that are tested for two bands, and the least number of all points.
_NEIGHBOURS, _FEWEST_BANDED = 8, 20


@dataclass(frozen=True, eq=False, repr=False)
class MeasuredContour(Graph, Single):
    """A strictly convex contour through measured points; see `from_points`.

    Attributes
    ----------
    x, y : ndarray, shape (n,)
        The given points [length].
    scatter : float or ndarray, shape (n,)
        Standard deviation of the heights, given or estimated [length].
    residual_rms : float
        Root mean square of the vertical distances of the points from the contour [length].
    graph : PPoly
        g, a polynomial of degree four between its breakpoints, with three continuous derivatives.

    Examples
    --------
    >>> x = np.linspace(-1.0, 1.0, 9)
    >>> from_points(x, 0.5 * x**2 + 0.3).residual_rms < 1e-6
    True
    """

    x: Floats
    y: Floats
    scatter: Parameter
    residual_rms: float
    graph: PPoly

    def __post_init__(self) -> None:
        check_kind("graph", self.graph, PPoly, "give a PPoly of SciPy, or take from_points")
        for name in ("x", "y", "scatter", "residual_rms"):
            check_numbers(name, getattr(self, name))

    @property
    def domain(self) -> tuple[Floats, Floats]:
        return np.asarray(self.graph.x[0]), np.asarray(self.graph.x[-1])

    def end_name(self, side: Literal["left", "right"]) -> str:
        return "the first point measured" if side == "left" else "the last point measured"

    def derivatives(self, x: Floats) -> tuple[Floats, Floats, Floats]:
        g, slope, bend = (np.asarray(self.graph(x, order)) for order in range(3))
        return g, slope, bend

    def __repr__(self) -> str:
        lo, hi = self.domain
        return (
            f"from_points({self.x.size} points, x from {lo:.6g} to {hi:.6g}, "
            f"scatter {np.median(self.scatter):.3g}, residual_rms {self.residual_rms:.3g})"
        )


def from_points(x: ArrayLike, y: ArrayLike, *, scatter: ArrayLike | None = None) -> MeasuredContour:
    """Fit a strictly convex, smooth contour to measured points of an object's lower boundary.

    Its curvature g'' is a quadratic spline, so that the radius of curvature and its slope are continuous. It minimises
    the squares of the residuals, over scatter², plus a weight times ∫ g⁗² dx, with g'' nowhere below 1/1000 of the
    points' mean curvature. The weight, and the scatter if it is not given, maximise the restricted likelihood for white
    noise g⁗ (the smoothing spline's prior; Wahba, Ann. Statist. 13, 1985, p. 1378).

    First, every stretch of neighbouring points, short and long, is tested for a bend of the wrong sign: the quadratic
    term of a parabola fitted to it is compared with its standard error. Points of a convex contour with Gaussian
    scatter are refused at most once in 1000 times.

    Parameters
    ----------
    x, y : array_like, shape (n,)
        The points [length], in any order; the x may repeat. At least six x must differ; they are taken as exact.
    scatter : array_like, shape () or (n,), optional
        Standard deviation of the heights y [length], of all or of each, independent from point to point; give a larger
        one where neighbouring errors are correlated, as in a filtered profile. A scatter σ normal to a contour of slope
        angle α is one of σ/cos α in height. By default one is estimated: a dent of few points counts as scatter.

    Returns
    -------
    MeasuredContour
        The contour on [min x, max x].

    Raises
    ------
    ContourError
        If the points are not convex within their scatter (the message names the stretch), form a closed outline, are
        upside down, as good as a line, too few or not finite, or a scatter is not positive.

    Examples
    --------
    >>> import numpy as np
    >>> from tactile_bayes.contours import from_points
    >>> x = np.linspace(-0.8, 0.8, 60)
    >>> measured = 0.3 + 0.5 * x**2 + 0.002 * np.random.default_rng(1).standard_normal(60)
    >>> contour = from_points(x, measured)
    >>> contour
    from_points(60 points, x from -0.8 to 0.8, scatter 0.00177, residual_rms 0.00171)
    >>> contour.height([-0.5, 0.0, 0.5]).round(3)
    array([0.425, 0.3  , 0.425])
    """
    x, y, given = _checked(x, y, scatter)
    refuse_two_bands(x, y)
    lo, hi = x.min(), x.max()
    middle, half = 0.5 * (lo + hi), 0.5 * (hi - lo)
    u = (x - middle) / half
    level, tilt = np.polynomial.Polynomial.fit(u, y, 1, domain=[-1.0, 1.0]).coef
    off_line = y - (level + tilt * u)
    rounding = 8.0 * np.finfo(float).eps * (np.abs(y).max() + abs(tilt / half) * np.abs(x).max())
    size = float(np.std(off_line))
    if size <= rounding:
        raise ContourError(f"from_points: the points are on a straight line{_STRAIGHT}")

    with threadpool_limits(1):  # the matrices are small: threads would wait for one another
        noise = np.ones_like(y) if given is None else np.broadcast_to(np.hypot(given, rounding) / size, y.shape)
        problem = _Smoothing.of(u, off_line / size, noise)
        estimate = problem.weigh(None)
        if given is None:
            weight, unit, freedom = estimate.weight, max(estimate.noise, rounding / size), estimate.freedom
            remark = f"the scatter, estimated from the points, is {size * unit:.3g}"
        else:
            weight, unit, freedom = problem.weigh(1.0).weight, 1.0, np.inf
            remark = f"the points by themselves suggest {estimate.noise:.2g} times the scatter given"
        bends = Bends.of(u, off_line, size * unit * noise)
        refuse_unless_convex(bends, freedom, lambda at: float(middle + half * at), remark)
        offset, curvature = problem.solve(weight, _FLOOR * bends.mean_curvature / size)

    bent = BSpline(problem.knots, curvature, 2).antiderivative(2)
    breaks = np.unique(problem.knots)
    powers = [size * bent(breaks[:-1], n) / factorial(n) for n in range(5)]
    powers[0] += level + size * offset[0] + (tilt + size * offset[1]) * breaks[:-1]
    powers[1] += tilt + size * offset[1]
    ends = np.concatenate([[lo], middle + half * breaks[1:-1], [hi]])
    graph = PPoly(np.array([power * half**-n for n, power in enumerate(powers)])[::-1], ends)
    residual_rms = float(np.sqrt(np.mean((y - graph(x)) ** 2)))
    used: Parameter = size * unit if given is None else float(given) if given.ndim == 0 else given
    return MeasuredContour(x, y, used, residual_rms, graph)


class _Weighing(NamedTuple):
    weight: float  # weight of the roughness
    noise: float  # factor on the noise
    freedom: float  # degrees of freedom of the estimate of this factor


class _Smoothing(NamedTuple):
    """Least squares for a line (level, slope) and the B-splines of g'', reduced to a triangular system."""

    knots: Floats
    design: Floats
    target: Floats
    rest: float  # residual sum of squares of the unpenalised fit
    points: int
    roughness: Floats  # Matrix R with |R c|² = ∫ g⁗² du for coefficients c

    @classmethod
    def of(cls, u: Floats, heights: Floats, noise: Floats) -> _Smoothing:
        distinct = np.unique(u)
        pieces = int(np.clip((distinct.size - 1) // 2, 3, _MOST_PIECES))
        share = np.linspace(0.0, 1.0, pieces + 1)
        # Short pieces where points are dense, but none so short that rounding would spoil the derivatives.
        breaks = 0.75 * np.quantile(distinct, share) + 0.25 * (2.0 * share - 1.0)
        knots = np.pad(breaks, 2, mode="edge")
        bases = BSpline(knots, np.eye(pieces + 2), 2)
        columns = np.column_stack([np.ones_like(u), u, bases.antiderivative(2)(u), heights])
        triangle = _triangle(columns / noise[:, None])
        design, target, rest = triangle[: pieces + 4, :-1], triangle[: pieces + 4, -1], triangle[pieces + 4 :, -1]
        fourth = bases(0.5 * (breaks[1:] + breaks[:-1]), 2) * np.sqrt(np.diff(breaks))[:, None]
        return cls(knots, design, target, float(np.sum(rest**2)), u.size, np.pad(fourth, ((0, 0), (2, 0))))

    def weigh(self, noise: float | None) -> _Weighing:
        """Find the weight, and the noise if it is None, of greatest restricted likelihood."""
        smooth = null_space(self.roughness)  # cubics, which cost nothing
        beyond = np.linalg.qr(self.design @ smooth, mode="complete")[0][:, smooth.shape[1] :]
        modes, gain, _ = np.linalg.svd(beyond.T @ self.design @ np.linalg.pinv(self.roughness))
        gain2 = np.zeros(modes.shape[0])
        gain2[: gain.size] = gain**2
        power = (self.target @ beyond @ modes) ** 2
        count = self.points - smooth.shape[1]

        def squares(log_weight: float) -> float:
            return float(np.sum(power / (1.0 + gain2 * np.exp(-log_weight)))) + self.rest + _TINY

        def misfit(log_weight: float) -> float:
            fit = squares(log_weight)
            of_noise = fit / noise**2 if noise else count * np.log(fit)
            return float(np.sum(np.log1p(gain2 * np.exp(-log_weight)))) + of_noise

        tried = np.log(gain2.max()) + np.linspace(-40.0, 10.0, 101)
        best = int(np.argmin([misfit(log_weight) for log_weight in tried]))
        bracket = tried[max(best - 1, 0)], tried[min(best + 1, tried.size - 1)]
        log_weight = float(minimize_scalar(misfit, bounds=bracket, method="bounded", options={"xatol": 1e-6}).x)
        weight = np.exp(log_weight)
        return _Weighing(weight, np.sqrt(squares(log_weight) / count), count - float(np.sum(gain2 / (gain2 + weight))))

    def solve(self, weight: float, floor: float) -> tuple[Floats, Floats]:
        """Find the line and the coefficients of g'', none of which is below the floor."""
        stacked = np.vstack([self.design, np.sqrt(weight) * self.roughness])
        target = np.pad(self.target, (0, self.roughness.shape[0])) - floor * stacked[:, 2:].sum(axis=1)
        triangle = _triangle(np.column_stack([stacked, target]))
        above, _ = nnls(triangle[2:, 2:-1], triangle[2:, -1], maxiter=50 * stacked.shape[1])
        offset = np.linalg.solve(triangle[:2, :2], triangle[:2, -1] - triangle[:2, 2:-1] @ above)
        return np.asarray(offset, dtype=float), above + floor


def _triangle(columns: Floats) -> Floats:
    return np.asarray(np.linalg.qr(columns, mode="r"))


def _checked(x: ArrayLike, y: ArrayLike, scatter: ArrayLike | None) -> tuple[Floats, Floats, Floats | None]:
    """Return read-only copies of the points, or refuse them."""
    columns = {"x": x, "y": y} if scatter is None else {"x": x, "y": y, "scatter": scatter}
    checked: dict[str, Floats] = {}
    for name, given in columns.items():
        values = np.asarray(as_parameter("from_points", name, given))
        values.flags.writeable = False
        if values.ndim != 1 and not (name == "scatter" and values.ndim == 0):
            raise ContourError(f"from_points: {name} has shape {values.shape}: it must be a list of numbers")
        if values.ndim == 1 and values.size != checked.get("x", values).size:
            raise ContourError(f"from_points: x has {checked['x'].size} numbers, {name} has {values.size}")
        good = np.isfinite(values) & ((values > 0.0) | (name != "scatter"))
        if not np.all(good):
            at = int(np.argmin(np.atleast_1d(good)))
            where = f"{name}[{at}]" if values.ndim else name
            rule = "a scatter must be positive and finite" if name == "scatter" else "leave such points out"
            raise ContourError(f"from_points: {where} is {np.atleast_1d(values)[at]}: {rule}")
        checked[name] = values
    distinct = np.unique(checked["x"]).size
    if distinct < _FEWEST:
        raise ContourError(f"from_points: the points have {distinct} different x: at least {_FEWEST} are needed")
    return checked["x"], checked["y"], checked.get("scatter")


class Bends(NamedTuple):
    """Parabolas fitted to stretches of neighbouring points, the last of all points, by the product with a parabola of
    signs + − + that is orthogonal to lines. Heights of a convex contour, less the line through them at its sign
    changes, have the signs + − + too, so that their product is never negative."""

    first: Floats
    last: Floats
    size: Floats  # coefficients of the squares
    errors: Floats  # coefficients in standard errors

    @property
    def mean_curvature(self) -> float:
        return 2.0 * float(self.size[-1])

    @classmethod
    def of(cls, u: Floats, heights: Floats, noise: Floats) -> Bends:
        u, at = np.unique(u, return_inverse=True)
        weight = np.bincount(at, noise**-2.0)
        heights = np.bincount(at, heights * noise**-2.0) / weight
        found = []
        length = 3
        while True:
            length = min(length, u.size)
            starts = np.arange(0, u.size - length + 1, max(1, length // 8))
            starts = np.union1d(starts, u.size - length)
            x, y, w = (np.asarray(sliding_window_view(c, length)[starts], float) for c in (u, heights, weight))
            offset = x - _mean(x, w)
            spread = _mean(offset**2, w)
            square = offset**2 - spread - _mean(offset**3, w) / spread * offset
            y = y - _mean(y, w)
            y = y - _mean(offset * y, w) / spread * offset
            norm = np.sum(w * square**2, axis=1)
            product = np.sum(w * square * y, axis=1)
            found.append((x[:, 0], x[:, -1], product / norm, product / np.sqrt(norm)))
            if length == u.size:
                return cls(*(np.concatenate(column) for column in zip(*found, strict=True)))
            length = int(np.ceil(1.35 * length))


def _mean(values: Floats, weight: Floats) -> Floats:
    return np.asarray(np.sum(weight * values, axis=1, keepdims=True) / np.sum(weight, axis=1, keepdims=True))


def refuse_unless_convex(bends: Bends, freedom: float, place: Callable[[float], float], remark: str) -> None:
    limit = -float(stdtrit(freedom, FALSE_ALARM / bends.errors.size))
    worst = int(np.argmin(bends.errors))
    if bends.errors[-1] < -limit and bends.errors.max() < limit:
        raise ContourError(
            "from_points: the points are upside down: they bend downward. The contour is the lower boundary of an "
            "object that lies above the pivot; if it was measured from above, mirror y"
        )
    if bends.errors[worst] < -limit:
        first, last = bends.first[worst], bends.last[worst]
        off_chord = -bends.size[worst] * (0.5 * (last - first)) ** 2
        raise ContourError(
            f"from_points: the points are not convex from x = {place(first):.6g} to {place(last):.6g}: there they bend "
            f"downward by {-bends.errors[worst]:.1f} standard errors ({limit:.1f} pass as chance), and stand off a "
            f"chord by {off_chord:.3g} ({remark}). Leave this stretch out, or give a larger scatter; an object "
            "with a dent cannot be modelled"
        )
    if bends.errors[-1] < _LEAST_BEND:
        raise ContourError(
            f"from_points: the points cannot be distinguished from a straight line: as a whole they bend upward by "
            f"{bends.errors[-1]:.1f} standard errors, and {_LEAST_BEND:g} are needed ({remark}){_STRAIGHT}"
        )


def refuse_two_bands(x: Floats, y: Floats) -> None:
    """Refuse points with two heights at about the same x, like those of a closed outline. The heights of eight
    neighbours are parted at their widest gap. If upper and lower ones alternate, with a gap twice as wide as either
    part, in more than a third of all groups, it is an outline; of those that scatter, 1 in 150 does."""
    if x.size < _FEWEST_BANDED:
        return
    _, place = np.unique(x, return_inverse=True)
    order = np.lexsort((np.where(place % 2, -y, y), x))  # where an x repeats, with as few turns as possible
    groups = sliding_window_view(y[order], _NEIGHBOURS)
    heights = np.sort(groups, axis=1)
    last = 1 + np.argmax(np.diff(heights, axis=1)[:, 1:-1], axis=1)  # at least two in either part
    group = np.arange(len(groups))
    below, above = heights[group, last], heights[group, last + 1]
    spans = np.maximum(below - heights[:, 0], heights[:, -1] - above)
    turns = np.count_nonzero(np.diff(groups > below[:, None], axis=1), axis=1)
    banded = (above - below > 2.0 * spans) & (turns > 2)
    if 3 * np.count_nonzero(banded) > banded.size:
        at = int(np.argmax(np.where(banded, above - below, -np.inf)))
        middle = float(np.round(x[order[at + _NEIGHBOURS // 2]], 12)) + 0.0
        raise ContourError(
            f"from_points: near x = {middle:.6g} there are points at y = {below[at]:.6g} and at y = {above[at]:.6g}, "
            "as on a closed outline: give the lower boundary only, the side that faces the pivot"
        )
