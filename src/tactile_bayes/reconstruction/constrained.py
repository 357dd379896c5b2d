"""Constrained Step 2: the most likely of the possible contacts."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from tactile_bayes.arrays import Floats
from tactile_bayes.errors import ParameterError
from tactile_bayes.mechanics.contacts.contact_coordinates import contact_states, contact_states_and_slopes
from tactile_bayes.mechanics.contacts.fits import ContactFit
from tactile_bayes.mechanics.fitting import fit_contacts
from tactile_bayes.mechanics.rods.profile import Rods
from tactile_bayes.reconstruction.estimate import (
    AMBIGUOUS,
    BETWEEN_PHASES,
    EITHER_PHASE,
    NO_FIT,
    NO_ZERO,
    NONLINEAR,
    OK,
    RIVAL,
    Estimate,
    bends_too_much,
    is_weak,
    unanswered,
)
from tactile_bayes.reconstruction.samples import Samples

_CLEARANCE = 2.0  # standard deviations from the edge between the phases below which the phase of a contact is uncertain
_MISFIT = 25.0  # sum of squares of one degree of freedom that noise exceeds in less than one of a million samples


def constrained_estimate(samples: Samples, delta: Floats) -> Estimate:
    """Most likely contacts, with their covariance on the sheet of possible contacts."""
    _refuse_without_noise(samples)
    count = delta.size
    place, covariance = np.full((count, 4), np.nan), np.full((count, 4, 4), np.nan)
    misfit, distance = np.full(count, np.nan), np.full(count, np.nan)
    phase = np.zeros(count, dtype=np.int8)
    other, status = np.full((count, 4), np.nan), unanswered(samples.loaded, samples.cut_off)
    with np.errstate(over="ignore"):
        usable = np.isfinite(samples.reading.loads**2).all(axis=1)
    where = np.flatnonzero(samples.loaded & ~samples.cut_off & usable)
    if where.size:
        reading = samples.reading.take(where)
        given = delta[where], samples.rods.take(where)
        fit = fit_contacts(reading, *given)
        rod, slopes = contact_states_and_slopes(fit.coordinates, *given)
        found = np.isfinite(fit.misfit) & np.isfinite(rod.place).all(axis=0)
        by = slopes.place
        with np.errstate(over="ignore", invalid="ignore"):
            spread = by @ fit.covariance @ np.swapaxes(by, 1, 2)
        covariance[where] = np.where(found[:, None, None], spread, np.nan)
        place[where] = np.where(found[:, None], rod.place.T, np.nan)
        phase[where] = np.where(found, fit.phase, 0)
        misfit[where], distance[where] = np.where(found, (fit.misfit, fit.clearance), np.nan)
        bent = is_weak(reading.loads, reading.covariance)
        with np.errstate(invalid="ignore"):
            # Near the limits: the line of force through the pivot, or a vertical contour.
            bent |= rod.loads[0] < np.sqrt(reading.covariance[:, 0, 0])
            bent |= np.abs(rod.place[2]) > 0.49 * np.pi
        bent |= bends_too_much(place[where], covariance[where], _aside(fit, *given))
        rivalled = found & (fit.rival < RIVAL)
        twice = rivalled & (fit.other_phase == fit.phase)
        kinds = (~found, fit.misfit > _MISFIT, twice, fit.clearance < _CLEARANCE, rivalled, bent)
        status[where] = np.select(kinds, (NO_ZERO, NO_FIT, AMBIGUOUS, BETWEEN_PHASES, EITHER_PHASE, NONLINEAR), OK)
        has_other = rivalled & ((status[where] == AMBIGUOUS) | (status[where] == EITHER_PHASE))
        other[where] = np.where(has_other[:, None], contact_states(fit.other, *given).place.T, np.nan)
    return Estimate(place, covariance, phase, status, other, misfit, distance)


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


def _aside(fit: ContactFit, delta: Floats, rods: Rods) -> list[tuple[Floats, Floats]]:
    """Contacts one standard deviation aside, along the axes of the covariance."""
    pairs = []
    for step in principal_steps(fit.covariance):
        both = fit.coordinates + step, fit.coordinates - step
        more, less = (contact_states(aside, delta, rods).place.T for aside in both)
        pairs.append((more, less))
    return pairs
