"""Misspecification: the difference between a simulation and what inference assumes."""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np

from tactile_bayes.checks import check_numbers, check_optional
from tactile_bayes.contours import Contour, ShapeFree
from tactile_bayes.errors import ParameterError
from tactile_bayes.inference.family import Family, family_of
from tactile_bayes.inference.parameters.unknowns import RigValues
from tactile_bayes.rig.rig import Rig

_SPOT = 0.1  # standard deviation of a flat spot in slope angle [rad]
# Largest slope angle [rad], and number of knots, of a contour with a flat spot, which is a spline.
_ENDS, _KNOTS = 1.5, 121


@dataclass(frozen=True)
class Misspecification:
    """Differences between a simulation and what inference assumes, also those that no `Rig` can state; by default none.

    Parameters
    ----------
    rig : Rig, optional
        The rig from which records are simulated, if it is another than inference assumes.
    base_shift : (float, float)
        Shift of all pivots from their recorded positions [length]; those of single ones are `base_2_x` and so on of a
        `Rig`.
    flat_spot : (float, float), optional
        Slope angle [rad], and factor, > 0, by which the radius of curvature is larger there than that of the drawn
        contour; the factor's logarithm falls off as a bell curve with a standard deviation of 0.1 rad.
    family : Family or str, optional
        Family from which contours are drawn, with its own priors, in place of the one that inference assumes.

    Raises
    ------
    ParameterError
        If an entry is impossible, or there is no such family.

    Examples
    --------
    >>> Misspecification(base_shift=(0.01, 0.0))
    Misspecification(base_shift=(0.01, 0.0))
    """

    rig: Rig | None = None
    base_shift: tuple[float, float] = (0.0, 0.0)
    flat_spot: tuple[float, float] | None = None
    family: Family | str | None = None

    def __post_init__(self) -> None:
        check_optional("rig of the misspecification", self.rig, Rig)
        for name in ("base_shift", "flat_spot"):
            if (given := getattr(self, name)) is not None or name == "base_shift":
                numbers = check_numbers(f"{name} of the misspecification", given, "give 2 finite numbers", shape=(2,))
                object.__setattr__(self, name, tuple(numbers.tolist()))
        if self.flat_spot is not None and not self.flat_spot[1] > 0.0:
            raise ParameterError(
                f"the factor of a flat spot of the misspecification is {self.flat_spot[1]:g}: give a positive number"
            )
        if self.family is not None:
            object.__setattr__(self, "family", family_of(self.family))

    def __repr__(self) -> str:
        given = {each.name: getattr(self, each.name) for each in fields(self)}
        differing = (f"{each.name}={given[each.name]!r}" for each in fields(self) if given[each.name] != each.default)
        return f"Misspecification({', '.join(differing)})"

    def contour(self, drawn: Contour) -> Contour:
        """Return the contour of the object, shape (1,), from a drawn one."""
        if self.flat_spot is None:
            return drawn
        slopes = np.linspace(-_ENDS, _ENDS, _KNOTS)
        at, factor = self.flat_spot
        radius = np.asarray(drawn.radius_of_curvature(slopes), dtype=float)
        x, y = (np.ravel(np.asarray(value, dtype=float))[0] for value in drawn.point(0.0))
        flatter = np.log(radius) + np.log(factor) * np.exp(-0.5 * ((slopes - at) / _SPOT) ** 2)
        return ShapeFree(slopes, flatter[None], x=x, y=y, at=0.0)

    def shifted(self, drawn: RigValues, pivots: int) -> RigValues:
        """Return the rig of one contour from the drawn one, with its pivots shifted."""
        shifts = np.zeros((1, pivots, 2))
        if drawn.base_shifts is not None:
            shifts[:, : drawn.base_shifts.shape[1]] += drawn.base_shifts
        return drawn._replace(base_shifts=shifts + np.array(self.base_shift))
