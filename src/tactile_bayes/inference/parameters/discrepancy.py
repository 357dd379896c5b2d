"""The discrepancy of a model that is inferred beside a contour: its parameters, and its size in contact."""

from __future__ import annotations

from collections.abc import Collection, Mapping

import numpy as np
from scipy import stats

from tactile_bayes.arrays import Floats
from tactile_bayes.inference.parameters.priors import Prior
from tactile_bayes.load_cell.discrepancy import Course

__all__ = ["DISCREPANCY", "PARAMETERS", "discrepancy_priors", "is_discrepancy", "load_in_contact"]

DISCREPANCY = "discrepancy"
"""Name that stands for both parameters among the nuisances."""

PARAMETERS = ("discrepancy_scale", "discrepancy_length")

_SCALE, _SCALE_SPREAD = 0.005, 1.0
"""Median of the prior of the scale, and standard deviation of its logarithm."""

_LENGTH, _LENGTH_SPREAD = 0.3, 0.5
"""Median of the prior of the length [rad], and standard deviation of its logarithm."""


def is_discrepancy(name: str) -> bool:
    """Return True for a name by which a discrepancy is asked for."""
    return name == DISCREPANCY or name in PARAMETERS


def discrepancy_priors(nuisances: Collection[str], priors: Mapping[str, Prior]) -> dict[str, Prior]:
    """Return default priors of the discrepancy, if a nuisance or a prior asks for it; else none."""
    if not any(map(is_discrepancy, (*nuisances, *priors))):
        return {}
    return {
        "discrepancy_scale": stats.lognorm(s=_SCALE_SPREAD, scale=_SCALE),
        "discrepancy_length": stats.lognorm(s=_LENGTH_SPREAD, scale=_LENGTH),
    }


def load_in_contact(loads: Floats, course: Course) -> Floats:
    """Return the largest load of the sweep at samples in contact, shape (..., samples, 3); 0 at the others.

    The largest force in any direction stands for both forces, so that the discrepancy does not depend on the frame of
    the load cell, and a force that happens to be small is as uncertain as the other.

    Parameters
    ----------
    loads : ndarray, shape (..., samples, 3)
        Loads, exactly zero out of contact.
    course : Course
        Sweeps of the record.
    """
    sizes = np.stack([np.abs(loads[..., 0]), np.hypot(loads[..., 1], loads[..., 2])], axis=-1)
    begins = np.flatnonzero(np.isinf(course.step))
    largest = np.maximum.reduceat(sizes[..., course.order, :], begins, axis=-2)
    of_sample = np.empty(course.order.size, dtype=np.intp)
    of_sample[course.order] = np.cumsum(np.isinf(course.step)) - 1
    in_contact = (sizes[..., 1] > 0.0) | (sizes[..., 0] > 0.0)
    return np.asarray(np.where(in_contact[..., None], largest[..., of_sample, :][..., [0, 1, 1]], 0.0))
