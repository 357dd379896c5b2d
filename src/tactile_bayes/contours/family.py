"""A family of contours: its parameters, their default priors, and the fit to points."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from scipy.optimize import least_squares

from tactile_bayes.arrays import Floats
from tactile_bayes.contours.base import Contour

_MOST_STEPS = 100

# Change of parameters, in rod lengths and relative to their size, at which least squares have converged.
_SETTLED = 1e-5


class DefaultPrior(NamedTuple):
    """Default prior of a parameter, for a rod of length one."""

    distribution: str  # name of the distribution in scipy.stats
    numbers: Mapping[str, float]  # arguments of the distribution; `scale` has the parameter's unit


def log_normal(s: float, scale: float, **more: float) -> DefaultPrior:
    """Return a log-normal prior: the logarithm has the standard deviation s, and the median is `scale`."""
    return DefaultPrior("lognorm", {"s": s, **more, "scale": scale})


class FamilyParameter(NamedTuple):
    """Parameter of a family."""

    meaning: str
    length_power: int  # power of length in its unit
    prior: DefaultPrior | None = None  # none for the vertex, which lies anywhere within a rod length of the pivot
    bounds: tuple[float, float] = (-np.inf, np.inf)  # least and greatest value of a valid contour
    unit: str = "1"  # unit of a parameter without length


# The last two parameters of every family.
VERTEX = {"q": FamilyParameter("height of the vertex", 1), "x_c": FamilyParameter("position of the vertex", 1)}


class ContourFamily(ABC):
    """Contours that a vector of parameters describes; the last two are those of the vertex, q and x_c."""

    name: str  # name that users give
    table: Mapping[str, FamilyParameter]  # parameters by name, in order

    @cached_property
    def parameters(self) -> tuple[str, ...]:
        return tuple(self.table)

    @cached_property
    def length_powers(self) -> dict[str, int]:
        """Power of length in the unit of each parameter."""
        return {name: parameter.length_power for name, parameter in self.table.items()}

    @cached_property
    def bounds(self) -> dict[str, tuple[float, float]]:
        """Least and greatest value of each parameter, under any prior."""
        return {name: parameter.bounds for name, parameter in self.table.items()}

    @property
    def roughness(self) -> tuple[str, ...]:
        """Parameters of the random shape, which a record need not determine."""
        return ()

    @property
    def is_always_clear(self) -> bool:
        """True if a rod is clear of every contour of the family after snap-off."""
        return False

    @abstractmethod
    def build(self, *values: Any) -> Contour:
        """Build contours from parameters in the order of `parameters`, numbers or arrays."""

    def contour(self, values: Mapping[str, Any]) -> Contour:
        """Build contours from parameters by name, numbers or arrays; ContourError beyond their bounds."""
        return self.build(*(values[name] for name in self.parameters))

    @abstractmethod
    def fit(self, x: Floats, y: Floats) -> dict[str, float]:
        """Fit parameters, by name, to points (x, y) in rod lengths, by robust least squares."""


def parabola_through(x: Floats, y: Floats) -> tuple[float, float, float]:
    """a, q and x_c of a parabola fitted to points, with a > 0."""
    design = np.stack([x * x, x, np.ones_like(x)], axis=1)
    a, b, c = robust_least_squares(lambda p: design @ p - y, np.linalg.lstsq(design, y, rcond=None)[0])
    if not a > 0.0:
        return 0.5, float(np.min(y)), float(x[np.argmin(y)])
    return float(a), float(c - b * b / (4.0 * a)), float(-b / (2.0 * a))


def robust_least_squares(miss: Callable[[Floats], Floats], point: Any) -> Floats:
    """Robust least squares, repeated with the residuals scaled by the median residual of the last fit."""
    for _ in range(5):
        spread = max(float(np.median(np.abs(miss(point)))), 1e-9)

        def scaled(p: Floats, unit: float = spread) -> Floats:
            return miss(p) / unit

        before, point = point, least_squares(scaled, point, loss="soft_l1", max_nfev=_MOST_STEPS).x
        if np.allclose(point, before, rtol=_SETTLED, atol=_SETTLED):
            break
    return np.asarray(point)
