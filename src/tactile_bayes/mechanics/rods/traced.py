"""Rest curvature of a rod from points traced along it while nothing touches it.

The prior of the rest curvature is an integrated Wiener process in the arc length, with a vague level and trend: its
second derivative is white noise, so that the posterior mean is a smoothing spline (Wahba 1978, doi
10.1111/j.2517-6161.1978.tb01050.x). With the pivot and the direction of the base the curvature determines the
centreline, from which the points have normally distributed distances; these are linearised at the posterior mean. How
smooth the curvature is follows from the strength of the noise. It is marginalised, as is the scatter of the points
unless it is given: the logarithm of their ratio is uniform, from where the noise no longer matters.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.polynomial import Chebyshev
from numpy.polynomial.legendre import legvander
from numpy.typing import ArrayLike
from scipy.integrate import cumulative_trapezoid
from scipy.special import chdtrc

from tactile_bayes.arrays import Floats
from tactile_bayes.checks import check_numbers, check_positive
from tactile_bayes.errors import ParameterError
from tactile_bayes.numerics import chebyshev

__all__ = ["TracedRod", "traced_rod"]

_FEWEST = 8
"""Least number of points: four for a linear curvature, and four for their scatter."""

_FREE = 4
"""Unknowns without a prior: the offset of the base and its direction, level and trend of the curvature."""

_TERMS = 20
"""Terms of the curvature, if there are points enough to estimate their scatter beside so many."""

_STRENGTHS = np.geomspace(0.1, 1e17, 400)
"""Strengths of the noise over that which moves points by a root mean square of their scatter."""

_NODES = 48
"""Nodes at which slopes of the centreline are interpolated."""

_GROUPS = 10
"""Groups of neighbouring points, whose means must go one way."""

_THICKEST = 0.05
"""Largest scatter of the points, as a share of the length."""

_THINNEST = 1e-12
"""Least scatter that is taken, as a share of the length."""

_MOST_BEYOND = 1.5
"""Largest length of a rod over that of its points."""

_BACKWARD = 6.0
"""Standard deviations by which a point may lie behind one before it: noise does so once in 1e5 times."""

_FALSE_ALARM = 1e-6
"""Probability that points with the scatter that is given are refused."""

_ROUNDING = 1e-12
"""Scatter over the length that is rounding."""

_MOST_STEPS = 50

_WILD = 1e3
"""Unknowns beyond which a fit diverges."""

_SETTLED = 1e-8
"""Last step of the fit, in lengths and rad."""


@dataclass(frozen=True)
class TracedRod:
    """Rest curvature of a rod from traced points; see `traced_rod`."""

    length: float
    """Arc length from the first to the last point, in their unit."""
    scatter: float
    """Standard deviation of a coordinate of a point, given or estimated, in their unit."""
    coefficients: Floats
    """Chebyshev coefficients of the rest curvature [1/L] on s from 0 to 1."""
    covariance: Floats
    """Their covariance."""

    def rest_curvature(self, s: ArrayLike) -> Floats:
        """Rest curvature [1/L] at arc lengths s from 0, the base, to 1, the tip."""
        return chebyshev.evaluate(self.coefficients, np.asarray(s, dtype=float))

    def deviation(self, s: ArrayLike) -> Floats:
        """Standard deviation of the rest curvature [1/L]."""
        at = chebyshev.polynomials(self.coefficients.size, np.asarray(s, dtype=float))
        return np.asarray(np.sqrt(np.einsum("...i,ij,...j", at, self.covariance, at)))

    @property
    def deviation_of_mean(self) -> float:
        """Standard deviation of the mean rest curvature [1/L]."""
        mean = chebyshev.integral(np.eye(self.coefficients.size)).sum(axis=0)
        return float(np.sqrt(mean @ self.covariance @ mean))


def traced_rod(x: ArrayLike, y: ArrayLike, *, scatter: float | None = None, length: float | None = None) -> TracedRod:
    """Return the rest curvature of a rod from points traced along it, base first; see `Rod.from_shape`.

    Beyond the last point, up to a given length, the curvature continues with its trend and a deviation that grows.
    """
    columns = [check_numbers(name, values, shape=(None,)) for name, values in (("x", x), ("y", y))]
    if columns[0].size != columns[1].size or columns[0].size < _FEWEST:
        raise ParameterError(
            f"x and y have {columns[0].size} and {columns[1].size} values: give as many of both, at least {_FEWEST}"
        )
    if scatter is not None:
        scatter = check_positive("scatter", scatter, "give a positive number, in the unit of x and y, or None")
    points = np.stack(columns, axis=1)
    _refuse_turns(points)
    if length is not None:
        length = check_positive("length", length, "give a positive number, in the unit of x and y, or None")
    fit = _fitted(points, None)
    if length is not None:
        _refuse_length(length, fit)
        fit = _fitted(points, None, length)
    found = fit.length * fit.posterior.scatter
    if not found <= _THICKEST * fit.length:
        raise ParameterError(
            f"the points are off the smoothest rod through them by {found:.3g} (root mean square), and the rod is "
            f"{fit.length:.3g} long: trace one rod, its points in order"
        )
    if scatter is not None:
        if not _THINNEST * fit.length <= scatter <= _THICKEST * fit.length:
            raise ParameterError(
                f"scatter is {scatter:.3g}, and the rod is {fit.length:.3g} long: give at most a twentieth of that, "
                "and more than rounding, in the unit of x and y"
            )
        if fit.posterior.probability_below(scatter / fit.length) < _FALSE_ALARM:
            raise ParameterError(
                f"the points are off a smooth rod by {found:.3g} (root mean square), and their scatter is given as "
                f"{scatter:.3g}: give a larger one, or None to estimate it"
            )
        fit = _fitted(points, scatter, length)
    used = fit.posterior.scatter if scatter is None else scatter / fit.length
    _refuse_backward(fit.feet, used)
    # The ends, unless the length is given, are known to the scatter along the rod.
    nodes = chebyshev.nodes(fit.curvature.size)
    value = chebyshev.evaluate(fit.curvature, nodes)
    rate = chebyshev.evaluate(chebyshev.derivative(fit.curvature), nodes)
    ends = chebyshev.coefficients(np.array([(1.0 - nodes) * rate - value, nodes * rate + value]))
    if length is not None:
        ends = ends[:, :1]
    covariance = fit.covariance + used**2 * (ends @ ends.T)
    return TracedRod(fit.length, fit.length * used if scatter is None else scatter, fit.curvature, covariance)


def _refuse_length(length: float, fit: _Fit) -> None:
    traced, scatter = fit.length, fit.length * fit.posterior.scatter
    if not traced - _BACKWARD * scatter - _SETTLED * traced <= length <= _MOST_BEYOND * traced:
        raise ParameterError(
            f"length is {length:.6g}, and the points are {traced:.6g} long: give the length of the whole rod from the "
            f"first point on, at most {_MOST_BEYOND:g} times as long as the points, or None if they end at its tip"
        )


def _refuse_turns(points: Floats) -> None:
    """Refuse points that do not go one way, as means of neighbours do that scatter only."""
    groups = np.array_split(np.arange(points.shape[0]), min(_GROUPS, points.shape[0] // 2))
    steps = np.diff([points[group].mean(axis=0) for group in groups], axis=0)
    backward = np.flatnonzero(~(np.sum(steps[1:] * steps[:-1], axis=1) > 0.0))
    if backward.size:
        first, last = groups[backward[0]][0], groups[backward[0] + 2][-1]
        raise ParameterError(
            f"the points turn back between x[{first}], y[{first}] and x[{last}], y[{last}]: give those of one rod in "
            "order, from the base to the tip"
        )


def _refuse_backward(feet: Floats, scatter: float) -> None:
    behind = feet < np.maximum.accumulate(feet) - _BACKWARD * np.sqrt(2.0) * scatter - _SETTLED
    if behind.any():
        at = int(np.argmax(behind))
        raise ParameterError(
            f"the point x[{at}], y[{at}] lies behind one before it by more than the scatter: order the points from the "
            "base to the tip"
        )


class _Start(NamedTuple):
    """A first guess."""

    length: float
    feet: Floats
    """Arc lengths of the points, over the length."""
    slopes: Floats
    """Slopes of the rod at points of equal distance [rad]."""


def _start_of(points: Floats) -> _Start:
    """Polynomials through the points by the length of the chain that they form."""
    chain = np.append(0.0, np.cumsum(np.hypot(*np.diff(points, axis=0).T)))
    chain /= chain[-1]
    x, y = (Chebyshev.fit(chain, column, 5, domain=[0.0, 1.0]).deriv() for column in points.T)
    z = np.linspace(0.0, 1.0, 201)
    arc = cumulative_trapezoid(np.hypot(x(z), y(z)), z, initial=0)
    slopes = np.unwrap(np.arctan2(y(z), x(z)))
    even = np.linspace(0.0, arc[-1], z.size)
    return _Start(float(arc[-1]), np.interp(chain, z, arc) / arc[-1], np.interp(even, arc, slopes))


class _Posterior(NamedTuple):
    """Unknowns of a linear model, with the strength of the noise marginalised."""

    mean: Floats
    covariance: Floats
    weights: Floats
    """Posterior probabilities of `_STRENGTHS`."""
    squares: Floats
    """Sums of squares that each leaves to the scatter."""
    freedom: int

    @property
    def scatter(self) -> float:
        """Estimated scatter."""
        return math.sqrt(float(self.weights @ self.squares) / self.freedom)

    def probability_below(self, scatter: float) -> float:
        """Return the probability that the scatter is smaller than a value, if it was not given."""
        return float(self.weights @ chdtrc(self.freedom, self.squares / scatter**2))


def _posterior(by: Floats, target: Floats, scatter: float | None) -> _Posterior:
    """Posterior of a linear model, whose first unknowns are free and whose others are white noise."""
    count, terms = by.shape[0], by.shape[1] - _FREE
    freedom = count - _FREE
    turn, upper = np.linalg.qr(by[:, :_FREE], mode="complete")
    rotated, data = turn.T @ by[:, _FREE:], turn.T @ target
    left, sizes, right = np.linalg.svd(rotated[_FREE:])
    seen = left.T @ data[_FREE:]
    sizes, along = (np.pad(of[:terms], (0, max(0, terms - freedom))) for of in (sizes, seen))
    rest = max(float(np.sum(seen[terms:] ** 2)), freedom * _ROUNDING**2)
    strengths = _STRENGTHS[:, None] / sizes[0]
    variances = 1.0 + (strengths * sizes) ** 2
    squares = rest + np.sum(along**2 / variances, axis=1)
    fit = freedom * np.log(squares) if scatter is None else squares / scatter**2
    evidence = -0.5 * (fit + np.log(variances).sum(axis=1))
    weights = np.exp(evidence - evidence.max())
    weights /= weights.sum()
    variance = squares / (freedom - 2) if scatter is None else np.full_like(squares, scatter**2)
    means = strengths**2 * sizes / variances * along
    mean = weights @ means
    inner = (weights[:, None] * (means - mean)).T @ (means - mean)
    inner += np.diag((weights * variance) @ (strengths**2 / variances))
    inverse = np.linalg.inv(upper[:_FREE])
    onto = np.concatenate([-inverse @ rotated[:_FREE], np.eye(terms)]) @ right.T
    free = np.concatenate([inverse, np.zeros((terms, _FREE))])
    covariance = onto @ inner @ onto.T + weights @ variance * (free @ free.T)
    return _Posterior(free @ data[:_FREE] + onto @ mean, covariance, weights, squares, freedom)


def _smooth(terms: int) -> Floats:
    """Chebyshev coefficients of the level, the trend, and the double integrals of orthonormal polynomials."""
    nodes = chebyshev.nodes(terms - 2)
    white = legvander(2.0 * nodes - 1.0, terms - 3) * np.sqrt(2.0 * np.arange(terms - 2) + 1.0)
    rough = chebyshev.integral(chebyshev.integral(chebyshev.coefficients(white.T)))
    return np.concatenate([np.eye(terms)[:, :2], rough], axis=1)


class _Fit(NamedTuple):
    """A rod fitted to points, in its own lengths."""

    length: float
    feet: Floats
    curvature: Floats
    covariance: Floats
    posterior: _Posterior


def _fitted(given: Floats, scatter: float | None, whole: float | None = None) -> _Fit:
    """Gauss–Newton steps for the offset of the base from the first point, its direction, and the curvature.

    Without the length of the whole rod it ends at the last point.
    """
    start = _start_of(given)
    length = start.length if whole is None else whole
    traced = start.length / length
    feet = traced * start.feet
    terms = min(_TERMS, given.shape[0] - _FREE) if scatter is None else _TERMS
    smooth, nodes = _smooth(terms), chebyshev.nodes(terms)
    guess = Chebyshev.fit(np.linspace(0.0, traced, start.slopes.size), start.slopes, _FREE, domain=[0.0, 1.0])
    offset, base, curvature = 0.0, float(guess(0.0)), np.zeros(terms)
    curvature[:_FREE] = guess.deriv().coef
    turns = chebyshev.integral(smooth)
    at_nodes = chebyshev.polynomials(terms + 1, chebyshev.nodes(_NODES)) @ turns
    for _ in range(_MOST_STEPS):
        before = np.concatenate([[offset, base], np.linalg.solve(smooth, curvature)])
        slope = base + at_nodes @ before[2:]
        cos, sin = np.cos(slope), np.sin(slope)
        kinds = np.concatenate([[cos, sin], -sin * at_nodes.T, cos * at_nodes.T])
        ways = chebyshev.polynomials(_NODES + 1, feet) @ chebyshev.integral(chebyshev.coefficients(kinds))
        slope = base + chebyshev.polynomials(terms + 1, feet) @ turns @ before[2:]
        cos, sin = np.cos(slope), np.sin(slope)
        away = (given - given[0]) / length - ways[:, :2] - offset * np.array([-np.sin(base), np.cos(base)])
        ahead, aside = away[:, 0] * cos + away[:, 1] * sin, away[:, 1] * cos - away[:, 0] * sin
        by = np.column_stack(
            [
                np.cos(slope - base),
                ways[:, 0] * cos + ways[:, 1] * sin + offset * np.sin(slope - base),
                ways[:, 2 + terms :] * cos[:, None] - ways[:, 2 : 2 + terms] * sin[:, None],
            ]
        )
        found = _posterior(by, aside + by @ before, None if scatter is None else scatter / length)
        step = found.mean - before
        step[2:], feet = smooth @ step[2:], np.clip(feet + ahead, -0.5, 1.5)
        settled = bool(max(np.abs(step).max(), np.abs(ahead).max()) < _SETTLED)
        # From lengths of the last guess to those of this one.
        share = float(feet[-1]) if whole is None else 1.0
        feet, length, offset, base = feet / share, length * share, (offset + step[0]) / share, base + step[1]
        curvature = share * chebyshev.coefficients(chebyshev.evaluate(curvature + step[2:], share * nodes))
        if settled:
            return _Fit(length, feet - feet[0], curvature, smooth @ found.covariance[2:, 2:] @ smooth.T, found)
        if not np.abs(curvature).max() < _WILD:
            break
    raise ParameterError(
        "no smooth rod can be fitted to the points: give those of one rod in order, from the base to the tip"
    )
