"""Raw Step 2: contacts from four noisy numbers as they are."""

from __future__ import annotations

import numpy as np

from tactile_bayes.arrays import Flags, Floats
from tactile_bayes.mechanics.contacts.fits import RawFit
from tactile_bayes.mechanics.fitting import raw_contacts
from tactile_bayes.mechanics.phases import NONE, TANGENTIAL, TIP
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

_ROUNDING = 1e-9
# Distance from which two points are different contacts, in standard deviations, or in L without noise.
_APART = 2.0, 1e-6


def raw_estimate(samples: Samples, delta: Floats) -> Estimate:
    """Contacts by Step 2, with their covariance to first order in the errors of the sensor."""
    fit = raw_contacts(samples.reading, delta, samples.rods, samples.has_noise)
    slope_angle, arclength = fit.place[:, 2:].T
    found = np.isfinite(arclength) & ~(samples.cut_off & samples.loaded)
    ambiguous = found & _is_ambiguous(fit, samples.has_noise)
    covariance, bent = None, np.zeros(found.size, dtype=bool)
    with np.errstate(invalid="ignore"):
        # In tangential contact the rod lies along the contour, in tip contact it ends there: take the nearer case.
        turn = fit.tip_angle - slope_angle
        tip = (np.abs(1.0 - arclength) < np.abs(np.sin(turn))) | (np.cos(turn) < 0.0)
        if samples.has_noise:
            covariance = fit.covariance
            covariance[~found] = np.nan
            bent = is_weak(samples.reading.loads, samples.reading.covariance) | ~(fit.bend <= MOST_BEND**2)
    reasons = {
        Status.NO_CONTACT: ~samples.loaded,
        Status.CUT_OFF: samples.cut_off,
        Status.NO_ZERO_OF_CURVATURE: ~found,
        Status.AMBIGUOUS: ambiguous,
        Status.BEYOND_THE_TIP: arclength > 1.0 + _ROUNDING,
        Status.NONLINEAR: bent,
    }
    fit.place[~found], fit.other[~ambiguous] = np.nan, np.nan
    phase = np.where(found, np.where(tip, TIP, TANGENTIAL), NONE).astype(np.int8)
    return Estimate(fit.place, covariance, phase, status_by(reasons), fit.other)


def _is_ambiguous(fit: RawFit, has_noise: bool) -> Flags:
    """Return where the other point is a contact elsewhere that is at most 20 times less likely.

    Without a noise level, the deviation of the contact that is found stands for one standard deviation.
    """
    x, y = (fit.other[:, :2] - fit.place[:, :2]).T
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        if not has_noise:
            apart = np.hypot(x, y) > _APART[1]
            return np.asarray(apart & (fit.other_deviation**2 < (1.0 + RIVAL) * (fit.deviation + _ROUNDING) ** 2))
        apart = squared_distance(x, y, fit.covariance) > _APART[0] ** 2
        return np.asarray(apart & (fit.other_deviation**2 < fit.deviation**2 + RIVAL))
