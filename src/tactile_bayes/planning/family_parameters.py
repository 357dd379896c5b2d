"""The family of a contour, and its parameters."""

from __future__ import annotations

from typing import Any

from tactile_bayes.contours import Contour, Joined
from tactile_bayes.contours.families import FLANKS, family_named, sides_of
from tactile_bayes.errors import ParameterError


def family_parameters(contour: Contour) -> tuple[str, dict[str, float]]:
    """Return the name of a contour's family, as in `infer_contour`, and its parameters."""
    if not isinstance(contour, Contour):
        raise ParameterError(f"{contour!r} is no contour: give one of tb.contours, like paper_profile('II', q=0.5)")
    if contour.shape != ():
        raise ParameterError(f"{contour!r} is a list of contours: give a single one")
    halves: list[Any] = [contour.left, contour.right] if isinstance(contour, Joined) else [contour]
    names = [name for half in halves for name, flank in FLANKS.items() if isinstance(half, flank.contour)]
    if len(names) < len(halves) or len(vertices := {(float(half.q), float(half.x_c)) for half in halves}) > 1:
        raise ParameterError(
            f"{type(contour).__name__} is of no family with parameters: give a parabola, circle, ellipse or power law, "
            "or two of these joined at their vertex"
        )
    ((q, x_c),) = vertices
    family = "/".join(names)
    own = {
        f"{side}{parameter}": float(getattr(half, parameter))
        for half, (side, flank) in zip(halves, sides_of(family).items(), strict=True)
        for parameter in FLANKS[flank].table
    }
    return family, {**own, "q": q, "x_c": x_c}


def enlarged(contour: Contour, factor: float) -> Contour:
    """Return a contour scaled by a factor about the origin."""
    name, values = family_parameters(contour)
    family = family_named(name)
    return family.build(*(values[p] * factor ** family.length_powers[p] for p in family.parameters))
