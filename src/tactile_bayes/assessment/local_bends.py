"""Flat spots and corners: contours of a family that are flatter, or more bent, about single slope angles."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from scipy import stats

from tactile_bayes.arrays import Floats
from tactile_bayes.contours import Contour, Smooth
from tactile_bayes.contours.family import ContourFamily, FamilyParameter
from tactile_bayes.inference.contour_model import ContourModel

# Slope angles at which a spot is sought, and standard deviation of its bell curve [rad].
PLACES = tuple(np.linspace(-1.2, 1.2, 17).round(6).tolist())
_WIDTH = 0.12
_SPREAD = 0.6  # prior deviation of the change of log ρ, as that of a shape-free contour
_NODES = Smooth.nodes(96)
_LARGEST = 8.0  # bound on log ρ about its median; that of a parabola is infinite where it is upright
_PARAMETER = FamilyParameter("change of the logarithm of the radius of curvature about a slope angle", 0)


@dataclass(frozen=True)
class LocalBends(ContourFamily):
    """Contours of another family whose log ρ(α) has a bell curve more about each of some slope angles."""

    family: ContourFamily
    places: tuple[float, ...]
    name: str = "local bends"

    @cached_property
    def bends(self) -> tuple[str, ...]:
        """Names of the sizes of the bell curves: positive ones are flat spots, negative ones corners."""
        return tuple(f"bend_{k + 1}" for k in range(len(self.places)))

    @cached_property
    def table(self) -> dict[str, FamilyParameter]:  # type: ignore[override]
        return {**dict.fromkeys(self.bends, _PARAMETER), **self.family.table}

    def build(self, *values: Any) -> Contour:
        sizes = np.stack(np.broadcast_arrays(*values[: len(self.places)]), axis=-1)
        drawn = self.family.build(*values[len(self.places) :])
        with np.errstate(all="ignore"):
            log_radius = np.log(np.asarray(drawn.radius_of_curvature(_NODES.reshape(-1, *[1] * len(drawn.shape)))))
        log_radius = np.moveaxis(log_radius, 0, -1)
        middle = np.nanmedian(log_radius, axis=-1, keepdims=True)
        log_radius = np.clip(np.where(np.isnan(log_radius), middle, log_radius), middle - _LARGEST, middle + _LARGEST)
        bells = np.exp(-0.5 * np.square((_NODES - np.array(self.places)[:, None]) / _WIDTH))
        x, y = drawn.point(0.0)
        return Smooth(log_radius + sizes @ bells, q=y, x_c=x)

    def fit(self, x: Floats, y: Floats) -> dict[str, float]:
        return {**dict.fromkeys(self.bends, 0.0), **self.family.fit(x, y)}


def with_bends(model: ContourModel, places: tuple[float, ...]) -> ContourModel:
    """Return the model whose contours may have a spot at each of some slope angles, of sizes that are unknown."""
    family = LocalBends(model.family, places)
    priors = {**dict.fromkeys(family.bends, stats.norm(0.0, _SPREAD)), **model.priors}
    return ContourModel(model.measured, family, model.unknowns, model.noise, priors)
