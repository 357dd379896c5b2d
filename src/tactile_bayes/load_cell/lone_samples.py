"""Samples by themselves: likelihood, covariance and distance from zero load; what samples share counts as noise."""

from __future__ import annotations

import math
from copy import copy

import numpy as np
from scipy.special import ndtri, stdtr

from tactile_bayes.arrays import Floats, Index
from tactile_bayes.load_cell.data_sheet import DataSheet
from tactile_bayes.load_cell.likelihood import (
    correlated_density,
    log_likelihood,
    normal_density,
    refuse_inexact,
    refuse_silent,
)
from tactile_bayes.record import CHANNELS

_BEYOND_ALL = 1e100  # bound on deviations in standard deviations, whose products do not overflow


def covariance(sheet: DataSheet, loads: Floats) -> Floats:
    """Covariance of readings, shape (samples, 3, 3), for loads of shape (samples, 3); see `LoadCell.covariance`."""
    nu = sheet.degrees_of_freedom
    widening = 1.0 if math.isinf(nu) else nu / (nu - 2.0) if nu > 2.0 else math.inf
    deviation = np.broadcast_to(sheet.deviation(loads), loads.shape)
    with np.errstate(invalid="ignore"):
        shared = widening * deviation[:, :, None] * sheet.correlation_matrix * deviation[:, None, :]
    result = np.where(np.isnan(shared), 0.0, shared)
    index = np.arange(3)
    result[:, index, index] += sheet.resolution**2 / 12.0 + wandering_deviation(sheet, len(loads)) ** 2
    return result


def wandering_deviation(sheet: DataSheet, samples: int) -> Floats:
    """Standard deviation of bias and drift at each sample, shape (samples, 3)."""
    bias = np.broadcast_to(sheet.bias_uncertainty, (samples, 3))
    if sheet.drift is None:
        return bias
    gone = np.arange(samples)
    decay = sheet.drift.decay ** (2 * gone)
    growth = gone if sheet.drift.decay == 1.0 else (1.0 - decay) / (1.0 - sheet.drift.decay**2)
    share = np.sqrt(sheet.drift.initial_variance * decay + sheet.drift.step_variance * growth)
    return np.hypot(bias, share[:, None] * sheet.drift.sizes)


def squared_mahalanobis_distance(sheet: DataSheet, readings: Floats) -> Floats:
    """Squared Mahalanobis distance, shape (samples,), of readings, shape (samples, 3), from zero load."""
    present = np.flatnonzero(~np.isnan(readings).all(axis=0))
    noise, step = sheet.noise[present], sheet.resolution[present] / math.sqrt(12.0)
    scale = np.hypot(np.hypot(noise, step), wandering_deviation(sheet, len(readings))[:, present])
    with np.errstate(over="ignore"):
        off = (readings[:, present] - np.array(sheet.bias)[present]) / scale
        if math.isfinite(sheet.degrees_of_freedom):
            off = ndtri(stdtr(sheet.degrees_of_freedom, -np.abs(off)))
        if not any(sheet.correlation):
            return np.asarray(np.sum(off**2, axis=1))
        shared = (noise / scale)[:, :, None] * sheet.correlation_matrix[np.ix_(present, present)]
        correlation = shared * (noise / scale)[:, None, :]
        correlation[:, range(present.size), range(present.size)] = 1.0
        off = np.clip(off, -_BEYOND_ALL, _BEYOND_ALL)
        return np.asarray(np.sum(off * np.linalg.solve(correlation, off[..., None])[..., 0], axis=1))


class LoneSamples:
    """Readings, each of which is judged by itself: unknown bias and drift count as noise of that sample. They have the
    shape (n, 3), in the sheet's units and frame, from the first sample of a record on, and are complete.
    """

    def __init__(self, sheet: DataSheet, readings: Floats) -> None:
        self._sheet = sheet
        self._readings = readings
        self._wandering = wandering_deviation(sheet, len(readings))
        self._wanders = bool(np.any(self._wandering))
        for index in range(len(CHANNELS)):
            refuse_silent(sheet, index)
        if self._wanders:
            refuse_inexact(sheet, readings, np.arange(len(CHANNELS)), wanders=True, correlated=False)

    def take(self, where: Index) -> LoneSamples:
        """Select samples."""
        some = copy(self)
        some._readings, some._wandering = self._readings[where], self._wandering[where]
        return some

    def log_density(self, loads: Floats) -> Floats:
        """Log-density of the readings, shape (..., n), for loads of shape (..., n, 3); NaN where a load is NaN."""
        sheet = self._sheet
        if not self._wanders:
            return log_likelihood(sheet, self._readings, loads, pointwise=True)
        residual = self._readings - sheet.expected(loads)
        deviation = np.broadcast_to(
            sheet.deviation(loads), loads.shape if sheet.relative_noise else residual.shape[-2:]
        )
        own = sheet.resolution**2 / 12.0 + self._wandering**2
        if not any(sheet.correlation):
            return normal_density(residual, deviation**2 + own)
        return correlated_density(residual, deviation, own, sheet.correlation_matrix)
