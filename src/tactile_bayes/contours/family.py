"""A family of contours: what its parameters are, what is expected of them, and which contour is nearest to points."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from scipy.optimize import least_squares

from tactile_bayes.arrays import Floats
from tactile_bayes.contours.base import Contour

__all__ = ["DefaultPrior", "Family", "FamilyParameter", "log_normal", "parabola_through", "robust_least_squares"]

_MOST_STEPS = 100

_SETTLED = 1e-5
"""Change of parameters, in rod lengths and over their size, after which least squares are not repeated."""


class DefaultPrior(NamedTuple):
    """The prior of a parameter unless another one is given, for a rod of length one."""

    distribution: str
    """Its name in scipy.stats."""
    numbers: Mapping[str, float]
    """Its arguments; `scale` has the parameter's unit."""


def log_normal(s: float, scale: float, **more: float) -> DefaultPrior:
    """A prior of which the logarithm has standard deviation s, about the median `scale`."""
    return DefaultPrior("lognorm", {"s": s, **more, "scale": scale})


class FamilyParameter(NamedTuple):
    """A parameter of a family."""

    meaning: str
    length_power: int
    """Power of length in its unit."""
    prior: DefaultPrior | None = None
    """None of the vertex, about which the pivot says more: it lies anywhere within a rod length of that."""
    bounds: tuple[float, float] = (-np.inf, np.inf)
    """What it is at least, and at most: there is no other contour."""
    unit: str = "1"
    """Of one without length."""


VERTEX = {"q": FamilyParameter("height of the vertex", 1), "x_c": FamilyParameter("position of the vertex", 1)}
"""The last two parameters of every family."""


class Family(ABC):
    """Contours that a vector of parameters describes, q and x_c, the vertex, being its last."""

    name: str
    """What users call it."""
    table: Mapping[str, FamilyParameter]
    """Its parameters by name, in order."""

    @cached_property
    def parameters(self) -> tuple[str, ...]:
        return tuple(self.table)

    @cached_property
    def length_powers(self) -> dict[str, int]:
        """For every parameter the power of length in its unit."""
        return {name: parameter.length_power for name, parameter in self.table.items()}

    @cached_property
    def bounds(self) -> dict[str, tuple[float, float]]:
        """What parameters are at least, and at most, whatever a prior says."""
        return {name: parameter.bounds for name, parameter in self.table.items()}

    @property
    def roughness(self) -> tuple[str, ...]:
        """Parameters that say nothing by themselves, of which a record need not tell anything."""
        return ()

    @property
    @abstractmethod
    def is_always_clear(self) -> bool:
        """Whether a rod that has snapped off is past every contour of the family."""

    @abstractmethod
    def build(self, *values: Any) -> Contour:
        """Contours from parameters in the order of `parameters`, numbers or arrays."""

    def contour(self, values: Mapping[str, Any]) -> Contour:
        """Contours from parameters by name, numbers or arrays; ContourError beyond their bounds."""
        return self.build(*(values[name] for name in self.parameters))

    @abstractmethod
    def fit(self, x: Floats, y: Floats) -> dict[str, float]:
        """Parameters by name that fit points (x, y) in rod lengths, by least squares that outliers do not rule."""


def parabola_through(x: Floats, y: Floats) -> tuple[float, float, float]:
    """a, q and x_c of a parabola through points; a positive one."""
    design = np.stack([x * x, x, np.ones_like(x)], axis=1)
    a, b, c = robust_least_squares(lambda p: design @ p - y, np.linalg.lstsq(design, y, rcond=None)[0])
    if not a > 0.0:
        return 0.5, float(np.min(y)), float(x[np.argmin(y)])
    return float(a), float(c - b * b / (4.0 * a)), float(-b / (2.0 * a))


def robust_least_squares(miss: Callable[[Floats], Floats], point: Any) -> Floats:
    """Least squares that outliers do not rule: repeated, each time in units of the spread that the last one left."""
    for _ in range(5):
        spread = max(float(np.median(np.abs(miss(point)))), 1e-9)

        def scaled(p: Floats, unit: float = spread) -> Floats:
            return miss(p) / unit

        before, point = point, least_squares(scaled, point, loss="soft_l1", max_nfev=_MOST_STEPS).x
        if np.allclose(point, before, rtol=_SETTLED, atol=_SETTLED):
            break
    return np.asarray(point)
