"""Families of contours whose parameters can be inferred."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, field
from typing import Any, Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray
from scipy import stats
from scipy.optimize import least_squares

from tactile_bayes.checks import shown
from tactile_bayes.contours import Circle, Contour, Ellipse, Joined, Parabola, PowerLaw
from tactile_bayes.errors import ParameterError

__all__ = ["FAMILIES", "FLANKS", "Family", "Flank", "Prior", "refuse_wrong_priors", "support_of"]

_MOST_STEPS = 100

_STEEPEST = 1e300
"""Of a power law, in its unit: more is beyond what numbers hold."""

_FAR = 1e3
"""Widths from the vertex beyond which a power law is as high as here, or its height would overflow."""

_SETTLED = 1e-5
"""Change of parameters, in rod lengths and over their size, after which least squares are not repeated."""

Floats = NDArray[np.float64]
Values = Mapping[str, Any]


@runtime_checkable
class Prior(Protocol):
    """What is asked of a prior: a frozen distribution of scipy.stats has it."""

    def logpdf(self, x: Any) -> Any: ...
    def rvs(self, size: int, random_state: np.random.Generator) -> Any: ...
    def std(self) -> Any: ...


def refuse_wrong_priors(priors: Mapping[str, Any], names: Collection[str], whose: str = "", more: str = "") -> None:
    """Refuse priors that are no distributions with fixed parameters, or of what is no parameter."""
    for name, prior in priors.items():
        if not isinstance(prior, Prior) or isinstance(prior, stats.rv_continuous):
            remedy = "give a frozen distribution, like scipy.stats.norm(0.5, 0.1)"
            raise ParameterError(f"the prior of {name} is {shown(prior)}: {remedy}")
    strangers = sorted(set(priors) - set(names))
    if strangers:
        raise ParameterError(
            f"there is a prior {whose}of {', '.join(strangers)}, which is no parameter: there are "
            f"{', '.join(names)}{more}"
        )


def support_of(prior: Prior) -> tuple[float, float]:
    """Between what values it lies."""
    ends = prior.support() if hasattr(prior, "support") else (-np.inf, np.inf)
    return float(ends[0]), float(ends[1])


@dataclass(frozen=True)
class Flank:
    """Contours with a vertex at height q above x_c, of one law on one side of it or on both.

    Parameters
    ----------
    build : callable
        From values by name, with q and x_c, to contours.
    length_powers : mapping
        For every parameter of the flank's own, by name, the power of length in its unit.
    bounds : mapping
        What each of them is at least, and at most: there is no other contour.
    priors : callable
        From the rod's length to priors by name: weakly informative, and from nothing but the rod's reach.
    start : callable
        From a in y = a x² to values by name, in rod lengths, of a flank that is about as bent.
    miss : callable
        From places seen from the vertex, and values by name, to their distances from the flank, about.
    is_always_clear : bool
        Whether a rod that has snapped off is past every such contour.
    """

    build: Callable[[Values], Contour]
    length_powers: Mapping[str, int]
    bounds: Mapping[str, tuple[float, float]]
    priors: Callable[[float], dict[str, Prior]]
    start: Callable[[float], dict[str, float]]
    miss: Callable[[Floats, Floats, Values], Floats]
    is_always_clear: bool = False


class Family(ABC):
    """Contours that a vector of parameters describes, q and x_c, the vertex, being its last."""

    name: str
    """What users call it."""
    length_powers: Mapping[str, int]
    """For every parameter, by name and in order, the power of length in its unit."""
    bounds: Mapping[str, tuple[float, float]]
    """What parameters are at least, and at most, whatever a prior says."""

    @property
    def parameters(self) -> tuple[str, ...]:
        return tuple(self.length_powers)

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

    def default_priors(self, base: tuple[float, float], length: float) -> dict[str, Prior]:
        """Priors by name, from pivot (x, y) and rod length alone.

        The vertex lies within a rod length of the pivot, to the side and in height, anywhere alike.
        """
        x, y = base
        vertex = {"q": stats.uniform(y - length, 2.0 * length), "x_c": stats.uniform(x - length, 2.0 * length)}
        return self._own_priors(length) | vertex

    @abstractmethod
    def _own_priors(self, length: float) -> dict[str, Prior]:
        """Of what is not the vertex."""

    @abstractmethod
    def fit(self, x: Floats, y: Floats) -> dict[str, float]:
        """Parameters by name that fit points (x, y) in rod lengths, by least squares that outliers do not rule."""


@dataclass(frozen=True)
class FlankFamily(Family):
    """Contours of one flank on both sides, or of two.

    Parameters
    ----------
    name : str
        What users call it.
    flanks : mapping of str to Flank
        By what stands before the names of their parameters: "" of one flank, "left_" and "right_" of two.
    """

    name: str
    flanks: Mapping[str, Flank]
    length_powers: Mapping[str, int] = field(init=False)
    bounds: Mapping[str, tuple[float, float]] = field(init=False)

    def __post_init__(self) -> None:
        powers = {f"{side}{name}": p for side, flank in self.flanks.items() for name, p in flank.length_powers.items()}
        bounds = {f"{side}{name}": b for side, flank in self.flanks.items() for name, b in flank.bounds.items()}
        object.__setattr__(self, "length_powers", {**powers, "q": 1, "x_c": 1})
        object.__setattr__(self, "bounds", bounds)

    @property
    def is_always_clear(self) -> bool:
        return all(flank.is_always_clear for flank in self.flanks.values())

    def build(self, *values: Any) -> Contour:
        by_name = dict(zip(self.parameters, values, strict=True))
        halves = [flank.build(self._own(side, by_name)) for side, flank in self.flanks.items()]
        return halves[0] if len(halves) == 1 else Joined(halves[0], halves[1])

    def _own_priors(self, length: float) -> dict[str, Prior]:
        return {
            f"{side}{name}": prior
            for side, flank in self.flanks.items()
            for name, prior in flank.priors(length).items()
        }

    def fit(self, x: Floats, y: Floats) -> dict[str, float]:
        a, q, x_c = parabola_through(x, y)
        names = list(self.parameters[:-2])

        def values_at(point: Floats) -> dict[str, float]:
            own = {name: self._unfold(name, p) for name, p in zip(names, point[:-2], strict=True)}
            return own | {"q": float(point[-2]), "x_c": float(point[-1])}

        def miss(point: Floats) -> Floats:
            values = values_at(point)
            u, v = x - values["x_c"], y - values["q"]
            parts = [flank.miss(u, v, self._own(side, values)) for side, flank in self.flanks.items()]
            return parts[0] if len(parts) == 1 else np.where(u < 0.0, *parts)

        found = []
        for bend in (a, 0.4 * a, 2.5 * a):
            start: dict[str, float] = {}
            for side, flank in self.flanks.items():
                start |= {f"{side}{name}": value for name, value in flank.start(bend).items()}
            found.append(_robust(miss, np.array([*(self._fold(name, start[name]) for name in names), q, x_c])))
        return values_at(min(found, key=lambda point: float(np.median(np.abs(miss(point))))))

    def _own(self, side: str, values: Values) -> dict[str, Any]:
        """The parameters of one flank, by its own names, with those of the vertex."""
        names = self.flanks[side].length_powers
        return {name: values[f"{side}{name}"] for name in names} | {"q": values["q"], "x_c": values["x_c"]}

    def _fold(self, name: str, value: float) -> float:
        """A bounded parameter as one that may have any value."""
        return float(np.log(value - self.bounds[name][0]))

    def _unfold(self, name: str, value: float) -> float:
        low, high = self.bounds[name]
        return float(min(low + np.exp(np.clip(value, -20.0, 20.0)), high))


def parabola_through(x: Floats, y: Floats) -> tuple[float, float, float]:
    """a, q and x_c of a parabola through points; a positive one."""
    design = np.stack([x * x, x, np.ones_like(x)], axis=1)
    a, b, c = _robust(lambda p: design @ p - y, np.linalg.lstsq(design, y, rcond=None)[0])
    if not a > 0.0:
        return 0.5, float(np.min(y)), float(x[np.argmin(y)])
    return float(a), float(c - b * b / (4.0 * a)), float(-b / (2.0 * a))


def _robust(miss: Callable[[Floats], Floats], point: Any) -> Floats:
    """Least squares that outliers do not rule: repeated, each time in units of the spread that the last one left."""
    for _ in range(5):
        spread = max(float(np.median(np.abs(miss(point)))), 1e-9)

        def scaled(p: Floats, unit: float = spread) -> Floats:
            return miss(p) / unit

        before, point = point, least_squares(scaled, point, loss="soft_l1", max_nfev=_MOST_STEPS).x
        if np.allclose(point, before, rtol=_SETTLED, atol=_SETTLED):
            break
    return np.asarray(point)


_POSITIVE = (0.0, np.inf)


def _power_law(values: Values) -> Contour:
    with np.errstate(over="ignore", divide="ignore"):  # where it is narrow, or wide, and n is large
        steepness = np.clip(values["w"] ** (1.0 - values["n"]), 1.0 / _STEEPEST, _STEEPEST)
    return PowerLaw(steepness, values["n"], values["q"], values["x_c"])


def _ellipse_miss(u: Floats, v: Floats, values: Values) -> Floats:
    a, b = values["a"], values["b"]
    across, up = u / a, (v - b) / b
    share = np.hypot(across, up)
    return (share - 1.0) * share / (np.hypot(across / a, up / b) + 1e-9)


FLANKS: dict[str, Flank] = {
    # Radius of curvature at the vertex, 1/(2a), like the circle's: half a rod length, give or take a factor of e.
    "parabola": Flank(
        lambda v: Parabola(v["a"], v["q"], v["x_c"]),
        {"a": -1},
        {"a": _POSITIVE},
        lambda length: {"a": stats.lognorm(s=1.0, scale=1.0 / length)},
        lambda a: {"a": a},
        lambda u, v, values: values["a"] * u * u - v,
        is_always_clear=True,
    ),
    "circle": Flank(
        lambda v: Circle(v["r"], v["q"], v["x_c"]),
        {"r": 1},
        {"r": _POSITIVE},
        lambda length: {"r": stats.lognorm(s=1.0, scale=0.5 * length)},
        lambda a: {"r": 0.5 / a},
        lambda u, v, values: np.hypot(u, v - values["r"]) - values["r"],
        is_always_clear=True,
    ),
    "ellipse": Flank(
        lambda v: Ellipse(v["a"], v["b"], v["q"], v["x_c"]),
        {"a": 1, "b": 1},
        {"a": _POSITIVE, "b": _POSITIVE},
        lambda length: {name: stats.lognorm(s=1.0, scale=0.5 * length) for name in ("a", "b")},
        lambda a: {"a": 0.5 / a, "b": 0.5 / a},
        _ellipse_miss,
    ),
    # w is where the contour is as high above its vertex as it is wide; a is w^(1 − n), so of a unit that n decides.
    "power-law": Flank(
        _power_law,
        {"w": 1, "n": 0},
        {"w": _POSITIVE, "n": (1.1, 50.0)},
        lambda length: {"w": stats.lognorm(s=1.0, scale=length), "n": stats.lognorm(s=0.7, loc=1.0, scale=1.0)},
        lambda a: {"w": 1.0 / a, "n": 2.0},
        lambda u, v, values: (
            values["w"] * np.minimum(np.abs(u / values["w"]), _FAR) ** np.minimum(values["n"], 50.0) - v
        ),
    ),
}
"""By name; any two make a joined family."""

FAMILIES: dict[str, Family] = {
    **{name: FlankFamily(name, {"": flank}) for name, flank in FLANKS.items()},
    **{
        f"{left}/{right}": FlankFamily(f"{left}/{right}", {"left_": FLANKS[left], "right_": FLANKS[right]})
        for left in FLANKS
        for right in FLANKS
    },
}
"""Families by name; "parabola/circle" is a parabola on the left of its vertex, and a circle on the right."""
