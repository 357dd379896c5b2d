"""Coordinates in which parameters are sampled: themselves, logarithms of some, or those of a flank of a contour."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Self

import numpy as np

from tactile_bayes.arrays import Flags, Floats
from tactile_bayes.contours.families import FLANKS, sides_of
from tactile_bayes.contours.family import VERTEX
from tactile_bayes.inference.densities import LogProbability, Mixture
from tactile_bayes.numerics.differences import central_slopes


@dataclass(frozen=True, eq=False, kw_only=True)
class Coordinates:
    """A change of variables between coordinates and as many parameters; here they are the same."""

    proposal: Mixture | None = None  # of the coordinates, near the posterior, if one is known

    @property
    def bent(self) -> int | None:
        """Number of the first coordinates, if all others are nearly standard normal."""
        return None

    @property
    def fitted(self) -> Mapping[str, Floats]:
        """What draws have changed of the map, by the names of its fields."""
        return {}

    def parameters(self, coordinates: Floats) -> tuple[Floats, Floats]:
        """Return parameters, (n, parameters), and the log of the Jacobian determinant of the map to them, (n,)."""
        return coordinates, np.zeros(len(coordinates))

    def of(self, points: Floats) -> Floats:
        """Return the coordinates of points, shape (..., parameters)."""
        return points

    def adapted(self, draws: Floats) -> Self:
        """Return coordinates that suit a target better of which these are draws, (walkers, steps, coordinates)."""
        return self

    def refitted(self, fitted: Mapping[str, Floats]) -> Self:
        """Return coordinates with other `fitted`."""
        changes: dict[str, Any] = dict(fitted)
        return replace(self, **changes)


@dataclass(frozen=True, eq=False)
class Logarithms(Coordinates):
    """The logarithms of some positive parameters, and the others themselves: ratios of powers then lie along a line."""

    positive: Flags

    def parameters(self, coordinates: Floats) -> tuple[Floats, Floats]:
        points = coordinates.copy()
        with np.errstate(over="ignore"):  # infinite parameters are impossible
            points[:, self.positive] = np.exp(coordinates[:, self.positive])
        return points, np.sum(coordinates[:, self.positive], axis=1)

    def of(self, points: Floats) -> Floats:
        coordinates = points.copy()
        coordinates[..., self.positive] = np.log(points[..., self.positive])
        return coordinates


def in_coordinates(log_probability: LogProbability, coordinates: Coordinates) -> LogProbability:
    """Return the log-density of the coordinates, from that of the parameters."""

    def log_density(points: Floats) -> Floats:
        parameters, log_jacobian = coordinates.parameters(points)
        return np.asarray(log_probability(parameters) + log_jacobian)

    return log_density


# Share of the draws, and distance from x over its median: if a larger share is nearer, the vertex may lie beyond x.
_MAX_SHARE, _NEAR = 0.01, 0.1
_STEP = 1e-6  # of central differences in the base's coordinates


# A flank is two functions of arrays (n,). The first takes the family's sizes and the horizontal distance u of the
# vertex, and returns log t, for two sizes the logarithm of the shape, log(t/t′), and the height above the vertex. The
# second takes the former, and returns the sizes in the base's coordinates, u, that height, and the log-Jacobian.


def _parabola_at(a: Floats, u: Floats) -> tuple[Floats, ...]:
    return np.log(2.0 * a * u), np.log(u), a * u**2


def _parabola_of(log_slope: Floats, log_ratio: Floats) -> tuple[Floats, ...]:
    u = np.exp(log_ratio)
    return log_slope - log_ratio - np.log(2.0), u, 0.5 * np.exp(log_slope) * u, log_ratio


def _circle_at(r: Floats, u: Floats) -> tuple[Floats, ...]:
    log_slope, _, log_ratio, rise = _ellipse_at(r, r, u)
    return log_slope, log_ratio, rise


def _circle_of(log_slope: Floats, log_ratio: Floats) -> tuple[Floats, ...]:
    log_r, _, *rest = _ellipse_of(log_slope, log_slope, log_ratio)
    return log_r, *rest


def _power_law_at(w: Floats, n: Floats, u: Floats) -> tuple[Floats, ...]:
    slope = n * (u / w) ** (n - 1.0)
    return np.log(slope), np.log(n - 1.0), np.log(u / (n - 1.0)), slope * u / n


def _power_law_of(log_slope: Floats, log_shape: Floats, log_ratio: Floats) -> tuple[Floats, ...]:
    shape, log_u = np.exp(log_shape), log_shape + log_ratio
    n, u = 1.0 + shape, np.exp(log_u)
    return log_u - (log_slope - np.log(n)) / shape, n, u, np.exp(log_slope) * u / n, log_u


def _ellipse_at(a: Floats, b: Floats, u: Floats) -> tuple[Floats, ...]:
    sin = u / a
    squared_cos = (1.0 - sin) * (1.0 + sin)
    tan = sin / np.sqrt(squared_cos)
    rise = b * sin**2 / (1.0 + np.sqrt(squared_cos))
    return np.log(b / a * tan), np.log(tan), np.log(u * squared_cos), rise


def _ellipse_of(log_slope: Floats, log_shape: Floats, log_ratio: Floats) -> tuple[Floats, ...]:
    tan = np.exp(log_shape)
    sec = np.hypot(1.0, tan)
    log_a = log_ratio + 3.0 * np.log(sec) - log_shape
    log_b = log_slope + log_a - log_shape
    rise = np.exp(log_b) * (tan / sec) ** 2 / (1.0 + 1.0 / sec)
    return log_a, log_b, np.exp(log_ratio) * sec**2, rise, log_ratio


_FLANKS: dict[str, tuple[Callable[..., tuple[Floats, ...]], Callable[..., tuple[Floats, ...]]]] = {
    "parabola": (_parabola_at, _parabola_of),
    "circle": (_circle_at, _circle_of),
    "power-law": (_power_law_at, _power_law_of),
    "ellipse": (_ellipse_at, _ellipse_of),
}


@dataclass(frozen=True, eq=False)
class FlankCoordinates(Coordinates):
    """Slope, shape, height and slope ratio of a contour at one x, instead of its sizes, q and x_c.

    A record of one flank hardly determines the vertex: sizes and vertex then lie along a bent ridge. With u = |x − x_c|
    and the slope t, the coordinates are log t, for two sizes the log of a shape, the height y, and log(t/t′). For a
    power law t = n (u/w)^(n − 1), the shape is n − 1, y = q + t u/n, t/t′ = u/(n − 1); for an ellipse with u = a sin τ,
    t = (b/a) tan τ, the shape is tan τ, y = q + b (1 − cos τ), t/t′ = u cos² τ. A parabola has n = 2, a circle b = a,
    without a shape.
    """

    flank: str  # of `FLANKS`
    base: Logarithms
    x: float  # at which the coordinates are taken [length]
    side: float  # 1 if the vertex lies at smaller x, −1 if it lies at larger x
    columns: tuple[int, ...]  # of the flank's sizes, q and x_c among the parameters

    @staticmethod
    def describe(family: str) -> bool:
        """Return True for a family of flanks."""
        return set(sides_of(family).values()) <= set(_FLANKS)

    @classmethod
    def at(
        cls, family: str, names: Sequence[str], base: Logarithms, point: Floats, x: float
    ) -> FlankCoordinates | None:
        """Return coordinates at x around a point, (parameters,); None at the vertex, or if a size or it is known."""
        sides, values = sides_of(family), dict(zip(names, point, strict=True))
        side = float(np.sign(x - values.get("x_c", x)))
        prefix = "" if len(sides) == 1 else "right_" if side > 0.0 else "left_"
        own = [*(f"{prefix}{name}" for name in FLANKS[sides[prefix]].table), *VERTEX]
        if abs(side) != 1.0 or not values.keys() >= set(own):
            return None
        return cls(sides[prefix], base, x, side, tuple(map(names.index, own)))

    def parameters(self, coordinates: Floats) -> tuple[Floats, Floats]:
        *logs, height, log_ratio = coordinates[:, self.columns].T
        based = coordinates.copy()
        with np.errstate(over="ignore", invalid="ignore"):  # infinite parameters are impossible
            *sizes, u, rise, own = _FLANKS[self.flank][1](*logs, log_ratio)
            based[:, self.columns] = np.stack([*sizes, height - rise, self.x - self.side * u], axis=1)
        points, log_jacobian = self.base.parameters(based)
        return points, log_jacobian + own

    def of(self, points: Floats) -> Floats:
        """Return coordinates of points, shape (..., parameters); NaN if the vertex is on the other side."""
        coordinates = self.base.of(points)
        *sizes, q, x_c = np.moveaxis(points[..., self.columns], -1, 0)
        with np.errstate(invalid="ignore", divide="ignore"):
            *logs, log_ratio, rise = _FLANKS[self.flank][0](*sizes, self.side * (self.x - x_c))
        coordinates[..., self.columns] = np.stack([*logs, q + rise, log_ratio], axis=-1)
        return coordinates

    def covariance(self, point: Floats, covariance: Floats) -> Floats:
        """Transform a covariance of the base coordinates to first order at a point, shape (parameters,)."""
        based = self.base.of(point[None])[0]
        slopes = central_slopes(lambda points: self.of(self.base.parameters(points)[0]), based, _STEP)
        return np.asarray(slopes @ covariance @ slopes.T)

    def reach_vertex(self, coordinates: Floats) -> bool:
        """Return True if the vertex may lie on the other side as well, according to draws, shape (n, parameters)."""
        distances = np.abs(self.parameters(coordinates)[0][:, self.columns[-1]] - self.x)
        return bool(np.quantile(distances, _MAX_SHARE) < _NEAR * np.median(distances))
