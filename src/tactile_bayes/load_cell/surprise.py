"""The surprise of a reading: how far it is from what a sensor reads without load."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtri, stdtr

from tactile_bayes.load_cell.covariance import wandering_deviation
from tactile_bayes.load_cell.data_sheet import DataSheet

__all__ = ["surprise"]

Floats = NDArray[np.float64]

_BEYOND_ALL = 1e100
"""Standard deviations that make no difference any more, and of which sums of products are still numbers."""


def surprise(sheet: DataSheet, readings: Floats) -> Floats:
    """Squared distance of readings, shape (samples, 3), from no load, shape (samples,); see `LoadCell.surprise`."""
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
