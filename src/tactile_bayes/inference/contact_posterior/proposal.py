"""Proposals for importance sampling of contacts: for each sample and branch, normal densities truncated at its ends."""

from __future__ import annotations

import numpy as np
from scipy.special import log_ndtr, logsumexp, ndtr, ndtri

from tactile_bayes.arrays import Floats, Index

__all__ = ["ContactProposal"]

_WIDTHS = np.array([1.15, 3.0])  # of the normal densities of a branch, in standard deviations of the approximation
_SHARES = np.array([0.75, 0.25])
_MAX_DISTANCE = 30.0  # of a mean beyond the edge, in standard deviations, so that probabilities stay positive


class ContactProposal:
    """A mixture distribution for each of n samples, of normal densities on each branch.

    Shapes: mean (branches, n, k) of way, force and, if k is 3, drive angle, covariance (branches, n, k, k), share
    (branches, n), 0 without an approximation, ways (branches, 2), the least and the largest.
    """

    def __init__(self, mean: Floats, covariance: Floats, share: Floats, ways: Floats) -> None:
        self._share = share
        self._root = np.linalg.cholesky(covariance)
        spread = self._root[..., 0, 0]
        self._low, self._high = (end[:, None] + 0.0 * share for end in ways.T)
        self._mean = mean.copy()
        self._mean[..., 0] = np.clip(
            mean[..., 0], self._low - _MAX_DISTANCE * spread, self._high + _MAX_DISTANCE * spread
        )

    def draw(self, count: int, rng: np.random.Generator) -> tuple[Floats, Floats]:
        """Draw `count` points for every sample, (count, n, k), in the shares of branches, with log-densities."""
        size, k = self._share.shape[1], self._mean.shape[-1]
        # The draws are stratified: shares are exact to one draw.
        order = (np.arange(count)[:, None] + rng.random((count, size))) / count
        branch = sum(order >= until for until in np.cumsum(self._share, axis=0)[:-1]).astype(np.intp)
        wide = (rng.random((count, size)) >= _SHARES[0]).astype(np.intp)
        who = np.broadcast_to(np.arange(size), branch.shape)
        mean, root, width = self._mean[branch, who], self._root[branch, who], _WIDTHS[wide]
        points = np.empty((count, size, k))
        low, high = self._low[branch, who], self._high[branch, who]
        scale = width * root[..., 0, 0]
        normal = _between((low - mean[..., 0]) / scale, (high - mean[..., 0]) / scale, rng.random((count, size)))
        points[..., 0] = np.clip(mean[..., 0] + scale * normal, low, high)
        along = (points[..., 0] - mean[..., 0]) / root[..., 0, 0]
        scale = width * root[..., 1, 1]
        middle = mean[..., 1] + root[..., 1, 0] * along
        normal = _between(-middle / scale, np.full(scale.shape, np.inf), rng.random((count, size)))
        points[..., 1] = middle + scale * normal
        if k == 3:
            across = (points[..., 1] - middle) / root[..., 1, 1]
            middle = mean[..., 2] + root[..., 2, 0] * along + root[..., 2, 1] * across
            points[..., 2] = middle + width * root[..., 2, 2] * rng.standard_normal((count, size))
        return points, self._log_density(points, branch, who)

    def _log_density(self, points: Floats, branch: Index, who: Index) -> Floats:
        mean, root = self._mean[branch, who], self._root[branch, who]
        k = points.shape[-1]
        along = (points[..., 0] - mean[..., 0]) / root[..., 0, 0]
        middle = mean[..., 1] + root[..., 1, 0] * along
        across = (points[..., 1] - middle) / root[..., 1, 1]
        squares = along**2 + across**2
        if k == 3:
            last = mean[..., 2] + root[..., 2, 0] * along + root[..., 2, 1] * across
            squares += ((points[..., 2] - last) / root[..., 2, 2]) ** 2
        volume = np.log(np.diagonal(root, axis1=-2, axis2=-1)).sum(axis=-1) + 0.5 * k * np.log(2.0 * np.pi)
        low, high = self._low[branch, who] - mean[..., 0], self._high[branch, who] - mean[..., 0]
        parts = []
        for width, share in zip(_WIDTHS, _SHARES, strict=True):
            inside = _log_mass(low / (width * root[..., 0, 0]), high / (width * root[..., 0, 0]))
            inside += log_ndtr(middle / (width * root[..., 1, 1]))
            parts.append(np.log(share) - 0.5 * squares / width**2 - k * np.log(width) - inside)
        with np.errstate(divide="ignore"):
            of_branch = np.log(self._share[branch, who])
        return np.asarray(logsumexp(np.stack(parts), axis=0) - volume + of_branch)


def _between(low: Floats, high: Floats, uniform: Floats) -> Floats:
    """Return standard normal numbers between two bounds, computed in the tail that keeps its digits."""
    flip = low > 0.0
    a, b = np.where(flip, -high, low), np.where(flip, -low, high)
    below, above = ndtr(a), ndtr(b)
    with np.errstate(divide="ignore"):
        normal = ndtri(below + uniform * (above - below))
    normal = np.clip(normal, a, b)
    return np.where(flip, -normal, normal)


def _log_mass(low: Floats, high: Floats) -> Floats:
    """Return the logarithm of the normal probability between two bounds."""
    flip = low > 0.0
    a, b = np.where(flip, -high, low), np.where(flip, -low, high)
    top = log_ndtr(b)
    with np.errstate(divide="ignore"):
        return np.asarray(top + np.log1p(-np.exp(np.minimum(log_ndtr(a) - top, -1e-300))))
