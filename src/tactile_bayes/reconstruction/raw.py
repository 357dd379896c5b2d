"""Raw Step 2: contacts from four noisy numbers as they are."""

from __future__ import annotations

import numpy as np

from tactile_bayes.arrays import Floats
from tactile_bayes.mechanics.fitting import raw_contacts
from tactile_bayes.mechanics.phases import NONE, TANGENTIAL, TIP
from tactile_bayes.reconstruction.estimate import BEYOND_TIP, MOST_BEND, NONLINEAR, OK, Estimate, is_weak, unanswered
from tactile_bayes.reconstruction.samples import Samples

__all__ = ["raw_estimate"]

_ROUNDING = 1e-9


def raw_estimate(samples: Samples, delta: Floats) -> Estimate:
    """Contacts by Step 2, with their covariance to first order in the errors of the sensor."""
    fit = raw_contacts(samples.reading, delta, samples.rods)
    slope_angle, arclength = fit.place[:, 2:].T
    found = np.isfinite(arclength) & ~(samples.cut_off & samples.loaded)
    status = unanswered(samples.loaded, samples.cut_off)
    status[found] = OK
    covariance = None
    with np.errstate(invalid="ignore"):
        # In tangential contact the rod lies along the contour, in tip contact it ends there: take the nearer case.
        tip = np.abs(1.0 - arclength) < np.abs(np.sin(fit.tip_angle - slope_angle))
        if samples.has_noise:
            covariance = fit.covariance
            covariance[~found] = np.nan
            status[
                found & (is_weak(samples.reading.loads, samples.reading.covariance) | ~(fit.bend <= MOST_BEND**2))
            ] = NONLINEAR
        status[found & (arclength > 1.0 + _ROUNDING)] = BEYOND_TIP
    fit.place[~found] = np.nan
    phase = np.where(found, np.where(tip, TIP, TANGENTIAL), NONE).astype(np.int8)
    return Estimate(fit.place, covariance, phase, status)
