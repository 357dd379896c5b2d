"""Coordinates in which a posterior that lies along a bent ridge is nearly normal."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from tactile_bayes.arrays import Floats
from tactile_bayes.inference.ensembles.coordinates import Coordinates
from tactile_bayes.inference.ensembles.moves import standard_moves
from tactile_bayes.inference.ensembles.proposal import Mixture

__all__ = ["Straightened"]

_FARTHEST = 1e100
"""Coordinate of what is further off: its square is a number still."""

_NEAR = 0.1
"""Share of draws, those nearest to the middle, by which directions are found."""

_SURE = 3.0
"""Standard errors that a bend has to be: what is uncertain would bend the coordinates anew."""


@dataclass(frozen=True, eq=False)
class Straightened:
    """Principal directions, wide ones first, each counted from parabolas of those before it; volumes stay as they are.

    Where loads are thousands of times their noise, a record tells most directions to a ten-thousandth, and a few hardly
    more than the prior: stiffness, lever. Along these few the others move by second order further than they are wide,
    and turn about one another.

    Parameters
    ----------
    base : Coordinates
        Those that are turned and straightened.
    mean : ndarray, shape (d,)
    root : ndarray, shape (d, d)
        Directions, a column each; one step along each is about a standard deviation.
    bends : ndarray, shape (d, d, d)
        By how much a direction, first index, moves with the product of two before it, the wider one first; zero for
        other products.
    proposal : Mixture, optional
        Of coordinates, that comes near the posterior.
    """

    base: Coordinates
    mean: Floats
    root: Floats
    bends: Floats
    proposal: Mixture | None = None

    @classmethod
    def fitted(cls, base: Coordinates, points: Floats, scale: Floats, count: float) -> Straightened:
        """To draws of a posterior.

        Parameters
        ----------
        base : Coordinates
        points : ndarray, shape (n, d)
            Parameters.
        scale : ndarray, shape (d,)
            On which each of the base's coordinates varies a priori: wide is what is wide on it.
        count : float
            How many independent draws they are worth.

        Raises
        ------
        numpy.linalg.LinAlgError
            If they lie in a plane.
        """
        places = base.of(points)
        mean: Floats = places.mean(axis=0)
        apart: Floats = places - mean
        distances = np.sum(np.square(_solved(np.asarray(np.linalg.cholesky(np.cov(places.T))), apart)), axis=1)
        near = places[distances <= np.quantile(distances, _NEAR)]  # where bends have not made narrow directions wide
        root = _principal(np.cov(near.T), scale)
        straight = _solved(root, apart)
        root, straight = root * straight.std(axis=0), straight / straight.std(axis=0)
        bends = np.zeros(3 * scale.shape)
        for k in range(1, scale.size):
            one, other = np.triu_indices(k)
            products = straight[:, one] * straight[:, other]
            design = np.hstack([np.ones((len(points), 1)), straight[:, :k], products])
            gram = count / len(points) * design.T @ design + np.eye(design.shape[1])
            solved = np.linalg.solve(gram, count / len(points) * straight[:, k] @ design)
            left = np.mean(np.square(straight[:, k] - design @ solved))
            certain = np.abs(solved) > _SURE * np.sqrt(left * np.diag(np.linalg.inv(gram)))
            bends[k, one, other] = np.where(certain, solved, 0.0)[1 + k :]
            straight[:, k] -= products @ bends[k, one, other]
        return cls(base, mean, root, bends)

    @property
    def digest(self) -> str:
        arrays = (self.mean, self.root, self.bends)
        content = b"".join(np.ascontiguousarray(a, dtype="<f8").tobytes() for a in arrays)
        proposal = "" if self.proposal is None else self.proposal.digest
        return f"straightened {hashlib.sha256(content).hexdigest()}, {self.base.digest}, proposal {proposal}"

    def parameters(self, coordinates: Floats) -> tuple[Floats, Floats]:
        products = coordinates[:, :, None] * coordinates[:, None, :]
        turned = coordinates + products.reshape(len(coordinates), -1) @ self.bends.reshape(self.mean.size, -1).T
        return self.base.parameters(self.mean + turned @ self.root.T)

    def of(self, points: Floats) -> Floats:
        """Coordinates of points, shape (..., parameters)."""
        straight = _solved(self.root, self.base.of(points.reshape(-1, points.shape[-1])) - self.mean)
        for k, bend in enumerate(self.bends):
            one, other = np.nonzero(bend)
            bent = straight[:, k] - (straight[:, one] * straight[:, other]) @ bend[one, other]
            straight[:, k] = np.clip(bent, -_FARTHEST, _FARTHEST)
        return straight.reshape(points.shape)

    def with_proposal(self, proposal: Mixture) -> Straightened:
        return replace(self, proposal=proposal)

    def moves(self) -> list[tuple[Any, float]]:
        return standard_moves(self.proposal)


def _solved(root: Floats, apart: Floats) -> Floats:
    return np.array(np.linalg.solve(root, apart.T).T, dtype=np.float64)


def _principal(covariance: Floats, scale: Floats) -> Floats:
    """Principal directions, a column each, the widest on the scale first.

    Raises
    ------
    numpy.linalg.LinAlgError
        If one of them is no wider than rounding.
    """
    sizes, axes = np.linalg.eigh(covariance / np.outer(scale, scale))
    if not sizes[0] > np.finfo(float).eps * sizes[-1]:
        raise np.linalg.LinAlgError("draws lie in a plane")
    return np.asarray(scale[:, None] * axes[:, ::-1] * np.sqrt(sizes[::-1]))
