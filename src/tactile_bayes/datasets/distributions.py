"""Distributions of the numbers that differ from record to record of a data set."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from scipy.special import ndtri

from tactile_bayes.arrays import Floats, Index
from tactile_bayes.checks import as_number, shown
from tactile_bayes.errors import SpecificationError

__all__ = ["Distribution", "distribution_of"]


class _Kind(NamedTuple):
    """A distribution with two parameters."""

    is_possible: Callable[[float, float], bool]
    rule: str
    """Rule for the two numbers, for messages."""
    text: str
    at: Callable[[float, float, Floats], Any]
    """Quantile function."""


_KINDS = {
    "uniform": _Kind(
        lambda low, high: low < high,
        "the first must be below the second",
        "uniform from {} to {}",
        lambda low, high, share: low + (high - low) * share,
    ),
    "log_uniform": _Kind(
        lambda low, high: 0.0 < low < high,
        "both must be positive, the first below the second",
        "log-uniform from {} to {}",
        lambda low, high, share: np.exp(math.log(low) + math.log(high / low) * share),
    ),
    "normal": _Kind(
        lambda mean, deviation: deviation >= 0.0,
        "they are mean and standard deviation, which is not negative",
        "normal, mean {}, standard deviation {}",
        lambda mean, deviation, share: mean + deviation * ndtri(_open(share)),
    ),
    "log_normal": _Kind(
        lambda median, deviation: median > 0.0 and deviation >= 0.0,
        "they are the median, positive, and the logarithm's standard deviation, which is not negative",
        "log-normal, median {}, standard deviation of the logarithm {}",
        lambda median, deviation, share: median * np.exp(deviation * ndtri(_open(share))),
    ),
}


@dataclass(frozen=True)
class Distribution:
    """A number for each record: constant, drawn, or from a list in turn.

    Parameters
    ----------
    kind : {"constant", "uniform", "log_uniform", "normal", "log_normal", "choice", "each"}
        Constant: the number. Uniform and log_uniform: the two limits. Normal: mean and standard deviation; log_normal:
        median, and standard deviation of the natural logarithm. Choice: one of a list with equal probabilities. Each:
        the numbers of the list in turn, in all combinations with the specification's other lists, except those on the
        same axis, which advance in step.
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
        return self.numbers[0] if self.kind in ("normal", "log_normal") else min(self.numbers)

    @property
    def greatest(self) -> float:
        """Greatest possible number."""
        if self.kind in ("normal", "log_normal"):
            return math.inf if self.numbers[1] else self.numbers[0]
        return max(self.numbers)

    @property
    def text(self) -> str:
        """Description of the distribution."""
        numbers = [f"{number:g}" for number in self.numbers]
        if self.kind == "choice":
            return f"one of {', '.join(numbers)}"
        if self.kind == "each":
            return f"each of {', '.join(numbers)}" + (f", on the axis {self.axis}" if self.axis else "")
        return _KINDS[self.kind].text.format(*numbers) if self.kind in _KINDS else numbers[0]

    def at(self, share: Floats, turn: Index) -> Floats:
        """Return the quantiles at probabilities in [0, 1), for records with given positions in the list."""
        if self.kind == "choice":
            return np.array(self.numbers)[(share * len(self.numbers)).astype(np.intp)]
        if self.kind == "each":
            return np.array(self.numbers)[turn]
        if self.kind == "constant":
            return np.full(share.shape, self.numbers[0])
        first, second = self.numbers
        return np.asarray(_KINDS[self.kind].at(first, second, share))


def distribution_of(value: Any, key: str) -> Distribution:
    """Parse the distribution that a value of a specification states; messages name it by `key`.

    Raises
    ------
    SpecificationError
        If the value is not a distribution.

    Examples
    --------
    >>> distribution_of({"uniform": [0.3, 0.8]}, "contours[0].q").at(np.array([0.0, 0.5]), np.zeros(2, dtype=int))
    array([0.3 , 0.55])
    """
    if _is_number(value):
        return Distribution("constant", (float(value),))
    kinds = (*_KINDS, "choice", "each")
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
    if not isinstance(numbers, list) or not numbers or not all(map(_is_number, numbers)):
        raise SpecificationError(f"{key}.{kind} is {shown(numbers)}: give a list of finite numbers")
    if kind in _KINDS and len(numbers) != 2:
        raise SpecificationError(f"{key}.{kind} has {len(numbers)} numbers: give two")
    if kind in _KINDS and not _KINDS[kind].is_possible(*numbers):
        raise SpecificationError(f"{key}.{kind} is {shown(numbers)}: {_KINDS[kind].rule}")
    found = Distribution(kind, tuple(float(number) for number in numbers), axis)
    with np.errstate(all="ignore"):
        ends = found.at(np.array([0.0, 1.0 - 2.0**-53]), np.zeros(2, dtype=np.intp))
    if not np.isfinite(ends).all():
        raise SpecificationError(
            f"{key}.{kind} is {shown(numbers)}: its draws may be larger than any number, narrow it"
        )
    return found


def _is_number(value: Any) -> bool:
    number = as_number(value)
    return number is not None and math.isfinite(number)


def _open(share: Floats) -> Floats:
    """Bound probabilities away from 0, where a normal quantile would be infinite."""
    return np.maximum(share, 2.0**-54)
