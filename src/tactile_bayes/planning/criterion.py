"""The criterion by which a design compares candidates."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from tactile_bayes.checks import check_choice, check_numbers, check_probability, refused

CriterionName = Literal["band", "gap", "information"]


@dataclass(frozen=True)
class Criterion:
    """Criterion of the best candidate of a design, and the band that is meant.

    Parameters
    ----------
    name : {"band", "gap", "information"}
        The narrowest band, the smallest gap, or the most information.
    span : (float, float), optional
        Interval of x in which the band matters [length]; by default between the outermost first contacts of the sweeps
        so far, or, for a prior, of sweeps from the origin; medians over the draws.
    probability : float
        Probability of the pointwise band, in (0, 1).

    Raises
    ------
    ParameterError
        If there is no such criterion, the span is empty, or the probability is impossible.
    """

    name: CriterionName = "band"
    span: tuple[float, float] | None = None
    probability: float = 0.95

    def __post_init__(self) -> None:
        check_choice("criterion", self.name, ("band", "gap", "information"))
        object.__setattr__(self, "probability", check_probability("probability", self.probability))
        if self.span is not None:
            correction = "give two values of x, the smaller first"
            left, right = check_numbers("span", self.span, correction, shape=(2,)).tolist()
            if not left < right:
                raise refused("span", self.span, correction)
            object.__setattr__(self, "span", (left, right))


def criterion_of(criterion: CriterionName | Criterion) -> Criterion:
    """Return a criterion, from its name."""
    return criterion if isinstance(criterion, Criterion) else Criterion(criterion)
