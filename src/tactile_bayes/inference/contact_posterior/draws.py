"""Draws of many single contacts: by importance sampling where it certifies itself, by emcee elsewhere."""

from __future__ import annotations

from collections.abc import Callable
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tactile_bayes.arrays import Flags, Floats
from tactile_bayes.errors import InferenceError
from tactile_bayes.inference.contact_posterior.density import ContactDensity
from tactile_bayes.inference.contact_posterior.importance import ContactWeights, weigh_contacts
from tactile_bayes.inference.ensembles import SamplerSettings, sample, scatter_walkers
from tactile_bayes.numerics.random_numbers import spawn
from tactile_bayes.numerics.selection import resampled

__all__ = ["CHAINS", "EMCEE", "EMCEE_SETTINGS", "IMPORTANCE", "ContactDraws", "Method", "draw_contacts"]

Method = Literal["auto", "importance", "emcee"]
CHAINS = 4  # number of chains
IMPORTANCE, EMCEE = 1, 2  # codes of the method that made the draws
# Default settings of emcee for a single contact.
EMCEE_SETTINGS = SamplerSettings(walkers=24, min_ess=400.0, max_steps=4000)
_PROPOSALS = 4  # number of proposals per resampled draw
_MIN_PROPOSALS = 1000  # smallest number of proposals of a sample, among which emcee's walkers start
_BLOCK = 64  # number of samples that are processed at a time


class ContactDraws(NamedTuple):
    """Draws for each of n samples, with their diagnostics."""

    points: Floats  # way, force and, if it is uncertain, drive angle, shape (chains, draws, n, 2 or 3)
    engine: NDArray[np.int8]  # `IMPORTANCE` or `EMCEE`, shape (n,), like all further entries
    converged: Flags
    tangential: Floats  # probability of tangential contact
    log_evidence: Floats  # NaN with emcee; see `ContactWeights`
    pareto_k: Floats
    effective_draws: Floats
    r_hat: Floats  # R̂ of emcee; NaN with importance sampling
    ess: Floats  # effective sample size of emcee; NaN with importance sampling


def draw_contacts(
    density: ContactDensity,
    draws: int,
    method: Method,
    seed: np.random.SeedSequence,
    settings: SamplerSettings | None = None,
    progress: Callable[[int, int], object] | None = None,
) -> ContactDraws:
    """Draw contacts for all samples of a density, `draws` of each in all chains together; see `infer_contacts`."""
    count = density.samples.side.size
    of_blocks, of_samples = spawn(seed, 2)
    seeds, own = spawn(of_blocks, -(-count // _BLOCK)), spawn(of_samples, count)
    parts = []
    for begin, block_seed in zip(range(0, count, _BLOCK), seeds, strict=True):
        who = np.arange(begin, min(begin + _BLOCK, count))
        parts.append(_draw_block(density.take(who), draws, method, block_seed, own[begin:], settings))
        if progress is not None:
            progress(int(who[-1]) + 1, count)
    columns = dict(zip(ContactDraws._fields, zip(*parts, strict=True), strict=True))
    return ContactDraws(*(np.concatenate(c, axis=2 if name == "points" else 0) for name, c in columns.items()))


def _draw_block(
    density: ContactDensity,
    draws: int,
    method: Method,
    seed: np.random.SeedSequence,
    own: list[np.random.SeedSequence],
    settings: SamplerSettings | None,
) -> ContactDraws:
    """Draw contacts for one block of samples; `own` are the seeds of emcee for each sample."""
    for_weights, for_picks = spawn(seed, 2)
    count = density.samples.side.size
    weights = weigh_contacts(
        density, _MIN_PROPOSALS if method == "emcee" else max(_PROPOSALS * draws, _MIN_PROPOSALS), for_weights
    )
    points = _resampled(weights, draws, np.random.default_rng(for_picks))
    tangential = np.where(weights.points[..., 0] < 0.0, np.exp(weights.log_weight), 0.0).sum(axis=0)
    tangential[weights.effective_draws == 0.0] = np.nan
    found = ContactDraws(
        points,
        np.full(count, IMPORTANCE, dtype=np.int8),
        weights.certified,
        tangential,
        weights.log_evidence,
        weights.pareto_k,
        weights.effective_draws,
        np.full(count, np.nan),
        np.full(count, np.nan),
    )
    points[:, :, weights.effective_draws == 0.0] = np.nan
    if method == "importance":
        return found
    for i in np.flatnonzero((method == "emcee") | ~found.converged).tolist():
        found.engine[i], found.log_evidence[i] = EMCEE, np.nan
        points[:, :, i], found.r_hat[i], found.ess[i], found.converged[i] = _draw_by_emcee(
            density.take(np.array([i])), weights, i, draws, own[i], settings or EMCEE_SETTINGS
        )
        lost = np.isnan(points[0, 0, i, 0])
        tangential[i] = np.nan if lost else np.mean(points[:, :, i, 0] < 0.0)
    return found


def _resampled(weights: ContactWeights, draws: int, rng: np.random.Generator) -> Floats:
    """Resample points by their weights, shape (chains, draws, n, 2 or 3); each chain has its own proposals."""
    each = draws // CHAINS
    points = np.empty((CHAINS, each, *weights.points.shape[1:]))
    for chain in range(CHAINS):
        part = slice(chain, None, CHAINS)  # proposals are in the order of their phases
        for i in range(points.shape[2]):
            weight = np.exp(weights.log_weight[part, i] - weights.log_weight[part, i].max())
            points[chain, :, i] = weights.points[part, i][rng.permutation(resampled(weight, each, rng))]
    return points


def _draw_by_emcee(
    density: ContactDensity,
    weights: ContactWeights,
    i: int,
    draws: int,
    seed: np.random.SeedSequence,
    settings: SamplerSettings,
) -> tuple[Floats, float, float, bool]:
    """Draw one sample's contact by emcee, over both branches at once, with R̂ and effective sample size."""
    proposed = weights.points[:, i]
    weight = np.exp(weights.log_weight[:, i] - weights.log_weight[:, i].max())
    names = ("way", "force", "drive angle")[: proposed.shape[-1]]
    spread = np.sqrt(np.maximum(np.cov(proposed.T, aweights=weight).diagonal(), 1e-20))

    def log_probability(points: Floats) -> Floats:
        return density.at(*density.unfold(points[:, None, :])).log_density[:, 0]

    def draw(rng: np.random.Generator, count: int) -> Floats:
        near = proposed[rng.choice(weight.size, count, p=weight / weight.sum())]
        return np.asarray(near + spread * rng.standard_normal(near.shape))

    for_start, for_sampling = spawn(seed, 2)
    try:
        start = scatter_walkers(
            log_probability, draw, parameters=len(names), seed=for_start, settings=settings, max_rounds=1000
        )
    except InferenceError:  # no contact is possible for this sample
        return np.full((CHAINS, draws // CHAINS, len(names)), np.nan), np.nan, 0.0, False
    found = sample(log_probability, start, names=names, seed=for_sampling, settings=settings)
    thinned = np.linspace(0, found.samples.shape[1] - 1, draws // CHAINS).astype(int)
    ess = float(np.min([found.ess_bulk, found.ess_tail]))
    return found.samples[:, thinned], float(np.max(found.r_hat)), ess, found.converged
