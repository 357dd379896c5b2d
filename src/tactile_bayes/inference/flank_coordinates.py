"""Coordinates of power laws and ellipses with contacts on one flank only."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from tactile_bayes.arrays import Floats
from tactile_bayes.inference.contour_events import events_of
from tactile_bayes.inference.contour_model import ContourModel
from tactile_bayes.inference.ensembles import Logarithms, Mixture
from tactile_bayes.inference.ensembles.moves import Moves, standard_moves
from tactile_bayes.numerics.differences import central_slopes

__all__ = ["FlankCoordinates"]

_PARAMETERS, _X_C = 4, 3
"""Number of parameters of a contour, and the column of x_c among them."""

_MAX_SHARE, _NEAR = 0.01, 0.1
"""Share of the draws, and distance of the vertex from x over its median: if a larger share is nearer, the vertex may
lie on the other side as well, which these coordinates exclude."""

_STEP = 1e-6
"""Step of central differences in the model's coordinates."""


class _AtFlank(NamedTuple):
    """A contour at the horizontal distance u from its vertex, each of shape (n,)."""

    log_slope: Floats
    """Logarithm of the slope t."""
    log_shape: Floats
    """Logarithm of the shape, which slope and curvature leave free."""
    log_ratio: Floats
    """Logarithm of t/t′ [length]."""
    rise: Floats
    """Height above the vertex [length]."""


class _FromVertex(NamedTuple):
    """A contour as its family describes it, each of shape (n,)."""

    first: Floats
    """First parameter, in the model's coordinates."""
    second: Floats
    u: Floats
    """Horizontal distance of the vertex [length]."""
    rise: Floats
    log_jacobian: Floats
    """Logarithm of the Jacobian determinant of the model's coordinates by those of the flank."""


class _PowerLawFlank:
    """Width w and exponent n; the shape is n − 1, t = n (u/w)^(n − 1) and t/t′ = u/(n − 1)."""

    @staticmethod
    def at(w: Floats, n: Floats, u: Floats) -> _AtFlank:
        slope = n * (u / w) ** (n - 1.0)
        return _AtFlank(np.log(slope), np.log(n - 1.0), np.log(u / (n - 1.0)), slope * u / n)

    @staticmethod
    def vertex(log_slope: Floats, log_shape: Floats, log_ratio: Floats) -> _FromVertex:
        shape, log_u = np.exp(log_shape), log_shape + log_ratio
        n, u = 1.0 + shape, np.exp(log_u)
        return _FromVertex(log_u - (log_slope - np.log(n)) / shape, n, u, np.exp(log_slope) * u / n, log_u)


class _EllipseFlank:
    """Half-axes a and b; with u = a sin τ the shape is tan τ, t = (b/a) tan τ and t/t′ = u cos² τ."""

    @staticmethod
    def at(a: Floats, b: Floats, u: Floats) -> _AtFlank:
        sin = u / a
        squared_cos = (1.0 - sin) * (1.0 + sin)
        tan = sin / np.sqrt(squared_cos)
        rise = b * sin**2 / (1.0 + np.sqrt(squared_cos))
        return _AtFlank(np.log(b / a * tan), np.log(tan), np.log(u * squared_cos), rise)

    @staticmethod
    def vertex(log_slope: Floats, log_shape: Floats, log_ratio: Floats) -> _FromVertex:
        tan = np.exp(log_shape)
        sec = np.hypot(1.0, tan)
        log_a = log_ratio + 3.0 * np.log(sec) - log_shape
        log_b = log_slope + log_a - log_shape
        rise = np.exp(log_b) * (tan / sec) ** 2 / (1.0 + 1.0 / sec)
        return _FromVertex(log_a, log_b, np.exp(log_ratio) * sec**2, rise, log_ratio)


_FLANKS: dict[str, type[_PowerLawFlank] | type[_EllipseFlank]] = {"power-law": _PowerLawFlank, "ellipse": _EllipseFlank}


@dataclass(frozen=True, eq=False)
class FlankCoordinates:
    """Slope, shape, height and slope ratio of a contour at one x, instead of its two sizes, q and x_c.

    A record of one flank determines height, slope and curvature at the contacts, but hardly the vertex: the posterior
    of w, n, q and x_c of a power law, or of a, b, q and x_c of an ellipse, is then a bent ridge, thousands of times as
    long as wide. The coordinates are log t of the slope t, the logarithm of a shape, the height y and log(t/t′), where
    t′ is the derivative of t. With u = |x − x_c|, for a power law t = n (u/w)^(n − 1), the shape is n − 1,
    y = q + t u/n and t/t′ = u/(n − 1); for an ellipse with u = a sin τ, t = (b/a) tan τ, the shape is tan τ,
    y = q + b (1 − cos τ) and t/t′ = u cos² τ. They determine the contour on either side of the vertex.

    Parameters
    ----------
    family : str
        "power-law" or "ellipse".
    base : Logarithms
        Coordinates of all parameters, of which those of the contour are the first four.
    x : float
        Position at which the coordinates are taken [length].
    side : float
        1 if the vertex lies at smaller x, −1 if it lies at larger x.
    proposal : Mixture, optional
        Distribution of coordinates that approximates the posterior.
    """

    family: str
    base: Logarithms
    x: float
    side: float
    proposal: Mixture | None = None

    @classmethod
    def at_contacts(cls, model: ContourModel, point: Floats) -> FlankCoordinates | None:
        """Return coordinates at the middle of the contacts predicted at a point, shape (parameters,).

        There are none at the vertex, nor for families other than power law and ellipse.
        """
        if model.family.name not in _FLANKS:
            return None
        at = point[None]
        events = events_of(model.likelihood, model.contours(at), model.rig(at), exact=False)
        x = float(np.mean([events["first_contact_x"], events["snap_off_contact_x"]]))
        side = float(np.sign(x - point[_X_C]))
        return cls(model.family.name, model.coordinates, x, side) if abs(side) == 1.0 else None

    @property
    def digest(self) -> str:
        """Identity of the coordinates, as text."""
        proposal = "" if self.proposal is None else self.proposal.digest
        return f"flank of a {self.family}, side {self.side:g} at {self.x!r}, {self.base.digest}, proposal {proposal}"

    def parameters(self, coordinates: Floats) -> tuple[Floats, Floats]:
        """Return parameters, shape (n, parameters), and the logarithm of the Jacobian determinant, shape (n,)."""
        log_slope, log_shape, height, log_ratio = coordinates[:, :_PARAMETERS].T
        based = coordinates.copy()
        with np.errstate(over="ignore", invalid="ignore"):  # infinite parameters are impossible
            found = _FLANKS[self.family].vertex(log_slope, log_shape, log_ratio)
            based[:, 0], based[:, 1] = found.first, found.second
            based[:, 2], based[:, 3] = height - found.rise, self.x - self.side * found.u
        points, log_jacobian = self.base.parameters(based)
        return points, log_jacobian + found.log_jacobian

    def of(self, points: Floats) -> Floats:
        """Return coordinates of points, shape (..., parameters); NaN if the vertex is on the other side."""
        coordinates = self.base.of(points)
        first, second, q, x_c = np.moveaxis(points[..., :_PARAMETERS], -1, 0)
        with np.errstate(invalid="ignore", divide="ignore"):
            found = _FLANKS[self.family].at(first, second, self.side * (self.x - x_c))
        coordinates[..., 0], coordinates[..., 1] = found.log_slope, found.log_shape
        coordinates[..., 2], coordinates[..., 3] = q + found.rise, found.log_ratio
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
