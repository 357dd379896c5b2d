"""Draws of many single contacts, by importance sampling with Pareto's k̂ as certificate."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from typing import NamedTuple

import numpy as np
from scipy.special import log_ndtr, logsumexp, ndtr, ndtri

from tactile_bayes.arrays import Flags, Floats, Index
from tactile_bayes.inference.contact_posterior.density import ContactDensity
from tactile_bayes.inference.densities import (
    LARGEST_K,
    Mixture,
    Proposal,
    effective_number,
    flattened,
    normalised,
    pareto_smoothed,
    weighed,
)
from tactile_bayes.mechanics.contacts.contact_coordinates import ARCLENGTH, DRIVE_ANGLE, FORCE, PSI1
from tactile_bayes.mechanics.fitting import fit_sheet
from tactile_bayes.mechanics.phases import TANGENTIAL, TIP
from tactile_bayes.numerics.random_numbers import spawn
from tactile_bayes.numerics.selection import resampled

_WIDTHS = np.array([1.15, 3.0])  # of the normal densities of a branch, in standard deviations of the approximation
_SHARES = np.array([0.75, 0.25])
_MAX_DISTANCE = 30.0  # of a mean beyond the edge, in standard deviations, so that probabilities stay positive


class ContactProposal:
    """Mixture of normal densities on each branch, for each of n samples. Shapes: mean (branches, n, k) of way, force[,
    drive angle]; share (branches, n), maybe 0; ways (branches, n, 2)."""

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


CHAINS = 4  # number of chains
LEAST_DRAWS = 400.0  # smallest number of effective draws
_PROPOSALS, _MIN_PROPOSALS = 4, 1000  # number of proposals per resampled draw, and of a sample at least
_BLOCK = 64  # number of samples that are processed at a time: a proposal takes 7 numbers of memory
_LEAST_SHARE = 0.15  # of a branch among the proposals, however badly its approximation fits
_HOPELESS = 60.0  # excess of the sum of squares from which a tip that is turned beyond the normal is left out
_NEGLIGIBLE = 600.0  # logarithm of a ratio of weights from which the smaller is negligible
# Kernels about weighted draws: their number, their width over that of the draws, and the effective draws per parameter
# among which they are chosen. Of 1,131 contacts of 14 random records, 22 were not certified without kernels, 21 of them
# after one round, one after four.
_KERNELS, _KERNEL_WIDTH, _KERNEL_DRAWS = 64, 0.5, 20
_ROUNDS = 8  # of kernels at most
_SELDOM = 1e-3  # probability of a way up to which its diagnostics do not count


class ContactWeights(NamedTuple):
    """Weighted contacts for each of n samples."""

    points: Floats  # way, force and, if it is uncertain, drive angle, (draws, 2 or 3, n)
    log_weight: Floats  # smoothed, with sum one, (draws, n)
    pareto_k: Floats  # (n,); infinite if no proposal is possible
    effective_draws: Floats  # (n,)
    log_evidence: Floats  # logarithm of the sample's density under the prior, (n,)

    @property
    def certified(self) -> Flags:
        """True for samples whose weights represent the posterior, shape (n,)."""
        return np.asarray((self.pareto_k <= LARGEST_K) & (self.effective_draws >= LEAST_DRAWS))


class ContactDraws(NamedTuple):
    """Draws for each of n samples, with their diagnostics."""

    points: Floats  # way, force and, if it is uncertain, drive angle, shape (chains, draws, n, 2 or 3)
    converged: Flags  # shape (n,), like all further entries
    tangential_probability: Floats
    log_evidence: Floats
    pareto_k: Floats
    effective_draws: Floats


class MixedDraws(NamedTuple):
    """Draws of samples from those of the ways in which each may touch, with their diagnostics; see `mixed`."""

    samples: Index  # numbers of the n samples
    picked: Index  # for each draw the way that it is of, shape (chains, draws, n)
    of_ways: ContactDraws
    stats: dict[str, Floats]  # the diagnostics of `ContactDraws`, shape (n,)


def draw_contacts(
    density: ContactDensity,
    draws: int,
    seed: np.random.SeedSequence,
    progress: Callable[[int, int], object] | None = None,
) -> ContactDraws:
    """Draw contacts for all samples of a density, `draws` of each in all chains together; see `infer_contacts`."""
    count = density.samples.side.size
    parts = []
    for begin, block_seed in zip(range(0, count, _BLOCK), spawn(seed, -(-count // _BLOCK)), strict=True):
        who = np.arange(begin, min(begin + _BLOCK, count))
        for_weights, for_picks = spawn(block_seed, 2)
        weights = weigh_contacts(density.take(who), max(_PROPOSALS * draws, _MIN_PROPOSALS), for_weights)
        parts.append(_drawn(weights, draws, np.random.default_rng(for_picks)))
        if progress is not None:
            progress(int(who[-1]) + 1, count)
    columns = dict(zip(ContactDraws._fields, zip(*parts, strict=True), strict=True))
    return ContactDraws(*(np.concatenate(c, axis=2 if name == "points" else 0) for name, c in columns.items()))


def _drawn(weights: ContactWeights, draws: int, rng: np.random.Generator) -> ContactDraws:
    """Return points resampled by their weights; each chain has its own proposals."""
    _, size, count = weights.points.shape
    points = np.empty((CHAINS, draws // CHAINS, count, size))
    for chain in range(CHAINS):
        part = slice(chain, None, CHAINS)  # proposals are in the order of their phases
        for i in range(count):
            picked = rng.permutation(resampled(normalised(weights.log_weight[part, i]), draws // CHAINS, rng))
            points[chain, :, i] = weights.points[part, :, i][picked]
    tangential = np.where(weights.points[:, 0] < 0.0, np.exp(weights.log_weight), 0.0).sum(axis=0)
    lost = weights.effective_draws == 0.0
    tangential[lost], points[:, :, lost] = np.nan, np.nan
    _, _, k, effective, evidence = weights
    return ContactDraws(points, weights.certified, tangential, evidence, k, effective)


def mixed(found: ContactDraws, rows: Index, log_prior: Floats, rng: np.random.Generator) -> MixedDraws:
    """Return draws of samples, of which each way has the number of its sample, and the logarithm of its prior."""
    samples, first = np.unique(rows, return_index=True)
    points, *others = found
    picked = np.tile(first, (*points.shape[:2], 1))
    stats = {name: of[first].astype(float) for name, of in zip(found._fields[1:], others, strict=True)}
    for i, ways in enumerate(np.split(np.arange(rows.size), first[1:])):
        logs = found.log_evidence[ways] + log_prior[ways]
        if ways.size == 1 or not np.isfinite(logs).any():
            continue
        shares = normalised(np.where(np.isfinite(logs), logs, -np.inf))
        for chain in range(CHAINS):
            picked[chain, :, i] = ways[rng.permutation(resampled(shares, points.shape[1], rng))]
        often = shares > _SELDOM
        stats["log_evidence"][i] = logsumexp(logs[often])
        stats["tangential_probability"][i] = shares[often] @ found.tangential_probability[ways][often]
        stats["converged"][i] = found.converged[ways][often].all()
        stats["pareto_k"][i] = found.pareto_k[ways][often].max()
        stats["effective_draws"][i] = 1.0 / np.sum(shares[often] ** 2 / found.effective_draws[ways][often])
    return MixedDraws(samples, picked, found, stats)


def weigh_contacts(density: ContactDensity, draws: int, seed: np.random.SeedSequence) -> ContactWeights:
    """Return proposals, from normal approximations, and their importance weights. Those not certified follow kernels
    about the best draws (Cappé et al. 2004, doi 10.1198/106186004X12803)."""
    rng = np.random.default_rng(seed)
    found = _weighed(density, *ContactProposal(*_approximation(density), density.ways).draw(draws, rng))
    for i in np.flatnonzero(~found.certified).tolist():
        one, own = density.take(np.array([i])), ContactWeights(*(each.take([i], -1) for each in found))
        with suppress(np.linalg.LinAlgError):  # the draws of most weight lie in a plane
            for _ in range(_ROUNDS):
                kernels = _kernels(own.points[..., 0], own.log_weight[:, 0], rng)
                points = kernels.draw_unbounded(rng, draws)
                log_proposal = kernels.log_density(points) + kernels.parts[0].constant
                own = _weighed(one, points[:, None], log_proposal[:, None])
                if own.certified.all():
                    break
        for each, new in zip(found, own, strict=True):
            each[..., i] = new[..., 0]
    return found


def _weighed(density: ContactDensity, points: Floats, log_proposal: Floats) -> ContactWeights:
    """Return points, (draws, n, 2 or 3), from proposals of a log-density, (draws, n), with their importance weights."""
    log_weight = density.log_density(*density.unfold(points)) - log_proposal
    _, log_evidence = weighed(log_weight)
    lost = ~np.isfinite(log_evidence)
    log_weight[:, lost] = 0.0
    smoothed, k = log_weight.copy(), np.full(lost.size, np.inf)
    # If nearly all weights are negligible there is no tail to smooth.
    many = np.count_nonzero(log_weight > log_weight.max(axis=0) - _NEGLIGIBLE, axis=0) >= 0.25 * len(points)
    for i in np.flatnonzero(many & ~lost).tolist():
        smoothed[:, i], k[i] = pareto_smoothed(log_weight[:, i])
    smoothed, _ = weighed(smoothed)
    effective = np.where(lost, 0.0, effective_number(np.exp(smoothed)))
    return ContactWeights(points.swapaxes(1, 2), smoothed, k, effective, log_evidence)


def _kernels(points: Floats, logs: Floats, rng: np.random.Generator) -> Mixture:
    """Return a mixture of equal distributions about draws of weighted points, (draws, k)."""
    weights = flattened(np.maximum(logs, logs.max() - _NEGLIGIBLE), _KERNEL_DRAWS * points.shape[1])
    root = _KERNEL_WIDTH * Proposal.fitted(points, weights).root
    return Mixture(tuple(Proposal(points[i], root) for i in rng.choice(len(points), _KERNELS, p=weights)))


def _approximation(density: ContactDensity) -> tuple[Floats, Floats, Floats]:
    """Return normal approximations on all branches: means (branches, n, k), covariances, and shares (branches, n)."""
    reading, delta = density.samples.reading, density.delta
    rods = density.samples.rods
    branches = [(TIP, False), (TANGENTIAL, False), (TIP, True)][: len(density.ways)]
    free = [DRIVE_ANGLE] if density.has_free_angle else []
    means, covariances, masses = [], [], []
    least = np.full(delta.size, np.inf)  # sum of squares
    for phase, is_over in branches:
        sheet = fit_sheet(reading, delta, phase, rods, is_over)
        way, shift = (PSI1, delta) if phase == TIP else (ARCLENGTH, -1.0)
        order = [way, FORCE, *free]
        mean = sheet.coordinates[:, order]
        mean[:, 0] += shift
        covariance = sheet.covariance[:, order][:, :, order]
        good = np.isfinite(mean).all(axis=1) & np.isfinite(covariance).all(axis=(1, 2)) & np.isfinite(sheet.misfit)
        if is_over:
            good &= sheet.misfit < least + _HOPELESS
        mean[~good], covariance[~good] = 0.1, np.eye(len(order))
        index = np.arange(len(order))
        covariance[:, index, index] *= 1.0 + 1e-9
        means.append(mean)
        covariances.append(covariance)
        masses.append(np.where(good, 0.5 * np.linalg.slogdet(covariance).logabsdet - 0.5 * sheet.misfit, -np.inf))
        least = np.fmin(least, sheet.misfit)
    logs = np.stack(masses)
    logs[1, np.isinf(logs).all(axis=0)] = 0.0
    shares = np.where(np.isfinite(logs), np.maximum(np.exp(weighed(logs)[0]), _LEAST_SHARE), 0.0)
    return np.stack(means), np.stack(covariances), shares / shares.sum(axis=0)
