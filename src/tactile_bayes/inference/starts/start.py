"""Start of the walkers: a robust least-squares optimum, and the distribution of starting points around it."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace
from typing import Any, NamedTuple, cast

import numpy as np

from tactile_bayes.arrays import Floats
from tactile_bayes.inference.deadline import NEVER, Deadline
from tactile_bayes.inference.ensembles.proposal import ANYTHING, Ends
from tactile_bayes.numerics.differences import central_slopes

__all__ = ["Cloud", "Optimum", "descend", "gather", "optima"]

Residuals = Callable[[Floats], Floats]

_HUBER_THRESHOLD = 2.0
"""Residual, in standard deviations, beyond which the loss grows linearly, in the final search."""

_THRESHOLD_FACTOR = 0.2
"""Factor on the threshold from one search to the next; the first threshold is the root mean square of residuals."""

_MOST_EVALUATIONS = 40
"""Largest number of evaluations of the residuals in a search."""

_FINAL_TOLERANCE, _EARLY_TOLERANCE = 1e-4, 1e-2
"""Relative change of cost or point below which a search ends: the final one, and those before it."""

_GAIN = 1.0
"""Least gain in cost for which a search is repeated from where it ended."""

_WIDER = 2.0
"""Standard deviation of the starting points over that of the posterior."""

_DEFICIT = 12.0
"""Log-probability per parameter by which a start may be below the best: three times the mean that _WIDER causes."""

_INSIDE = 1e-3
"""Distance from a bound at which a bounded search begins, over the scale of the parameter."""

_ROUNDS = 30
"""Largest number of rounds of the cross-entropy method."""

_SOME = 0.05
"""Least share of points with a finite log-probability after the deadline."""

_FITS = 0.55
"""Cost per residual below which the noise explains the record: it is 0.4 if the estimate of the noise is right."""


class Optimum(NamedTuple):
    """A robust least-squares solution."""

    point: Floats
    covariance: Floats
    """Covariance from the Jacobian, for the stated noise, shape (d, d)."""
    residuals: Floats
    """Residuals in standard deviations, shape (k,)."""
    cost: float
    """Robust cost, with that of the priors."""
    beyond: Floats | None = None
    """Optimum without bounds, if it is out of bounds."""
    excess: float = 0.0
    """Cost above that of the optimum without bounds."""

    @property
    def fits(self) -> bool:
        """True if the estimated noise explains the record."""
        return self.cost < _FITS * self.residuals.size


def optima(
    residuals: Residuals,
    candidates: Iterable[Floats],
    middle: Floats,
    spread: Floats,
    low: Floats | float = -np.inf,
    high: Floats | float = np.inf,
    deadline: Deadline = NEVER,
) -> Iterator[Optimum]:
    """Yield robust least-squares optima, one from each candidate.

    A search may pass through points that are a priori impossible; if it ends at one, it is repeated within the bounds
    from the nearest possible point.

    Shapes: candidates (d,), middle, spread (d,), low, high (d,).
    """
    for candidate in candidates:
        found = descend(residuals, candidate, middle, spread, deadline=deadline)
        gain = np.inf
        while gain > _GAIN and not deadline.has_passed:  # samples may have crossed an event during the search
            again = descend(residuals, found.point, middle, spread, deadline=deadline)
            gain = found.cost - again.cost
            found = again if gain > 0.0 else found
        if not np.all((found.point > low) & (found.point < high)):
            inside = np.clip(found.point, low + _INSIDE * spread, high - _INSIDE * spread)
            bounded = descend(residuals, inside, middle, spread, low, high, deadline)
            if not deadline.has_passed:  # otherwise the unbounded optimum is unknown
                bounded = bounded._replace(beyond=found.point, excess=bounded.cost - found.cost)
            found = bounded
        yield found
        if deadline.has_passed:
            break


def descend(
    residuals: Residuals,
    start: Floats,
    middle: Floats,
    spread: Floats,
    low: Floats | float = -np.inf,
    high: Floats | float = np.inf,
    deadline: Deadline = NEVER,
) -> Optimum:
    """Return the robust least-squares optimum from one starting point.

    Arguments are those of `optima`. The search is in units of `spread`, so that it does not depend on those of the
    record. The loss is 2 (√(1 + z) − 1) of squared residuals z in units of the threshold (pseudo-Huber, `soft_l1` of
    `scipy.optimize.least_squares`), and quadratic for the priors.
    """

    def one(point: Floats) -> Floats:
        return np.append(residuals((point * spread)[None])[0], point - middle / spread)

    def jacobian(point: Floats) -> Floats:
        """Return central differences, whose step must not be too small for interpolated loads."""
        slopes = central_slopes(lambda points: residuals(points * spread), point, 1e-4)
        return np.concatenate([slopes, np.eye(point.size)])

    def loss(squares: Floats) -> Any:
        """Return the robust loss of the record's residuals, and the quadratic one of the priors', with derivatives."""
        root = np.sqrt(1.0 + squares)
        found = np.stack([2.0 * (root - 1.0), 1.0 / root, -0.5 / root**3])
        own = squares[-start.size :]
        found[:, -start.size :] = own, np.ones(own.size), np.zeros(own.size)
        return found

    bounds = np.broadcast_to(low / spread, start.shape), np.broadcast_to(high / spread, start.shape)
    point, scale, robust = start / spread, np.inf, cast(Any, loss)
    while scale > _HUBER_THRESHOLD:  # far from the optimum a quadratic loss converges faster
        typical = float(np.sqrt(np.mean(np.square(one(point)))))
        scale = max(_HUBER_THRESHOLD, min(typical, _THRESHOLD_FACTOR * scale))
        tolerance = _FINAL_TOLERANCE if scale == _HUBER_THRESHOLD else _EARLY_TOLERANCE
        solution = deadline.least_squares(
            one,
            point,
            jacobian,
            bounds=bounds,
            loss=robust,
            f_scale=scale,
            max_nfev=_MOST_EVALUATIONS,
            ftol=tolerance,
            xtol=tolerance,
        )
        point = solution.x
        if deadline.has_passed:
            break
    _, sizes, axes = np.linalg.svd(np.asarray(solution.jac), full_matrices=False)
    axes = axes / sizes[:, None] * spread
    covariance = axes.T @ axes
    return Optimum(solution.x * spread, covariance, one(solution.x)[: -spread.size], float(solution.cost))


@dataclass(frozen=True, eq=False)
class Cloud:
    """Distribution of starting points: a normal distribution, and the least log-probability of a start."""

    centre: Floats
    """Mean, shape (d,)."""
    root: Floats
    """Square root of the covariance, shape (d, d): the covariance is `root @ root.T`."""
    floor: float
    """Least log-probability of a start."""
    ends: Ends = ANYTHING
    """Bounds of the points."""
    is_possible: bool = True
    """True if a possible point was found."""

    @property
    def narrow_covariance(self) -> Floats:
        """Approximate covariance of the posterior, shape (d, d)."""
        return np.asarray(self.root @ self.root.T / _WIDER**2)

    def floor_by(self, deadline: Deadline) -> float:
        """Return the floor; past the deadline it is −inf, since points above it may be rare."""
        return -np.inf if deadline.has_passed else self.floor

    def draw(self, rng: np.random.Generator, count: int) -> Floats:
        """Draw points, shape (count, d)."""
        return self.ends.drawn(
            lambda count: self.centre + rng.normal(size=(count, self.centre.size)) @ self.root.T, count
        )


def gather(
    log_probability: Callable[[Floats], Floats],
    centre: Floats,
    covariance: Floats,
    rng: np.random.Generator,
    deadline: Deadline = NEVER,
    ends: Ends = ANYTHING,
) -> Cloud:
    """Return a distribution of starting points that is wider than the posterior and mostly of comparable probability.

    A walker that starts where a sample of the record is impossible, as just beyond a snap-off, inflates the noise to
    explain it, and takes thousands of steps to return. Points are therefore drawn around the centre, and while most of
    them are far less probable than the best, centre and covariance are estimated from the best fifth (cross-entropy
    method). The covariance is halved, since the best fifth of points that are twice as wide would not be narrower.

    Shapes: centre (d,), covariance (d, d).
    """
    size = centre.size
    top = float(log_probability(centre[None])[0])
    for _ in range(_ROUNDS):
        root = _square_root(covariance)
        cloud = Cloud(centre, _WIDER * root, -np.inf, ends)
        points = cloud.draw(rng, 60 * size)
        values = log_probability(points)
        if values.max() > top:
            top = float(values.max())
        floor = top - _DEFICIT * size
        if np.mean(values > floor) > 0.5 or (deadline.has_passed and np.mean(np.isfinite(values)) > _SOME):
            break
        if top == -np.inf and deadline.has_passed:  # there is nothing to gather around
            break
        best = np.argsort(values)[-12 * size :]
        best = best[np.isfinite(values[best])]
        if np.count_nonzero(values > floor) > 2 * size:
            centre, covariance = points[best].mean(axis=0), 0.5 * np.cov(points[best].T)
        else:  # nearly all are far less probable than the best so far
            centre = points[best[-1]] if best.size and values[best[-1]] == top else centre
            covariance = 0.25 * covariance
    floor = float(min(floor, np.quantile(values, 0.8, method="lower")))
    return replace(cloud, floor=floor, is_possible=top > -np.inf)


def _square_root(covariance: Floats) -> Floats:
    """Return R with R Rᵀ the covariance, even if rounding has made that singular."""
    scale = np.sqrt(np.diag(covariance))
    values, axes = np.linalg.eigh(covariance / np.outer(scale, scale))
    return scale[:, None] * axes * np.sqrt(np.maximum(values, np.finfo(float).eps))
