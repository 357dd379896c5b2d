"""Contacts from noisy samples: taken at their word, or brought onto the sheets of possible contacts.

A contact has three degrees of freedom, a sample has four numbers (drive angle, holding moment, two forces): the sum of
squares that is left, in standard deviations, has one. Each phase is fitted on its sheet (`touching`); a sheet's optimum
beyond the edge where the two meet does not count, and where neither has one before it, the most likely contact lies on
the edge (`fits`).

Dimensionless, relative to the pivot, forward contacts.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from tactile_bayes.mechanics.phases import NONE

__all__ = ["ContactFit", "RawFit", "Reading", "SheetFit", "fit_contacts", "fit_sheet", "raw_contacts"]

Floats = NDArray[np.float64]


class Reading(NamedTuple):
    """Samples of forward contacts, with how far they are to be trusted; dimensionless."""

    drive_angle: Floats
    """Shape (n,)."""
    loads: Floats
    """Holding moment and support reaction, shape (n, 3)."""
    angle_deviation: Floats
    """Standard deviation of the drive angle, shape (n,)."""
    leaning: Floats
    """By how much the error of the loads grows with that of the drive angle, shape (n, 3)."""
    covariance: Floats
    """Of what else is wrong with the loads, shape (n, 3, 3)."""

    def take(self, where: NDArray[np.intp] | slice) -> Reading:
        return Reading(*(column[where] for column in self))


class SheetFit(NamedTuple):
    """The best contact of one phase, its bounds not heeded."""

    coordinates: Floats
    """Force, ψ1, arc length and drive angle, shape (n, 4); NaN where there is none."""
    covariance: Floats
    """Of the coordinates, shape (n, 4, 4); zero for those that are not free."""
    misfit: Floats
    """Sum of squared deviations, shape (n,)."""


class ContactFit(NamedTuple):
    """Most likely contacts."""

    coordinates: Floats
    covariance: Floats
    misfit: Floats
    phase: NDArray[np.int8]
    at_edge: NDArray[np.bool_]
    """Whether the contact lies where tip and tangential contact meet, the best of both lying beyond."""
    clearance: Floats
    """Distance from the edge, in standard deviations of the coordinate that leads to it."""
    rival: Floats
    """By how much the sum of squares of the best contact of the other phase is larger; infinite where it has none."""
    moment: Floats
    """Holding moment of the contact."""
    place: Floats
    """Contact point, slope angle and arc length, shape (n, 4)."""
    place_covariance: Floats
    """Shape (n, 4, 4)."""
    bend: Floats
    """Squared distance, in the metric of the covariance, of the mean of two contacts that are one standard deviation to
    either side from the contact; the largest of all axes, NaN where there is no such contact, shape (n,)."""


class RawFit(NamedTuple):
    """Contacts of Step 2."""

    place: Floats
    """Shape (n, 4)."""
    tip_angle: Floats
    covariance: Floats
    """Of the place, to first order, shape (n, 4, 4)."""
    bend: Floats
    """As in `ContactFit`."""


def fit_contacts(reading: Reading, friction_angle: Floats) -> ContactFit:
    """Most likely contacts of samples.

    Parameters
    ----------
    reading : Reading
        n samples.
    friction_angle : ndarray, shape (n,)
        δ = arctan μ.
    """
    from tactile_bayes.mechanics.fits import fits  # numba takes a second to load

    count = friction_angle.size
    fit = ContactFit(
        coordinates=np.empty((count, 4)),
        covariance=np.empty((count, 4, 4)),
        misfit=np.empty(count),
        phase=np.empty(count, np.int8),
        at_edge=np.empty(count, np.bool_),
        clearance=np.empty(count),
        rival=np.empty(count),
        moment=np.empty(count),
        place=np.empty((count, 4)),
        place_covariance=np.empty((count, 4, 4)),
        bend=np.empty(count),
    )
    fits(_plain(reading), np.array(friction_angle), fit)
    return fit


def fit_sheet(reading: Reading, delta: Floats, phase: int | None) -> SheetFit:
    """The best contact of one phase, or on the edge (None), wherever on its sheet, beyond the edge as well.

    Parameters
    ----------
    reading : Reading
        n samples.
    delta : ndarray, shape (n,)
        δ = arctan μ.
    phase : TIP, TANGENTIAL or None
    """
    from tactile_bayes.mechanics.fits import sheet_fits  # numba takes a second to load

    count = delta.size
    fit = SheetFit(np.empty((count, 4)), np.empty((count, 4, 4)), np.empty(count))
    sheet_fits(_plain(reading), np.array(delta), NONE if phase is None else phase, fit)
    return fit


def raw_contacts(reading: Reading, delta: Floats) -> RawFit:
    """What Step 2 makes of samples.

    Parameters
    ----------
    reading : Reading
        n samples.
    delta : ndarray, shape (n,)
        δ = arctan μ.
    """
    from tactile_bayes.mechanics.fits import raw_fits  # numba takes a second to load

    count = delta.size
    fit = RawFit(np.empty((count, 4)), np.empty(count), np.empty((count, 4, 4)), np.empty(count))
    raw_fits(_plain(reading), np.array(delta), fit)
    return fit


def _plain(reading: Reading) -> Reading:
    """In arrays of the one layout that is compiled."""
    return Reading(*(np.array(column, dtype=float, order="C") for column in reading))
