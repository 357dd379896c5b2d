"""Variations: numbers that may differ from record to record of a data set."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from tactile_bayes.arrays import Floats, Index
from tactile_bayes.checks import as_number, shown
from tactile_bayes.distributions import KINDS, Distribution, distribution_of_table, in_words, open_share, support_of
from tactile_bayes.errors import SpecificationError
from tactile_bayes.rig.rig_file import number_in

_WORDS = {"default": "the default of the rig", "calibrated": "as the calibration of the rig has found"}


@dataclass(frozen=True)
class Variation:
    """A number for each record: constant, drawn (by `KINDS`, choice, or scipy), "each" of a list in turn, in all
    combinations with other lists, except those on the same axis, which advance in step; deviations of a rig may be
    "default" (around what its data sheets state) or "calibrated".
    """

    kind: str
    numbers: tuple[float, ...] = ()  # parameters of the kind; of scipy the finite ends of its support
    axis: str | None = None  # axis of a list
    of: Any = None  # frozen distribution of the kind "scipy"

    @property
    def ends(self) -> tuple[float, float]:
        """Least and greatest possible number; for log_normal, which is always positive, the median is the least."""
        if self.kind == "scipy":
            return support_of(self.of)
        if self.kind in ("normal", "log_normal", "half_normal") and self.numbers[-1]:
            least = {"normal": -math.inf, "log_normal": self.numbers[0], "half_normal": 0.0}
            return least[self.kind], math.inf
        numbers = self.numbers[:1] if self.kind in ("normal", "log_normal") else self.numbers
        return min(numbers), max(numbers)

    @property
    def text(self) -> str:
        """Description of the distribution."""
        numbers = [f"{number:g}" for number in self.numbers]
        if self.kind == "choice":
            return f"one of {', '.join(numbers)}"
        if self.kind == "each":
            return f"each of {', '.join(numbers)}" + (f", on the axis {self.axis}" if self.axis else "")
        if self.kind in _WORDS:
            return _WORDS[self.kind]
        if self.kind == "scipy":
            return in_words(self.of)
        return KINDS[self.kind].text.format(*numbers) if self.kind in KINDS else numbers[0]

    @property
    def frozen(self) -> Distribution:
        """The distribution as a frozen one of scipy.stats."""
        found: Distribution = KINDS[self.kind].frozen(*self.numbers) if self.of is None else self.of
        return found

    def at(self, share: Floats, turn: Index) -> Floats:
        """Return the quantiles at probabilities in [0, 1), for records with given positions in the list."""
        if self.kind == "choice":
            return np.array(self.numbers)[(share * len(self.numbers)).astype(np.intp)]
        if self.kind == "each":
            return np.array(self.numbers)[turn]
        if self.kind == "constant":
            return np.full(share.shape, self.numbers[0])
        if self.kind == "scipy":
            return np.asarray(self.of.ppf(open_share(share)))
        return np.asarray(KINDS[self.kind].at(*self.numbers, share))


def quantity_of(value: Any, key: str, unit: str, is_si: bool) -> Variation:
    """Parse a distribution of a quantity, whose numbers may be texts with a unit; see `variation_of`."""
    return variation_of(value, key, partial(number_in, unit=unit, name=key, is_si=is_si))


def variation_of(value: Any, key: str, number: Callable[[Any], float | None] = as_number) -> Variation:
    """Parse the distribution that a value of a specification states; messages name it by `key`. `number` returns a
    number that stands there, also as a text with a unit, or None if there is none.
    """
    plain = number(value)
    if plain is not None and math.isfinite(plain):
        return Variation("constant", (plain,))
    kinds = (*KINDS, "choice", "each")
    hint = f"give a number, or a distribution such as {{ uniform = [0.3, 0.8] }} (distributions: {', '.join(kinds)})"
    axis = None
    if isinstance(value, dict) and "each" in value and "axis" in value:
        value = dict(value)
        axis = value.pop("axis")
        if not isinstance(axis, str) or not axis:
            raise SpecificationError(
                f"{key}.axis is {shown(axis)}: give a name, the same for lists that advance in step"
            )
    if not isinstance(value, dict) or len(value) != 1:
        raise SpecificationError(f"{key} is {value!r:.1000}: {hint}")
    ((kind, stated),) = value.items()
    if isinstance(stated, dict):
        found = distribution_of_table(value, key, number)
        assert not isinstance(found, float)
        return Variation("scipy", tuple(end for end in support_of(found) if math.isfinite(end)), of=found)
    if kind not in kinds:
        raise SpecificationError(f"{key} has the distribution {shown(kind)}, which is unknown: {hint}")
    of = KINDS.get(kind)
    listed = [stated] if of is not None and of.size == 1 and not isinstance(stated, list) else stated
    numbers = [number(each) for each in listed] if isinstance(listed, list) else []
    wanted = max(len(numbers), 1) if of is None else of.size
    if len(numbers) != wanted or not all(each is not None and math.isfinite(each) for each in numbers):
        raise SpecificationError(f"{key}.{kind} is {shown(stated)}: give a list of {wanted} finite numbers")
    if of is not None and not of.is_possible(*numbers):
        raise SpecificationError(f"{key}.{kind} is {shown(stated)}: {of.rule}")
    made = Variation(kind, tuple(each for each in numbers if each is not None), axis)
    with np.errstate(all="ignore"):
        ends = made.at(np.array([0.0, 1.0 - 2.0**-53]), np.zeros(2, dtype=np.intp))
    if not np.isfinite(ends).all():
        raise SpecificationError(f"{key}.{kind} is {shown(stated)}: its draws may be larger than any number, narrow it")
    return made
