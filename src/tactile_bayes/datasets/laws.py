"""Laws: how a number differs from record to record of a data set."""

from __future__ import annotations

import math
import sys
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtri

from tactile_bayes.errors import SpecificationError

__all__ = ["Law", "law_of"]

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Law:
    """A number for each record: always the same, drawn, or one after the other of a list.

    Parameters
    ----------
    kind : {"constant", "uniform", "log_uniform", "normal", "log_normal", "choice", "each"}
        Constant: the number. Uniform and log_uniform: between two. Normal: mean and standard deviation; log_normal:
        median, and standard deviation of the natural logarithm. Choice: one of a list, each as likely. Each: the
        list's numbers in turn, every one together with every one of the specification's other lists, but for those on
        the same axis, which advance in step.
    numbers : tuple of float
        What the kind wants.
    """

    kind: str
    numbers: tuple[float, ...]
    axis: str | None = None
    """Of lists only."""

    @property
    def is_drawn(self) -> bool:
        return self.kind not in ("constant", "each")

    def at(self, share: Floats, turn: NDArray[np.intp]) -> Floats:
        """The numbers at shares of the probability, in [0, 1), of records whose turn in the list is given."""
        first, second = self.numbers[0], self.numbers[-1]
        match self.kind:
            case "uniform":
                return first + (second - first) * share
            case "log_uniform":
                return np.exp(math.log(first) + math.log(second / first) * share)
            case "normal":
                return first + second * ndtri(_open(share))
            case "log_normal":
                return np.asarray(first * np.exp(second * ndtri(_open(share))))
            case "choice":
                return np.array(self.numbers)[(share * len(self.numbers)).astype(np.intp)]
            case "each":
                return np.array(self.numbers)[turn]
            case _:
                return np.full(share.shape, first)


def law_of(value: Any, key: str) -> Law:
    """The law that a value of a specification states; `key` names it in refusals.

    Raises
    ------
    SpecificationError
        If it states none.

    Examples
    --------
    >>> law_of({"uniform": [0.3, 0.8]}, "contours[0].q").at(np.array([0.0, 0.5]), np.zeros(2, dtype=int))
    array([0.3 , 0.55])
    """
    if _is_number(value):
        return Law("constant", (float(value),))
    kinds = "uniform, log_uniform, normal, log_normal, choice, each"
    hint = f"give a number, or a law such as {{ uniform = [0.3, 0.8] }} (laws: {kinds})"
    axis = None
    if isinstance(value, dict) and "each" in value and "axis" in value:
        value = dict(value)
        axis = value.pop("axis")
        if not isinstance(axis, str) or not axis:
            raise SpecificationError(f"{key}.axis is {axis!r}: give a name, the same for lists that advance in step")
    if not isinstance(value, dict) or len(value) != 1:
        raise SpecificationError(f"{key} is {value!r}: {hint}")
    ((kind, numbers),) = value.items()
    if kind not in kinds.split(", "):
        raise SpecificationError(f"{key} has the law {kind!r}, which there is not: {hint}")
    if not isinstance(numbers, list) or not numbers or not all(map(_is_number, numbers)):
        raise SpecificationError(f"{key}.{kind} is {numbers!r}: give a list of finite numbers")
    law = Law(kind, tuple(float(number) for number in numbers), axis)
    if kind in ("choice", "each"):
        return law
    if len(numbers) != 2:
        raise SpecificationError(f"{key}.{kind} has {len(numbers)} numbers: give two")
    first, second = law.numbers
    rules = {
        "uniform": (first < second, "the first must be below the second"),
        "log_uniform": (0.0 < first < second, "both must be positive, the first below the second"),
        "normal": (second >= 0.0, "they are mean and standard deviation, which is not negative"),
        "log_normal": (first > 0.0 and second >= 0.0, "they are the median, positive, and the logarithm's standard "
                       "deviation, which is not negative"),
    }  # fmt: skip
    holds, rule = rules[kind]
    if not holds:
        raise SpecificationError(f"{key}.{kind} is {numbers!r}: {rule}")
    return law


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and abs(value) <= sys.float_info.max


def _open(share: Floats) -> Floats:
    """Shares away from 0, where a normal number would be infinite."""
    return np.maximum(share, 2.0**-54)
