"""Contours of any shape whose parameters can be inferred: a random radius of curvature, and the vertex."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import stats
from scipy.optimize import least_squares

from tactile_bayes.contours import Contour, Smooth
from tactile_bayes.inference.families import Family, Prior, parabola_through
from tactile_bayes.inference.shape_free_posterior.random_radius import RandomRadius

__all__ = ["SHAPE_FREE", "ShapeFreeFamily"]

Floats = NDArray[np.float64]

_AMPLITUDE, _LENGTH = stats.lognorm(s=0.6, scale=0.7), stats.lognorm(s=0.4, scale=0.7)
"""Priors of the standard deviation of log ρ, and of the length over which it changes [rad]."""

_RADIUS = RandomRadius(shortest=0.15, longest=4.0, tolerance=0.01)

_SCATTER, _BRAVE = 0.01, 2.0
"""Of points to be fitted, in rod lengths, as a first guess; and from how many times that on they pull less."""

_STEP = 1e-5

_POINTS = 500
"""To which a contour is fitted at most: as a first guess, which every search improves on."""


@dataclass(frozen=True)
class ShapeFreeFamily(Family):
    """Any smooth contour between vertical ends.

    Parameters
    ----------
    name : str
    radius : RandomRadius
        The prior of its radius of curvature.
    """

    name: str
    radius: RandomRadius
    length_powers: Mapping[str, int] = field(init=False)
    bounds: Mapping[str, tuple[float, float]] = field(init=False)

    def __post_init__(self) -> None:
        weights = {f"z_{k + 1}": 0 for k in range(self.radius.count)}
        powers = {"r": 1, "amplitude": 0, "length_scale": 0, **weights, "q": 1, "x_c": 1}
        bounds = {
            "r": (0.0, np.inf),
            "amplitude": (0.0, np.inf),
            "length_scale": (self.radius.shortest, self.radius.longest),
        }
        object.__setattr__(self, "length_powers", powers)
        object.__setattr__(self, "bounds", bounds)

    @property
    def roughness(self) -> tuple[str, ...]:
        return ("amplitude", "length_scale", *(f"z_{k + 1}" for k in range(self.radius.count)))

    @property
    def is_always_clear(self) -> bool:
        return False

    def build(self, *values: Any) -> Contour:
        r, amplitude, length, *weights, q, x_c = np.broadcast_arrays(*map(np.asarray, values))
        log_radius = self.radius.log_radius(np.log(r), amplitude, length, np.stack(weights, axis=-1))
        return Smooth(log_radius, q=q, x_c=x_c)

    def _own_priors(self, length: float) -> dict[str, Prior]:
        standard = stats.norm()
        weights = {f"z_{k + 1}": standard for k in range(self.radius.count)}
        return {
            "r": stats.lognorm(s=1.0, scale=0.5 * length),
            "amplitude": _AMPLITUDE,
            "length_scale": _LENGTH,
            **weights,
        }

    def fit(self, x: Floats, y: Floats) -> dict[str, float]:
        """From a circle that is as bent as the points, by distances along the normal and the directions' prior.

        Of very many points, some that are evenly picked.
        """
        picked = np.unique(np.linspace(0, x.size - 1, min(x.size, _POINTS)).astype(np.intp))
        x, y = x[picked], y[picked]
        a, q, x_c = parabola_through(x, y)
        middle = np.array([np.log(0.5 / a), *np.zeros(self.radius.count), q, x_c])
        amplitude, length = float(_AMPLITUDE.ppf(0.9)), float(_LENGTH.median())

        def residuals(points: Floats, scatter: float) -> Floats:
            """Of points (n, d): (n, points + d)."""
            ones = np.ones(len(points))
            contours = self.build(np.exp(points[:, 0]), amplitude * ones, length * ones, *points[:, 1:].T)
            return np.hstack([_distances(contours, x, y) / scatter, points - middle])

        def of_one(point: Floats, scatter: float) -> Floats:
            return np.asarray(residuals(point[None], scatter)[0])

        def jacobian(point: Floats, scatter: float) -> Floats:
            moved = residuals(point + _STEP * np.vstack([np.eye(point.size), -np.eye(point.size)]), scatter)
            return (moved[: point.size] - moved[point.size :]).T / (2.0 * _STEP)

        point, scatter = middle, _SCATTER
        for _ in range(2):
            found = least_squares(of_one, point, jacobian, loss="soft_l1", f_scale=_BRAVE, args=(scatter,), max_nfev=40)
            point = found.x
            left = residuals(point[None], 1.0)[0, : x.size]
            scatter = max(1.4826 * float(np.median(np.abs(left))), 0.1 * _SCATTER)
        weights = {f"z_{k + 1}": float(z) for k, z in enumerate(point[1:-2])}
        sizes = {"r": float(np.exp(point[0])), "amplitude": amplitude, "length_scale": length}
        return {**sizes, **weights, "q": float(point[-2]), "x_c": float(point[-1])}


def _distances(contours: Contour, x: Floats, y: Floats) -> Floats:
    """Of points from contours, along the normal where they are above or below them, shape (n, points)."""
    left, right = (contours.locate(end).x for end in contours.domain)
    margin = 1e-9 * (right - left)
    at = contours.locate(contours.parameter_of_x(np.clip(x[:, None], left + margin, right - margin)))
    return ((y[:, None] - at.y) * np.cos(at.slope_angle) - (x[:, None] - at.x) * np.sin(at.slope_angle)).T


SHAPE_FREE = ShapeFreeFamily("shape-free", _RADIUS)
