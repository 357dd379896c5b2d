"""Rest curvature of a rod from points traced along it while nothing touches it.

The rest curvature is a Chebyshev series in the arc length. With the pivot and the direction of the base it determines
the centreline, which is fitted to the points by least squares of their distances from it: the arc length at which a
point belongs to the rod is that of its foot. The number of terms is one more than the least on which, by the
Bayesian information criterion, the next do not improve strongly: the standard deviation of the curvature is then that
of its errors, which were 0.8 to 1.25 standard deviations in drawn rods, and up to three without the further term.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.polynomial import Chebyshev
from numpy.typing import ArrayLike
from scipy.integrate import cumulative_trapezoid
from scipy.stats import chi2

from tactile_bayes.arrays import Floats
from tactile_bayes.checks import check_numbers, check_positive
from tactile_bayes.errors import ParameterError
from tactile_bayes.numerics import chebyshev

__all__ = ["TracedRod", "traced_rod"]

_FEWEST = 8
"""Least number of points: three for an arc, and five for their scatter."""

_MOST_TERMS = 9

_STRONG = 10.0
"""Difference of the Bayesian information criterion that is very strong evidence (Kass and Raftery 1995, doi
10.1080/01621459.1995.10476572); for less no terms are added, since polynomials of high degree swing at the ends."""

_NODES = 48
"""Nodes at which slopes of the centreline are interpolated."""

_GROUPS = 10
"""Groups of neighbouring points, whose means must go one way."""

_THICKEST = 0.05
"""Largest scatter of the points, as a share of the length."""

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


def traced_rod(x: ArrayLike, y: ArrayLike, *, scatter: float | None = None) -> TracedRod:
    """Return the rest curvature of a rod from points traced along it, base first.

    Parameters
    ----------
    x, y : array_like, shape (n,)
        Points of the unloaded rod in order, from the base to the tip, at least 8 [any unit of length].
    scatter : float, optional
        Standard deviation of each coordinate, in that unit; estimated from the points by default.

    Returns
    -------
    TracedRod

    Raises
    ------
    ParameterError
        If the points are too few, not ordered, fold back, or scatter by more than a twentieth of the length.

    Examples
    --------
    >>> angle = np.linspace(0.0, 0.6, 30)
    >>> rod = traced_rod(50.0 * np.sin(angle), 50.0 * (1.0 - np.cos(angle)))
    >>> round(rod.length, 6), rod.rest_curvature(0.5).round(6)
    (30.0, np.float64(0.6))
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
    start = _start_of(points)
    scaled = (points - points[0]) / start.length
    fits = [_fitted(scaled, start, terms) for terms in range(1, min(_MOST_TERMS, points.shape[0] - 6) + 1)]
    criteria = np.array([fit.criterion for fit in fits])
    best = _enough(criteria)
    if fits[best].criterion == math.inf:
        raise ParameterError(
            "no smooth rod can be fitted to the points: give those of one rod in order, from the base to the tip"
        )
    # One more term, so that the standard deviation holds what is left out.
    fit = fits[best + 1 if best + 1 < len(fits) and fits[best + 1].criterion < math.inf else best]
    found = start.length * fit.scatter
    length = start.length * float(fit.feet[-1])
    if not found <= _THICKEST * length:
        raise ParameterError(
            f"the points are off the smoothest rod through them by {found:.3g} (root mean square), and the rod is "
            f"{length:.3g} long: trace one rod, its points in order"
        )
    used = found if scatter is None else scatter
    _refuse_backward(fit.feet, used / start.length)
    if scatter is not None and fit.freedom * (found / scatter) ** 2 > chi2.isf(_FALSE_ALARM, fit.freedom):
        raise ParameterError(
            f"the points are off a smooth rod by {found:.3g} (root mean square), and their scatter is given as "
            f"{scatter:.3g}: give a larger one, or None to estimate it"
        )
    share = float(fit.feet[-1])
    terms = fit.curvature.size
    # From lengths of the first guess to the rod's own, whose ends are known to the scatter along it.
    nodes = chebyshev.nodes(terms)
    own = share * chebyshev.coefficients(chebyshev.basis(terms, share * nodes))
    curvature = own @ fit.curvature
    value = chebyshev.evaluate(curvature, nodes)
    rate = chebyshev.evaluate(chebyshev.derivative(curvature), nodes) if terms > 1 else np.zeros(1)
    ends = chebyshev.coefficients(np.array([(1.0 - nodes) * rate - value, nodes * rate + value])) / share
    covariance = (used / start.length) ** 2 * (own @ fit.covariance @ own.T + ends @ ends.T)
    return TracedRod(length, used, curvature, covariance)


