"""Families of contours by the names that specifications use."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tactile_bayes.contours import Circle, Contour, Ellipse, Joined, Parabola, PowerLaw, ShapeFree
from tactile_bayes.contours.base import refuse_unless
from tactile_bayes.errors import ContourError

__all__ = ["FAMILIES", "FLANKS", "KNOTS", "LOG_RADIUS", "Family", "rule_of"]

Floats = NDArray[np.float64]

KNOTS = np.linspace(-1.5, 1.5, 13)
"""Slope angles at which a shape-free contour's radius of curvature is drawn."""

LOG_RADIUS = "log_radius"
"""Its logarithm there, a parameter of shape (..., knots)."""

_LARGEST_AMPLITUDE, _LEAST_LENGTH_SCALE = 3.0, 0.1
"""Beyond, radii of curvature change by powers of ten from knot to knot, and paths along them take for ever."""


@dataclass(frozen=True)
class Family:
    """Contours of one family.

    Parameters
    ----------
    parameters : tuple of str
        All that must be given.
    optional : mapping of str to float
        What may be left out, with what it is then.
    build : callable
        From arrays of the parameters by name.
    draw_log_radius : callable, optional
        Of a contour that is not its parameters alone: from these, and standard normal numbers of shape (records,
        knots), the logarithm of the radius of curvature at `KNOTS`, which `build` then wants.
    """

    parameters: tuple[str, ...]
    optional: Mapping[str, float]
    build: Callable[[Mapping[str, Floats]], Contour]
    draw_log_radius: Callable[[Mapping[str, Floats], Floats], Floats] | None = None

    def refuse(self, name: str, value: float) -> None:
        """Raise ContourError if no contour has this value of a parameter, whatever the others are."""
        possible = {key: np.full(1, 2.0 if key.endswith("n") else 1.0) for key in (*self.parameters, *self.optional)}
        if self.draw_log_radius is not None:
            possible[LOG_RADIUS] = np.zeros((1, KNOTS.size))
        self.build(possible | {name: np.full(1, value)})


def rule_of(error: ContourError) -> str:
    """The rule that parameters have broken, without their values, so that many breaches of it count as one."""
    words = str(error).partition("; found ")[0]
    return words.partition(": ")[2] or words


def _shape_free(values: Mapping[str, Floats]) -> Contour:
    amplitude, length_scale = values["amplitude"], values["length_scale"]
    refuse_unless(
        (amplitude >= 0.0) & (amplitude <= _LARGEST_AMPLITUDE),
        "shape-free",
        f"amplitude must be from 0 to {_LARGEST_AMPLITUDE:g}, the latter a factor of 20 in the radius",
        amplitude=amplitude,
    )
    refuse_unless(
        length_scale >= _LEAST_LENGTH_SCALE,
        "shape-free",
        f"length_scale must be at least {_LEAST_LENGTH_SCALE:g} rad: the radius is drawn at slope angles "
        f"{KNOTS[1] - KNOTS[0]:g} rad apart",
        length_scale=length_scale,
    )
    return ShapeFree(KNOTS, values[LOG_RADIUS], values["x_c"], values["q"])


def _log_radius(values: Mapping[str, Floats], normals: Floats) -> Floats:
    """log ρ is a Gaussian process over the slope angle, with a squared-exponential kernel."""
    apart = KNOTS[:, None] - KNOTS
    kernel = np.exp(-0.5 * (apart / values["length_scale"][:, None, None]) ** 2) + 1e-9 * np.eye(KNOTS.size)
    smooth = np.einsum("nij,nj->ni", np.linalg.cholesky(kernel), normals)
    return np.asarray(np.log(values["radius"])[:, None] + values["amplitude"][:, None] * smooth)


_PLACE = {"x_c": 0.0}

FLANKS: Mapping[str, Family] = {
    "parabola": Family(("a", "q"), _PLACE, lambda v: Parabola(v["a"], v["q"], v["x_c"])),
    "circle": Family(("r", "q"), _PLACE, lambda v: Circle(v["r"], v["q"], v["x_c"])),
    "ellipse": Family(("a", "b", "q"), _PLACE, lambda v: Ellipse(v["a"], v["b"], v["q"], v["x_c"])),
    "power-law": Family(("a", "n", "q"), _PLACE, lambda v: PowerLaw(v["a"], v["n"], v["q"], v["x_c"])),
}
"""Families with a vertex, of which any two, or one twice, make a joined contour."""


def _joined(left: str, right: str) -> Family:
    def own(side: str, name: str) -> str:
        return name if name in ("q", "x_c") else f"{side}_{name}"

    def half(side: str, family: str, values: Mapping[str, Floats]) -> Contour:
        flank = FLANKS[family]
        return flank.build({n: values[own(side, n)] for n in (*flank.parameters, *flank.optional)})

    names = [own(side, n) for side, family in (("left", left), ("right", right)) for n in FLANKS[family].parameters]
    return Family(
        tuple(dict.fromkeys(names)),
        _PLACE,
        lambda v: Joined(half("left", left, v), half("right", right, v)),
    )


FAMILIES: Mapping[str, Family] = {
    **FLANKS,
    "shape-free": Family(
        ("radius", "amplitude", "length_scale", "q"),
        _PLACE,
        _shape_free,
        _log_radius,
    ),
    **{f"{left}/{right}": _joined(left, right) for left in FLANKS for right in FLANKS},
}
"""Families that data sets may draw from; "parabola/circle" is a parabola on the left and a circle on the right."""
