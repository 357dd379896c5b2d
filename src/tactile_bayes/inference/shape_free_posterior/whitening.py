"""Coordinates in which the posterior of a contour of any shape is nearly a standard normal one."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from typing import Any

import numpy as np

from tactile_bayes.arrays import Floats
from tactile_bayes.inference.ensembles import whitened_moves
from tactile_bayes.inference.shape_free_posterior.normal_approximation import NormalApproximation, joined, split

__all__ = ["Whitening"]

_FAR = 4.0
"""Logarithm of how far from where walkers start a scale may be: beyond, all is taken for impossible."""

_LARGEST = 50.0
"""Logarithm of a radius that no prior comes near."""


@dataclass(frozen=True, eq=False)
class Whitening:
    """A change of variables, exact whatever it is made from: only how normal the posterior becomes depends on that.

    Given what is not linear (amplitude and length scale of the random radius, and the noise), an approximation says
    how all the rest is distributed: normally, with a mean and covariance that are known. The rest is given by how far
    it is from that mean, in units of that covariance: coordinates are the logarithms of what is not linear, and these
    numbers, which the posterior makes nearly independent and standard normal.
    """

    approximation: NormalApproximation
    scales: Floats
    """Amplitude, length scale and noise around which walkers start, shape (bent,)."""

    @property
    def bent(self) -> int:
        """Number of coordinates that are logarithms, the first ones."""
        return self.scales.size

    @property
    def digest(self) -> str:
        """Of all that parameters follow from."""
        arrays = (*self.approximation.arrays, self.scales)
        return hashlib.sha256(b"".join(np.ascontiguousarray(a, dtype="<f8").tobytes() for a in arrays)).hexdigest()

    @property
    def middle(self) -> Floats:
        """Where the posterior has its centre, roughly, shape (coordinates,)."""
        return np.append(np.log(self.scales), np.zeros(self.approximation.prior.mean.size))

    @property
    def centre(self) -> Floats:
        """The model's parameters there."""
        return self.parameters(self.middle[None])[0][0]

    def parameters(self, coordinates: Floats) -> tuple[Floats, Floats]:
        """The model's parameters, (n, parameters), and the logarithm of by how much a volume grows, (n,)."""
        points, growth = np.empty(coordinates.shape), np.empty(len(coordinates))
        for part in np.array_split(np.arange(len(coordinates)), max(1, len(coordinates) // 500)):
            points[part], growth[part] = self._moved(coordinates[part])
        return points, growth

    def of(self, points: Floats) -> Floats:
        """Coordinates of the model's parameters, (n, parameters)."""
        scales, linear = split(self.approximation.model, points)
        pulled, root = self.approximation.conditional(scales)
        return np.hstack([np.log(scales), (np.swapaxes(root, 1, 2) @ linear[..., None])[..., 0] - pulled])

    def moves(self) -> list[tuple[Any, float]]:
        return whitened_moves(self.bent)

    def _moved(self, coordinates: Floats) -> tuple[Floats, Floats]:
        bent = self.bent
        middle = np.log(self.scales)
        away = coordinates[:, :bent] - middle
        scales: Floats = np.exp(middle + np.clip(away, -_FAR, _FAR))
        pulled, root = self.approximation.conditional(scales)
        linear = np.linalg.solve(np.swapaxes(root, 1, 2), (pulled + coordinates[:, bent:])[..., None])[..., 0]
        linear[:, 0] = np.clip(linear[:, 0], -_LARGEST, _LARGEST)
        volume = np.log(scales).sum(axis=1) - np.log(np.diagonal(root, axis1=1, axis2=2)).sum(axis=1)
        volume[(np.abs(away) > _FAR).any(axis=1)] = -np.inf
        return joined(scales, np.asarray(linear)), linear[:, 0] + volume
