"""Errors of the encoder: where the drive may have stood when it read an angle."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.special import logsumexp, ndtr

from tactile_bayes.arrays import Floats
from tactile_bayes.load_cell import LoadCell

__all__ = ["EncoderErrors"]

_WIDEST, _NARROWEST = 0.75, 0.1
"""Distance between neighbouring errors, in standard deviations, at most and at least."""

_REACH = 3.75
"""Standard deviations up to which errors are taken into account."""

_STEEP = np.array([10.0, 30.0, 30.0])
"""How fast loads change with the drive angle, close to snap-off [EI/L and EI/L² per rad]."""


class EncoderErrors:
    """Errors of the encoder as a few of them with weights, over which the likelihood of a sample is summed.

    The sum serves where loads are smooth functions of the drive angle, whatever the noise of the load cell, as well as
    at first contact and at snap-off, where some of the places at which the drive may have stood are in contact and
    others are not. What lies between the event and the nearest of these places counts with that place. Against a fine
    integral the logarithm of a sample's probability is right to 0.001, but beside an event to 0.8 at worst.

    Parameters
    ----------
    cell : LoadCell
        Dimensionless.

    Attributes
    ----------
    errors, log_weights : ndarray, shape (k,)
    """

    def __init__(self, cell: LoadCell) -> None:
        noise, step = cell.drive_angle_noise, cell.drive_angle_resolution
        # What varies over no less than a distance is summed well by neighbours that far apart.
        seen = float(np.min(np.where(cell.noise > 0.0, cell.noise, np.inf) / _STEEP))
        self.errors: Floats
        self.log_weights: Floats
        if noise:
            distance = noise * float(np.clip(seen / noise, _NARROWEST, _WIDEST))
            half = int(np.ceil((_REACH * noise + 0.5 * step) / distance))
            self.errors = np.linspace(-half * distance, half * distance, 2 * half + 1)
            self.log_weights = _log_density(self.errors, noise, step)
        else:
            count = int(np.ceil(step / seen)) + 2 if step else 1
            self.errors = step * ((np.arange(count) + 0.5) / count - 0.5)
            self.log_weights = np.zeros(count)
        self.log_weights = self.log_weights - logsumexp(self.log_weights)

    @property
    def count(self) -> int:
        return int(self.errors.size)

    def draw(self, rng: np.random.Generator, shape: tuple[int, ...]) -> NDArray[np.intp]:
        """Indices of errors, drawn by their weights."""
        return rng.choice(self.count, size=shape, p=np.exp(self.log_weights))


def _log_density(error: Floats, noise: float, step: float) -> Floats:
    """Of a normal error and one that is uniform over a step, up to a constant."""
    if step == 0.0:
        return np.asarray(-0.5 * (error / noise) ** 2)
    far, near = (np.abs(error) + 0.5 * step) / noise, (np.abs(error) - 0.5 * step) / noise
    return np.asarray(np.log(ndtr(-near) - ndtr(-far)))
