"""Coordinates of power laws of which one flank is touched, far from the vertex."""

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

_RARELY, _NEARBY = 0.01, 0.1
"""Share of the draws, and of the median distance of the vertex from x: if more draws are nearer than this, the vertex
may lie on the other side as well, which these coordinates exclude."""

_STEP = 1e-6
"""Step of the differences in the model's coordinates."""


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
        Distribution of coordinates that approximates the posterior.
    """

    base: Logarithms
    x: float
    side: float
    proposal: Mixture | None = None

    @classmethod
    def where_touched(cls, model: ContourModel, point: Floats) -> FlankCoordinates | None:
        """Coordinates at the middle of the contacts that parameters predict, shape (parameters,); None at the vertex,
        and for other families than the power law."""
        if model.family.name != "power-law":
            return None
        at = point[None]
        events = events_of(model.likelihood, model.contours(at), model.rig(at), exact=False)
        x = float(np.mean([events["first_contact_x"], events["snap_off_contact_x"]]))
        side = float(np.sign(x - point[_X_C]))
        return cls(model.coordinates, x, side) if abs(side) == 1.0 else None

    @property
    def digest(self) -> str:
        """Text that tells these coordinates from others."""
        proposal = "" if self.proposal is None else self.proposal.digest
        return f"flank of a power law, side {self.side:g} at {self.x!r}, {self.base.digest}, proposal {proposal}"

    def parameters(self, coordinates: Floats) -> tuple[Floats, Floats]:
        """Return parameters, shape (n, parameters), and the logarithm of the Jacobian determinant, shape (n,)."""
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
        """Return coordinates of points, shape (..., parameters); NaN where the vertex is on the other side."""
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
        place = self.base.of(point[None])[0]
        slopes = central_slopes(lambda places: self.of(self.base.parameters(places)[0]), place, _STEP)
        return np.asarray(slopes @ covariance @ slopes.T)

    def reach_vertex(self, coordinates: Floats) -> bool:
        """Return whether draws of the posterior, shape (n, parameters), come so near to the vertex that it may lie on
        the other side as well."""
        distances = np.abs(self.parameters(coordinates)[0][:, _X_C] - self.x)
        return bool(np.quantile(distances, _RARELY) < _NEARBY * np.median(distances))

    def with_proposal(self, proposal: Mixture) -> FlankCoordinates:
        """Return the same coordinates with a distribution that approximates the posterior."""
        return replace(self, proposal=proposal)

    def moves(self) -> Moves:
        """Return the moves of an ensemble, with their shares."""
        return standard_moves(self.proposal)
