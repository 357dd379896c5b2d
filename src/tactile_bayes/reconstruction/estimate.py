"""The estimate: a contact for every sample, raw or constrained to possible contacts, and its covariance."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from enum import IntEnum
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tactile_bayes.arrays import Flags, Floats
from tactile_bayes.errors import ParameterError
from tactile_bayes.mechanics.contacts.contact_coordinates import contact_states, contact_states_and_slopes
from tactile_bayes.mechanics.contacts.fits import ContactFit, RawFit
from tactile_bayes.mechanics.fitting import fit_contacts, raw_contacts
from tactile_bayes.mechanics.phases import NONE, TANGENTIAL, TIP
from tactile_bayes.mechanics.rods.profile import Rods
from tactile_bayes.reconstruction.samples import Samples


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
_MOST_BEND = 0.5  # shift by curvature, in standard deviations, above which a covariance of first order is not valid
_RIVAL = 6.0  # difference of sums of squares below which another contact is not negligible: a likelihood ratio of 20
_WEAK = 10.0  # standard deviations of the noise below which a force is weak, so that its direction is uncertain
_APART = 2.0, 1e-6  # distance from which two points are different contacts: in standard deviations, in L without noise
_CLEARANCE = 2.0  # standard deviations from the edge between the phases below which the phase of a contact is uncertain
_MISFIT = 25.0  # sum of squares of one degree of freedom that noise exceeds in less than one of a million samples
_ROUNDING = 1e-9  # distance [L] that rounding makes


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
            bent = _is_weak(samples.reading.loads, samples.reading.covariance) | ~(fit.bend <= _MOST_BEND**2)
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
    return Estimate(fit.place, covariance, phase, _status_by(reasons), fit.other)


def _is_ambiguous(fit: RawFit, has_noise: bool) -> Flags:
    """Return where the other point is a contact elsewhere that is at most 20 times less likely. Without a noise level,
    the deviation of the contact that is found stands for one standard deviation."""
    x, y = (fit.other[:, :2] - fit.place[:, :2]).T
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        if not has_noise:
            apart = np.hypot(x, y) > _APART[1]
            return np.asarray(apart & (fit.other_deviation**2 < (1.0 + _RIVAL) * (fit.deviation + _ROUNDING) ** 2))
        apart = _squared_distance(x, y, fit.covariance) > _APART[0] ** 2
        return np.asarray(apart & (fit.other_deviation**2 < fit.deviation**2 + _RIVAL))


def constrained_estimate(samples: Samples, delta: Floats) -> Estimate:
    """Most likely contacts, with their covariance on the sheet of possible contacts."""
    _refuse_without_noise(samples)
    with np.errstate(over="ignore"):
        usable = np.isfinite(samples.reading.loads**2).all(axis=1)
    status = _status_by(
        {
            Status.NO_CONTACT: ~samples.loaded,
            Status.CUT_OFF: samples.cut_off,
            Status.NO_ZERO_OF_CURVATURE: ~usable,
        }
    )
    where = np.flatnonzero(status == Status.OK)
    reading, given = samples.reading.take(where), (delta[where], samples.rods.take(where))
    fit = fit_contacts(reading, *given)
    rod, slopes = contact_states_and_slopes(fit.coordinates, *given)
    place = rod.place.T
    found = np.isfinite(fit.misfit) & np.isfinite(place).all(axis=1)
    with np.errstate(over="ignore", invalid="ignore"):
        covariance = slopes.place @ fit.covariance @ np.swapaxes(slopes.place, 1, 2)
        bent = _is_weak(reading.loads, reading.covariance) | _bends_too_much(fit, place, covariance, *given)
        # Near the limits: the line of force through the pivot, or a vertical contour.
        bent |= rod.loads[0] < np.sqrt(reading.covariance[:, 0, 0])
        bent |= np.abs(place[:, 2]) > 0.49 * np.pi
    rivalled = found & (fit.rival < _RIVAL)
    status[where] = _status_by(
        {
            Status.NO_ZERO_OF_CURVATURE: ~found,
            Status.DOES_NOT_FIT: fit.misfit > _MISFIT,
            Status.AMBIGUOUS: rivalled & (fit.other_phase == fit.phase),
            Status.BETWEEN_PHASES: fit.clearance < _CLEARANCE,
            Status.EITHER_PHASE: rivalled,
            Status.NONLINEAR: bent,
        }
    )
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
            bent |= ~((_squared_distance(x, y, covariance) <= _MOST_BEND**2) | (x * x + y * y < _ROUNDING**2))
    return bent


def _status_by(reasons: Mapping[Status, Any]) -> NDArray[np.int8]:
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


def _is_weak(loads: Floats, covariance: Floats) -> Flags:
    """Return which forces, of loads (n, 3) with covariance (n, 3, 3), are below 10 standard deviations."""
    force = loads[:, 1:]
    with np.errstate(invalid="ignore", over="ignore"):
        squared = (force * force).sum(axis=1)
        noise = np.einsum("ni,nij,nj->n", force, covariance[:, 1:, 1:], force) / np.where(squared > 0.0, squared, 1.0)
        return np.asarray(squared < _WEAK**2 * noise)


def _squared_distance(x: Floats, y: Floats, covariance: Floats) -> Floats:
    """Return the squared Mahalanobis distance of points in the plane, for covariances of shape (n, ≥ 2, ≥ 2)."""
    xx, yy, xy = covariance[:, 0, 0], covariance[:, 1, 1], covariance[:, 0, 1]
    return np.asarray((yy * x * x - 2.0 * xy * x * y + xx * y * y) / (xx * yy - xy * xy))
