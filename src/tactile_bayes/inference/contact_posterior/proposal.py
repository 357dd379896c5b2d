"""Proposals for importance sampling of contacts: for each sample and branch, normal densities truncated at its ends."""

from __future__ import annotations

import numpy as np
from scipy.special import log_ndtr, logsumexp, ndtr, ndtri

from tactile_bayes.arrays import Floats

_WIDTHS = np.array([1.15, 3.0])  # of the normal densities of a branch, in standard deviations of the approximation
_SHARES = np.array([0.75, 0.25])
_MAX_DISTANCE = 30.0  # of a mean beyond the edge, in standard deviations, so that probabilities stay positive


class ContactProposal:
    """Mixture of normal densities on each branch, for each of n samples.

    Shapes: mean (branches, n, k) of way, force and drive angle, if it is free; share (branches, n), 0 without an
    approximation; ways (branches, n, 2).
    """

    def __init__(self, mean: Floats, covariance: Floats, share: Floats, ways: Floats) -> None:
        self._share, self._ways = share, ways
        self._root = np.linalg.cholesky(covariance)
        farthest = _MAX_DISTANCE * self._root[..., 0, 0]
        self._mean = mean.copy()
        self._mean[..., 0] = np.clip(mean[..., 0], ways[..., 0] - farthest, ways[..., 1] + farthest)

    def draw(self, count: int, rng: np.random.Generator) -> tuple[Floats, Floats]:
        """Draw `count` points for every sample, (count, n, k), in the shares of branches, with log-densities."""
        size, k = self._share.shape[1], self._mean.shape[-1]
        # The draws are stratified: shares are exact to one draw.
        order = (np.arange(count)[:, None] + rng.random((count, size))) / count
        branch = sum(order >= until for until in np.cumsum(self._share, axis=0)[:-1]).astype(np.intp)
        who = np.broadcast_to(np.arange(size), branch.shape)
        mean, root = self._mean[branch, who], self._root[branch, who]
        width = np.where(rng.random((count, size)) < _SHARES[0], *_WIDTHS)
        ends = np.moveaxis(self._ways[branch, who], -1, 0), (0.0, np.inf), (-np.inf, np.inf)
        points, steps = np.empty((count, size, k)), np.empty((count, size, k))
        logs = np.zeros((2, count, size)) + np.log(_SHARES / _WIDTHS**k)[:, None, None]
        for j, (low, high) in zip(range(k), ends, strict=False):
            scale = root[..., j, j]
            middle = mean[..., j] + np.einsum("...i,...i", root[..., j, :j], steps[..., :j])
            from_low, from_high = (low - middle) / scale, (high - middle) / scale
            step = width * _between(from_low / width, from_high / width, rng.random((count, size)))
            points[..., j] = np.clip(middle + scale * step, low, high)
            steps[..., j] = step
            for of_width, each in zip(logs, _WIDTHS, strict=True):
                of_width -= 0.5 * np.square(step / each) + _log_mass(from_low / each, from_high / each)
        volume = np.log(np.diagonal(root, axis1=-2, axis2=-1)).sum(axis=-1) + 0.5 * k * np.log(2.0 * np.pi)
        with np.errstate(divide="ignore"):
            of_branch = np.log(self._share[branch, who])
        return points, np.asarray(logsumexp(logs, axis=0) - volume + of_branch)


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
