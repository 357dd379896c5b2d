"""The family of contours of any shape: a random radius of curvature, and the vertex."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from scipy.optimize import least_squares
from scipy.special import ndtri

from tactile_bayes.arrays import Floats
from tactile_bayes.contours.base import Contour, refuse_unless
from tactile_bayes.contours.family import (
    VERTEX,
    ContourFamily,
    DefaultPrior,
    FamilyParameter,
    log_normal,
    parabola_through,
)
from tactile_bayes.contours.random_radius import RandomRadius
from tactile_bayes.contours.smooth import Smooth
from tactile_bayes.numerics.scatter import robust_deviation
from tactile_bayes.numerics.selection import evenly_spread

# Priors of the standard deviation of log ρ, and of the length over which it changes [rad].
_AMPLITUDE, _LENGTH = log_normal(0.6, 0.7), log_normal(0.4, 0.7)
_FLAT_LENGTH = log_normal(0.7, 0.5)
_UPRIGHT = 0.5 * np.pi
_FLAT = {
    "flat_length": FamilyParameter("length of the flat side", 1, _FLAT_LENGTH, (0.0, np.inf)),
    "flat_slope": FamilyParameter(
        "slope angle of the flat side", 0, DefaultPrior("norm", {"scale": 1.0}), (-_UPRIGHT, _UPRIGHT), "rad"
    ),
}
# First guess of the scatter of points to be fitted [L], and the threshold of the soft-L1 loss in units of it.
_SCATTER, _HUBER = 0.01, 2.0
_STEP = 1e-5

_POINTS = 500  # largest number of points of a fit, which is a first guess for a search


@dataclass(frozen=True)
class ShapeFreeFamily(ContourFamily):
    """Family of all smooth contours between vertical ends."""

    name: str
    radius: RandomRadius  # prior of the radius of curvature
    has_flat: bool = False  # whether one of its sides is flat

    @cached_property
    def table(self) -> dict[str, FamilyParameter]:  # type: ignore[override]
        size, spread = "mean radius of curvature (geometric)", "standard deviation of the logarithm of the radius"
        lengths = self.radius.shortest, self.radius.longest
        weight = FamilyParameter("weight of a direction of the random radius", 0, DefaultPrior("norm", {}))
        return {
            "r": FamilyParameter(size, 1, log_normal(1.0, 0.5), (0.0, np.inf)),
            "amplitude": FamilyParameter(spread, 0, _AMPLITUDE, (0.0, np.inf)),
            "length_scale": FamilyParameter("slope angle over which it changes", 0, _LENGTH, lengths, "rad"),
            **dict.fromkeys(self.directions, weight),
            **(_FLAT if self.has_flat else {}),
            **VERTEX,
        }

    @cached_property
    def directions(self) -> tuple[str, ...]:
        """Names of the weights of the random radius, which are standard normal."""
        return tuple(f"z_{k + 1}" for k in range(self.radius.count))

    @property
    def roughness(self) -> tuple[str, ...]:
        return ("amplitude", "length_scale", *self.directions)

    def build(self, *values: Any) -> Contour:
        r, amplitude, length, *rest = np.broadcast_arrays(*map(np.asarray, values))
        weights, placed = np.stack(rest[: self.radius.count], axis=-1), rest[self.radius.count :]
        if self.has_flat:
            placed[0] = np.log(placed[0])
        return self.smooth(self.radius.log_radius(np.log(r), amplitude, length, weights), *placed)

    def smooth(self, log_radius: Floats, *placed: Floats) -> Smooth:
        """Return contours from log-radii at the nodes, (n, nodes), the logarithm of the length of the flat side and its
        slope angle, if there is one, and the vertex, (n,)."""
        *flat, q, x_c = placed
        return Smooth(log_radius, q, x_c, *([np.exp(flat[0]), flat[1]] if flat else []))

    def contour(self, values: Mapping[str, Any]) -> Contour:
        amplitude, length = (np.asarray(values[name]) for name in ("amplitude", "length_scale"))
        for name in ("r", "flat_length") if self.has_flat else ("r",):
            size, rule = np.asarray(values[name]), f"{name} must be positive and finite"
            refuse_unless((size > 0.0) & np.isfinite(size), self.name, rule, **{name: size})
        rule = "amplitude must be finite and not negative"
        refuse_unless((amplitude >= 0.0) & np.isfinite(amplitude), self.name, rule, amplitude=amplitude)
        low, high = self.bounds["length_scale"]
        rule = f"length_scale must be from {low:g} to {high:g} rad"
        refuse_unless((length >= low) & (length <= high), self.name, rule, length_scale=length)
        return super().contour(values)

    def fit(self, x: Floats, y: Floats) -> dict[str, float]:
        """Fit by distances along the normal and the prior of the directions, from a circle with the points' curvature.
        Of very many points an even selection is used."""
        picked = evenly_spread(x.size, _POINTS)
        x, y = x[picked], y[picked]
        a, q, x_c = parabola_through(x, y)
        slopes = np.arctan(2.0 * a * (np.array([x.min(), x.max()]) - x_c))
        flat = [np.log(_FLAT_LENGTH.numbers["scale"]), slopes[np.argmax(np.abs(slopes))]] if self.has_flat else []
        middle = np.array([np.log(0.5 / a), *np.zeros(self.radius.count), *flat, q, x_c])
        amplitude = float(np.exp(_AMPLITUDE.numbers["s"] * ndtri(0.9)) * _AMPLITUDE.numbers["scale"])  # the last decile
        length = _LENGTH.numbers["scale"]

        def residuals(points: Floats, scatter: float) -> Floats:
            """Residuals at parameters of shape (n, d), shape (n, points + d)."""
            ones = np.ones(len(points))
            columns = np.split(points, [1, 1 + self.radius.count], axis=1)
            log_radius = self.radius.log_radius(columns[0][:, 0], amplitude * ones, length * ones, columns[1])
            contours = self.smooth(log_radius, *columns[2].T)
            return np.hstack([_distances(contours, x, y) / scatter, points - middle])

        def of_one(point: Floats, scatter: float) -> Floats:
            return np.asarray(residuals(point[None], scatter)[0])

        def jacobian(point: Floats, scatter: float) -> Floats:
            moved = residuals(point + _STEP * np.vstack([np.eye(point.size), -np.eye(point.size)]), scatter)
            return (moved[: point.size] - moved[point.size :]).T / (2.0 * _STEP)

        point, scatter = middle, _SCATTER
        for _ in range(2):
            found = least_squares(of_one, point, jacobian, loss="soft_l1", f_scale=_HUBER, args=(scatter,), max_nfev=40)
            point = found.x
            left = residuals(point[None], 1.0)[0, : x.size]
            scatter = max(robust_deviation(left), 0.1 * _SCATTER)
        others = [name for name in self.parameters if name not in ("amplitude", "length_scale")]
        values = dict(zip(others, point.tolist(), strict=True)) | {"amplitude": amplitude, "length_scale": length}
        return {name: float(np.exp(v)) if name in ("r", "flat_length") else v for name, v in values.items()}


def _distances(contours: Contour, x: Floats, y: Floats) -> Floats:
    """Distances of points from contours, along the normal above or below them, shape (n, points)."""
    left, right = (contours.locate(end).x for end in contours.domain)
    margin = 1e-9 * (right - left)
    at = contours.locate(contours.parameter_of_x(np.clip(x[:, None], left + margin, right - margin)))
    return ((y[:, None] - at.y) * np.cos(at.slope_angle) - (x[:, None] - at.x) * np.sin(at.slope_angle)).T


SHAPE_FREE = ShapeFreeFamily("shape-free", RandomRadius(shortest=0.15, longest=4.0, tolerance=0.01))
FLAT_SIDED = ShapeFreeFamily("flat-sided", SHAPE_FREE.radius, has_flat=True)
