"""How errors of a load cell and an encoder belong together, over a whole record."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_triangular

from tactile_bayes.arrays import Floats
from tactile_bayes.load_cell import LoadCell
from tactile_bayes.load_cell.covariance import wandering_deviation

__all__ = ["Whitening", "whitening"]


class Whitening(NamedTuple):
    """What makes errors of readings independent, and of size one."""

    present: NDArray[np.bool_]
    """Which channels were measured, shape (3,)."""
    alone: Floats | None
    """Of each sample by itself, shape (samples, channels, channels); None where samples share errors."""
    together: Floats | None
    """Root of the covariance of all readings, sample by sample, shape (samples · channels,) twice."""

    def __call__(self, readings: Floats) -> Floats:
        """Independent ones, (samples, channels, k), of errors or slopes of readings, shape (samples, 3, k)."""
        kept = readings[:, self.present]
        if self.alone is not None:
            return np.asarray(self.alone @ kept)
        assert self.together is not None
        flat = kept.reshape(-1, kept.shape[-1])
        return np.asarray(solve_triangular(self.together, flat, lower=True)).reshape(kept.shape)


def whitening(cell: LoadCell, loads: Floats, by_angle: Floats, present: NDArray[np.bool_]) -> Whitening:
    """Of the readings of loads, errors of the encoder included to first order.

    Parameters
    ----------
    cell : LoadCell
        Dimensionless.
    loads : ndarray, shape (samples, 3)
    by_angle : ndarray, shape (samples, 3)
        Derivatives of the readings by the drive angle.
    present : ndarray of bool, shape (3,)
    """
    samples = len(loads)
    covariance = cell.covariance(loads)
    covariance += cell.drive_angle_deviation**2 * by_angle[:, :, None] * by_angle[:, None, :]
    wandering = wandering_deviation(cell, samples)
    shared = bool(np.any(wandering[:, present]))
    index = np.arange(3)
    if not shared:
        chosen = covariance[:, present][:, :, present]
        return Whitening(present, np.asarray(np.linalg.inv(np.linalg.cholesky(chosen))), None)
    covariance[:, index, index] -= wandering**2
    chosen = covariance[:, present][:, :, present]
    channels = int(present.sum())
    whole = np.zeros((samples, channels, samples, channels))
    whole[np.arange(samples), :, np.arange(samples), :] = chosen
    sums = _wandering(cell, samples)[..., present]
    for c in range(channels):
        whole[:, c, :, c] += sums[..., c]
    size = samples * channels
    return Whitening(present, None, np.asarray(np.linalg.cholesky(whole.reshape(size, size))))


def _wandering(cell: LoadCell, samples: int) -> Floats:
    """Covariance of bias and drift between samples, shape (samples, samples, 3)."""
    bias = np.square(np.asarray(cell.bias_uncertainty, dtype=float))
    shared = np.broadcast_to(bias, (samples, samples, 3)).copy()
    if cell.drift is not None:
        gone = np.arange(samples)
        kept = cell.drift.decay
        variance = wandering_deviation(cell, samples) ** 2 - bias
        apart = np.abs(gone[:, None] - gone)
        shared += kept ** apart[..., None] * variance[np.minimum(gone[:, None], gone)]
    return shared
