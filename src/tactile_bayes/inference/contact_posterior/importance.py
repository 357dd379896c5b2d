"""Posteriors of many single contacts at once, by importance sampling with Pareto's k̂ as certificate."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from tactile_bayes.arrays import Flags, Floats
from tactile_bayes.inference.contact_posterior.density import ContactDensity
from tactile_bayes.inference.contact_posterior.proposal import ContactProposal
from tactile_bayes.inference.densities import effective_number
from tactile_bayes.inference.importance import LARGEST_K, pareto_smoothed, weighed
from tactile_bayes.mechanics.contacts.contact_coordinates import ARCLENGTH, DRIVE_ANGLE, FORCE, PSI1
from tactile_bayes.mechanics.fitting import fit_sheet
from tactile_bayes.mechanics.phases import TANGENTIAL, TIP

__all__ = ["LEAST_DRAWS", "ContactWeights", "weigh_contacts"]

LEAST_DRAWS = 400.0  # smallest number of effective draws
_NEGLIGIBLE = 600.0  # logarithm of a ratio of weights from which the smaller is negligible
# Number of proposals of each pilot run, and the smallest share of a branch in the next run: the edge between the phases
# cuts off narrow layers of the posterior, which need more than one pilot.
_PILOTS = ((600, 0.25), (600, 0.15))
# Effective share of a branch's proposals from which its approximation is final: moments of a truncated posterior would
# not improve it.
_GOOD_SHARE = 0.4
_HOPELESS = 60.0  # excess of the sum of squares from which a tip that is turned beyond the normal is left out


class ContactWeights(NamedTuple):
    """Weighted contacts for each of n samples."""

    points: Floats  # way, force and, if it is uncertain, drive angle, (draws, n, 2 or 3)
    contact: Floats  # point, slope angle and arc length, in the sweep frame and dimensionless, (4, draws, n)
    log_weight: Floats  # smoothed, with sum one, (draws, n)
    pareto_k: Floats  # (n,); infinite if no proposal is possible
    effective_draws: Floats  # (n,)
    log_evidence: Floats  # logarithm of the sample's density under the prior, (n,)

    @property
    def certified(self) -> Flags:
        """True for samples whose weights represent the posterior, shape (n,)."""
        return np.asarray((self.pareto_k <= LARGEST_K) & (self.effective_draws >= LEAST_DRAWS))


def weigh_contacts(density: ContactDensity, draws: int, seed: np.random.SeedSequence) -> ContactWeights:
    """Return proposals and their importance weights.

    A proposal takes 7 numbers of memory, so that many samples are better processed in blocks.
    """
    rng = np.random.default_rng(seed)
    approximation = _approximation(density)
    for count, least in _PILOTS:
        points, _, log_weight = _evaluated(density, ContactProposal(*approximation, density.ways), count, rng)
        approximation = _refined(points, log_weight, density.ways, *approximation, least)
    proposal = ContactProposal(*approximation, density.ways)
    points, contact, log_weight = _evaluated(density, proposal, draws, rng)
    _, log_evidence = weighed(log_weight)
    lost = ~np.isfinite(log_evidence)
    log_weight[:, lost] = 0.0
    smoothed, k = log_weight.copy(), np.full(lost.size, np.inf)
    # If nearly all weights are negligible there is no tail to smooth.
    many = np.count_nonzero(log_weight > log_weight.max(axis=0) - _NEGLIGIBLE, axis=0) >= 0.25 * draws
    for i in np.flatnonzero(many & ~lost).tolist():
        smoothed[:, i], k[i] = pareto_smoothed(log_weight[:, i])
    smoothed, _ = weighed(smoothed)
    effective = effective_number(np.exp(smoothed))
    return ContactWeights(points, contact, smoothed, k, np.where(lost, 0.0, effective), log_evidence)


def _evaluated(
    density: ContactDensity, proposal: ContactProposal, draws: int, rng: np.random.Generator
) -> tuple[Floats, Floats, Floats]:
    """Return proposals, their contacts, and the logarithms of their importance weights."""
    points, log_proposal = proposal.draw(draws, rng)
    found = density.at(*density.unfold(points))
    return points, found.contact, found.log_density - log_proposal


def _approximation(density: ContactDensity) -> tuple[Floats, Floats, Floats]:
    """Return normal approximations on all branches: means (branches, n, k), covariances, and shares (branches, n)."""
    reading, delta = density.samples.reading, np.full(density.samples.side.size, density.delta)
    rods = density.samples.rods
    branches = [(TIP, False), (TANGENTIAL, False), (TIP, True)][: len(density.ways)]
    free = [DRIVE_ANGLE] if density.has_free_angle else []
    means, covariances, usable = [], [], []
    misfits: list[Floats] = []
    for phase, is_over in branches:
        sheet = fit_sheet(reading, delta, phase, rods, is_over)
        way, shift = (PSI1, density.delta) if phase == TIP else (ARCLENGTH, -1.0)
        order = [way, FORCE, *free]
        mean = sheet.coordinates[:, order]
        mean[:, 0] += shift
        covariance = sheet.covariance[:, order][:, :, order]
        good = np.isfinite(mean).all(axis=1) & np.isfinite(covariance).all(axis=(1, 2)) & np.isfinite(sheet.misfit)
        if is_over:
            good &= sheet.misfit < np.min(misfits, axis=0) + _HOPELESS
        mean[~good], covariance[~good] = 0.1, np.eye(len(order))
        index = np.arange(len(order))
        covariance[:, index, index] *= 1.0 + 1e-9
        means.append(mean)
        covariances.append(covariance)
        usable.append(good)
        misfits.append(sheet.misfit)
    usable[1] |= ~np.any(usable, axis=0)
    return np.stack(means), np.stack(covariances), np.stack(usable) / np.sum(usable, axis=0)


def _refined(
    points: Floats, log_weight: Floats, ways: Floats, mean: Floats, covariance: Floats, share: Floats, least: float
) -> tuple[Floats, Floats, Floats]:
    """Return the approximation corrected by a pilot run."""
    mean, covariance, masses = mean.copy(), covariance.copy(), []
    with np.errstate(invalid="ignore"):
        weight = np.exp(log_weight - np.max(log_weight, axis=0))
    weight[~np.isfinite(weight)] = 0.0
    for branch, (low, high) in enumerate(ways):
        mine = (points[..., 0] >= low) & (points[..., 0] < high) if low >= 0.0 else points[..., 0] < high
        own = np.where(mine, weight, 0.0)
        mass = own.sum(axis=0)
        masses.append(mass)
        with np.errstate(divide="ignore", invalid="ignore"):
            own = own / mass
            effective = effective_number(own)
            new = np.einsum("dn,dnk->nk", own, points)
            off = points - new
            spread = np.einsum("dn,dni,dnj->nij", own, off, off)
        trusted = (effective >= 10.0 * points.shape[-1]) & (effective < _GOOD_SHARE * mine.sum(axis=0))
        spread[~trusted] = np.eye(points.shape[-1])
        scale = np.sqrt(np.diagonal(spread, axis1=1, axis2=2))
        with np.errstate(divide="ignore", invalid="ignore"):
            scaled = spread / scale[:, :, None] / scale[:, None, :]
        trusted &= np.isfinite(scaled).all(axis=(1, 2))
        scaled[~trusted] = np.eye(points.shape[-1])
        trusted &= np.linalg.eigvalsh(scaled)[:, 0] > 1e-9
        mean[branch][trusted], covariance[branch][trusted] = new[trusted], spread[trusted]
    return mean, covariance, _shares(np.stack(masses), share, least)


def _shares(masses: Floats, share: Floats, least: float) -> Floats:
    """Return the shares of the branches by their masses, but at least `least` for each that has a share."""
    total = masses.sum(axis=0)
    with np.errstate(divide="ignore", invalid="ignore"):
        raised = np.where(share > 0.0, np.maximum(masses / total, least), 0.0)
        room = np.where(share > 0.0, raised - least, 0.0)
        found = raised - (raised.sum(axis=0) - 1.0) * room / room.sum(axis=0)
    return np.where((np.count_nonzero(share, axis=0) > 1) & (total > 0.0), found, share)
