"""Coordinates in which the posterior of a shape-free contour is nearly standard normal."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from tactile_bayes.arrays import Floats
from tactile_bayes.inference.coordinates.base import Coordinates
from tactile_bayes.inference.shape_free_posterior.columns import joined, split
from tactile_bayes.inference.shape_free_posterior.normal_approximation import NormalApproximation

_FAR = 4.0  # largest distance of the logarithm of a scale from its starting value; the density is zero beyond
_LARGEST = 50.0  # bound of the logarithm of a radius, far beyond any prior


@dataclass(frozen=True, eq=False)
class Whitening(Coordinates):
    """A change of variables by a normal approximation, whose quality affects efficiency, not exactness.

    The coordinates are the logarithms of the scales, and the other parameters, standardised by the mean and covariance
    that the approximation gives at these scales; of those that may vanish by the positive part of that distribution.
    """

    approximation: NormalApproximation
    scales: Floats  # amplitude, length scale and noise at the centre of the walkers' starting points, shape (bent,)
    mean: Floats  # of the posterior, as the approximation standardises it, shape (d,): zero if that is exact
    root: Floats  # root of their posterior covariance, shape (d, d): one if the approximation is exact

    @property
    def bent(self) -> int:
        """Number of coordinates that are logarithms, the first ones."""
        return self.scales.size

    @cached_property
    def _log_volume(self) -> float:
        return float(np.linalg.slogdet(self.root).logabsdet)

    @property
    def middle(self) -> Floats:
        """Approximate centre of the posterior, shape (coordinates,)."""
        return np.append(np.log(self.scales), np.zeros(self.approximation.prior.mean.size))

    @property
    def centre(self) -> Floats:
        """The model's parameters at that centre, shape (parameters,)."""
        return self.parameters(self.middle[None])[0][0]

    def parameters(self, coordinates: Floats) -> tuple[Floats, Floats]:
        """Return the model's parameters, (n, parameters), and the log of the Jacobian determinant, (n,)."""
        points, growth = np.empty(coordinates.shape), np.empty(len(coordinates))
        for part in np.array_split(np.arange(len(coordinates)), max(1, len(coordinates) // 500)):
            points[part], growth[part] = self._parameters(coordinates[part])
        return points, growth

    def of(self, points: Floats) -> Floats:
        """Return the coordinates of the model's parameters, (n, parameters)."""
        scales, linear = split(self.approximation.model, points)
        linear = self.approximation.bent(scales, linear, back=True)
        pulled, root = self.approximation.conditional(scales)
        normal = (np.swapaxes(root, 1, 2) @ linear[..., None])[..., 0] - pulled
        numbers = self.approximation.untruncated(pulled, root, normal)
        return np.hstack([np.log(scales), np.linalg.solve(self.root, (numbers - self.mean).T).T])

    def standardised(self, mean: Floats, root: Floats) -> Whitening:
        """Return the coordinates in which those after the first `bent` have been standardised by mean and root."""
        return replace(self, mean=self.mean + self.root @ mean, root=self.root @ root)

    def _parameters(self, coordinates: Floats) -> tuple[Floats, Floats]:
        """Return parameters and log-determinants as `parameters` does, of all coordinates at once."""
        bent = self.bent
        middle = np.log(self.scales)
        away = coordinates[:, :bent] - middle
        scales: Floats = np.exp(middle + np.clip(away, -_FAR, _FAR))
        pulled, root = self.approximation.conditional(scales)
        numbers = self.mean + coordinates[:, bent:] @ self.root.T
        normal, growth = self.approximation.truncated(pulled, root, numbers)
        linear = np.asarray(np.linalg.solve(np.swapaxes(root, 1, 2), (pulled + normal)[..., None])[..., 0])
        linear[:, 0] = np.clip(linear[:, 0], -_LARGEST, _LARGEST)
        linear = self.approximation.bent(scales, linear)
        volume = np.log(scales).sum(axis=1) - np.log(np.diagonal(root, axis1=1, axis2=2)).sum(axis=1) + growth
        volume += self._log_volume
        volume[(np.abs(away) > _FAR).any(axis=1)] = -np.inf
        return joined(self.approximation.model, scales, linear), linear[:, 0] + volume
