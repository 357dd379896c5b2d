"""Families of contours whose parameters can be inferred."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray
from scipy import stats
from scipy.optimize import least_squares

from tactile_bayes.contours import Circle, Contour, Parabola
from tactile_bayes.errors import ParameterError

__all__ = ["FAMILIES", "Family", "Prior", "family_named"]

Floats = NDArray[np.float64]


@runtime_checkable
class Prior(Protocol):
    """What is asked of a prior: a frozen distribution of scipy.stats has it."""

    def logpdf(self, x: Any) -> Any: ...
    def rvs(self, size: int, random_state: np.random.Generator) -> Any: ...
    def std(self) -> Any: ...


@dataclass(frozen=True)
class Family:
    """A family of contours.

    Parameters
    ----------
    name : str
        What users call it.
    build : callable
        From parameters in the order of `parameters`, numbers or arrays, to contours.
    length_powers : mapping
        For every parameter, by name, the power of length in its unit.
    positive : tuple of str
        The parameters that have to be positive, whatever a prior says.
    default_priors : callable
        From pivot (x, y) and rod length to priors by name: weakly informative, and from nothing but the rod's reach.
    fit : callable
        From points (x, y) in rod lengths to parameters by name, least squares that outliers do not rule.
    """

    name: str
    build: Callable[..., Contour]
    length_powers: Mapping[str, int]
    positive: tuple[str, ...]
    default_priors: Callable[[tuple[float, float], float], dict[str, Prior]]
    fit: Callable[[Floats, Floats], dict[str, float]]

    @property
    def parameters(self) -> tuple[str, ...]:
        return tuple(self.length_powers)


def family_named(name: str) -> Family:
    """The family of a name.

    Raises
    ------
    ParameterError
        If there is none.

    Examples
    --------
    >>> family_named("circle").parameters
    ('r', 'q', 'x_c')
    """
    if name not in FAMILIES:
        raise ParameterError(f"there is no family {name!r}: choose {' or '.join(map(repr, FAMILIES))}")
    return FAMILIES[name]


def _vertex_priors(base: tuple[float, float], length: float) -> dict[str, Prior]:
    """The lowest point lies within a rod length of the pivot, to the side and in height, anywhere alike."""
    x, y = base
    return {
        "q": stats.uniform(y - length, 2.0 * length),
        "x_c": stats.uniform(x - length, 2.0 * length),
    }


def _parabola_priors(base: tuple[float, float], length: float) -> dict[str, Prior]:
    """Radius of curvature at the vertex, 1/(2a): half a rod length, give or take a factor of e (one sd)."""
    return {"a": stats.lognorm(s=1.0, scale=1.0 / length), **_vertex_priors(base, length)}


def _circle_priors(base: tuple[float, float], length: float) -> dict[str, Prior]:
    """Radius: half a rod length, give or take a factor of e (one sd)."""
    return {"r": stats.lognorm(s=1.0, scale=0.5 * length), **_vertex_priors(base, length)}


def _robust(miss: Callable[[Floats], Floats], point: Any) -> Floats:
    """Least squares that outliers do not rule: repeated, each time in units of the spread that the last one left."""
    for _ in range(5):
        spread = max(float(np.median(np.abs(miss(point)))), 1e-9)

        def scaled(p: Floats, unit: float = spread) -> Floats:
            return miss(p) / unit

        point = least_squares(scaled, point, loss="soft_l1").x
    return np.asarray(point)


def _fit_parabola(x: Floats, y: Floats) -> dict[str, float]:
    design = np.stack([x * x, x, np.ones_like(x)], axis=1)
    a, b, c = _robust(lambda p: design @ p - y, np.linalg.lstsq(design, y, rcond=None)[0])
    return {"a": float(a), "q": float(c - b * b / (4.0 * a)), "x_c": float(-b / (2.0 * a))}


def _fit_circle(x: Floats, y: Floats) -> dict[str, float]:
    # Kåsa's algebraic fit first, then the distance from the circle.
    design = np.stack([x, y, np.ones_like(x)], axis=1)
    b, c, d = np.linalg.lstsq(design, x * x + y * y, rcond=None)[0]
    first = np.array([0.5 * b, 0.5 * c, np.sqrt(max(d + 0.25 * (b * b + c * c), 1e-12))])
    centre_x, centre_y, r = _robust(lambda p: np.hypot(x - p[0], y - p[1]) - p[2], first)
    return {"r": float(r), "q": float(centre_y - r), "x_c": float(centre_x)}


FAMILIES: dict[str, Family] = {
    family.name: family
    for family in (
        Family("parabola", Parabola, {"a": -1, "q": 1, "x_c": 1}, ("a",), _parabola_priors, _fit_parabola),
        Family("circle", Circle, {"r": 1, "q": 1, "x_c": 1}, ("r",), _circle_priors, _fit_circle),
    )
}
"""Families by name."""
