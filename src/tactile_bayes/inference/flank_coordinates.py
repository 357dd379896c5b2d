"""Coordinates of power laws of which one flank is touched, far from the vertex."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from tactile_bayes.arrays import Floats
from tactile_bayes.inference.ensembles import Logarithms, Mixture
from tactile_bayes.inference.ensembles.moves import standard_moves

__all__ = ["FlankCoordinates"]

_PARAMETERS = 4


@dataclass(frozen=True, eq=False)
class FlankCoordinates:
    """Slope, exponent, height and bend of a power law at one place, instead of its parameters w, n, q and x_c.

    A record of one flank tells height, slope and curvature where the rod touches, and hardly where the vertex is: w, n,
    q and x_c then lie along a bent ridge, thousands of times as long as wide. With u = |x − x_c| the coordinates are
    log t, log(n − 1), y and log(t/t′), where t = n (u/w)^(n − 1) is the slope, t/t′ = u/(n − 1) its ratio to its
    derivative, and y = q + t u/n the height. They determine the contour on either side of the vertex.

    Parameters
    ----------
    base : Logarithms
        Coordinates of all parameters, of which those of the contour are the first four.
    x : float
        The place [length].
    side : float
        1 where the vertex lies at smaller x, −1 where it lies at larger x.
    proposal : Mixture, optional
        Of coordinates, that comes near the posterior.
    """

    base: Logarithms
    x: float
    side: float
    proposal: Mixture | None = None

    @property
    def digest(self) -> str:
        """What tells them from others."""
        proposal = "" if self.proposal is None else self.proposal.digest
        return f"flank of a power law, side {self.side:g} at {self.x!r}, {self.base.digest}, proposal {proposal}"

    def parameters(self, coordinates: Floats) -> tuple[Floats, Floats]:
        """Parameters, (n, parameters), and the logarithm of by how much a volume grows on the way to them, (n,)."""
        log_slope, log_power, height, log_ratio = coordinates[:, :_PARAMETERS].T
        based = coordinates.copy()
        with np.errstate(over="ignore", invalid="ignore"):  # what is beyond all numbers is impossible
            power, u = np.exp(log_power), np.exp(log_power + log_ratio)
            n = 1.0 + power
            based[:, 0] = log_power + log_ratio - (log_slope - np.log(n)) / power
            based[:, 1] = n
            based[:, 2] = height - np.exp(log_slope) * u / n
            based[:, 3] = self.x - self.side * u
        points, growth = self.base.parameters(based)
        return points, growth + log_power + log_ratio

    def of(self, points: Floats) -> Floats:
        """Coordinates of points, shape (..., parameters); NaN where the vertex is on the other side."""
        coordinates = self.base.of(points)
        w, n, q, x_c = np.moveaxis(points[..., :_PARAMETERS], -1, 0)
        with np.errstate(invalid="ignore", divide="ignore"):
            u = self.side * (self.x - x_c)
            slope = n * (u / w) ** (n - 1.0)
            coordinates[..., 0], coordinates[..., 1] = np.log(slope), np.log(n - 1.0)
            coordinates[..., 2], coordinates[..., 3] = q + slope * u / n, np.log(u / (n - 1.0))
        return coordinates

    def with_proposal(self, proposal: Mixture) -> FlankCoordinates:
        """The same, with what is known to come near the posterior."""
        return replace(self, proposal=proposal)

    def moves(self) -> list[tuple[Any, float]]:
        """Moves of one ensemble and their shares, new ones at each call."""
        return standard_moves(self.proposal)
