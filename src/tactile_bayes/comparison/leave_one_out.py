"""Leave-one-out cross-validation: predictive density of each sample given all the others.

Log-densities are log p(y_i | θ) of independent samples, or log p(y_i | all other y, θ) of correlated ones (Bürkner,
Gabry & Vehtari 2021, doi 10.1007/s00180-020-01045-4); a draw has the weight 1 / p(y_i | θ) under the posterior without
sample i.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from arviz_stats.base.array import array_stats
from scipy.optimize import Bounds, LinearConstraint, minimize
from scipy.special import logsumexp

from tactile_bayes.arrays import Floats
from tactile_bayes.errors import InferenceError, ParameterError
from tactile_bayes.inference.densities import effective_number
from tactile_bayes.inference.importance import LARGEST_K, pareto_smoothed, weighed

_LEAST_DRAWS = 25  # smallest number of draws; a fifth of them, the tail, suffices to fit two parameters
_LEAST_EFFECTIVE = 10.0  # number of effective draws below which their scatter does not estimate the error of their mean
_SAME = 1e-12  # difference of logarithms below which weights are equal
_OFF = 1e-5  # largest loss of log-density per sample of the stacking weights relative to the best


class LeftOut(NamedTuple):
    """Predictive log-density of each sample given all the others."""

    log_density: Floats  # shape (samples,)
    # Monte-Carlo error of each, allowing for autocorrelation; too small, maybe several times, where k̂ is above 0.5,
    # and infinite where it is above `largest_k`.
    standard_error: Floats
    # Shape of the weights' tail, k̂; −∞ where the largest weights are all the same, ∞ where no tail can be fitted.
    pareto_k: Floats


class FromWider(NamedTuple):
    """Predictive log-density of one sample given all the others, from a posterior given fewer samples."""

    log_density: float  # NaN where no draw has any weight
    # Monte-Carlo error, allowing for autocorrelation; infinite with fewer than 10 effective draws.
    standard_error: float
    effective: float  # effective number of draws of the weights, (Σ w)² / Σ w²; autocorrelation reduces it further


def largest_k(draws: int) -> float:
    """Return the Pareto k̂ above which so many draws do not represent the posterior without a sample.

    It is the smaller of 1 − 1 / log₁₀ draws and 0.7 (Vehtari et al. 2024, JMLR 25(72)).
    """
    return min(1.0 - 1.0 / math.log10(draws), LARGEST_K)


def left_out(log_densities: Floats) -> LeftOut:
    """Return leave-one-out densities by Pareto-smoothed importance sampling, from (chains, draws, samples).

    Vehtari, Gelman & Gabry 2017, doi 10.1007/s11222-016-9696-4. A small k̂ is no proof beside a jump: see
    `left_out_from_wider`.
    """
    logs = np.asarray(log_densities, dtype=np.float64)
    chains, draws, samples = logs.shape
    if chains * draws < _LEAST_DRAWS:
        raise ParameterError(f"log_densities has {chains * draws} draws: give {_LEAST_DRAWS} at least")
    if not np.isfinite(logs).all():
        chain, draw, sample = np.argwhere(~np.isfinite(logs))[0].tolist()
        raise ParameterError(
            f"the log-density of sample {sample} is {float(logs[chain, draw, sample])!r} at draw {draw} of chain "
            f"{chain}: give draws of the posterior, in which no sample is impossible"
        )
    found = LeftOut(*np.empty((3, samples)))
    worst = largest_k(chains * draws)
    for i in range(samples):
        log_density = np.ascontiguousarray(logs[..., i])
        log_weights, k = _smoothed(log_density)
        found.log_density[i], error = _weighed(log_weights, log_density)
        found.standard_error[i] = error if k <= worst else np.inf
        found.pareto_k[i] = k
    return found


def left_out_from_wider(log_densities: Floats, chosen: int) -> FromWider:
    """Return the predictive density of a sample given all the others, from a posterior without it and some more.

    A sample beside a jump of the load excludes values alone, which draws of the whole posterior do not reach. Given
    draws without the samples E, log-densities (chains, draws, events), it is Σ_s w_s p(y_i | θ_s) / Σ_s w_s with w_s =
    Π_{j in E, j ≠ i} p(y_j | θ_s).
    """
    logs = np.asarray(log_densities, dtype=np.float64)
    log_weights, log_density = np.delete(logs, chosen, axis=-1).sum(axis=-1), logs[..., chosen]
    if not np.isfinite(log_weights).any():
        return FromWider(math.nan, math.inf, 0.0)
    log_weights = weighed(log_weights.ravel())[0].reshape(log_weights.shape)
    effective = float(effective_number(np.exp(log_weights.ravel())))
    found, error = _weighed(log_weights, log_density)
    return FromWider(found, error if effective >= _LEAST_EFFECTIVE else math.inf, effective)


def stacking_weights(log_densities: Floats) -> Floats:
    """Return the weights, (models,), with the best leave-one-out predictions, from (models, samples): stacking.

    They maximise Σ_i log Σ_k w_k p_k(y_i | all other y), a convex problem, to 1e-5 per sample (Yao et al. 2018, doi
    10.1214/17-BA1091).
    """
    logs = np.asarray(log_densities, dtype=np.float64)
    densities = np.exp(logs - logs.max(axis=0))

    def loss(weights: Floats) -> tuple[float, Floats]:
        mixture = weights @ densities
        return -float(np.log(mixture).mean()), -(densities / mixture).mean(axis=1)

    models = len(logs)
    least = 1e-10 / models  # keeps mixtures positive
    found = minimize(
        loss,
        np.full(models, 1.0 / models),
        jac=True,
        method="SLSQP",
        bounds=Bounds(least, 1.0),
        constraints=LinearConstraint(np.ones((1, models)), 1.0, 1.0),
        options={"ftol": 1e-14, "maxiter": 1000},
    )
    weights = np.clip(found.x, least, 1.0)
    weights /= weights.sum()
    off = -float(loss(weights)[1].min()) - 1.0  # how far below the best they can be at most, by convexity
    if not off <= _OFF:
        raise InferenceError(f"stacking did not converge ({found.message}): its weights may be {off:.1e} off the best")
    return np.asarray(weights)


def _smoothed(log_density: Floats) -> tuple[Floats, float]:
    """Return logarithms of weights in proportion to 1 / density, with sum one and a smoothed tail, and its k̂."""
    efficiency = _efficiency(np.exp(log_density - log_density.max()))
    tail = int(3.0 * math.sqrt(log_density.size / efficiency))
    tail = min(tail, log_density.size // 5)
    lowest = np.partition(log_density, tail, axis=None)[: tail + 1]
    logs = -log_density.ravel()
    plain = weighed(logs)[0].reshape(log_density.shape)
    if np.ptp(lowest) < _SAME:
        return plain, -math.inf
    with np.errstate(all="ignore"):  # a fit to few different weights fails and gives NaN
        smoothed, k = pareto_smoothed(logs, efficiency)
    is_fitted = np.isfinite(k) and np.isfinite(smoothed).all()
    return (smoothed.reshape(plain.shape), k) if is_fitted else (plain, math.inf)


def _weighed(log_weights: Floats, log_density: Floats) -> tuple[float, float]:
    """Return the logarithm of a weighted mean of densities, and its first-order error, from weights with sum one."""
    found = float(logsumexp(log_weights + log_density))
    if found == -np.inf:
        return found, math.inf
    off = np.exp(log_weights + log_density - found) - np.exp(log_weights)
    return found, math.sqrt(float(np.sum(off**2)) / _efficiency(off))


def _efficiency(values: Floats) -> float:
    """Return effective over actual draws for the mean of values, shape (chains, draws), at most 1."""
    size = np.abs(values).max()
    if size == 0.0:
        return 1.0
    effective = float(array_stats.ess(values / size, method="mean"))
    return min(effective / values.size, 1.0) if effective > 0.0 else 1.0 / values.size
