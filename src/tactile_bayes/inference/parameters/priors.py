"""Priors of parameters."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from typing import Any, Protocol, runtime_checkable

import numpy as np
from scipy import stats

from tactile_bayes.checks import as_number, check_kind, check_mapping, shown
from tactile_bayes.contours.family import Family, FamilyParameter
from tactile_bayes.errors import ParameterError

__all__ = [
    "MAY_VANISH",
    "Prior",
    "check_prior",
    "check_priors",
    "default_priors",
    "numbers_of",
    "own_priors",
    "refuse_unknown_priors",
    "support_of",
]

_TRIED = 16
"""Number of draws with which a prior is tried."""

_NARROWEST = 64.0 * float(np.finfo(float).eps)
"""Range of draws over their size up to which they count as one number."""

_HELD = 1e-6
"""Standard deviation of a prior that holds a parameter, over its value."""

MAY_VANISH = ("friction", "suspension_compliance", "taper", "stem")
"""Nuisance parameters that are zero or positive, and may be zero."""


@runtime_checkable
class Prior(Protocol):
    """Protocol of a prior, which frozen distributions of scipy.stats satisfy."""

    def logpdf(self, x: Any) -> Any: ...
    def rvs(self, size: int, random_state: np.random.Generator) -> Any: ...
    def std(self) -> Any: ...


def check_priors(name: str, priors: Any) -> None:
    """Refuse an argument that is no mapping of names to frozen distributions with a density.

    Raises
    ------
    ParameterError
        If it is none.
    """
    correction = "give distributions by name, like {'q': scipy.stats.norm(0.5, 0.1)}"
    check_kind(name, priors, Mapping, correction)
    check_mapping(name, priors, correction)
    for parameter, prior in priors.items():
        check_prior(parameter, prior)


def check_prior(parameter: str, prior: Any) -> None:
    """Refuse a prior that is no frozen distribution, or has no density.

    Raises
    ------
    ParameterError
        If it is none; the message names the parameter.
    """
    if not isinstance(prior, Prior) or isinstance(prior, stats.rv_continuous):
        correction = "give a frozen distribution, like scipy.stats.norm(0.5, 0.1)"
        raise ParameterError(f"the prior of {parameter} is {shown(prior)}: {correction}")
    flaw = _flaw_of(prior)
    if flaw:
        kind = getattr(getattr(prior, "dist", None), "name", "")
        raise ParameterError(f"the prior of {parameter}{f', {kind},' if kind else ''} {flaw}")


def _flaw_of(prior: Prior) -> str:
    """Return what keeps a prior from having a density, and what to do; "" if nothing does."""
    numbers = numbers_of(prior)
    for name, value in numbers.items():
        number = as_number(value)
        if number is None or np.isnan(number):
            return f"has the {name} {shown(value)}: give a number"
    if numbers.get("scale") == 0.0:
        return _no_width(float(numbers["loc"]))
    try:
        with np.errstate(all="ignore"):
            low, high = support_of(prior)
            draws = np.asarray(prior.rvs(_TRIED, random_state=np.random.default_rng(0)), dtype=float)
            density = np.asarray(prior.logpdf(draws), dtype=float)
    except (TypeError, ValueError) as error:
        return f"cannot be drawn from ({error}): check its numbers"
    if draws.shape != (_TRIED,) or density.shape != (_TRIED,):
        return "does not give one number for each draw: give the distribution of a single number"
    if not low <= high or not np.isfinite(draws).all() or np.isnan(density).any() or np.isneginf(density).any():
        return "has no finite draws, or no density there: check its numbers"
    if not np.ptp(draws) > _NARROWEST * float(np.abs(draws).max()):
        return _no_width(float(draws[0]))
    return ""


def _no_width(value: float) -> str:
    narrow = f"scipy.stats.norm({value:.6g}, {_HELD * abs(value) or _HELD:.6g})"
    return f"has no width, and so no density: to hold the parameter, give a narrow one, like {narrow}"


def numbers_of(prior: Prior) -> dict[str, Any]:
    """Return shapes, loc and scale of a frozen distribution of scipy.stats by name, however they were given.

    {} for an object of another kind.

    Examples
    --------
    >>> numbers_of(stats.lognorm(0.5, scale=2.0))
    {'s': 0.5, 'loc': 0, 'scale': 2.0}
    """
    distribution = getattr(prior, "dist", None)
    if not isinstance(distribution, stats.rv_continuous):
        return {}
    shapes, loc, scale = distribution._parse_args(*prior.args, **prior.kwds)  # type: ignore[attr-defined]
    names = distribution.shapes.split(", ") if distribution.shapes else []
    return dict(zip((*names, "loc", "scale"), (*shapes, loc, scale), strict=True))


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
