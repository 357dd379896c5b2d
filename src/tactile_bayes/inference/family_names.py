"""Families of contours by the names that users give."""

from __future__ import annotations

from tactile_bayes.checks import shown
from tactile_bayes.errors import ParameterError
from tactile_bayes.inference.families import FAMILIES, FLANKS, Family
from tactile_bayes.inference.shape_free_posterior.family import SHAPE_FREE

__all__ = ["family_named"]


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
    >>> family_named("parabola/power-law").parameters
    ('left_a', 'right_w', 'right_n', 'q', 'x_c')
    """
    if isinstance(name, str) and name == SHAPE_FREE.name:
        return SHAPE_FREE
    if not isinstance(name, str) or name not in FAMILIES:
        raise ParameterError(
            f"there is no family {shown(name)}: choose {', '.join(FLANKS)}, one for each flank, like "
            "parabola/power-law, or shape-free"
        )
    return FAMILIES[name]
