"""Coordinates of power laws with contacts on one flank only, far from the vertex."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from tactile_bayes.arrays import Floats
from tactile_bayes.inference.contour_events import events_of
from tactile_bayes.inference.contour_model import ContourModel
from tactile_bayes.inference.ensembles import Logarithms, Mixture
from tactile_bayes.inference.ensembles.moves import Moves, standard_moves
from tactile_bayes.numerics.differences import central_slopes

__all__ = ["FlankCoordinates"]

_PARAMETERS, _X_C = 4, 3
"""Number of parameters of a power law, and the column of x_c among them."""

_MAX_SHARE, _NEAR = 0.01, 0.1
"""Share of the draws, and distance of the vertex from x over its median: if a larger share is nearer, the vertex may
lie on the other side as well, which these coordinates exclude."""

_STEP = 1e-6
"""Step of central differences in the model's coordinates."""


@dataclass(frozen=True, eq=False)
class FlankCoordinates:
    """Slope, exponent, height and slope ratio of a power law at one x, instead of its parameters w, n, q and x_c.

    A record of one flank determines height, slope and curvature at the contacts, but hardly the vertex: the posterior
    of w, n, q and x_c is then a bent ridge, thousands of times as long as wide. With u = |x − x_c| the coordinates are
    log t, log(n − 1), y and log(t/t′), where t = n (u/w)^(n − 1) is the slope, t/t′ = u/(n − 1) its ratio to its
    derivative, and y = q + t u/n the height. They determine the contour on either side of the vertex.

    Parameters
    ----------
    base : Logarithms
        Coordinates of all parameters, of which those of the contour are the first four.
    x : float
        Position at which the coordinates are taken [length].
    side : float
        1 if the vertex lies at smaller x, −1 if it lies at larger x.
    proposal : Mixture, optional
        Distribution of coordinates that approximates the posterior.
    """

    base: Logarithms
    x: float
    side: float
    proposal: Mixture | None = None

    @classmethod
    def at_contacts(cls, model: ContourModel, point: Floats) -> FlankCoordinates | None:
        """Return coordinates at the middle of the contacts predicted at a point, shape (parameters,).

        There are none at the vertex, nor for families other than the power law.
        """
        if model.family.name != "power-law":
            return None
        at = point[None]
        events = events_of(model.likelihood, model.contours(at), model.rig(at), exact=False)
        x = float(np.mean([events["first_contact_x"], events["snap_off_contact_x"]]))
        side = float(np.sign(x - point[_X_C]))
        return cls(model.coordinates, x, side) if abs(side) == 1.0 else None

    @property
    def digest(self) -> str:
        """Identity of the coordinates, as text."""
        proposal = "" if self.proposal is None else self.proposal.digest
        return f"flank of a power law, side {self.side:g} at {self.x!r}, {self.base.digest}, proposal {proposal}"

    def parameters(self, coordinates: Floats) -> tuple[Floats, Floats]:
        """Return parameters, shape (n, parameters), and the logarithm of the Jacobian determinant, shape (n,)."""
        log_slope, log_power, height, log_ratio = coordinates[:, :_PARAMETERS].T
        based = coordinates.copy()
        with np.errstate(over="ignore", invalid="ignore"):  # infinite parameters are impossible
            power, u = np.exp(log_power), np.exp(log_power + log_ratio)
            n = 1.0 + power
            based[:, 0] = log_power + log_ratio - (log_slope - np.log(n)) / power
            based[:, 1] = n
            based[:, 2] = height - np.exp(log_slope) * u / n
            based[:, 3] = self.x - self.side * u
        points, log_jacobian = self.base.parameters(based)
        return points, log_jacobian + log_power + log_ratio

    def of(self, points: Floats) -> Floats:
        """Return coordinates of points, shape (..., parameters); NaN if the vertex is on the other side."""
        coordinates = self.base.of(points)
        w, n, q, x_c = np.moveaxis(points[..., :_PARAMETERS], -1, 0)
        with np.errstate(invalid="ignore", divide="ignore"):
            u = self.side * (self.x - x_c)
            slope = n * (u / w) ** (n - 1.0)
            coordinates[..., 0], coordinates[..., 1] = np.log(slope), np.log(n - 1.0)
            coordinates[..., 2], coordinates[..., 3] = q + slope * u / n, np.log(u / (n - 1.0))
        return coordinates

    def covariance(self, point: Floats, covariance: Floats) -> Floats:
        """Transform a covariance of the base coordinates to first order at a point, shape (parameters,)."""
        based = self.base.of(point[None])[0]
        slopes = central_slopes(lambda points: self.of(self.base.parameters(points)[0]), based, _STEP)
        return np.asarray(slopes @ covariance @ slopes.T)

    def reach_vertex(self, coordinates: Floats) -> bool:
        """Return True if the vertex may lie on the other side as well, according to draws, shape (n, parameters)."""
        distances = np.abs(self.parameters(coordinates)[0][:, _X_C] - self.x)
        return bool(np.quantile(distances, _MAX_SHARE) < _NEAR * np.median(distances))

    def with_proposal(self, proposal: Mixture) -> FlankCoordinates:
        """Return the same coordinates with a distribution that approximates the posterior."""
        return replace(self, proposal=proposal)

    def moves(self) -> Moves:
        """Return the moves of an ensemble, with their shares."""
        return standard_moves(self.proposal)
