"""Fisher's information of a whole record about a contour and all else that is not known, as arrays."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from tactile_bayes.arrays import Floats
from tactile_bayes.errors import ReachError
from tactile_bayes.inference.contour_model import ContourModel
from tactile_bayes.load_cell import LoadCell
from tactile_bayes.numerics.differences import central_slopes
from tactile_bayes.planning.error_covariance import whitening
from tactile_bayes.record import CHANNELS

__all__ = ["ReadingSlopes", "RecordInformation", "prior_precision", "reading_slopes", "record_information"]

_STEP = 1e-5
"""Of the differences, over the scale of each parameter."""


class ReadingSlopes(NamedTuple):
    """What a record would show, and how that changes, whatever the noise; dimensionless."""

    loads: Floats
    """Shape (samples, 3)."""
    by_parameters: Floats
    """Derivatives of the readings by the parameters of contour and rig, shape (samples, 3, parameters)."""
    by_angle: Floats
    """And by the drive angle, shape (samples, 3); zero where the encoder makes no errors."""


class RecordInformation(NamedTuple):
    """What a record says, to first order and on average over its noise."""

    slopes: Floats
    """Derivatives of independent readings of unit variance by the parameters, shape (samples, channels, d)."""
    of_noise: Floats
    """Information about the parameters of the noise, shape (d,); zero for the others."""

    @property
    def matrix(self) -> Floats:
        """Shape (d, d)."""
        flat = self.slopes.reshape(-1, self.slopes.shape[-1])
        return np.asarray(flat.T @ flat + np.diag(self.of_noise))


def reading_slopes(model: ContourModel, point: Floats, step: float = _STEP) -> ReadingSlopes:
    """Derivatives of what a record would show, at a point of the model's parameters.

    Parameters
    ----------
    model : ContourModel
    point : ndarray, shape (d,)
    step : float
        Of differences, over the scale of each parameter; larger where loads are interpolated roughly.

    Raises
    ------
    ReachError
        If the rod does not reach the contour in every sweep.
    """
    cell, located = model.likelihood.load_cell, len(model.located)
    if not model.likelihood.usable(model.contours(point[None]), model.rig(point[None]))[0]:
        raise ReachError("the rod does not reach the contour in every sweep, or does not come free of it")
    loads = model.loads(point[None])[0]
    rough = np.where(cell.noise > 0.0, cell.noise, 1.0)

    def readings(points: Floats) -> Floats:
        whole = np.hstack([points, np.broadcast_to(point[located:], (len(points), point.size - located))])
        return (cell.expected(model.loads(whole)) / rough).reshape(len(points), -1)

    steps = step * parameter_scales(model, point)[:located]
    # What cannot be less than it is, like no friction at all, is looked at one step further.
    inside = np.clip(point[:located], model.low[:located] + steps, model.high[:located] - steps)
    slopes = central_slopes(readings, inside, steps).reshape(len(loads), len(CHANNELS), located)
    by_angle = _by_angle(model, point) if cell.drive_angle_deviation else np.zeros_like(loads)
    return ReadingSlopes(loads, slopes * rough[:, None], by_angle)


def record_information(
    model: ContourModel,
    point: Floats,
    channels: NDArray[np.bool_] | None = None,
    *,
    slopes: ReadingSlopes | None = None,
    load_cell: LoadCell | None = None,
) -> RecordInformation:
    """Expected information at a point of the model's parameters.

    For errors with a normal distribution it is JᵀΣ⁻¹J, J the derivatives of the readings; for Student's t with ν
    degrees of freedom smaller by (ν + 1)/(ν + 3), with Σ of the scale in place of the standard deviation. That contact
    ends at the snap-off tells besides which contours are impossible: that has no slope, and does not count. Nor does
    what noise in proportion to the loads tells of these by its size; and what is said of the noise's scale is that of
    white noise, which is too much beside drift or an encoder's noise.

    Parameters
    ----------
    model : ContourModel
    point : ndarray, shape (d,)
    channels : ndarray of bool, shape (3,), optional
        Those that are used, of those that were measured.
    slopes : ReadingSlopes, optional
        At this point, where they are known already.
    load_cell : LoadCell, optional
        Another than the model's, in its units, that differs in the noise of its channels alone.

    Raises
    ------
    ReachError
        If the rod does not reach the contour in every sweep.
    """
    located = len(model.located)
    cell = model.likelihood.load_cell if load_cell is None else load_cell.dimensionless(model.likelihood.rod)
    cell = _scaled(cell, model.noise_scale(point[None])[0])
    present = model.present if channels is None else model.present & channels
    loads, by_parameters, by_angle = reading_slopes(model, point) if slopes is None else slopes
    white = whitening(cell, loads, by_angle, present)(by_parameters)
    nu = cell.degrees_of_freedom
    if not math.isinf(nu):  # the covariance is wider than the scale by ν/(ν − 2)
        white = white * math.sqrt((nu + 1.0) / (nu + 3.0) * nu / (nu - 2.0))
    every = np.zeros((*white.shape[:2], point.size))
    every[..., :located] = white
    of_noise = np.zeros(point.size)
    for name, scaled in zip(model.noise.names, model.noise.channels, strict=True):
        count = len(loads) * sum(present[CHANNELS.index(c)] for c in scaled)
        share = 1.0 if math.isinf(nu) else nu / (nu + 3.0)
        i = model.names.index(name)
        of_noise[i] = 2.0 * share * count / point[i] ** 2
    return RecordInformation(every, of_noise)


def _scaled(cell: LoadCell, factors: Floats) -> LoadCell:
    """The cell with the white noise of its channels as many times larger."""
    moment, force = float(factors[0]), float(factors[1])
    return replace(
        cell,
        moment_noise=moment * cell.moment_noise,
        force_noise=force * cell.force_noise,
        relative_noise=force * cell.relative_noise,
    )


def prior_precision(model: ContourModel) -> Floats:
    """One over the variances of the priors, shape (d,); zero where that is infinite."""
    variance = np.array([float(model.priors[name].std()) ** 2 for name in model.names])
    return np.where(np.isfinite(variance) & (variance > 0.0), 1.0 / np.where(variance > 0.0, variance, 1.0), 0.0)


def parameter_scales(model: ContourModel, point: Floats) -> Floats:
    """On which each parameter varies: its own size, or the spread of its prior where that is smaller or it is zero."""
    scales = []
    for name, value in zip(model.names, point, strict=True):
        sizes = [size for size in (abs(float(value)), float(model.priors[name].std())) if 0.0 < size < np.inf]
        scales.append(min(sizes) if sizes else 1.0)
    return np.array(scales)


def _by_angle(model: ContourModel, point: Floats) -> Floats:
    """Derivatives of the readings by the drive angle, shape (samples, 3)."""
    contours, rig = model.contours(point[None]), model.rig(point[None])
    rough = model.likelihood.load_cell.noise

    def readings(angles: Floats) -> Floats:
        many = contours.take(np.zeros(len(angles), dtype=np.intp))
        every = rig._replace(
            **{
                name: np.repeat(np.atleast_1d(value), len(angles), axis=0)
                for name, value in rig._asdict().items()
                if value is not None and name != "drive_angle_offset"
            },
            drive_angle_offset=np.asarray(rig.drive_angle_offset) - angles[:, 0],
        )
        loads, _ = model.likelihood.predict(many, every)
        return np.asarray((model.likelihood.load_cell.expected(loads) / rough).reshape(len(angles), -1))

    slopes = central_slopes(readings, np.zeros(1), _STEP)
    return np.asarray(slopes.reshape(-1, len(CHANNELS)) * rough)
