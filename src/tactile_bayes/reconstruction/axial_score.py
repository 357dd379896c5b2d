"""Agreement of the force along the rod with the moment, over tangential contacts."""

from __future__ import annotations

import numpy as np

from tactile_bayes.arrays import Floats
from tactile_bayes.mechanics.contacts.contact_coordinates import (
    DRIVE_ANGLE,
    FORCE,
    PSI1,
    contact_states,
    contact_states_and_slopes,
)
from tactile_bayes.mechanics.elastica import lever_of_stem
from tactile_bayes.mechanics.fitting import fit_sheet
from tactile_bayes.mechanics.phases import TANGENTIAL
from tactile_bayes.reconstruction.estimate import principal_steps
from tactile_bayes.reconstruction.samples import Samples

AXIAL_ALARM = 6.0  # size of the axial score above which the force along the rod is reported to disagree with the moment


def axial_score(samples: Samples, friction: float) -> float:
    """Return the mean difference of the force along the rod from its value by the moment, over its standard error. For
    rods that vary along their length, it is that of f sin ψ1 at the contact from −f sin δ; NaN without a usable
    contact."""
    if samples.rods.profile is None:
        surplus, variance = _of_arcs(samples, friction)
    else:
        surplus, variance = _of_varied_rods(samples, samples.friction_angles(friction))
    if not surplus.size:
        return np.nan
    return float(np.sum(surplus / variance) / np.sqrt(np.sum(1.0 / variance)))


def _of_arcs(samples: Samples, friction: float) -> tuple[Floats, Floats]:
    """Difference by the first integral where the rod begins, and its variance, shape (n,)."""
    reading, rest, stem = samples.reading, samples.rods.curvature, samples.rods.stem
    moment, force_x, force_y = reading.loads.T
    cos, sin = np.cos(reading.drive_angle), np.sin(reading.drive_angle)
    force = np.hypot(force_x, force_y)
    drag = samples.sense * friction / np.hypot(1.0, friction)
    moment_variance = reading.covariance[:, 0, 0]
    if stem:
        moment = moment - lever_of_stem(stem, reading.drive_angle, force_x, force_y)
        arm = np.stack([np.ones_like(cos), stem * sin, -stem * cos], axis=1)
        moment_variance = np.einsum("ni,nij,nj->n", arm, reading.covariance, arm)
    surplus = force_x * cos + force_y * sin + drag * force - 0.5 * (moment**2 - moment_variance)
    surplus += rest * moment
    slopes = np.stack([rest - moment, cos + drag * force_x / force, sin + drag * force_y / force], axis=1)
    by_angle = force_y * cos - force_x * sin
    if stem:
        by_angle += stem * slopes[:, 0] * (force_y * sin + force_x * cos)
        slopes = slopes + slopes[:, :1] * (arm - [1.0, 0.0, 0.0])
    by_angle += np.sum(slopes * reading.leaning, axis=1)
    variance = np.einsum("ni,nij,nj->n", slopes, reading.covariance, slopes)
    variance += (by_angle * reading.angle_deviation) ** 2
    return surplus, variance


def _of_varied_rods(samples: Samples, delta: Floats) -> tuple[Floats, Floats]:
    """Return D = f (sin ψ1 + sin δ) by Step 2, to first order about the best tangential contact, and its variance. D is
    zero for all tangential contacts, so that its derivatives there follow from the loads. The expectation of second
    order is subtracted; samples without neighbours one deviation aside are left out."""
    reading, rods = samples.reading, samples.rods
    fit = fit_sheet(reading, delta, TANGENTIAL, rods)
    z = fit.coordinates
    here, slopes = contact_states_and_slopes(z, delta, rods)
    by_coordinates = np.zeros((delta.size, DRIVE_ANGLE, 1))
    by_coordinates[:, PSI1, 0] = z[:, FORCE] * np.cos(z[:, PSI1])
    by_loads = np.linalg.solve(np.swapaxes(slopes.loads[:, :, :DRIVE_ANGLE], 1, 2), by_coordinates)[:, :, 0]
    by_angle = -np.sum(by_loads * slopes.loads[:, :, DRIVE_ANGLE], axis=1)
    off = reading.loads - here.loads.T
    for step in principal_steps(fit.covariance):
        more, less = (contact_states(z + sign * step, delta, rods).loads for sign in (1.0, -1.0))
        off += 0.5 * (more + less - 2.0 * here.loads).T
    surplus = np.sum(by_loads * off, axis=1) + by_angle * (reading.drive_angle - z[:, DRIVE_ANGLE])
    variance = np.einsum("ni,nij,nj->n", by_loads, reading.covariance, by_loads)
    variance += ((by_angle + np.sum(by_loads * reading.leaning, axis=1)) * reading.angle_deviation) ** 2
    usable = np.isfinite(surplus) & np.isfinite(variance)
    return surplus[usable], variance[usable]
