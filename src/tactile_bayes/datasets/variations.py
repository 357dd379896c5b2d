"""Variations: numbers that may differ from record to record of a data set."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from tactile_bayes.arrays import Floats, Index
from tactile_bayes.checks import shown
from tactile_bayes.distributions import KINDS, is_finite_number
from tactile_bayes.errors import SpecificationError

__all__ = ["Variation", "variation_of"]


@dataclass(frozen=True)
class Variation:
    """A number for each record: constant, drawn, or from a list in turn.

    Parameters
    ----------
    kind : {"constant", "uniform", "log_uniform", "normal", "log_normal", "half_normal", "choice", "each"}
        Constant: the number. Uniform and log_uniform: the two limits. Normal: mean and standard deviation; log_normal:
        median, and standard deviation of the natural logarithm; half_normal: the scale. Choice: one of a list with
        equal probabilities. Each: the numbers of the list in turn, in all combinations with the specification's other
        lists, except those on the same axis, which advance in step.
    numbers : tuple of float
        Parameters of the kind.
    """

    kind: str
    numbers: tuple[float, ...]
    axis: str | None = None
    """Axis of a list."""

    @property
    def is_drawn(self) -> bool:
        return self.kind not in ("constant", "each")

    @property
    def least(self) -> float:
        """Least possible number; for log_normal, which is always positive, the median."""
        if self.kind == "normal" and self.numbers[1]:
            return -math.inf
        if self.kind == "half_normal":
            return 0.0
        return self.numbers[0] if self.kind in ("normal", "log_normal") else min(self.numbers)

    @property
    def greatest(self) -> float:
        """Greatest possible number."""
        if self.kind in ("normal", "log_normal"):
            return math.inf if self.numbers[1] else self.numbers[0]
        if self.kind == "half_normal":
            return math.inf if self.numbers[0] else 0.0
        return max(self.numbers)

    @property
    def text(self) -> str:
        """Description of the distribution."""
        numbers = [f"{number:g}" for number in self.numbers]
        if self.kind == "choice":
            return f"one of {', '.join(numbers)}"
        if self.kind == "each":
            return f"each of {', '.join(numbers)}" + (f", on the axis {self.axis}" if self.axis else "")
        return KINDS[self.kind].text.format(*numbers) if self.kind in KINDS else numbers[0]

    def at(self, share: Floats, turn: Index) -> Floats:
        """Return the quantiles at probabilities in [0, 1), for records with given positions in the list."""
        if self.kind == "choice":
            return np.array(self.numbers)[(share * len(self.numbers)).astype(np.intp)]
        if self.kind == "each":
            return np.array(self.numbers)[turn]
        if self.kind == "constant":
            return np.full(share.shape, self.numbers[0])
        return np.asarray(KINDS[self.kind].at(*self.numbers, share))


def variation_of(value: Any, key: str) -> Variation:
    """Parse the distribution that a value of a specification states; messages name it by `key`.

    Raises
    ------
    SpecificationError
        If the value is not a distribution.

    Examples
    --------
    >>> variation_of({"uniform": [0.3, 0.8]}, "contours[0].q").at(np.array([0.0, 0.5]), np.zeros(2, dtype=int))
    array([0.3 , 0.55])
    """
    if is_finite_number(value):
        return Variation("constant", (float(value),))
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
    ((kind, numbers),) = value.items()
    if kind not in kinds:
        raise SpecificationError(f"{key} has the distribution {shown(kind)}, which is unknown: {hint}")
    if kind in KINDS and KINDS[kind].size == 1 and is_finite_number(numbers):
        numbers = [numbers]
    if not isinstance(numbers, list) or not numbers or not all(map(is_finite_number, numbers)):
        raise SpecificationError(f"{key}.{kind} is {shown(numbers)}: give a list of finite numbers")
    if kind in KINDS and len(numbers) != KINDS[kind].size:
        raise SpecificationError(f"{key}.{kind} has {len(numbers)} numbers: give {KINDS[kind].size}")
    if kind in KINDS and not KINDS[kind].is_possible(*numbers):
        raise SpecificationError(f"{key}.{kind} is {shown(numbers)}: {KINDS[kind].rule}")
    found = Variation(kind, tuple(float(number) for number in numbers), axis)
    with np.errstate(all="ignore"):
        ends = found.at(np.array([0.0, 1.0 - 2.0**-53]), np.zeros(2, dtype=np.intp))
    if not np.isfinite(ends).all():
        raise SpecificationError(
            f"{key}.{kind} is {shown(numbers)}: its draws may be larger than any number, narrow it"
        )
    return found
