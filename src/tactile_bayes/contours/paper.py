"""The four profiles of the paper."""

from __future__ import annotations

from typing import Literal

from tactile_bayes.contours.base import Contour
from tactile_bayes.contours.joined import Joined
from tactile_bayes.contours.oval import Circle
from tactile_bayes.contours.parabola import Parabola
from tactile_bayes.contours.power_law import PowerLaw
from tactile_bayes.errors import ContourError


def paper_profile(name: Literal["I", "II", "III", "IV"], q: float) -> Contour:
    """Return one of the paper's profiles (equations 21 to 24 of Merker et al. 2018, doi 10.1155/2018/1613945).

    Parameters
    ----------
    name : {"I", "II", "III", "IV"}
        0.7 x² + q, 0.5 x² + q, 1 − √(1 − x²) + q, or 0.5 x² + q for x < 0 and x⁴ + q for x ≥ 0, in rod lengths.
    q : float
        Height of the vertex above the x axis, in rod lengths.

    Raises
    ------
    ContourError
        If there is no profile of that name, or q is not finite.

    Examples
    --------
    >>> from tactile_bayes.contours import paper_profile
    >>> paper_profile("II", q=0.5)
    Parabola(a=0.5, q=0.5, x_c=0.0)
    """
    profiles: dict[str, Contour] = {
        "I": Parabola(0.7, q),
        "II": Parabola(0.5, q),
        "III": Circle(1.0, q),
        "IV": Joined(Parabola(0.5, q), PowerLaw(1.0, 4.0, q)),
    }
    if not isinstance(name, str) or name not in profiles:
        raise ContourError(f"there is no profile {name!r}: choose 'I', 'II', 'III' or 'IV'")
    return profiles[name]
