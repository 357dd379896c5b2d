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
    Proposal,
    effective_number,
    flattened,
    normalised,
)

__all__ = ["LARGEST_K", "approximate", "pareto_smoothed", "weighed"]

LARGEST_K = 0.7  # Pareto k̂ above which weights are not reliable (Vehtari et al. 2024, JMLR 25(72))
_ROUNDS = 8  # of adaptation, at most
_DRAWS = 60  # per parameter in each round
_GOOD = 0.6  # efficiency from which no further round is made
_MASS_DRAWS = 4000  # from which the mass of a proposal within the bounds is estimated
_MIN_EFFECTIVE = 5  # effective draws per parameter for a covariance; weights are made more equal to reach it


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
            if ends is not ANYTHING:
                within = ends.hold(proposal.draw_unbounded(rng, _MASS_DRAWS)).mean()
                log_mass += float(np.log(max(within, 1.0 / _MASS_DRAWS)))
            best = replace(proposal, efficiency=efficiency, log_mass=log_mass)
        if best.efficiency >= _GOOD:
            break
        try:
            proposal = Proposal.fitted(points, flattened(surplus, _MIN_EFFECTIVE * centre.size), ends)
        except np.linalg.LinAlgError:
            break
    return best