def _enough(criteria: Floats) -> int:
    """Index of the first fit on which neither of the next two improves strongly."""
    for best, criterion in enumerate(criteria):
        if criterion < math.inf and not np.any(criteria[best + 1 : best + 3] < criterion - _STRONG):
            return best
    return 0


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


class _Fit(NamedTuple):
    """A rod fitted to points, in lengths of the first guess."""

    curvature: Floats
    covariance: Floats
    """Covariance of its coefficients for a scatter of one."""
    feet: Floats
    scatter: float
    freedom: int
    criterion: float
    """Bayesian information criterion; infinite if the fit did not converge."""


def _fitted(points: Floats, start: _Start, terms: int) -> _Fit:
    """Gauss–Newton steps for the offset of the base from the first point, its direction, and the curvature."""
    guess = Chebyshev.fit(np.linspace(0.0, 1.0, start.slopes.size), start.slopes, terms, domain=[0.0, 1.0])
    unknown = np.concatenate([[0.0, guess(0.0)], guess.deriv().coef])
    feet = start.feet
    turns = chebyshev.integral(np.eye(terms))
    at_nodes = chebyshev.polynomials(terms + 1, chebyshev.nodes(_NODES)) @ turns
    for _ in range(_MOST_STEPS):
        offset, base, curvature = unknown[0], unknown[1], unknown[2:]
        slope = base + at_nodes @ curvature
        cos, sin = np.cos(slope), np.sin(slope)
        kinds = np.concatenate([[cos, sin], -sin * at_nodes.T, cos * at_nodes.T])
        ways = chebyshev.polynomials(_NODES + 1, feet) @ chebyshev.integral(chebyshev.coefficients(kinds))
        slope = base + chebyshev.polynomials(terms + 1, feet) @ turns @ curvature
        cos, sin = np.cos(slope), np.sin(slope)
        away = points - ways[:, :2] - offset * np.array([-np.sin(base), np.cos(base)])
        ahead, aside = away[:, 0] * cos + away[:, 1] * sin, away[:, 1] * cos - away[:, 0] * sin
        by = np.column_stack(
            [
                np.cos(slope - base),
                ways[:, 0] * cos + ways[:, 1] * sin + offset * np.sin(slope - base),
                ways[:, 2 + terms :] * cos[:, None] - ways[:, 2 : 2 + terms] * sin[:, None],
            ]
        )
        step = np.linalg.lstsq(by, aside)[0]
        unknown = unknown + step
        feet = np.clip(feet + ahead, -0.5, 1.5)
        settled = bool(max(np.abs(step).max(), np.abs(ahead).max()) < _SETTLED)
        if settled or not np.abs(unknown).max() < _WILD:
            break
    inverse = np.linalg.pinv(by)
    count, square = points.shape[0], float(np.sum(aside**2))
    freedom = count - unknown.size
    return _Fit(
        unknown[2:],
        (inverse @ inverse.T)[2:, 2:],
        feet - feet[0],
        math.sqrt(square / freedom),
        freedom,
        count * math.log(square / count + _ROUNDING**2) + unknown.size * math.log(count) if settled else math.inf,
    )
