"""Constrained Step 2: the most likely of the contacts that a rod can make."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from tactile_bayes.errors import ParameterError
from tactile_bayes.mechanics.fitting import fit_contacts
from tactile_bayes.reconstruction.estimate import (
    AT_EDGE,
    EITHER_PHASE,
    NO_FIT,
    NO_ZERO,
    NONLINEAR,
    OK,
    Estimate,
    bends_too_much,
    is_weak,
    unanswered,
)
from tactile_bayes.reconstruction.samples import Samples

__all__ = ["are_weighed", "constrained_estimate", "refuse_without_noise"]

Floats = NDArray[np.float64]

_CLEARANCE = 2.0
"""Standard deviations from the edge between the phases below which a contact may well be of the other one."""

_MISFIT = 25.0
"""Sum of squares, of one degree of freedom, that noise exceeds in less than one of a million samples."""

_RIVAL = 6.0
"""Lead in the sum of squares, below which the other phase is too likely to be left out: by a factor of 20."""


def constrained_estimate(samples: Samples, delta: Floats) -> Estimate:
    """Most likely contacts, with their covariance on the sheet of possible ones.

    Raises
    ------
    ParameterError
        If a channel has no noise, or noise without a variance.
    """
    refuse_without_noise(samples)
    count = delta.size
    place, covariance = np.full((count, 4), np.nan), np.full((count, 4, 4), np.nan)
    misfit, distance = np.full(count, np.nan), np.full(count, np.nan)
    phase = np.zeros(count, dtype=np.int8)
    status = unanswered(samples.loaded, samples.cut_off)
    with np.errstate(over="ignore"):
        usable = np.isfinite(samples.reading.loads**2).all(axis=1)
    where = np.flatnonzero(samples.loaded & ~samples.cut_off & usable)
    reading = samples.reading.take(where)
    fit = fit_contacts(reading, delta[where])
    found = np.isfinite(fit.misfit) & np.isfinite(fit.place).all(axis=1)
    bent = is_weak(reading) | bends_too_much(fit.bend)
    # At the ends of what is possible: the line of force through the pivot, or an upright contour.
    bent |= fit.moment < np.sqrt(reading.covariance[:, 0, 0])
    bent |= np.abs(fit.place[:, 2]) > 0.49 * np.pi
    kinds = (~found, fit.misfit > _MISFIT, fit.clearance < _CLEARANCE, fit.rival < _RIVAL, bent)
    status[where] = np.select(kinds, (NO_ZERO, NO_FIT, AT_EDGE, EITHER_PHASE, NONLINEAR), OK)
    where = where[found]
    place[where], covariance[where], phase[where] = fit.place[found], fit.place_covariance[found], fit.phase[found]
    misfit[where], distance[where] = fit.misfit[found], fit.clearance[found]
    return Estimate(place, covariance, phase, status, misfit, distance)


def are_weighed(samples: Samples) -> bool:
    """Whether the load cell says how far each channel is to be trusted."""
    covariance = samples.reading.covariance
    return bool(np.all(np.isfinite(covariance)) and np.all(np.diagonal(covariance, axis1=1, axis2=2) > 0.0))


def refuse_without_noise(samples: Samples) -> None:
    """Refuse a load cell that does not say how far each channel is to be trusted."""
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
