"""Priors of parameters."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from typing import Any, Protocol, runtime_checkable

import numpy as np
from scipy import stats

from tactile_bayes.checks import check_kind, check_mapping, shown
from tactile_bayes.contours.family import Family, FamilyParameter
from tactile_bayes.errors import ParameterError

__all__ = [
    "MAY_VANISH",
    "Prior",
    "check_priors",
    "default_priors",
    "own_priors",
    "refuse_unknown_priors",
    "support_of",
]

MAY_VANISH = ("friction", "suspension_compliance", "taper", "stem")
"""Nuisance parameters that are zero or positive, and may be zero."""


@runtime_checkable
class Prior(Protocol):
    """Protocol of a prior, which frozen distributions of scipy.stats satisfy."""

    def logpdf(self, x: Any) -> Any: ...
    def rvs(self, size: int, random_state: np.random.Generator) -> Any: ...
    def std(self) -> Any: ...


def check_priors(name: str, priors: Any) -> None:
    """Refuse an argument that is no mapping of names to frozen distributions.

    Raises
    ------
    ParameterError
        If it is none.
    """
    correction = "give distributions by name, like {'q': scipy.stats.norm(0.5, 0.1)}"
    check_kind(name, priors, Mapping, correction)
    check_mapping(name, priors, correction)
    for parameter, prior in priors.items():
        if not isinstance(prior, Prior) or isinstance(prior, stats.rv_continuous):
            correction = "give a frozen distribution, like scipy.stats.norm(0.5, 0.1)"
            raise ParameterError(f"the prior of {parameter} is {shown(prior)}: {correction}")


def refuse_unknown_priors(priors: Mapping[str, Any], names: Collection[str], whose: str = "", more: str = "") -> None:
    """Refuse priors by names that are no parameters.

    Raises
    ------
    ParameterError
        If there are such names.
    """
    unknown = sorted(set(priors) - set(names))
    if unknown:
        raise ParameterError(
            f"there is a prior {whose}of {', '.join(unknown)}, which is no parameter: there are "
            f"{', '.join(names)}{more}"
        )


def support_of(prior: Prior) -> tuple[float, float]:
    """Return the ends of a prior's support."""
    ends = prior.support() if hasattr(prior, "support") else (-np.inf, np.inf)
    return float(ends[0]), float(ends[1])


def own_priors(family: Family, length: float) -> dict[str, Prior]:
    """Return the default priors of a family's parameters, except the vertex, from the rod's length alone.

    Parameters with the same entry of the table share one prior object, so that their densities come from one call.
    """
    entries = {name: entry for name, entry in family.table.items() if entry.prior is not None}
    made = {id(entry): _prior(entry, length) for entry in entries.values()}
    return {name: made[id(entry)] for name, entry in entries.items()}


def _prior(entry: FamilyParameter, length: float) -> Prior:
    assert entry.prior is not None
    numbers = dict(entry.prior.numbers)
    if entry.length_power:
        numbers["scale"] = numbers["scale"] * length if entry.length_power > 0 else numbers["scale"] / length
    prior: Prior = getattr(stats, entry.prior.distribution)(**numbers)
    return prior


def default_priors(family: Family, base: tuple[float, float], length: float) -> dict[str, Prior]:
    """Return the default priors of a family's parameters by name, from pivot (x, y) and rod length alone [length].

    The vertex is uniformly distributed within a rod length of the pivot, sideways and in height.
    """
    x, y = base
    vertex = {"q": stats.uniform(y - length, 2.0 * length), "x_c": stats.uniform(x - length, 2.0 * length)}
    return own_priors(family, length) | vertex
