"""Contours of any shape whose parameters can be inferred: a random radius of curvature, and the vertex."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from tactile_bayes.contours import Contour, Smooth
from tactile_bayes.inference.families import Family, Prior, parabola_through
from tactile_bayes.inference.random_radius import RandomRadius

__all__ = ["SHAPE_FREE", "ShapeFreeFamily"]

Floats = NDArray[np.float64]

_AMPLITUDE, _LENGTH = stats.lognorm(s=0.6, scale=0.7), stats.lognorm(s=0.35, scale=0.7)
"""Priors of the standard deviation of log ρ, and of the length over which it changes [rad]."""

_RADIUS = RandomRadius(shortest=0.15, longest=4.0, typical=float(_LENGTH.ppf(0.05)), tolerance=0.01)


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
        weights = {f"z_{k + 1}": stats.norm() for k in range(self.radius.count)}
        return {
            "r": stats.lognorm(s=1.0, scale=0.5 * length),
            "amplitude": _AMPLITUDE,
            "length_scale": _LENGTH,
            **weights,
        }

    def fit(self, x: Floats, y: Floats) -> dict[str, float]:
        """Those of a circle that is as bent as the points."""
        a, q, x_c = parabola_through(x, y)
        weights = {f"z_{k + 1}": 0.0 for k in range(self.radius.count)}
        middle = {"amplitude": float(_AMPLITUDE.median()), "length_scale": float(_LENGTH.median())}
        return {"r": 0.5 / a, **middle, **weights, "q": q, "x_c": x_c}


SHAPE_FREE = ShapeFreeFamily("shape-free", _RADIUS)
