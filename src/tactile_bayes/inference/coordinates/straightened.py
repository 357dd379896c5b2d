"""Coordinates in which a posterior that lies along a bent ridge is nearly normal."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tactile_bayes.arrays import Floats
from tactile_bayes.inference.coordinates.base import Coordinates
from tactile_bayes.inference.densities import Mixture

__all__ = ["Straightened"]

_MAX_COORDINATE = 1e100  # whose square is finite
_CENTRAL_SHARE = 0.1  # of the draws, nearest to the centre, from which principal directions are estimated
_MIN_SIGNIFICANCE = 3.0  # of a bend, in standard errors: an uncertain bend would distort the coordinates


@dataclass(frozen=True, eq=False)
class Straightened(Coordinates):
    """Principal directions, wide ones first, each relative to a quadratic form in those before it; volume-preserving.

    If loads are thousands of times their noise, a record determines most directions to a ten-thousandth, and a few,
    such as stiffness and lever, hardly better than the prior. Along these few the second-order shift of the others
    exceeds their width.
    """

    base: Coordinates
    mean: Floats  # centre in the base's coordinates, (d,)
    root: Floats  # directions, a column each; one step along each is about a standard deviation
    bends: Floats  # of a direction, first index, on the product of two before it, the wider one first; (d, d, d)
    proposal: Mixture | None = None

    @classmethod
    def fitted(cls, base: Coordinates, points: Floats, scale: Floats, count: float) -> Straightened:
        """Fit coordinates to draws of a posterior. Shapes: points (n, d), scale (d,)."""
        coordinates = base.of(points)
        mean: Floats = coordinates.mean(axis=0)
        deviations: Floats = coordinates - mean
        root = np.asarray(np.linalg.cholesky(np.cov(coordinates.T)))
        distances = np.sum(np.square(_solved(root, deviations)), axis=1)
        # Farther out, bends make narrow directions wide.
        near = coordinates[distances <= np.quantile(distances, _CENTRAL_SHARE)]
        root = _principal(np.cov(near.T), scale)
        straight = _solved(root, deviations)
        root, straight = root * straight.std(axis=0), straight / straight.std(axis=0)
        bends = np.zeros(3 * scale.shape)
        for k in range(1, scale.size):
            one, other = np.triu_indices(k)
            products = straight[:, one] * straight[:, other]
            design = np.hstack([np.ones((len(points), 1)), straight[:, :k], products])
            gram = count / len(points) * design.T @ design + np.eye(design.shape[1])
            solved = np.linalg.solve(gram, count / len(points) * straight[:, k] @ design)
            left = np.mean(np.square(straight[:, k] - design @ solved))
            certain = np.abs(solved) > _MIN_SIGNIFICANCE * np.sqrt(left * np.diag(np.linalg.inv(gram)))
            bends[k, one, other] = np.where(certain, solved, 0.0)[1 + k :]
            straight[:, k] -= products @ bends[k, one, other]
        return cls(base, mean, root, bends)

    def parameters(self, coordinates: Floats) -> tuple[Floats, Floats]:
        products = coordinates[:, :, None] * coordinates[:, None, :]
        turned = coordinates + products.reshape(len(coordinates), -1) @ self.bends.reshape(self.mean.size, -1).T
        return self.base.parameters(self.mean + turned @ self.root.T)

    def of(self, points: Floats) -> Floats:
        straight = _solved(self.root, self.base.of(points.reshape(-1, points.shape[-1])) - self.mean)
        for k, bend in enumerate(self.bends):
            one, other = np.nonzero(bend)
            bent = straight[:, k] - (straight[:, one] * straight[:, other]) @ bend[one, other]
            straight[:, k] = np.clip(bent, -_MAX_COORDINATE, _MAX_COORDINATE)
        return straight.reshape(points.shape)


def _solved(root: Floats, deviations: Floats) -> Floats:
    """Return deviations, (n, d), in units of the root's columns."""
    return np.array(np.linalg.solve(root, deviations.T).T, dtype=np.float64)


def _principal(covariance: Floats, scale: Floats) -> Floats:
    """Return principal directions, a column each, the widest relative to the scale first."""
    sizes, axes = np.linalg.eigh(covariance / np.outer(scale, scale))
    if not sizes[0] > np.finfo(float).eps * sizes[-1]:
        raise np.linalg.LinAlgError("draws lie in a plane")
    return np.asarray(scale[:, None] * axes[:, ::-1] * np.sqrt(sizes[::-1]))
