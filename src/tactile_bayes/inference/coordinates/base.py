"""Coordinates in which parameters are sampled: the parameters themselves, or logarithms of some."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tactile_bayes.arrays import Flags, Floats
from tactile_bayes.inference.densities import LogProbability, Mixture


@dataclass(frozen=True, eq=False, kw_only=True)
class Coordinates:
    """A change of variables between coordinates and as many parameters; here they are the same."""

    proposal: Mixture | None = None  # of the coordinates, near the posterior, if one is known

    @property
    def bent(self) -> int | None:
        """Number of the first coordinates, if all others are nearly standard normal."""
        return None

    def parameters(self, coordinates: Floats) -> tuple[Floats, Floats]:
        """Return parameters, (n, parameters), and the log of the Jacobian determinant of the map to them, (n,)."""
        return coordinates, np.zeros(len(coordinates))

    def of(self, points: Floats) -> Floats:
        """Return the coordinates of points, shape (..., parameters)."""
        return points


@dataclass(frozen=True, eq=False)
class Logarithms(Coordinates):
    """The logarithms of some positive parameters, and the others themselves.

    If a record determines a ratio of powers of two sizes, but hardly the sizes, their logarithms lie along a line.
    """

    positive: Flags

    def parameters(self, coordinates: Floats) -> tuple[Floats, Floats]:
        points = coordinates.copy()
        with np.errstate(over="ignore"):  # infinite parameters are impossible
            points[:, self.positive] = np.exp(coordinates[:, self.positive])
        return points, np.sum(coordinates[:, self.positive], axis=1)

    def of(self, points: Floats) -> Floats:
        coordinates = points.copy()
        coordinates[..., self.positive] = np.log(points[..., self.positive])
        return coordinates


def in_coordinates(log_probability: LogProbability, coordinates: Coordinates) -> LogProbability:
    """Return the log-density of the coordinates, from that of the parameters."""

    def log_density(points: Floats) -> Floats:
        parameters, log_jacobian = coordinates.parameters(points)
        return np.asarray(log_probability(parameters) + log_jacobian)

    return log_density
