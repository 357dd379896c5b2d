"""Constrained Step 2: the most likely of the possible contacts."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tactile_bayes.arrays import Flags, Floats
from tactile_bayes.errors import ParameterError
from tactile_bayes.mechanics.contacts.contact_coordinates import contact_states, contact_states_and_slopes
from tactile_bayes.mechanics.contacts.fits import ContactFit
from tactile_bayes.mechanics.fitting import fit_contacts
from tactile_bayes.mechanics.phases import NONE
from tactile_bayes.mechanics.rods.profile import Rods
from tactile_bayes.reconstruction.estimate import (
    MOST_BEND,
    RIVAL,
    Estimate,
    Status,
    is_weak,
    squared_distance,
    status_by,
)
from tactile_bayes.reconstruction.samples import Samples

_CLEARANCE = 2.0  # standard deviations from the edge between the phases below which the phase of a contact is uncertain
_ROUNDING = 1e-9  # distance [L] that rounding makes
_MISFIT = 25.0  # sum of squares of one degree of freedom that noise exceeds in less than one of a million samples


def constrained_estimate(samples: Samples, delta: Floats) -> Estimate:
    """Most likely contacts, with their covariance on the sheet of possible contacts."""
    _refuse_without_noise(samples)
    with np.errstate(over="ignore"):
        usable = np.isfinite(samples.reading.loads**2).all(axis=1)
    reasons = {Status.NO_CONTACT: ~samples.loaded, Status.CUT_OFF: samples.cut_off}
    status = status_by({**reasons, Status.NO_ZERO_OF_CURVATURE: ~usable})
    where = np.flatnonzero(status == Status.OK)
    reading, given = samples.reading.take(where), (delta[where], samples.rods.take(where))
    fit = fit_contacts(reading, *given)
    rod, slopes = contact_states_and_slopes(fit.coordinates, *given)
    place = rod.place.T
    found = np.isfinite(fit.misfit) & np.isfinite(place).all(axis=1)
    with np.errstate(over="ignore", invalid="ignore"):
        covariance = slopes.place @ fit.covariance @ np.swapaxes(slopes.place, 1, 2)
        bent = is_weak(reading.loads, reading.covariance) | _bends_too_much(fit, place, covariance, *given)
        # Near the limits: the line of force through the pivot, or a vertical contour.
        bent |= rod.loads[0] < np.sqrt(reading.covariance[:, 0, 0])
        bent |= np.abs(place[:, 2]) > 0.49 * np.pi
    rivalled = found & (fit.rival < RIVAL)
    reasons = {
        Status.NO_ZERO_OF_CURVATURE: ~found,
        Status.DOES_NOT_FIT: fit.misfit > _MISFIT,
        Status.AMBIGUOUS: rivalled & (fit.other_phase == fit.phase),
        Status.BETWEEN_PHASES: fit.clearance < _CLEARANCE,
        Status.EITHER_PHASE: rivalled,
        Status.NONLINEAR: bent,
    }
    status[where] = status_by(reasons)
    has_other = np.isin(status[where], (Status.AMBIGUOUS, Status.EITHER_PHASE))

    def of_all(values: NDArray[Any], known: Flags = found, blank: float = np.nan) -> NDArray[Any]:
        every = np.full((delta.size, *values.shape[1:]), blank, dtype=values.dtype)
        every[where[known]] = values[known]
        return every

    return Estimate(
        of_all(place),
        of_all(covariance),
        of_all(fit.phase, blank=NONE),
        status,
        of_all(contact_states(fit.other, *given).place.T, has_other),
        of_all(fit.misfit),
        of_all(fit.clearance),
    )


def are_weighed(samples: Samples) -> bool:
    """Return whether the load cell states a finite variance of every channel."""
    covariance = samples.reading.covariance
    return bool(np.all(np.isfinite(covariance)) and np.all(np.diagonal(covariance, axis1=1, axis2=2) > 0.0))


def _refuse_without_noise(samples: Samples) -> None:
    """Refuse a load cell without a finite variance of every channel."""
    if not np.all(np.isfinite(samples.reading.covariance)):
        raise ParameterError(
            "Student's t with 2 degrees of freedom and fewer has no standard deviation to weigh the channels by: use "
            "method='raw', or more degrees of freedom"
        )
    if not are_weighed(samples):
        raise ParameterError(
            "which contact is most likely depends on the noise of every channel, and the load cell has none on at "
            "least one: give LoadCell(force_noise=..., moment_noise=...), or one of LoadCell.from_zero_load(record)"
        )


def principal_steps(covariance: Floats) -> Iterator[Floats]:
    """Steps of one standard deviation along the principal axes of the covariance of coordinates, shape (n, 4)."""
    scale = np.sqrt(np.diagonal(covariance, axis1=1, axis2=2))
    scale = np.where((scale > 0.0) & np.isfinite(scale), scale, 1.0)
    with np.errstate(invalid="ignore"):
        scaled = np.nan_to_num(covariance / scale[:, :, None] / scale[:, None, :], posinf=1e6)
    variances, axes = np.linalg.eigh(scaled)
    for k in range(4):
        if np.any(variances[:, k] > 1e-9):
            yield scale * axes[:, :, k] * np.sqrt(np.maximum(variances[:, k], 0.0))[:, None]


def _bends_too_much(fit: ContactFit, place: Floats, covariance: Floats, delta: Floats, rods: Rods) -> Flags:
    """Return where contacts one standard deviation aside contradict a covariance of first order, shape (n,)."""
    bent = np.zeros(len(place), dtype=bool)
    for step in principal_steps(fit.covariance):
        more, less = (contact_states(fit.coordinates + sign * step, delta, rods).place.T for sign in (1.0, -1.0))
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            x, y = (0.5 * (more + less) - place)[:, :2].T
            bent |= ~((squared_distance(x, y, covariance) <= MOST_BEND**2) | (x * x + y * y < _ROUNDING**2))
    return bent
