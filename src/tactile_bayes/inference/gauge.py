"""A gauge: a contour that is known, as a family without parameters."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from tactile_bayes.arrays import Floats
from tactile_bayes.checks import check_kind
from tactile_bayes.contours import Circle, Contour, Parabola, Single
from tactile_bayes.contours.family import ContourFamily, FamilyParameter
from tactile_bayes.errors import ParameterError
from tactile_bayes.inference.misfit import GAUGE

__all__ = ["Gauge"]


@dataclass(frozen=True)
class Gauge(ContourFamily):
    """Family whose only contour is a known one, in the record's unit of length."""

    known: Contour

    def __post_init__(self) -> None:
        correction = "give the contour of the gauge, like Circle(r=0.01, q=0.03)"
        check_kind("contour", self.known, Contour, correction)
        if isinstance(self.known, Single) or self.known.shape:
            raise ParameterError(
                f"contour is {self.known!r}: {correction}, one contour of a family (not from_points or from_function)"
            )

    @property
    def name(self) -> str:  # type: ignore[override]
        return GAUGE

    @property
    def table(self) -> Mapping[str, FamilyParameter]:  # type: ignore[override]
        return {}

    @property
    def is_always_clear(self) -> bool:
        return isinstance(self.known, Circle | Parabola)

    def build(self, *values: Any) -> Contour:
        return self.known

    def fit(self, x: Floats, y: Floats) -> dict[str, float]:
        return {}
