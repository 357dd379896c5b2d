"""The estimate: a contact for every sample, its covariance to first order, and the validity of that order."""

from __future__ import annotations

from collections.abc import Mapping
from enum import IntEnum
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from tactile_bayes.arrays import Flags, Floats


class Status(IntEnum):
    """What became of a sample; `reconstruct` describes each."""

    NO_CONTACT = 0
    CUT_OFF = 1
    NO_ZERO_OF_CURVATURE = 2
    OK = 3
    NONLINEAR = 4
    BEYOND_THE_TIP = 5
    BETWEEN_PHASES = 6
    EITHER_PHASE = 7
    DOES_NOT_FIT = 8
    AMBIGUOUS = 9


STATUSES = tuple(one.name.lower().replace("_", " ") for one in Status)  # by code
MOST_BEND = 0.5  # shift by curvature, in standard deviations, above which a covariance of first order is not valid
RIVAL = 6.0  # difference of sums of squares below which another contact is not negligible: a likelihood ratio of 20
_WEAK = 10.0  # standard deviations of the noise below which a force is weak, so that its direction is uncertain


class Estimate(NamedTuple):
    """Contacts, dimensionless and mirrored to forward ones; NaN where there is none."""

    place: Floats  # contact point, slope angle and arc length, shape (n, 4)
    covariance: Floats | None  # covariance of the place, shape (n, 4, 4); None without any noise level
    phase: NDArray[np.int8]
    status: NDArray[np.int8]  # code in `STATUSES`
    other: Floats  # place of the other contact that is likely, shape (n, 4); NaN where there is none
    misfit: Floats | None = None  # residual sum of squared deviations, shape (n,)
    # Distance from the change between tip and tangential contact, in standard deviations, shape (n,).
    edge_distance: Floats | None = None


def status_by(reasons: Mapping[Status, Flags]) -> NDArray[np.int8]:
    """Return the status of samples: the first whose reason holds, OK without any."""
    return np.select(list(reasons.values()), list(reasons), Status.OK).astype(np.int8)


def spread_across(covariance: Floats, slope_angle: Floats) -> tuple[Floats, Floats]:
    """Standard deviations along the contour and normal to it, for points with covariance (n, ≥ 2, ≥ 2)."""
    cos, sin = np.cos(slope_angle), np.sin(slope_angle)
    xx, yy, xy = covariance[:, 0, 0], covariance[:, 1, 1], covariance[:, 0, 1]
    with np.errstate(invalid="ignore"):
        along = np.sqrt(np.maximum(cos * cos * xx + sin * sin * yy + 2.0 * sin * cos * xy, 0.0))
        normal = np.sqrt(np.maximum(sin * sin * xx + cos * cos * yy - 2.0 * sin * cos * xy, 0.0))
    return along, normal


def is_weak(loads: Floats, covariance: Floats) -> Flags:
    """Return which forces, of loads (n, 3) with covariance (n, 3, 3), are below 10 standard deviations."""
    force = loads[:, 1:]
    with np.errstate(invalid="ignore", over="ignore"):
        squared = (force * force).sum(axis=1)
        noise = np.einsum("ni,nij,nj->n", force, covariance[:, 1:, 1:], force) / np.where(squared > 0.0, squared, 1.0)
        return np.asarray(squared < _WEAK**2 * noise)


def squared_distance(x: Floats, y: Floats, covariance: Floats) -> Floats:
    """Return the squared Mahalanobis distance of points in the plane, for covariances of shape (n, ≥ 2, ≥ 2)."""
    xx, yy, xy = covariance[:, 0, 0], covariance[:, 1, 1], covariance[:, 0, 1]
    return np.asarray((yy * x * x - 2.0 * xy * x * y + xx * y * y) / (xx * yy - xy * xy))
