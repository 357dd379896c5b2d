"""The discrepancy of a model that is inferred beside a contour: its parameters, and its size in contact."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy import stats

from tactile_bayes.arrays import Floats
from tactile_bayes.distributions import Distribution
from tactile_bayes.errors import ParameterError
from tactile_bayes.load_cell.discrepancy import Course
from tactile_bayes.rig.parameters import GROUPS
from tactile_bayes.rig.parameters import PARAMETERS as RIG_PARAMETERS

if TYPE_CHECKING:
    from tactile_bayes.rig.rig import Rig

__all__ = ["PARAMETERS", "discrepancy_priors", "is_discrepancy", "load_in_contact"]

PARAMETERS = GROUPS["discrepancy"]


def is_discrepancy(name: str) -> bool:
    """Return True for the name of a parameter of the discrepancy, or of both."""
    return name == "discrepancy" or name in PARAMETERS


def discrepancy_priors(rig: Rig) -> dict[str, Distribution]:
    """Return the priors of the discrepancy, if it is unknown; none if nothing or zero is said of it."""
    said = {name: value for name, value in rig.said.items() if name in PARAMETERS}
    if known := [name for name, value in said.items() if isinstance(value, float) and value]:
        raise ParameterError(
            f"{known[0]} is a number: a discrepancy has no known size, so give a distribution, or 0 for none"
        )
    if not any(not isinstance(value, float) for value in said.values()):
        return {}
    rows = [RIG_PARAMETERS[name] for name in PARAMETERS]
    usual = {row.name: stats.lognorm(s=row.width, scale=row.neutral or 1.0) for row in rows}
    return {name: rig.distributions.get(name, default) for name, default in usual.items()}


def load_in_contact(loads: Floats, course: Course) -> Floats:
    """Return the largest load of the sweep at samples in contact, shape (..., samples, 3); 0 at the others.

    The largest force in any direction stands for both forces, so that the discrepancy does not depend on the frame of
    the load cell, and a force that happens to be small is as uncertain as the other.
    """
    sizes = np.stack([np.abs(loads[..., 0]), np.hypot(loads[..., 1], loads[..., 2])], axis=-1)
    begins = np.flatnonzero(np.isinf(course.step))
    largest = np.maximum.reduceat(sizes[..., course.order, :], begins, axis=-2)
    of_sample = np.empty(course.order.size, dtype=np.intp)
    of_sample[course.order] = np.cumsum(np.isinf(course.step)) - 1
    in_contact = (sizes[..., 1] > 0.0) | (sizes[..., 0] > 0.0)
    return np.asarray(np.where(in_contact[..., None], largest[..., of_sample, :][..., [0, 1, 1]], 0.0))
