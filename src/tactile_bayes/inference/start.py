"""Where the walkers start: a robust optimum found from the record alone, and how far to scatter around it."""

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

_BRAVE = 2.0
"""Residual in standard deviations from which on a sample pulls less than by its square."""

_CLOSER = 0.2
"""Factor from one such residual to the next, the first being as large as all of them are."""

_MOST_STEPS = 40

_ENOUGH, _ON_THE_WAY = 1e-4, 1e-2
"""Share of its cost, or of its size, that a step has to gain or change for a search to go on; before the last one."""

_GAIN = 1.0
"""Cost by which a search that begins where one ended has to be better to go on."""

_WIDER = 2.0
"""How many times wider than the posterior walkers start."""

_DEFICIT = 12.0
"""Log-probability per parameter that a walker may start below the best: three times what _WIDER makes on average."""

_INSIDE = 1e-3
"""Of the scale of a parameter, from its end, where a search begins that must not leave."""

_ROUNDS = 30

_SOME = 0.05
"""Share of a cloud that must be possible if time is up."""

_FITS = 0.55
"""Cost per residual that says that the noise explains the record: 0.4 if the noise is guessed right."""


class Optimum(NamedTuple):
    """A robust least-squares solution."""

    point: Floats
    covariance: Floats
    """From the Jacobian, as if noise were as stated."""
    residuals: Floats
    cost: float
    beyond: Floats | None = None
    """Where the search ended before it was told to stay where things are possible."""
    excess: float = 0.0
    """Cost above that there."""

    @property
    def fits(self) -> bool:
        """Whether noise as it was guessed explains the record."""
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
    """Robust least squares from one candidate after the other.

    The way to an optimum may lead through what is impossible a priori; if it ends there, the search goes on from the
    nearest place where that is not so, and stays there.

    Parameters
    ----------
    residuals : callable
        From points (n, d) to residuals in standard deviations (n, k).
    candidates : iterable of ndarray, shape (d,)
    middle, spread : ndarray, shape (d,)
        Where each parameter lies a priori, and on which scale it varies there: it is drawn there like by one residual.
    low, high : ndarray, shape (d,), or float
        Between what each parameter can be.
    deadline : Deadline
        Past it, the search that is under way ends where it is, and no other begins.
    """
    for candidate in candidates:
        found = descend(residuals, candidate, middle, spread, deadline=deadline)
        gain = np.inf
        while gain > _GAIN and not deadline.has_passed:  # samples may have fallen on an event's other side on the way
            again = descend(residuals, found.point, middle, spread, deadline=deadline)
            gain = found.cost - again.cost
            found = again if gain > 0.0 else found
        if not np.all((found.point > low) & (found.point < high)):
            inside = np.clip(found.point, low + _INSIDE * spread, high - _INSIDE * spread)
            bounded = descend(residuals, inside, middle, spread, low, high, deadline)
            if not deadline.has_passed:  # else what the record wants is not known
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
    """Robust least squares from one place, as in `optima`; in units of the spread, so that those of the record do not
    matter.
    """

    def one(point: Floats) -> Floats:
        return np.append(residuals((point * spread)[None])[0], point - middle / spread)

    def jacobian(point: Floats) -> Floats:
        """Central differences; loads are interpolated, so the step must not be too small."""
        slopes = central_slopes(lambda points: residuals(points * spread), point, 1e-4)
        return np.concatenate([slopes, np.eye(point.size)])

    def loss(squares: Floats) -> Any:
        """Outliers are the record's: to be far from where a parameter lies a priori costs its square."""
        root = np.sqrt(1.0 + squares)
        found = np.stack([2.0 * (root - 1.0), 1.0 / root, -0.5 / root**3])
        own = squares[-start.size :]
        found[:, -start.size :] = own, np.ones(own.size), np.zeros(own.size)
        return found

    bounds = np.broadcast_to(low / spread, start.shape), np.broadcast_to(high / spread, start.shape)
    point, scale, robust = start / spread, np.inf, cast(Any, loss)
    while scale > _BRAVE:  # far off, residuals all pull by their squares, or the way would be long
        typical = float(np.sqrt(np.mean(np.square(one(point)))))
        scale = max(_BRAVE, min(typical, _CLOSER * scale))
        enough = _ENOUGH if scale == _BRAVE else _ON_THE_WAY
        solution = deadline.least_squares(
            one,
            point,
            jacobian,
            bounds=bounds,
            loss=robust,
            f_scale=scale,
            max_nfev=_MOST_STEPS,
            ftol=enough,
            xtol=enough,
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
    """Where walkers may start: a normal distribution, and the log-probability that is asked of them."""

    centre: Floats
    root: Floats
    """Times its transpose it is the covariance."""
    floor: float
    ends: Ends = ANYTHING

    @property
    def narrow_covariance(self) -> Floats:
        """Roughly the posterior's."""
        return np.asarray(self.root @ self.root.T / _WIDER**2)

    def floor_by(self, deadline: Deadline) -> float:
        """The floor; past the deadline there is none, for of what is above it few points may be found."""
        return -np.inf if deadline.has_passed else self.floor

    def draw(self, rng: np.random.Generator, count: int) -> Floats:
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
    """A cloud that is wider than the posterior, but of which most is not hopeless.

    A walker that starts where a sample of the record is impossible, as just beyond a snap-off, inflates the noise to
    live with it, and takes thousands of steps to come back. So points are drawn around the centre, and while most of
    them are far less probable than the best, centre and covariance are taken from the best fifth (the cross-entropy
    method). Half its covariance, or the cloud would not shrink: of points twice as wide the best fifth are as wide.

    Parameters
    ----------
    log_probability : callable
        From points (n, d) to (n,); −inf where impossible.
    centre : ndarray, shape (d,)
    covariance : ndarray, shape (d, d)
        A guess at the posterior's.
    rng : np.random.Generator
    deadline : Deadline
        Past it, a cloud will do of which `_SOME` is possible.
    ends : Ends
        Of what is possible, as far as it is known.
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
        best = np.argsort(values)[-12 * size :]
        best = best[np.isfinite(values[best])]
        if np.count_nonzero(values > floor) > 2 * size:
            centre, covariance = points[best].mean(axis=0), 0.5 * np.cov(points[best].T)
        else:  # nearly all are hopeless beside the centre, or beside the best that was found on the way
            centre = points[best[-1]] if best.size and values[best[-1]] == top else centre
            covariance = 0.25 * covariance
    return replace(cloud, floor=float(min(floor, np.quantile(values, 0.8, method="lower"))))


def _square_root(covariance: Floats) -> Floats:
    """R with R Rᵀ the covariance, also where rounding has left that without an inverse."""
    scale = np.sqrt(np.diag(covariance))
    values, axes = np.linalg.eigh(covariance / np.outer(scale, scale))
    return scale[:, None] * axes * np.sqrt(np.maximum(values, np.finfo(float).eps))
