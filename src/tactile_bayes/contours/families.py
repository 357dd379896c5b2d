"""The registry of families by the names that users give."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from tactile_bayes.arrays import Floats
from tactile_bayes.checks import shown
from tactile_bayes.contours.base import Contour
from tactile_bayes.contours.family import (
    VERTEX,
    ContourFamily,
    FamilyParameter,
    log_normal,
    parabola_through,
    robust_least_squares,
)
from tactile_bayes.contours.joined import Joined
from tactile_bayes.contours.oval import Circle, Ellipse
from tactile_bayes.contours.parabola import Parabola
from tactile_bayes.contours.power_law import PowerLaw
from tactile_bayes.contours.shape_free_family import FLAT_SIDED, SHAPE_FREE
from tactile_bayes.errors import ParameterError

_FAR = 1e3  # widths from the vertex beyond which the height of a power law is constant, to avoid overflow
Values = Mapping[str, Any]


@dataclass(frozen=True)
class Flank:
    """Contours with a vertex at height q above x_c and one formula, on one side of it or on both."""

    contour: type[Contour]  # class of the contours, which has the parameters as attributes
    table: Mapping[str, FamilyParameter]  # parameters of the flank by name
    # Maps a in y = a x² to parameters by name, in rod lengths, of a flank with about the same curvature.
    start: Callable[[float], dict[str, float]]
    # Maps points relative to the vertex, and parameters by name, to their approximate distances from the flank.
    miss: Callable[[Floats, Floats, Values], Floats]
    build: Callable[..., Contour] | None = None  # maps parameters by name, with q and x_c, to contours; else the class
    is_always_clear: bool = False  # whether a rod is clear of every such contour after snap-off


@dataclass(frozen=True)
class FlankFamily(ContourFamily):
    """Family of contours with one flank on both sides, or with two different flanks."""

    name: str
    flanks: Mapping[str, Flank]  # by the prefix of their parameters: "" for one flank, "left_" and "right_" for two

    @cached_property
    def table(self) -> dict[str, FamilyParameter]:  # type: ignore[override]
        return {f"{side}{name}": p for side, flank in self.flanks.items() for name, p in flank.table.items()} | VERTEX

    @property
    def is_always_clear(self) -> bool:
        return all(flank.is_always_clear for flank in self.flanks.values())

    def build(self, *values: Any) -> Contour:
        by_name = dict(zip(self.parameters, values, strict=True))
        halves = [(flank.build or flank.contour)(**self._own(side, by_name)) for side, flank in self.flanks.items()]
        return halves[0] if len(halves) == 1 else Joined(halves[0], halves[1])

    def fit(self, x: Floats, y: Floats) -> dict[str, float]:
        a, q, x_c = parabola_through(x, y)
        names = self.parameters[:-2]

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
            start = {f"{side}{n}": v for side, flank in self.flanks.items() for n, v in flank.start(bend).items()}
            point = np.array([*(self._fold(name, start[name]) for name in names), q, x_c])
            found.append(robust_least_squares(miss, point))
        return values_at(min(found, key=lambda point: float(np.median(np.abs(miss(point))))))

    def _own(self, side: str, values: Values) -> dict[str, Any]:
        """Parameters of one flank, by its own names, with those of the vertex."""
        names = self.flanks[side].table
        return {name: values[f"{side}{name}"] for name in names} | {"q": values["q"], "x_c": values["x_c"]}

    def _fold(self, name: str, value: float) -> float:
        """Map a bounded parameter to an unbounded one."""
        return float(np.log(value - self.bounds[name][0]))

    def _unfold(self, name: str, value: float) -> float:
        low, high = self.bounds[name]
        return float(min(low + np.exp(np.clip(value, -20.0, 20.0)), high))


def _ellipse_miss(u: Floats, v: Floats, values: Values) -> Floats:
    a, b = values["a"], values["b"]
    across, up = u / a, (v - b) / b
    share = np.hypot(across, up)
    return (share - 1.0) * share / (np.hypot(across / a, up / b) + 1e-9)


def _size(meaning: str, scale: float, length_power: int = 1) -> FamilyParameter:
    """Return a positive parameter with a log-normal prior about `scale`, in rod lengths."""
    return FamilyParameter(meaning, length_power, log_normal(1.0, scale), (0.0, np.inf))


# Flanks by name; any two make a joined family.
FLANKS: dict[str, Flank] = {
    # Radius of curvature at the vertex, 1/(2a), like the circle's: half a rod length within a factor of e.
    "parabola": Flank(
        Parabola,
        {"a": _size("half the curvature at the vertex", 1.0, -1)},
        start=lambda a: {"a": a},
        miss=lambda u, v, values: values["a"] * u * u - v,
        is_always_clear=True,
    ),
    "circle": Flank(
        Circle,
        {"r": _size("radius", 0.5)},
        start=lambda a: {"r": 0.5 / a},
        miss=lambda u, v, values: np.hypot(u, v - values["r"]) - values["r"],
        is_always_clear=True,
    ),
    "ellipse": Flank(
        Ellipse,
        {"a": _size("horizontal half-axis", 0.5), "b": _size("vertical half-axis", 0.5)},
        start=lambda a: {"a": 0.5 / a, "b": 0.5 / a},
        miss=_ellipse_miss,
    ),
    # The unit of PowerLaw's a = w^(1 − n) would depend on n.
    "power-law": Flank(
        PowerLaw,
        {
            "w": _size("width at which a power law is as high as wide", 1.0),
            "n": FamilyParameter("exponent", 0, log_normal(0.7, 1.0, loc=1.0), (1.1, 50.0)),
        },
        start=lambda a: {"w": 1.0 / a, "n": 2.0},
        miss=lambda u, v, values: values["w"] * np.minimum(np.abs(u / values["w"]), _FAR) ** values["n"] - v,
        build=PowerLaw.of_width,
    ),
}


def sides_of(family: str) -> dict[str, str]:
    """Names of the flanks of a family, by the prefix of the names of their parameters."""
    names = family.split("/")
    return dict(zip(("left_", "right_") if len(names) > 1 else ("",), names, strict=True))


def _of_flanks(name: str) -> FlankFamily:
    return FlankFamily(name, {side: FLANKS[flank] for side, flank in sides_of(name).items()})


# Families by name; "parabola/circle" is a parabola on the left of the vertex and a circle on the right.
FAMILIES: dict[str, ContourFamily] = {
    **{name: _of_flanks(name) for name in FLANKS},
    SHAPE_FREE.name: SHAPE_FREE,
    FLAT_SIDED.name: FLAT_SIDED,
    **{f"{left}/{right}": _of_flanks(f"{left}/{right}") for left in FLANKS for right in FLANKS},
}


def family_named(name: str) -> ContourFamily:
    """Return the family with a name."""
    if not isinstance(name, str) or name not in FAMILIES:
        raise ParameterError(
            f"there is no family {shown(name)}: choose {', '.join(FLANKS)}, one for each flank, like "
            "parabola/power-law, shape-free or flat-sided"
        )
    return FAMILIES[name]
