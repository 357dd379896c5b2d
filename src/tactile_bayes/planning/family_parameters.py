"""What a contour is in the parameters of its family."""

from __future__ import annotations

import numpy as np

from tactile_bayes.contours import Circle, Contour, Ellipse, Joined, Parabola, PowerLaw
from tactile_bayes.errors import ParameterError
from tactile_bayes.inference.family_names import family_named

__all__ = ["enlarged", "family_parameters"]


def family_parameters(contour: Contour) -> tuple[str, dict[str, float]]:
    """The family, by the name that `infer_contour` takes, and the parameters that it gives this contour.

    Parameters
    ----------
    contour : Contour
        A single one.

    Raises
    ------
    ParameterError
        If it is of none of the families that have parameters.

    Examples
    --------
    >>> from tactile_bayes.contours import paper_profile
    >>> family_parameters(paper_profile("IV", q=0.5))
    ('parabola/power-law', {'left_a': 0.5, 'right_w': 1.0, 'right_n': 4.0, 'q': 0.5, 'x_c': 0.0})
    """
    if not isinstance(contour, Contour):
        raise ParameterError(f"{contour!r} is no contour: give one of tb.contours, like paper_profile('II', q=0.5)")
    if contour.shape != ():
        raise ParameterError(f"{contour!r} is a list of contours: give a single one")
    if isinstance(contour, Joined):
        left, right = _flank(contour.left), _flank(contour.right)
        if left is None or right is None or left[1:] != right[1:]:
            raise _not_of_a_family(contour)
        own = {
            f"{side}_{name}": value
            for side, flank in (("left", left), ("right", right))
            for name, value in flank[0][1].items()
        }
        q, x_c = left[1:]
        return f"{left[0][0]}/{right[0][0]}", {**own, "q": q, "x_c": x_c}
    flank = _flank(contour)
    if flank is None:
        raise _not_of_a_family(contour)
    (family, own), q, x_c = flank
    return family, {**own, "q": q, "x_c": x_c}


def enlarged(contour: Contour, factor: float) -> Contour:
    """The contour, of a family with parameters, as many times larger, seen from the origin.

    Examples
    --------
    >>> from tactile_bayes.contours import paper_profile
    >>> enlarged(paper_profile("II", q=0.5), 0.2)
    Parabola(a=2.5, q=0.1, x_c=0.0)
    """
    name, values = family_parameters(contour)
    family = family_named(name)
    return family.build(*(values[p] * factor ** family.length_powers[p] for p in family.parameters))


def _flank(contour: Contour) -> tuple[tuple[str, dict[str, float]], float, float] | None:
    """Family and parameters of its own, height and place of the vertex."""
    match contour:
        case Parabola():
            own = "parabola", {"a": contour.a}
        case Circle():
            own = "circle", {"r": contour.r}
        case Ellipse():
            own = "ellipse", {"a": contour.a, "b": contour.b}
        case PowerLaw():
            own = "power-law", {"w": np.asarray(contour.a) ** (1.0 / (1.0 - np.asarray(contour.n))), "n": contour.n}
        case _:
            return None
    numbers = {name: float(value) for name, value in own[1].items()}
    return (own[0], numbers), float(contour.q), float(contour.x_c)


def _not_of_a_family(contour: Contour) -> ParameterError:
    return ParameterError(
        f"{type(contour).__name__} is of no family with parameters: give a parabola, circle, ellipse or power law, or "
        "two of these joined at their vertex"
    )
