"""Coordinates in which parameters are sampled."""

from __future__ import annotations

from typing import Protocol, Self

import numpy as np

from tactile_bayes.arrays import Flags, Floats
from tactile_bayes.inference.ensembles.mixture import Mixture
from tactile_bayes.inference.ensembles.moves import Moves, standard_moves
from tactile_bayes.inference.ensembles.target import LogProbability

__all__ = ["Coordinates", "Logarithms", "Plain", "Proposing", "Standardising", "in_coordinates"]


class Coordinates(Protocol):
    """A change of variables between coordinates and as many parameters."""

    @property
    def digest(self) -> str:
        """Identity of the coordinates, as text."""

    def parameters(self, coordinates: Floats) -> tuple[Floats, Floats]:
        """Return parameters, (n, parameters), and the log of the Jacobian determinant of the map to them, (n,)."""

    def of(self, points: Floats) -> Floats:
        """Return the coordinates of parameters, (n, parameters)."""

    def moves(self) -> Moves:
        """Return the moves of an ensemble, with their shares."""


class Proposing(Coordinates, Protocol):
    """Coordinates in which a proposal near the posterior may be known."""

    @property
    def proposal(self) -> Mixture | None: ...

    def with_proposal(self, proposal: Mixture) -> Self:
        """Return the same coordinates with another proposal."""


class Standardising(Coordinates, Protocol):
    """Coordinates, all but the first of which are nearly standard normal."""

    def standardised(self, mean: Floats, root: Floats) -> Self:
        """Return the coordinates in which these have been standardised by a mean, (k,), and a root, (k, k)."""


class Plain:
    """The parameters themselves as coordinates."""

    digest: str = "the parameters"

    def parameters(self, coordinates: Floats) -> tuple[Floats, Floats]:
        return coordinates, np.zeros(len(coordinates))

    def of(self, points: Floats) -> Floats:
        return points

    def moves(self) -> Moves:
        return standard_moves()


class Logarithms(Plain):
    """The logarithms of some positive parameters, and the other parameters themselves.

    If a record determines a ratio of powers of two sizes, but hardly the sizes, their logarithms lie along a line.
    """

    def __init__(self, positive: Flags, proposal: Mixture | None = None) -> None:
        """Take logarithms where `positive` is True; `proposal`, in the coordinates, approximates the target."""
        self.positive = positive
        self.proposal = proposal
        self.digest = f"logarithms of parameters {', '.join(map(str, np.flatnonzero(positive)))}"
        if proposal is not None:
            self.digest += f", proposal {proposal.digest}"

    def with_proposal(self, proposal: Mixture) -> Self:
        return type(self)(self.positive, proposal)

    def parameters(self, coordinates: Floats) -> tuple[Floats, Floats]:
        points = coordinates.copy()
        with np.errstate(over="ignore"):  # infinite parameters are impossible
            points[:, self.positive] = np.exp(coordinates[:, self.positive])
        return points, np.sum(coordinates[:, self.positive], axis=1)

    def of(self, points: Floats) -> Floats:
        """Return the coordinates of points, shape (..., parameters)."""
        coordinates = points.copy()
        coordinates[..., self.positive] = np.log(points[..., self.positive])
        return coordinates

    def moves(self) -> Moves:
        return standard_moves(self.proposal)


def in_coordinates(log_probability: LogProbability, coordinates: Coordinates) -> LogProbability:
    """Return the log-density of the coordinates, from that of the parameters."""

    def log_density(points: Floats) -> Floats:
        parameters, log_jacobian = coordinates.parameters(points)
        return np.asarray(log_probability(parameters) + log_jacobian)

    return log_density
