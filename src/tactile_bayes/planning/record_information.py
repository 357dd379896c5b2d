"""Fisher's information of a whole record about contour, rig and noise, as arrays."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from scipy.linalg import solve_triangular

from tactile_bayes.arrays import Flags, Floats
from tactile_bayes.errors import ReachError
from tactile_bayes.inference.contour_model import ContourModel
from tactile_bayes.load_cell import LoadCell
from tactile_bayes.load_cell.discrepancy import Discrepancy
from tactile_bayes.load_cell.lone_samples import wandering_deviation
from tactile_bayes.numerics.differences import central_slopes
from tactile_bayes.record import CHANNELS

# Steps of finite differences, over the scale of each parameter: of exact loads, and of interpolated ones.
STEP, COARSE_STEP = 1e-5, 1e-3


class NoiseWhitening(NamedTuple):
    """Linear map of readings to independent ones of unit variance."""

    present: Flags  # true for channels that were measured, shape (3,)
    # Inverse Cholesky factor of each sample, shape (samples, channels, channels); None if samples share errors.
    alone: Floats | None
    # Cholesky factor of the covariance of all readings, shape (samples · channels, samples · channels), or None.
    together: Floats | None

    def __call__(self, readings: Floats) -> Floats:
        """Whiten errors or derivatives of readings, shape (samples, 3, k), to (samples, channels, k)."""
        kept = readings[:, self.present]
        if self.alone is not None:
            return np.asarray(self.alone @ kept)
        assert self.together is not None
        flat = kept.reshape(-1, kept.shape[-1])
        return np.asarray(solve_triangular(self.together, flat, lower=True)).reshape(kept.shape)


def whitening(
    cell: LoadCell, loads: Floats, by_angle: Floats, present: Flags, discrepancy: Discrepancy | None = None
) -> NoiseWhitening:
    """Return the whitening of the readings of loads, with errors of the encoder to first order.

    Shapes: loads (samples, 3), by_angle (samples, 3), present (3,).
    """
    samples = len(loads)
    covariance = cell.covariance(loads)
    covariance += cell.drive_angle_deviation**2 * by_angle[:, :, None] * by_angle[:, None, :]
    wandering = wandering_deviation(cell, samples)
    if discrepancy is None and not np.any(wandering[:, present]):
        chosen = covariance[:, present][:, :, present]
        return NoiseWhitening(present, np.asarray(np.linalg.inv(np.linalg.cholesky(chosen))), None)
    channels, index = int(present.sum()), np.arange(3)
    covariance[:, index, index] -= wandering**2
    whole = np.zeros((samples, channels, samples, channels))
    whole[np.arange(samples), :, np.arange(samples), :] = covariance[:, present][:, :, present]
    sums = _wandering(cell, samples)[..., present]
    if discrepancy is not None:
        sums += discrepancy.covariance()[..., present]
    for c in range(channels):
        whole[:, c, :, c] += sums[..., c]
    size = samples * channels
    return NoiseWhitening(present, None, np.asarray(np.linalg.cholesky(whole.reshape(size, size))))


def _wandering(cell: LoadCell, samples: int) -> Floats:
    """Return the covariance of bias and drift between samples, shape (samples, samples, 3)."""
    bias = np.square(np.asarray(cell.bias_uncertainty, dtype=float))
    shared = np.broadcast_to(bias, (samples, samples, 3)).copy()
    if cell.drift is not None:
        index = np.arange(samples)
        variance = wandering_deviation(cell, samples) ** 2 - bias
        lag = np.abs(index[:, None] - index)
        shared += cell.drift.decay ** lag[..., None] * variance[np.minimum(index[:, None], index)]
    return shared


class ReadingSlopes(NamedTuple):
    """Loads of a record without noise, and their derivatives, dimensionless."""

    loads: Floats  # loads, shape (samples, 3)
    # Derivatives of the readings by the parameters of contour and rig, shape (samples, 3, parameters).
    by_parameters: Floats
    # Derivatives of the readings by the drive angle, shape (samples, 3); zero if the encoder makes no errors.
    by_angle: Floats


class RecordInformation(NamedTuple):
    """Expected information of a record, to first order."""

    # Derivatives of independent readings of unit variance by the parameters, shape (samples, channels, d).
    slopes: Floats
    of_noise: Floats  # information about the parameters of the noise, shape (d,); zero for the others

    @property
    def matrix(self) -> Floats:
        """Information matrix, shape (d, d)."""
        flat = self.slopes.reshape(-1, self.slopes.shape[-1])
        return np.asarray(flat.T @ flat + np.diag(self.of_noise))


def reading_slopes(model: ContourModel, point: Floats, step: float = STEP) -> ReadingSlopes:
    """Return loads and derivatives of a record's readings at a point of the model's parameters. Shapes: point (d,)."""
    cell, count = model.likelihood.load_cell, len(model.forward_parameters)
    if not model.likelihood.usable(model.contours(point[None]), model.rig(point[None]))[0]:
        raise ReachError(
            "the rod does not reach the contour in every sweep, or is not clear of it after snap-off: change the pivot "
            "or the length of the rod"
        )
    loads = model.loads(point[None])[0]
    scale = np.where(cell.noise > 0.0, cell.noise, 1.0)

    def slopes(readings: Callable[[Floats], Floats], at: Floats, steps: Floats | float) -> Floats:
        flat = central_slopes(lambda moved: (readings(moved) / scale).reshape(len(moved), -1), at, steps)
        return np.asarray(flat.reshape(*loads.shape, at.size) * scale[:, None])

    def moved(points: Floats) -> Floats:
        return model.readings(np.hstack([points, np.broadcast_to(point[count:], (len(points), point.size - count))]))[0]

    def turned(angles: Floats) -> Floats:
        return model.readings(np.repeat(point[None], len(angles), axis=0), angles[:, 0])[0]

    steps = step * parameter_scales(model, point)[:count]
    # A parameter at its bound, like zero friction, is evaluated one step inside.
    inside = np.clip(point[:count], model.low[:count] + steps, model.high[:count] - steps)
    by_angle = slopes(turned, np.zeros(1), STEP)[..., 0] if cell.drive_angle_deviation else np.zeros_like(loads)
    return ReadingSlopes(loads, slopes(moved, inside, steps), by_angle)


def record_information(
    model: ContourModel,
    point: Floats,
    channels: Flags | None = None,
    *,
    slopes: ReadingSlopes | None = None,
    load_cell: LoadCell | None = None,
) -> RecordInformation:
    """Return Fisher's information, JᵀΣ⁻¹J, at a point of the model's parameters. Shapes: point (d,), channels (3,).

    Not counted are what the snap-off excludes, the dependence of noise on loads, and that about a discrepancy.
    """
    cell = model.likelihood.load_cell if load_cell is None else load_cell.dimensionless(model.likelihood.rod)
    cell = scaled_cell(cell, model.noise_scale(point[None])[0])
    present = model.present if channels is None else model.present & channels
    loads, by_parameters, by_angle = reading_slopes(model, point) if slopes is None else slopes
    white = whitening(cell, loads, by_angle, present, model.discrepancy_at(point))(by_parameters)
    nu = cell.degrees_of_freedom
    if not math.isinf(nu):  # (ν + 1)/(ν + 3) of a normal one; the covariance is wider than the scale by ν/(ν − 2)
        white = white * math.sqrt((nu + 1.0) / (nu + 3.0) * nu / (nu - 2.0))
    every = np.zeros((*white.shape[:2], point.size))
    every[..., : len(model.forward_parameters)] = white
    of_noise = np.zeros(point.size)
    for name, scaled in zip(model.noise.of_white, model.noise.channels, strict=True):
        count = len(loads) * sum(present[CHANNELS.index(c)] for c in scaled)
        share = 1.0 if math.isinf(nu) else nu / (nu + 3.0)
        i = model.names.index(name)
        of_noise[i] = 2.0 * share * count / point[i] ** 2
    return RecordInformation(every, of_noise)


def scaled_cell(cell: LoadCell, factors: Floats) -> LoadCell:
    """Return the load cell with the white noise of its channels multiplied by factors, shape (3,)."""
    moment, force = float(factors[0]), float(factors[1])
    return replace(
        cell,
        moment_noise=moment * cell.moment_noise,
        force_noise=force * cell.force_noise,
        relative_noise=force * cell.relative_noise,
    )


def prior_precision(model: ContourModel) -> Floats:
    """Return the precision of the priors, shape (d, d); zero for parameters whose variance is infinite.

    It is that of normal distributions with the same standard deviations, and the correlations of a calibrated rig.
    """
    variance = np.array([float(model.priors[name].std()) ** 2 for name in model.names])
    is_known = np.isfinite(variance) & (variance > 0.0)
    precision = np.diag(np.where(is_known, 1.0 / np.where(is_known, variance, 1.0), 0.0))
    if (joint := model.unknowns.joint) is not None:
        own = np.array([model.names.index(name) for name in joint.priors], dtype=np.intp)
        scale = np.sqrt(variance[own])
        precision[np.ix_(own, own)] = np.linalg.inv(joint.correlation) / np.outer(scale, scale)
    return precision


def parameter_scales(model: ContourModel, point: Floats) -> Floats:
    """Return the scale of each parameter, shape (d,): the smaller of its size and its prior standard deviation."""
    scales = []
    for name, value in zip(model.names, point, strict=True):
        sizes = [size for size in (abs(float(value)), float(model.priors[name].std())) if 0.0 < size < np.inf]
        scales.append(min(sizes) if sizes else 1.0)
    return np.array(scales)
