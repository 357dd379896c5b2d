"""The posterior density of single contacts, on the sheets of contacts that a rod can make."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from tactile_bayes.arrays import Floats, Index
from tactile_bayes.checks import shown
from tactile_bayes.errors import ParameterError
from tactile_bayes.load_cell import LoneSamples
from tactile_bayes.mechanics.contacts.contact_coordinates import (
    ARCLENGTH,
    DRIVE_ANGLE,
    FORCE,
    PSI1,
    ContactStates,
    contact_states,
)
from tactile_bayes.mechanics.phases import TANGENTIAL, TIP
from tactile_bayes.reconstruction import Samples
from tactile_bayes.record import turned

LogPrior = Callable[[Floats, Floats, Floats], Floats]
ContactPrior = Literal["flat", "polar"] | LogPrior


@dataclass(frozen=True, eq=False)
class ContactDensity:
    """Log-density of contacts, given one sample each, in coordinates of the sheet of a phase. A sample touches with the
    angle of friction times its `sense`, which lies between −1 and 1 if it sticks."""

    samples: Samples
    readings: LoneSamples
    base: Floats  # pivots [length], shape (n, 2)
    turning: bool  # whether the load cell turns with the drive
    friction: float
    prior: ContactPrior

    def __post_init__(self) -> None:
        if not (callable(self.prior) or (isinstance(self.prior, str) and self.prior in ("flat", "polar"))):
            raise ParameterError(
                f"prior is {shown(self.prior)}: choose 'flat' or 'polar', or give a function of contact_x, contact_y "
                "and slope_angle that returns a log-density"
            )

    @cached_property
    def delta(self) -> Floats:
        """Angles of friction, shape (n,)."""
        return self.samples.friction_angles(self.friction)

    @property
    def has_free_angle(self) -> bool:
        """True if the drive angle is uncertain."""
        return bool(np.any(self.samples.reading.angle_deviation))

    @property
    def ways(self) -> Floats:
        """Ranges of the way: tip, tangential and, unless rods are straight, over-turned tip, (branches, n, 2)."""
        normal, none = 0.5 * np.pi + self.delta, np.zeros(self.delta.size)
        branches = [(none, normal), (none - 1.0, none), (normal, none + np.pi)]
        return np.stack(branches[:2] if self.samples.rods.are_straight else branches).swapaxes(1, 2)

    def take(self, where: Index) -> ContactDensity:
        """Return the density of some of the samples."""
        samples, readings = self.samples.take(where), self.readings.take(where)
        return replace(self, samples=samples, readings=readings, base=self.base[where])

    def log_density(self, coordinates: Floats, phase: NDArray[np.int8]) -> Floats:
        """Return the log-density, (..., n), over force, ψ1 (tip) or arc length, and drive angle; −inf if impossible."""
        shape = coordinates.shape[:-1]
        tip = phase.reshape(-1) == TIP
        rod = self._states(coordinates)
        reading, side = self.samples.reading, self.samples.side
        moment, force_x, force_y = rod.loads.reshape(3, *shape)
        loads = np.stack([side * moment, side * force_x, force_y], axis=-1)
        angle = coordinates[..., DRIVE_ANGLE]
        if self.turning:
            in_lab_frame = np.where(side < 0.0, np.pi - angle, angle)
            loads[..., 1], loads[..., 2] = turned(loads[..., 1], loads[..., 2], in_lab_frame)
        alpha, arclength = rod.place[2:]
        with np.errstate(divide="ignore", invalid="ignore"):
            volume = np.log(np.where(tip, rod.volume_tip, rod.volume_tangential))
            facing = np.abs(alpha - self.samples.rod.surface.half_angle) < 0.5 * np.pi
            possible = ((arclength <= 1.0) & facing & np.isfinite(volume)).reshape(shape)
            turn = coordinates[..., PSI1] + self.delta
            possible &= (turn >= 0.0) & (turn <= np.pi)
            density = volume.reshape(shape) + self.readings.log_density(loads) + self._log_prior(rod.place, shape)
            if self.has_free_angle:
                off = (angle - reading.drive_angle) / reading.angle_deviation
                density -= 0.5 * off**2 + np.log(np.sqrt(2.0 * np.pi) * reading.angle_deviation)
        return np.where(possible & ~np.isnan(density), density, -np.inf)

    def contacts(self, coordinates: Floats) -> Floats:
        """Return contacts from coordinates, shape (..., n, 4), in the form of `_to_lab_frame`."""
        contact = self._states(coordinates).place
        return self._to_lab_frame(contact.reshape(4, *coordinates.shape[:-1]))

    def _states(self, coordinates: Floats) -> ContactStates:
        """Return contacts from coordinates, shape (..., n, 4), one after the other."""
        rods = self.samples.rods
        each, delta = (np.broadcast_to(of, coordinates.shape[:-1]).ravel() for of in (rods.curvature, self.delta))
        return contact_states(coordinates.reshape(-1, 4), delta, rods._replace(curvature=each))

    def _to_lab_frame(self, contact: Floats) -> Floats:
        """Return contacts on the object's surface, in the laboratory frame and the record's units, (4, ..., n)."""
        length, side = self.samples.rod.length_unit, self.samples.side
        x, y, alpha, arclength = self.samples.rod.surface.on_object(contact)
        return np.stack(
            [self.base[:, 0] + side * x * length, self.base[:, 1] + y * length, side * alpha, arclength * length]
        )

    def _log_prior(self, contact: Floats, shape: tuple[int, ...]) -> Floats | float:
        if self.prior == "flat":
            return 0.0
        contact = contact.reshape(4, *shape)
        if not callable(self.prior):
            return np.asarray(-np.log(np.hypot(contact[0], contact[1])))
        values = np.asarray(self.prior(*self._to_lab_frame(contact)[:3]), dtype=float)
        if values.shape != shape:
            raise ParameterError(
                f"the prior gave an array of shape {values.shape} for arguments of shape {shape}: it has to work "
                "element by element"
            )
        if np.any((np.isnan(values) | (values == np.inf)) & np.isfinite(contact[0])):
            raise ParameterError("the prior is not a number, or +inf, somewhere within reach: give a log-density")
        return values

    def unfold(self, points: Floats) -> tuple[Floats, NDArray[np.int8]]:
        """Return coordinates and phase of points (way, force[, drive angle]); the way is ψ1 + δ or s1 − 1 < 0."""
        way = points[..., 0]
        z = np.empty((*points.shape[:-1], 4))
        z[..., FORCE] = points[..., 1]
        z[..., PSI1] = np.maximum(way, 0.0) - self.delta
        z[..., ARCLENGTH] = 1.0 + np.minimum(way, 0.0)
        z[..., DRIVE_ANGLE] = points[..., 2] if self.has_free_angle else self.samples.reading.drive_angle
        return z, np.where(way >= 0.0, np.int8(TIP), np.int8(TANGENTIAL))
