"""Raw Step 2: four noisy numbers taken at their word."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from tactile_bayes.contact_fit import Reading
from tactile_bayes.mechanics.elastica import Contact, contact_from_wrench
from tactile_bayes.mechanics.phases import NONE, TANGENTIAL, TIP
from tactile_bayes.mechanics.touching import place_by_wrench, touching_and_slopes
from tactile_bayes.reconstruction.estimate import (
    BEYOND_TIP,
    NONLINEAR,
    OK,
    Estimate,
    bends_too_much,
    is_weak,
    unanswered,
)
from tactile_bayes.reconstruction.samples import Samples

__all__ = ["raw_contact", "raw_estimate"]

Floats = NDArray[np.float64]

_ROUNDING = 1e-9


def raw_contact(reading: Reading, delta: Floats) -> Contact:
    """What Step 2 makes of samples."""
    moment, force_x, force_y = reading.loads.T
    return contact_from_wrench(reading.drive_angle, moment, force_x, force_y, delta, side=1.0)


def raw_estimate(samples: Samples, delta: Floats) -> Estimate:
    """Contacts of Step 2, with the covariance that errors of the sensor give them to first order."""
    reading = samples.reading
    contact = raw_contact(reading, delta)
    place = _place(contact)
    found = np.isfinite(contact.contact_arclength) & ~(samples.cut_off & samples.loaded)
    place[~found] = np.nan
    with np.errstate(invalid="ignore"):
        beyond = found & (contact.contact_arclength > 1.0 + _ROUNDING)
        # In tangential contact the rod lies along the contour, in tip contact it ends there: which holds more nearly?
        lift = np.abs(np.sin(contact.tip_angle - contact.slope_angle))
        tip = np.abs(1.0 - contact.contact_arclength) < lift
    status = unanswered(samples.loaded, samples.cut_off)
    status[found], status[beyond] = OK, BEYOND_TIP
    covariance = None
    where = np.flatnonzero(found)
    if samples.has_noise:
        covariance = np.full((delta.size, 4, 4), np.nan)
    if covariance is not None and where.size:
        part, delta = reading.take(where), delta[where]
        covariance[where], deviations = _covariance(part, contact, where, delta)
        aside = [
            (_place(_moved(part, delta, column)), _place(_moved(part, delta, -column)))
            for column in deviations
            if np.any(column)
        ]
        bent = is_weak(part.loads, part.covariance) | bends_too_much(place[where], covariance[where], aside)
        status[where[bent & (status[where] == OK)]] = NONLINEAR
    phase = np.where(found, np.where(tip, TIP, TANGENTIAL), NONE).astype(np.int8)
    return Estimate(place, covariance, phase, status)


def _covariance(reading: Reading, contact: Contact, where: NDArray[np.intp], delta: Floats) -> tuple[Floats, Floats]:
    """Of the place, shape (n, 4, 4), and errors of drive angle and loads by one standard deviation, shape (4, n, 4)."""
    force = np.hypot(reading.loads[:, 1], reading.loads[:, 2])
    psi1 = contact.tip_angle[where] - contact.slope_angle[where] - delta
    coordinates = np.stack([force, psi1, contact.contact_arclength[where], reading.drive_angle], axis=-1)
    _, slopes = touching_and_slopes(coordinates, delta)
    deviations = np.zeros((4, delta.size, 4))
    deviations[0, :, 0] = reading.angle_deviation
    deviations[0, :, 1:] = reading.angle_deviation[:, None] * reading.leaning
    variances, axes = np.linalg.eigh(np.where(np.isfinite(reading.covariance), reading.covariance, 1e300))
    deviations[1:, :, 1:] = np.moveaxis(axes * np.sqrt(np.maximum(variances, 0.0))[:, None, :], -1, 0)
    moved = np.einsum("nij,knj->nki", place_by_wrench(slopes), deviations)
    return np.swapaxes(moved, 1, 2) @ moved, deviations


def _moved(reading: Reading, delta: Floats, by: Floats) -> Contact:
    with np.errstate(over="ignore", invalid="ignore"):
        return raw_contact(
            reading._replace(drive_angle=reading.drive_angle + by[:, 0], loads=reading.loads + by[:, 1:]), delta
        )


def _place(contact: Contact) -> Floats:
    return np.stack([contact.contact_x, contact.contact_y, contact.slope_angle, contact.contact_arclength], axis=-1)
