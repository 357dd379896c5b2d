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
from tactile_bayes.inference.contour import Sampled
from tactile_bayes.inference.contour_model import ContourModel
from tactile_bayes.inference.densities import LARGEST_K, effective_number, pareto_smoothed, weighed
from tactile_bayes.inference.ensembles import Draws, SamplerSettings, sample
from tactile_bayes.inference.experiment import ContourProblem
from tactile_bayes.inference.starts.contour_start import walk_of
from tactile_bayes.numerics.random_numbers import Seed, spawn

_LEAST_DRAWS = 25  # smallest number of draws; a fifth of them, the tail, suffices to fit two parameters
_LEAST_EFFECTIVE = 10.0  # number of effective draws below which their scatter is no estimate of an error
_SAME = 1e-12  # difference of logarithms below which weights are equal
_DRAWS = 2000  # largest number of draws under which densities are computed
_OFF = 1e-5  # largest loss of log-density per sample of the stacking weights relative to the best


class LeftOut(NamedTuple):
    """Predictive log-density of each sample given all the others."""

    log_density: Floats  # shape (samples,)
    # Monte-Carlo error of each, allowing for autocorrelation; too small, maybe several times, where k̂ is above 0.5,
    # and infinite where so many draws are too few for k̂.
    standard_error: Floats
    # Shape of the weights' tail, k̂; −∞ where the largest weights are all the same, ∞ where no tail can be fitted.
    pareto_k: Floats


def predicted_samples(problem: ContourProblem, sampled: Sampled, *, seed: Seed, settings: SamplerSettings) -> LeftOut:
    """Return the leave-one-out densities of a record, of a sample's channels together in units of EI/L and EI/L².

    Samples at events are predicted from a posterior without any of them, and have no k̂; NaN if they are correlated.
    """
    model = problem.model
    logs = _densities(model, sampled.draws)
    found = left_out(logs)
    events = model.likelihood.segments.event_samples(problem.loaded)
    chosen = np.unique(events[events >= 0])
    found.pareto_k[chosen] = np.nan
    if _is_correlated(model):
        found.log_density[chosen] = found.standard_error[chosen] = np.nan
        return found
    seeds = spawn(seed, 2)
    wider = problem.without(np.isin(np.arange(logs.shape[-1]), chosen))
    walk = walk_of(wider, seeds[0], settings)
    draws = sample(
        wider.log_probability,
        walk.start,
        names=wider.names,
        seed=seeds[1],
        settings=settings,
        coordinates=walk.coordinates,
    )
    draws.refuse_interrupted(f"{model.family.name} without some samples")
    of_events = _densities(model, draws)[..., chosen]
    for i, of_sample in enumerate(chosen):
        found.log_density[of_sample], found.standard_error[of_sample] = left_out_from_wider(of_events, i)
    return found


def _is_correlated(model: ContourModel) -> bool:
    cell = model.likelihood.load_cell
    return bool(cell.drift or any(cell.bias_uncertainty) or model.noise.of_discrepancy)


def _densities(model: ContourModel, draws: Draws) -> Floats:
    """Return log-densities of samples, conditional on the others if correlated, shape (chains, draws, samples)."""
    chains, _, parameters = draws.samples.shape
    kept = draws.evenly(_DRAWS // chains)
    points = draws.samples[:, kept].reshape(-1, parameters)
    logs = []
    for part in np.array_split(points, max(1, len(points) // 200)):
        if _is_correlated(model):
            loads, _, discrepancy = model.loads_and_discrepancy(part)
            cell, measured, scale = model.likelihood.load_cell, model.likelihood.measured, model.noise_scale(part)
            logs.append(cell.log_density_left_out(measured, loads[:, 0], noise_scale=scale, discrepancy=discrepancy))
        else:
            logs.append(model.log_likelihood(part, pointwise=True))
    return np.concatenate(logs).reshape(chains, kept.size, -1)


def left_out(log_densities: Floats) -> LeftOut:
    """Return leave-one-out densities by Pareto-smoothed importance sampling, from (chains, draws, samples).

    Vehtari, Gelman & Gabry 2017, doi 10.1007/s11222-016-9696-4. Beside a jump a small k̂ is no proof.
    """
    logs = np.asarray(log_densities, dtype=np.float64)
    chains, draws, samples = logs.shape
    if chains * draws < _LEAST_DRAWS:
        raise ParameterError(f"log_densities has {chains * draws} draws: give {_LEAST_DRAWS} at least")
    found = LeftOut(*np.empty((3, samples)))
    worst = min(1.0 - 1.0 / math.log10(chains * draws), LARGEST_K)  # Vehtari et al. 2024, JMLR 25(72)
    for i in range(samples):
        log_density = np.ascontiguousarray(logs[..., i])
        log_weights, k = _smoothed(log_density)
        found.log_density[i], error = _weighed(log_weights, log_density)
        found.standard_error[i] = error if k <= worst else np.inf
        found.pareto_k[i] = k
    return found


def left_out_from_wider(log_densities: Floats, chosen: int) -> tuple[float, float]:
    """Return the log-density of a sample i given all the others, and its error, from draws without it and others, E.

    From (chains, draws, E) it is Σ_s w_s p(y_i | θ_s) / Σ_s w_s with w_s = Π_{j in E, j ≠ i} p(y_j | θ_s).
    """
    logs = np.asarray(log_densities, dtype=np.float64)
    log_weights, log_density = np.delete(logs, chosen, axis=-1).sum(axis=-1), logs[..., chosen]
    if not np.isfinite(log_weights).any():
        return math.nan, math.inf
    log_weights = weighed(log_weights.ravel())[0].reshape(log_weights.shape)
    found, error = _weighed(log_weights, log_density)
    return found, error if effective_number(np.exp(log_weights.ravel())) >= _LEAST_EFFECTIVE else math.inf


def stacking_weights(log_densities: Floats) -> Floats:
    """Return the weights, (models,), of the mixture with the best leave-one-out predictions, from (models, samples).

    They maximise Σ_i log Σ_k w_k p_k(y_i | all other y) to 1e-5 per sample (Yao et al. 2018, doi 10.1214/17-BA1091).
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
    tail = min(int(3.0 * math.sqrt(log_density.size / efficiency)), log_density.size // 5)
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
