"""Importance sampling: smoothed weights of draws with their certificate, and proposals that adapt to a target."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from arviz_stats.base.array import array_stats
from scipy.special import logsumexp

from tactile_bayes.arrays import Floats
from tactile_bayes.inference.deadline import NEVER, Deadline
from tactile_bayes.inference.densities import (
    ANYTHING,
    WIDENING,
    Ends,
    LogProbability,
    Mixture,
    Proposal,
    effective_number,
    flattened,
    normalised,
)

LARGEST_K = 0.7  # Pareto k̂ above which weights are not reliable (Vehtari et al. 2024, JMLR 25(72))
_ROUNDS = 8  # of adaptation, at most
_DRAWS = 60  # per parameter in each round
_GOOD = 0.6  # efficiency from which no further round is made
_MASS_DRAWS = 4000  # from which the mass of a proposal within the bounds is estimated
_MIN_EFFECTIVE = 5  # effective draws per parameter for a covariance; weights are made more equal to reach it
# Four pieces have the efficiency of eight: 5 to 57 % for seven posteriors along bent ridges that a single one covers to
# 1 to 10 %. After fewer rounds an efficiency that is enough is luck; after more, little is gained.
_PIECES, _FEWEST, _MOST, _ENOUGH = 4, 4, 16, 0.5
# Efficiency of a proposal above which the posterior is nearly normal around it: ensembles then converge in some hundred
# steps.
EFFICIENT = 0.35
_DRAWS_OF_PIECES = 120  # per parameter in each of these rounds


def weighed(logs: Floats) -> tuple[Floats, Floats]:
    """Return log-weights of sum one along the first axis, and the log of the given ones' mean, the evidence."""
    with np.errstate(invalid="ignore"):
        total = logsumexp(logs, axis=0)
        return np.asarray(logs - total), np.asarray(total - np.log(len(logs)))


def pareto_smoothed(logs: Floats, efficiency: float = 1.0) -> tuple[Floats, float]:
    """Return log-weights of sum one with the largest ones smoothed, and Pareto's k̂, for logs of shape (n,)."""
    smoothed, k = array_stats.psislw(-logs, r_eff=efficiency)  # weights are exp(−argument)
    return np.asarray(smoothed), float(k)


def approximate(
    log_probability: LogProbability,
    centre: Floats,
    covariance: Floats,
    rng: np.random.Generator,
    deadline: Deadline = NEVER,
    ends: Ends = ANYTHING,
) -> Proposal:
    """Approximate a target by rounds of adaptive importance sampling, from a guess at mean and covariance.

    The most efficient round gives the result (Oh & Berger 1992, doi 10.1080/00949659208810407; Cappé, Guillin, Marin &
    Robert 2004, doi 10.1198/106186004X12803). After the deadline there is no further round.
    """
    best = proposal = Proposal(centre, WIDENING * np.asarray(np.linalg.cholesky(covariance)), ends=ends)
    for _ in range(_ROUNDS):
        if deadline.has_passed:
            break
        points, density = proposal.draw(rng, _DRAWS * centre.size)
        surplus = log_probability(points) - density
        if not np.isfinite(surplus).sum() > _MIN_EFFECTIVE * centre.size:
            break
        efficiency = float(effective_number(normalised(surplus))) / len(points)
        if efficiency > best.efficiency:
            log_mass = float(logsumexp(surplus) - np.log(len(points)))
            log_mass += _log_within(proposal, rng)
            best = replace(proposal, efficiency=efficiency, log_mass=log_mass)
        if best.efficiency >= _GOOD:
            break
        try:
            proposal = Proposal.fitted(points, flattened(surplus, _MIN_EFFECTIVE * centre.size), ends)
        except np.linalg.LinAlgError:
            break
    return best


def _log_within(proposal: Proposal | Mixture, rng: np.random.Generator) -> float:
    """Return the logarithm of the share of a proposal's mass within its bounds."""
    if proposal.ends is ANYTHING:
        return 0.0
    within = proposal.ends.hold(proposal.draw_unbounded(rng, _MASS_DRAWS)).mean()
    return float(np.log(max(within, 1.0 / _MASS_DRAWS)))


def refined(
    log_probability: LogProbability, proposal: Proposal, rng: np.random.Generator, deadline: Deadline = NEVER
) -> Mixture:
    """Return a mixture of pieces that cover a bent target, if a proposal covers it poorly; else that alone.

    By adaptive multiple importance sampling (Cornuet, Marin, Mira & Robert 2012, doi
    10.1111/j.1467-9469.2011.00756.x): the draws of all rounds are weighed by the mean density of all proposals so far.
    """
    size = proposal.mean.size
    best, rounds = Mixture((proposal,)), list[tuple[Mixture, float]]()
    points, values = np.empty((0, size)), np.empty(0)
    while proposal.efficiency < EFFICIENT and len(rounds) < _MOST and not deadline.has_passed:
        drawn, density = best.draw(rng, _DRAWS_OF_PIECES * size)
        found = log_probability(drawn)
        if len(rounds) >= _FEWEST and effective_number(normalised(found - density)) >= _ENOUGH * len(drawn):
            break
        rounds.append((best, _log_within(best, rng)))
        points, values = np.concatenate([points, drawn]), np.append(values, found)
        surplus = values - logsumexp([one.log_density(points) - within for one, within in rounds], axis=0)
        log_mass = float(logsumexp(surplus) + np.log(len(rounds) / len(points)))
        try:
            weights = flattened(surplus, _PIECES * _MIN_EFFECTIVE * size)
            pieces = Mixture.fitted(points, range(size), _PIECES, proposal.ends, weights)
        except np.linalg.LinAlgError:
            break
        ratios = values - log_mass - pieces.log_density(points) + _log_within(pieces, rng)
        efficiency = float(np.exp(-logsumexp(ratios, b=normalised(surplus))))
        parts = (replace(part, efficiency=efficiency, log_mass=part.log_mass + log_mass) for part in pieces.parts)
        best = Mixture(tuple(parts))
    return best
