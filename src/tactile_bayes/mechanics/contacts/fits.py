"""Samples that contacts are fitted to, and what is found."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from tactile_bayes.arrays import Flags, Floats, Index


class Reading(NamedTuple):
    """Samples of forward contacts and their uncertainty, dimensionless."""

    drive_angle: Floats  # shape (n,)
    loads: Floats  # holding moment and support reaction, shape (n, 3)
    angle_deviation: Floats  # standard deviation of the drive angle, shape (n,)
    leaning: Floats  # derivative of the errors of the loads by the error of the drive angle, shape (n, 3)
    covariance: Floats  # covariance of the other errors of the loads, shape (n, 3, 3)

    def take(self, where: Index | slice) -> Reading:
        return Reading(*(column[where] for column in self))


class SheetFit(NamedTuple):
    """Best contact of one phase, regardless of its bounds."""

    coordinates: Floats  # force, ψ1, arc length and drive angle, shape (n, 4); NaN where there is none
    covariance: Floats  # covariance of the coordinates, shape (n, 4, 4); zero for those that are not free
    misfit: Floats  # sum of squared deviations, shape (n,)


class ContactFit(NamedTuple):
    """Most likely contacts."""

    coordinates: Floats
    covariance: Floats
    misfit: Floats
    phase: NDArray[np.int8]
    at_edge: Flags  # true if the contact lies on the edge, since the best contacts of both phases lie beyond it
    clearance: Floats  # distance from the edge, in standard deviations of the coordinate that leads to it
    rival: Floats  # excess of the sum of squares of the next best contact; infinite where there is none
    other: Floats  # coordinates of that contact, shape (n, 4)
    other_phase: NDArray[np.int8]


class RawFit(NamedTuple):
    """Contacts of Step 2."""

    place: Floats  # contact point, slope angle and arc length, shape (n, 4)
    tip_angle: Floats
    covariance: Floats  # covariance of the place to first order, shape (n, 4, 4), or without rows if there is no noise
    # Nonlinearity: squared distance, in the metric of the covariance, from the contact to the mean of two contacts one
    # standard deviation to either side; the largest of all axes, NaN where there is no such contact, shape (n,), or
    # (0,) without noise.
    bend: Floats
    # Deviation of the contact from one at the tip or along the rod, in its standard deviations, or in L and rad without
    # noise, shape (n,).
    deviation: Floats
    other: Floats  # the other point without moment, shape (n, 4); NaN without one
    other_deviation: Floats  # shape (n,)
