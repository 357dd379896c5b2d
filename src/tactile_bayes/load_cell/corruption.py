"""The corruption of loads and drive angles by a sensor."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike

from tactile_bayes.arrays import Floats, RandomSource
from tactile_bayes.load_cell.data_sheet import DataSheet
from tactile_bayes.load_cell.discrepancy import Discrepancy
from tactile_bayes.load_cell.memory import remembered


def corrupted_loads(
    sheet: DataSheet,
    loads: Floats,
    rng: RandomSource,
    noise_scale: ArrayLike = 1.0,
    discrepancy: Discrepancy | None = None,
    zeros: ArrayLike = 0.0,
    times: Floats | None = None,
) -> Floats:
    """Simulate readings of loads: memory, lever, gain and bias, drift, noise and discrepancy, the range, and the steps.
    Shapes: loads (..., samples, 3), noise_scale (..., 3), times [s] (samples,); `zeros` add to the bias.
    """
    noise = rng.standard_normal(loads.shape)
    if any(sheet.correlation):
        noise = noise @ np.linalg.cholesky(sheet.correlation_matrix).T
    loads = remembered(loads, (sheet.lag, sheet.lag_seconds, sheet.play), times)
    readings = sheet.expected(loads) + np.asarray(zeros)
    if any(sheet.bias_uncertainty):
        readings += np.array(sheet.bias_uncertainty) * rng.standard_normal((*loads.shape[:-2], 1, 3))
    if sheet.drift is not None:
        readings += sheet.drift.draw(rng.standard_normal(loads.shape))
    if math.isfinite(sheet.degrees_of_freedom):
        noise /= np.sqrt(rng.chisquare(sheet.degrees_of_freedom, loads.shape) / sheet.degrees_of_freedom)
    scale = np.asarray(noise_scale, dtype=float)
    readings += sheet.deviation(loads) * (scale[..., None, :] if scale.ndim else scale) * noise
    if discrepancy is not None:
        readings += discrepancy.draw(rng)
    return rounded(sheet.cut(readings), sheet.resolution)


def corrupted_angles(sheet: DataSheet, angles: Floats, direction: ArrayLike, rng: RandomSource) -> Floats:
    """Simulate readings of drive angles of any shape: offset, backlash by the direction, noise, then the steps."""
    noise = sheet.drive_angle_noise * rng.standard_normal(angles.shape)
    return rounded(angles + sheet.misread(direction) + noise, np.array(sheet.drive_angle_resolution))


def rounded(values: Floats, step: Floats) -> Floats:
    """Round values to the nearest multiple of a step; a step of 0 leaves them unchanged."""
    if not np.any(step):
        return values
    with np.errstate(over="ignore"):
        steps = np.round(values / np.where(step > 0.0, step, np.inf))
    return np.where((step > 0.0) & np.isfinite(steps), steps * step, values)
