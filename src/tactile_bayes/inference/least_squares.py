"""Robust least squares by damped Gauss–Newton steps, within priors."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from typing import Any, NamedTuple, cast

import numpy as np

from tactile_bayes.arrays import Floats
from tactile_bayes.inference.deadline import NEVER, Deadline
from tactile_bayes.numerics.differences import central_slopes

Residuals = Callable[[Floats], Floats]
HUBER_THRESHOLD = 2.0  # residual, in standard deviations, beyond which the loss of the final search grows linearly
STEP = 1e-4  # of central differences, in prior spreads; it must not be too small for interpolated loads
_THRESHOLD_FACTOR = 0.2  # from one search to the next; the first threshold is the root mean square of residuals
_MOST_EVALUATIONS = 40  # of the residuals in a search
# Relative change of cost or point below which a search ends: the final one, and those before it.
_FINAL_TOLERANCE, _EARLY_TOLERANCE = 1e-4, 1e-2
# Least gain in cost for which a search is repeated from where it ended, or share of a cost that no noise explains.
_GAIN, _SHARE = 1.0, 0.01
_INSIDE = 1e-3  # distance from a bound at which a bounded search begins, over the scale of the parameter
_FITS = 0.55  # cost per residual below which the noise explains the record: 0.4 if the estimate of the noise is right


class Optimum(NamedTuple):
    """A robust least-squares solution."""

    point: Floats
    covariance: Floats  # from the Jacobian, for the stated noise, (d, d)
    residuals: Floats  # in standard deviations, (k,)
    cost: float  # robust, with that of the priors
    beyond: Floats | None = None  # optimum without bounds, if it is out of bounds
    excess: float = 0.0  # cost above that of the optimum without bounds

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
    """Yield robust least-squares optima, one from each candidate, (d,). A search may pass through points that are a
    priori impossible; if it ends at one, it is repeated within the bounds."""
    for candidate in candidates:
        found = descend(residuals, candidate, middle, spread, deadline=deadline)
        gain = np.inf
        # Samples may have crossed an event during a search.
        while gain > (_GAIN if found.fits else max(_GAIN, _SHARE * found.cost)) and not deadline.has_passed:
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


def robust_cost(residuals: Floats) -> Floats:
    """Return the cost of residuals, (n, k), that grows linearly beyond the threshold; shape (n,)."""
    return np.asarray(HUBER_THRESHOLD**2 * np.sum(np.hypot(1.0, residuals / HUBER_THRESHOLD) - 1.0, axis=1))


def descend(
    residuals: Residuals,
    start: Floats,
    middle: Floats,
    spread: Floats,
    low: Floats | float = -np.inf,
    high: Floats | float = np.inf,
    deadline: Deadline = NEVER,
) -> Optimum:
    """Return the robust least-squares optimum from one starting point, in units of `spread`. Of the record's squared
    residuals z in units of the threshold the loss is 2 (√(1 + z) − 1); of the priors' it is z."""

    def one(point: Floats) -> Floats:
        return np.append(residuals((point * spread)[None])[0], point - middle / spread)

    def jacobian(point: Floats) -> Floats:
        """Return central differences."""
        slopes = central_slopes(lambda points: residuals(points * spread), point, STEP)
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
    while scale > HUBER_THRESHOLD:  # far from the optimum a quadratic loss converges faster
        typical = float(np.sqrt(np.mean(np.square(one(point)))))
        scale = max(HUBER_THRESHOLD, min(typical, _THRESHOLD_FACTOR * scale))
        tolerance = _FINAL_TOLERANCE if scale == HUBER_THRESHOLD else _EARLY_TOLERANCE
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
