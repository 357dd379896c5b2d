"""Covariance of the errors of a load cell and an encoder, over a whole record."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.linalg import solve_triangular

from tactile_bayes.arrays import Flags, Floats
from tactile_bayes.load_cell import LoadCell
from tactile_bayes.load_cell.discrepancy import Discrepancy
from tactile_bayes.load_cell.lone_samples import wandering_deviation


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
