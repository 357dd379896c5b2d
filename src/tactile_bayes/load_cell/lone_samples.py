"""Likelihood of each sample of a record by itself; errors that it shares with others count as its own noise."""

from __future__ import annotations

from copy import copy

import numpy as np

from tactile_bayes.arrays import Floats, Index
from tactile_bayes.load_cell.covariance import wandering_deviation
from tactile_bayes.load_cell.data_sheet import DataSheet
from tactile_bayes.load_cell.likelihood import (
    correlated_density,
    log_likelihood,
    normal_density,
    refuse_inexact,
    refuse_silent,
)
from tactile_bayes.record import CHANNELS


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
