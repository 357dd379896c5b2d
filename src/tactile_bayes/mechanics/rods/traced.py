"""Rest curvature of a rod from points traced along it while nothing touches it, and how far it may be from that.

The rest curvature is a vague level and trend in the arc length, and white noise that is integrated once, twice or three
times: how smooth it is, is unknown. With two integrals the posterior mean is a smoothing spline (Wahba 1978, doi
10.1111/j.2517-6161.1978.tb01050.x). With the pivot and the direction of the base the curvature determines the
centreline, from which the points have normally distributed distances; these are linearised at the posterior mean.
Number of integrals, strength of the noise and scatter of the points, unless it is given, are marginalised on a grid,
with priors that are broad in their logarithms.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.polynomial import Chebyshev
from numpy.polynomial.legendre import leggauss, legvander
from numpy.typing import ArrayLike
from scipy.integrate import cumulative_trapezoid
from scipy.special import chdtrc, chdtri

from tactile_bayes.arrays import Floats
from tactile_bayes.checks import check_numbers, check_positive
from tactile_bayes.errors import ParameterError
from tactile_bayes.numerics import chebyshev

_FEWEST = 8  # least number of points: four for a linear curvature, and four for their scatter
_FREE = 4  # unknowns without a prior: the offset of the base and its direction, level and trend of the curvature
_TERMS = 20  # terms of the curvature
_INTEGRALS = (1, 2, 3)  # numbers of integrals that make the curvature from white noise
# Root mean squares of what level and trend leave of the curvature [1/L], over the scatter [L].
_STRENGTHS = np.geomspace(1e-2, 1e18, 161)
# Middles of the priors of both: each is within a factor of ten with a probability of a half.
_USUAL_STRENGTH, _USUAL_SCATTER = 1.0, 1e-3
_QUANTILES = 9  # values of a scatter that is not given, for each strength
_FINE = 201  # points of the rod at which the curvature is measured
_NODES = 48  # nodes at which slopes of the centreline are interpolated
_GROUPS = 10  # groups of neighbouring points, whose means must go one way
_THICKEST = 0.05  # largest scatter of the points, as a share of the length
_THINNEST = 1e-12  # least scatter that is taken, as a share of the length
_MOST_BEYOND = 1.5  # largest length of a rod over that of its points
_BACKWARD = 6.0  # standard deviations by which a point may lie behind one before it: noise does so once in 1e5 times
_FALSE_ALARM = 1e-6  # probability that points with the scatter that is given are refused
_ROUNDING = 1e-12  # scatter over the length that is rounding
_BENT = 3  # degree of the polynomial beside which diameters are checked to fall linearly
_MOST_STEPS = 50

_WILD = 1e3  # unknowns beyond which a fit diverges
_SETTLED = 1e-8  # last step of the fit, in lengths and rad


@dataclass(frozen=True)
class TracedRod:
    """Rest curvature of a rod from traced points; see `traced_rod`."""

    length: float  # arc length from the first to the last point, in their unit
    scatter: float  # standard deviation of a coordinate of a point, given or estimated, in their unit
    coefficients: Floats  # Chebyshev coefficients of the rest curvature [1/L] on s from 0 to 1
    covariance: Floats  # their covariance
    feet: Floats  # arc lengths of the points from the first one, over the length

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

    def modes(self, count: int) -> Floats:
        """Coefficients of independent deviations of the rest curvature, each its standard deviation, shape (count, n).
        They are the principal components of the deflections ∫ (c − s) κ0 ds at points c: these are what a force there
        feels of the curvature, whose work is that of the moment that the force causes."""
        points, weights = leggauss(2 * self.coefficients.size)
        each = np.eye(self.coefficients.size)
        deflections = chebyshev.evaluate(chebyshev.integral(chebyshev.integral(each)), 0.5 * (points + 1.0)[:, None])
        sizes, axes = np.linalg.eigh(self.covariance)
        root = axes * np.sqrt(np.maximum(sizes, 0.0))
        *_, right = np.linalg.svd(np.sqrt(weights)[:, None] * (deflections @ root))
        modes = root @ right[:count].T
        return np.asarray(modes * np.where(chebyshev.integral(modes).sum(axis=0) < 0.0, -1.0, 1.0)).T


def traced_rod(x: ArrayLike, y: ArrayLike, *, scatter: float | None = None, length: float | None = None) -> TracedRod:
    """Return the rest curvature of a rod from points traced along it, base first; see `Rod.from_shape`. Beyond the last
    point, up to a given length, the curvature continues with its trend and a deviation that grows."""
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
    return TracedRod(fit.length, fit.length * used if scatter is None else scatter, fit.curvature, covariance, fit.feet)


class MeasuredCone(NamedTuple):
    """Diameter at the base and taper of a rod, from diameters measured along it."""

    diameter: float
    taper: float
    deviation: float  # standard deviation of the taper


def measured_cone(s: Floats, diameters: Floats) -> MeasuredCone:
    """Return the cone that diameters at arc lengths s, over the length, determine, with white noise of unknown size."""
    by = legvander(2.0 * s - 1.0, _BENT)
    spread, bent = np.linalg.inv(by.T @ by), np.linalg.lstsq(by, diameters)[0]
    freedom = s.size - by.shape[1]
    # The posterior is a t distribution, of this standard deviation over its scale.
    wider = math.sqrt(freedom / (freedom - 2.0))
    scatter = wider * math.sqrt(float(np.sum((diameters - by @ bent) ** 2)) / freedom)
    off = _BACKWARD * scatter * np.sqrt(np.diagonal(spread)[2:])
    if (np.abs(bent[2:]) > off + _ROUNDING * bent[0]).any():
        raise ParameterError(
            "the diameters do not fall linearly: give the diameter at the base, and a rigidity_profile, the fourth "
            "power of the diameter over that at the base"
        )
    middle, half = np.linalg.lstsq(by[:, :2], diameters)[0].tolist()
    base, end = middle - half, middle + half
    way = np.array([1.0 - end / base, 1.0 + end / base]) / base
    deviation = scatter * math.sqrt(float(way @ np.linalg.inv(by[:, :2].T @ by[:, :2]) @ way))
    taper = 1.0 - end / base
    return MeasuredCone(base, max(taper, 0.0) if taper > -_BACKWARD * deviation else taper, deviation)


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


def _start_of(points: Floats) -> tuple[float, Floats, Floats]:
    """First guess of the length, the arc lengths of the points over it, and slopes at points of equal distance [rad],
    from polynomials through the points by the length of the chain that they form."""
    chain = np.append(0.0, np.cumsum(np.hypot(*np.diff(points, axis=0).T)))
    chain /= chain[-1]
    x, y = (Chebyshev.fit(chain, column, 5, domain=[0.0, 1.0]).deriv() for column in points.T)
    z = np.linspace(0.0, 1.0, 201)
    arc = cumulative_trapezoid(np.hypot(x(z), y(z)), z, initial=0)
    slopes = np.unwrap(np.arctan2(y(z), x(z)))
    even = np.linspace(0.0, arc[-1], z.size)
    return float(arc[-1]), np.interp(chain, z, arc) / arc[-1], np.interp(even, arc, slopes)


class _Posterior(NamedTuple):
    """Offset and direction of the base, and curvature, with all else marginalised."""

    mean: Floats
    covariance: Floats
    weights: Floats  # posterior probabilities of strengths, for each number of integrals
    squares: Floats  # sums of squares that each leaves to the scatter
    freedom: int

    @property
    def scatter(self) -> float:
        """Estimated scatter."""
        return math.exp(0.5 * float(np.sum(self.weights * np.log(self.squares / self.freedom))))

    def probability_below(self, scatter: float) -> float:
        """Return the probability that the scatter is smaller than a value, if it was not given."""
        return float(np.sum(self.weights * chdtrc(self.freedom, self.squares / scatter**2)))


class _Known(NamedTuple):
    """What is known of the noise for each strength, over the scatter; in the directions that the points distinguish."""

    onto: Floats  # offset, direction and curvature by the noise in these directions
    means: Floats
    variances: Floats
    squares: Floats
    log_evidence: Floats


def _known(turned: Floats, noise: Floats, onto: Floats, freedom: int) -> _Known:
    """Return what points say of noise, from its effect on them, and `onto` what it determines."""
    left, sizes, right = np.linalg.svd(turned)
    seen, terms = left.T @ noise, turned.shape[1]
    sizes, along = (np.pad(of[:terms], (0, max(0, terms - freedom))) for of in (sizes, seen))
    narrowed = 1.0 + np.multiply.outer(_STRENGTHS, sizes) ** 2
    squares = max(float(np.sum(seen[terms:] ** 2)), freedom * _ROUNDING**2) + np.sum(along**2 / narrowed, axis=1)
    variances = _STRENGTHS[:, None] ** 2 / narrowed
    return _Known(onto @ right.T, variances * sizes * along, variances, squares, -0.5 * np.log(narrowed).sum(axis=1))


def _log_prior(values: Floats, usual: float) -> Floats:
    """Log-density of a positive number, by a Cauchy distribution of its decimal logarithm about that of a usual one."""
    return np.asarray(-np.log1p(np.log10(values / usual) ** 2))


def _posterior(by: Floats, target: Floats, kernels: Sequence[Floats], scatter: float | None) -> _Posterior:
    """Posterior of a linear model whose unknowns are free in the first ones, and beside them images of white noise."""
    freedom = by.shape[0] - _FREE
    turn, upper = np.linalg.qr(by[:, :_FREE], mode="complete")
    data, turned = turn.T @ target, [turn.T @ by @ kernel for kernel in kernels]
    free = np.eye(by.shape[1], _FREE) @ np.linalg.inv(upper[:_FREE])
    known = [
        _known(each[_FREE:], data[_FREE:], kernel - free @ each[:_FREE], freedom)
        for each, kernel in zip(turned, kernels, strict=True)
    ]
    squares = np.array([k.squares for k in known])[..., None]
    log_weights = np.array([k.log_evidence for k in known])[..., None]
    # Given the strength, a sum of squares over the square of the scatter has a chi-square distribution.
    shares = (np.arange(_QUANTILES) + 0.5) / _QUANTILES
    deviations = np.sqrt(squares / chdtri(freedom, shares)) if scatter is None else np.full_like(squares, scatter)
    fit = freedom * np.log(squares) if scatter is None else squares / scatter**2
    beside = _log_prior(deviations, _USUAL_SCATTER) if scatter is None else 0.0
    log_weights = log_weights - 0.5 * fit + beside + _log_prior(_STRENGTHS[:, None] * deviations, _USUAL_STRENGTH)
    weights = np.exp(log_weights - log_weights.max())
    weights /= weights.sum()
    variance, weights = (weights * deviations**2).sum(axis=-1), weights.sum(axis=-1)
    mean, covariance = free @ data[:_FREE], variance.sum() * (free @ free.T)
    parts = [k.onto @ (share @ k.means) for k, share in zip(known, weights, strict=True)]
    for k, share, spread in zip(known, weights, variance, strict=True):
        inner = (share[:, None] * k.means).T @ k.means + np.diag(spread @ k.variances)
        covariance += k.onto @ inner @ k.onto.T
    rough = np.sum(parts, axis=0)
    return _Posterior(mean + rough, covariance - np.outer(rough, rough), weights, squares[..., 0], freedom)


@functools.cache
def _kernels(terms: int) -> list[Floats]:
    """Offset, direction and Chebyshev coefficients of the curvature by white noise in orthonormal polynomials. What
    level and trend leave of the curvature has a root mean square of one."""
    fine = np.linspace(0.0, 1.0, _FINE)
    trend, found = np.vander(fine, 2), []
    for integrals in _INTEGRALS:
        nodes = chebyshev.nodes(terms - integrals)
        white = legvander(2.0 * nodes - 1.0, nodes.size - 1) * np.sqrt(2.0 * np.arange(nodes.size) + 1.0)
        curvature = chebyshev.coefficients(white.T)
        for _ in range(integrals):
            curvature = chebyshev.integral(curvature)
        values = chebyshev.polynomials(terms, fine) @ curvature
        rest = values - trend @ np.linalg.lstsq(trend, values)[0]
        found.append(np.pad(curvature, ((2, 0), (0, 0))) / math.sqrt(np.sum(rest**2) / _FINE))
    return found


class _Fit(NamedTuple):
    """A rod fitted to points, in its own lengths."""

    length: float
    feet: Floats
    curvature: Floats
    covariance: Floats
    posterior: _Posterior


def _fitted(given: Floats, scatter: float | None, whole: float | None = None) -> _Fit:
    """Gauss–Newton steps for the offset of the base from the first point, its direction, and the curvature. Without the
    length of the whole rod it ends at the last point."""
    own, feet, slopes = _start_of(given)
    length = own if whole is None else whole
    traced = own / length
    feet = traced * feet
    terms, nodes, kernels = _TERMS, chebyshev.nodes(_TERMS), _kernels(_TERMS)
    guess = Chebyshev.fit(np.linspace(0.0, traced, slopes.size), slopes, _FREE, domain=[0.0, 1.0])
    offset, base, curvature = 0.0, float(guess(0.0)), np.zeros(terms)
    curvature[:_FREE] = guess.deriv().coef
    turns = chebyshev.integral(np.eye(terms))
    at_nodes = chebyshev.polynomials(terms + 1, chebyshev.nodes(_NODES)) @ turns
    for _ in range(_MOST_STEPS):
        before = np.concatenate([[offset, base], curvature])
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
        found = _posterior(by, aside + by @ before, kernels, None if scatter is None else scatter / length)
        step = found.mean - before
        feet = np.clip(feet + ahead, -0.5, 1.5)
        settled = bool(max(np.abs(step).max(), np.abs(ahead).max()) < _SETTLED)
        # From lengths of the last guess to those of this one.
        share = float(feet[-1]) if whole is None else 1.0
        feet, length, offset, base = feet / share, length * share, (offset + step[0]) / share, base + step[1]
        curvature = share * chebyshev.coefficients(chebyshev.evaluate(curvature + step[2:], share * nodes))
        if settled:
            return _Fit(length, feet - feet[0], curvature, found.covariance[2:, 2:], found)
        if not np.abs(curvature).max() < _WILD:
            break
    raise ParameterError(
        "no smooth rod can be fitted to the points: give those of one rod in order, from the base to the tip"
    )
