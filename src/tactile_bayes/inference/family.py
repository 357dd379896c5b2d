"""A family of contours with what is said of its parameters: numbers are known, distributions are unknown."""

from __future__ import annotations

import functools
import json
import math
from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any

import numpy as np
import xarray as xr

from tactile_bayes.arrays import Floats
from tactile_bayes.checks import as_number, check_kind, check_number
from tactile_bayes.contours import Circle, Contour, Parabola, Single
from tactile_bayes.contours.families import family_named
from tactile_bayes.contours.family import ContourFamily, FamilyParameter
from tactile_bayes.distributions import (
    Distribution,
    all_in_words,
    check_distribution,
    distribution_of_table,
    frozen,
    in_words,
    refuse_unknown_names,
    stated_text,
    table_of_distribution,
    text_or_unwritten,
)
from tactile_bayes.errors import ParameterError
from tactile_bayes.inference.misfit import GAUGE
from tactile_bayes.inference.result import refuse_no_contour
from tactile_bayes.tasks.documents import read_json


class Family:
    """A family of contours, with what is said of its parameters: a number is known, a distribution is unknown.

    Parameters
    ----------
    name : str
        parabola, circle, ellipse, power-law, or one for each flank, like "parabola/power-law", on the left and on the
        right of a common vertex; or "shape-free", any smooth contour.
    **said : float or frozen scipy.stats distribution
        Parameters by name, in the unit of length of the record. The others have their default distributions, see
        `infer_contour`.

    Raises
    ------
    ParameterError
        If there is no such family or parameter, what is said of it is neither a number nor a distribution with a
        density, or a number is out of bounds; if all parameters are known.

    Examples
    --------
    >>> from scipy import stats
    >>> Family("circle", r=stats.norm(0.05, 0.002), x_c=0.0)
    Family('circle', r=norm(0.05, 0.002), x_c=0.0)
    """

    name: str
    priors: Mapping[str, Distribution]  # distributions that are given, by parameter
    known: Mapping[str, float]

    def __init__(self, name: str, /, **said: Any) -> None:
        family = family_named(name)
        refuse_unknown_names(said, family.parameters, f" of Family({name!r})")
        known, priors = {}, {}
        for parameter, value in said.items():
            number = as_number(value)
            if number is None:
                check_distribution(parameter, distribution := frozen(value))
                priors[parameter] = distribution
                continue
            low, high = family.bounds[parameter]
            least = low or math.ulp(0.0)  # sizes are positive
            check_number(parameter, number, f"give a number from {least:g} to {high:g}", least=least, most=high)
            known[parameter] = number
        if known and family.roughness:
            raise ParameterError(
                f"{', '.join(known)} cannot be known in Family({name!r}), which any shape may have: give distributions"
            )
        if len(known) == len(family.parameters):
            raise ParameterError(f"Family({name!r}) leaves nothing unknown: leave a number out, or give a distribution")
        self.name, self.priors, self.known = family.name, MappingProxyType(priors), MappingProxyType(known)

    def __repr__(self) -> str:
        said = {**{name: in_words(each) for name, each in self.priors.items()}, **self.known}
        return f"Family({', '.join([repr(self.name), *(f'{name}={value}' for name, value in said.items())])})"

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Family) and self._identity == other._identity

    def __hash__(self) -> int:
        return hash(self._identity)

    def __reduce__(self) -> tuple[Any, ...]:
        return functools.partial(Family, self.name, **self.priors, **self.known), ()

    @property
    def _identity(self) -> tuple[Any, ...]:
        return self.name, all_in_words(self.priors), tuple(sorted(self.known.items()))

    @functools.cached_property
    def contours(self) -> ContourFamily:
        """Contours of the unknown parameters."""
        family = family_named(self.name)
        return PartlyKnown(family, dict(self.known)) if self.known else family

    @property
    def text(self) -> str:
        """What is said of the parameters, as text; "not written" if a distribution is none of SciPy's."""
        said: dict[str, Any] = {**self.priors, **self.known}
        return text_or_unwritten(
            lambda: json.dumps({name: table_of_distribution(value) for name, value in said.items()})
        )

    @classmethod
    def of(cls, posterior: xr.DataTree) -> Family:
        """Return the family of a posterior, from `infer_contour`.

        Raises
        ------
        ParameterError
            If the posterior does not state it, since a distribution was none of SciPy's.
        """
        refuse_no_contour(posterior, "posterior")
        said = read_json(stated_text(posterior.attrs, "family_parameters"), "family_parameters")
        return cls(str(posterior.attrs["family"]), **{n: distribution_of_table(v, n) for n, v in said.items()})

    def only(self, **said: Any) -> Family:
        """Return the family of which something else is said about some parameters."""
        return Family(self.name, **{**self.priors, **self.known, **said})


def family_of(family: str | Family) -> Family:
    """Return a family by name, or as it is."""
    return family if isinstance(family, Family) else Family(family)


@dataclass(frozen=True)
class PartlyKnown(ContourFamily):
    """Contours of a family of which some parameters are known."""

    whole: ContourFamily
    known: Mapping[str, float]

    @property
    def name(self) -> str:  # type: ignore[override]
        return self.whole.name

    @functools.cached_property
    def table(self) -> Mapping[str, FamilyParameter]:  # type: ignore[override]
        return {name: entry for name, entry in self.whole.table.items() if name not in self.known}

    @property
    def is_always_clear(self) -> bool:
        return self.whole.is_always_clear

    def build(self, *values: Any) -> Contour:
        every = np.broadcast_arrays(*values, *self.known.values())
        return self.whole.contour(dict(zip((*self.parameters, *self.known), every, strict=True)))

    def fit(self, x: Floats, y: Floats) -> dict[str, float]:
        found = self.whole.fit(x, y)
        return {name: found[name] for name in self.parameters}


@dataclass(frozen=True)
class Gauge(ContourFamily):
    """Family whose only contour is a known one, in the record's unit of length."""

    known: Contour
    name = GAUGE
    table = MappingProxyType[str, FamilyParameter]({})

    def __post_init__(self) -> None:
        correction = "give the contour of the gauge, like Circle(r=0.01, q=0.03)"
        check_kind("contour", self.known, Contour, correction)
        if isinstance(self.known, Single) or self.known.shape:
            raise ParameterError(
                f"contour is {self.known!r}: {correction}, one contour of a family (not from_points or from_function)"
            )

    @property
    def is_always_clear(self) -> bool:
        return isinstance(self.known, Circle | Parabola)

    def build(self, *values: Any) -> Contour:
        return self.known

    def fit(self, x: Floats, y: Floats) -> dict[str, float]:
        return {}
