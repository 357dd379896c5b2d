"""Errors of the encoder: the possible true angles of a reading, with weights."""

from __future__ import annotations

import numpy as np
from scipy.special import logsumexp, ndtr

from tactile_bayes.arrays import Floats, Index
from tactile_bayes.load_cell import LoadCell

_WIDEST, _NARROWEST = 0.75, 0.1  # distance between neighbouring errors, in standard deviations, at most and at least
_REACH = 3.75  # largest error that is taken into account, in standard deviations
_STEEP = np.array([10.0, 30.0, 30.0])  # change of loads close to snap-off [EI/L and EI/L² per rad]


class EncoderErrors:
    """Quadrature nodes (reading less true angle [rad]) and weights over errors of the encoder of a dimensionless cell.

    A sample's log-probability errs by 0.001, and by 0.8 at worst next to an event, which is resolved to the nodes.
    """

    def __init__(self, cell: LoadCell) -> None:
        noise, step = cell.drive_angle_noise, cell.drive_angle_resolution
        # The sum resolves loads that change by their noise over the distance of nodes.
        resolved = float(np.min(np.where(cell.noise > 0.0, cell.noise, np.inf) / _STEEP))
        if noise:
            distance = noise * float(np.clip(resolved / noise, _NARROWEST, _WIDEST))
            half = int(np.ceil((_REACH * noise + 0.5 * step) / distance))
            errors = np.linspace(-half * distance, half * distance, 2 * half + 1)
            logs = _log_density(errors, noise, step)
        else:
            count = int(np.ceil(step / resolved)) + 2 if step else 1
            errors, logs = step * ((np.arange(count) + 0.5) / count - 0.5), np.zeros(count)
        self.errors, self.log_weights = errors, logs - logsumexp(logs)

    @property
    def count(self) -> int:
        """Number of nodes."""
        return int(self.errors.size)

    def draw(self, rng: np.random.Generator, shape: tuple[int, ...]) -> Index:
        """Draw indices of errors by their weights."""
        return rng.choice(self.count, size=shape, p=np.exp(self.log_weights))


def _log_density(error: Floats, noise: float, step: float) -> Floats:
    """Return the log-density of the sum of a normal error and a uniform one over a step, up to a constant."""
    if step == 0.0:
        return np.asarray(-0.5 * (error / noise) ** 2)
    far, near = (np.abs(error) + 0.5 * step) / noise, (np.abs(error) - 0.5 * step) / noise
    return np.asarray(np.log(ndtr(-near) - ndtr(-far)))
