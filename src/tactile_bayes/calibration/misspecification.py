"""Misspecification: differences between the simulated rig and what inference assumes."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from typing import Any

import numpy as np

from tactile_bayes.checks import check_number, check_numbers, check_optional
from tactile_bayes.contours import Contour, ShapeFree
from tactile_bayes.contours.families import family_named
from tactile_bayes.errors import ParameterError
from tactile_bayes.inference.parameters.nuisances import BIASES, DRIFTS, GAINS, LEVERS
from tactile_bayes.inference.parameters.priors import Prior, check_priors
from tactile_bayes.inference.record_likelihood.rig import Rig
from tactile_bayes.load_cell import LoadCell
from tactile_bayes.mechanics.elastica import MAX_FRICTION_ANGLE

__all__ = ["NUMBERS", "Misspecification"]

Triple = tuple[float, float, float]

NUMBERS = {
    "friction": 1,
    "rigidity_scale": 1,
    "drive_angle_offset": 1,
    "rest_curvature": 1,
    "taper": 1,
    "bias": 3,
    "drift": 3,
    "base_shift": 2,
    "further_base_shift": 2,
    "flat_spot": 2,
}
"""Numeric entries of a misspecification, and how many numbers each has."""

_NOTHING: Triple = (0.0, 0.0, 0.0)

_SPOT = 0.1
"""Standard deviation of a flat spot in slope angle [rad]."""

_ENDS, _KNOTS = 1.5, 121
"""Largest slope angle [rad], and number of knots, of a contour with a flat spot, which is a spline."""


@dataclass(frozen=True)
class Misspecification:
    """Differences between the simulated rig and what inference assumes, by default none.

    The truth of an inferred parameter of the rig is what the simulated rig has.

    Parameters
    ----------
    friction : float
        Coulomb's coefficient in addition to the one that inference knows or infers, >= 0.
    base_shift : (float, float)
        Shift of all pivots from their recorded positions [length].
    further_base_shift : (float, float)
        Additional shift of all pivots except the first [length].
    rigidity_scale : float
        Flexural rigidity over the stated one, > 0, times the inferred factor.
    drive_angle_offset : float
        Encoder offset in addition to the inferred one [rad].
    rest_curvature : float
        Rest curvature of the rod in addition to the stated or inferred one [1/rod length].
    taper : float
        Taper of the rod in addition to the stated or inferred one.
    bias, drift : (float, float, float)
        Errors of the readings of moment, force_x and force_y, in the record's units, in addition to the inferred ones:
        a drift is the linear change of a zero from the first sample to the last, a bias its value in the middle.
    load_cell : LoadCell, optional
        Load cell of the simulation, in place of the one that inference assumes.
    flat_spot : (float, float), optional
        Slope angle [rad], and factor, > 0, by which the radius of curvature is larger there than that of the drawn
        contour; the factor's logarithm falls off as a bell curve with a standard deviation of 0.1 rad.
    family : str, optional
        Family from which contours are drawn, with its own priors, in place of the one that inference assumes.
    priors : mapping
        Priors from which the truths of some parameters are drawn, in place of those of inference.

    Raises
    ------
    ParameterError
        If an entry is impossible, or there is no such family.

    Examples
    --------
    >>> Misspecification(friction=0.3)
    Misspecification(friction=0.3)
    """

    friction: float = 0.0
    base_shift: tuple[float, float] = (0.0, 0.0)
    further_base_shift: tuple[float, float] = (0.0, 0.0)
    rigidity_scale: float = 1.0
    drive_angle_offset: float = 0.0
    rest_curvature: float = 0.0
    taper: float = 0.0
    bias: Triple = _NOTHING
    drift: Triple = _NOTHING
    load_cell: LoadCell | None = None
    flat_spot: tuple[float, float] | None = None
    family: str | None = None
    priors: Mapping[str, Prior] = field(default_factory=dict)

    def __post_init__(self) -> None:
        for name, size in NUMBERS.items():
            if name == "flat_spot" and self.flat_spot is None:
                continue
            correction = f"give {size} finite numbers" if size > 1 else "give a finite number"
            shape = (size,) if size > 1 else ()
            numbers = check_numbers(
                f"{name} of the misspecification", getattr(self, name), correction, shape=shape
            ).tolist()
            object.__setattr__(self, name, tuple(numbers) if size > 1 else numbers)
        most = float(np.tan(MAX_FRICTION_ANGLE))
        correction = f"give a coefficient from 0 to {most:.2f}"
        check_number("friction of the misspecification", self.friction, correction, least=0.0, most=most)
        if not self.rigidity_scale > 0.0 or (self.flat_spot is not None and not self.flat_spot[1] > 0.0):
            raise ParameterError(
                "rigidity_scale or the factor of a flat spot of the misspecification is not positive: "
                "give positive numbers"
            )
        check_optional("load_cell of the misspecification", self.load_cell, LoadCell)
        if self.family is not None:
            family_named(self.family)
        check_priors("priors of the misspecification", self.priors)

    def __repr__(self) -> str:
        return f"Misspecification({', '.join(f'{name}={value!r}' for name, value in self._given().items())})"

    def _given(self) -> dict[str, Any]:
        """Return the entries that differ from their defaults."""
        given = {each.name: getattr(self, each.name) for each in fields(self)}
        ideal: dict[str, Any] = {each.name: {} if each.name == "priors" else each.default for each in fields(self)}
        return {name: value for name, value in given.items() if value != ideal[name]}

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

    def truth(self, drawn: Mapping[str, float], stated: LoadCell, curvature_unit: float) -> dict[str, float]:
        """Return the true values of inferred parameters from drawn ones, by name, in the record's units.

        The true value of an inferred property, such as friction, is that of the simulated rig, relative to the stated
        load cell, which inference knows.
        """
        cell = stated if self.load_cell is None else self.load_cell
        more = {
            "friction": self.friction,
            "drive_angle_offset": self.drive_angle_offset + cell.drive_angle_offset - stated.drive_angle_offset,
            "backlash": cell.drive_angle_backlash - stated.drive_angle_backlash,
            "rest_curvature": self.rest_curvature * curvature_unit,
            "taper": self.taper,
            **dict(zip(BIASES, np.add(self.bias, np.subtract(cell.bias, stated.bias)).tolist(), strict=True)),
            **dict(zip(DRIFTS, self.drift, strict=True)),
            **dict(zip(LEVERS, np.subtract(cell.lever, stated.lever).tolist(), strict=True)),
        }
        times = {"rigidity_scale": self.rigidity_scale}
        times |= dict(zip(GAINS, (cell.own_gains / stated.own_gains).tolist(), strict=True))
        found = {name: times.get(name, 1.0) * (value + more.get(name, 0.0)) for name, value in drawn.items()}
        for name in found:
            if name.startswith("base_"):
                found[name] += self.further_base_shift["xy".index(name[-1])]
        return found

    def rig(self, drawn: Rig, pivots: int) -> Rig:
        """Return the misspecified rig of one contour from the drawn one."""
        shifts = np.zeros((1, pivots, 2))
        if drawn.base_shifts is not None:
            shifts[:, : drawn.base_shifts.shape[1]] += drawn.base_shifts
        shifts += np.array(self.base_shift)
        shifts[:, 1:] += np.array(self.further_base_shift)
        return Rig(
            drive_angle_offset=drawn.drive_angle_offset + self.drive_angle_offset,
            rigidity_scale=drawn.rigidity_scale * self.rigidity_scale,
            suspension_compliance=drawn.suspension_compliance,
            friction=drawn.friction + self.friction,
            drive_angle_backlash=drawn.drive_angle_backlash,
            rest_curvature=drawn.rest_curvature + self.rest_curvature,
            taper=drawn.taper + self.taper,
            stem=drawn.stem,
            length=drawn.length,
            base_shifts=shifts,
        )
