"""Other coordinates than the parameters, for walkers to walk in."""

from __future__ import annotations

from typing import Any, Protocol, Self

import numpy as np
from numpy.typing import NDArray

from tactile_bayes.arrays import Floats
from tactile_bayes.inference.ensembles.moves import standard_moves
from tactile_bayes.inference.ensembles.proposal import Mixture
from tactile_bayes.inference.ensembles.target import LogProbability

__all__ = ["Coordinates", "Logarithms", "Plain", "Proposing", "in_coordinates"]


class Coordinates(Protocol):
    """As many as there are parameters, each of which they determine."""

    @property
    def digest(self) -> str:
        """What tells them from others."""

    def parameters(self, coordinates: Floats) -> tuple[Floats, Floats]:
        """Parameters, (n, parameters), and the logarithm of by how much a volume grows on the way to them, (n,)."""

    def of(self, points: Floats) -> Floats:
        """Coordinates of parameters, (n, parameters)."""

    def moves(self) -> list[tuple[Any, float]]:
        """Moves of one ensemble and their shares, new ones at each call."""


class Proposing(Coordinates, Protocol):
    """Coordinates that may know a proposal which comes near the posterior in them."""

    @property
    def proposal(self) -> Mixture | None: ...

    def with_proposal(self, proposal: Mixture) -> Self:
        """The same, with a proposal."""


class Plain:
    """The parameters themselves."""

    digest: str = "the parameters"

    def parameters(self, coordinates: Floats) -> tuple[Floats, Floats]:
        return coordinates, np.zeros(len(coordinates))

    def of(self, points: Floats) -> Floats:
        return points

    def moves(self) -> list[tuple[Any, float]]:
        return standard_moves()


class Logarithms(Plain):
    """The logarithms of some parameters, which are positive, and the others themselves.

    Where a record tells a ratio of powers of two sizes, and hardly the sizes, their logarithms lie along a line.
    """

    def __init__(self, positive: NDArray[np.bool_], proposal: Mixture | None = None) -> None:
        """What is known to come near the posterior, of the coordinates, may be proposed to walkers."""
        self.positive = positive
        self.proposal = proposal
        self.digest = f"logarithms of parameters {', '.join(map(str, np.flatnonzero(positive)))}"
        if proposal is not None:
            self.digest += f", proposal {proposal.digest}"

    def with_proposal(self, proposal: Mixture) -> Self:
        return type(self)(self.positive, proposal)

    def parameters(self, coordinates: Floats) -> tuple[Floats, Floats]:
        points = coordinates.copy()
        with np.errstate(over="ignore"):  # what is beyond all numbers is impossible
            points[:, self.positive] = np.exp(coordinates[:, self.positive])
        return points, np.sum(coordinates[:, self.positive], axis=1)

    def of(self, points: Floats) -> Floats:
        """Coordinates of points, shape (..., parameters)."""
        coordinates = points.copy()
        coordinates[..., self.positive] = np.log(points[..., self.positive])
        return coordinates

    def moves(self) -> list[tuple[Any, float]]:
        return standard_moves(self.proposal)


def in_coordinates(log_probability: LogProbability, coordinates: Coordinates) -> LogProbability:
    """The density of the coordinates, from that of the parameters."""

    def of_coordinates(points: Floats) -> Floats:
        parameters, growth = coordinates.parameters(points)
        return np.asarray(log_probability(parameters) + growth)

    return of_coordinates
