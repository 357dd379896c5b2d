"""Leave-one-out predictions of the samples of a record by a family of contours."""

from __future__ import annotations

import numpy as np

from tactile_bayes.arrays import Floats
from tactile_bayes.comparison.leave_one_out import LeftOut, left_out, left_out_from_wider
from tactile_bayes.inference.contour import Sampled
from tactile_bayes.inference.contour_model import ContourModel
from tactile_bayes.inference.contour_problem import ContourProblem
from tactile_bayes.inference.ensembles import Draws, SamplerSettings, sample
from tactile_bayes.inference.starts.contour_start import walk_of
from tactile_bayes.numerics.random_numbers import Seed, spawn

_DRAWS = 2000  # largest number of draws under which densities are computed


def predicted_samples(problem: ContourProblem, sampled: Sampled, *, seed: Seed, settings: SamplerSettings) -> LeftOut:
    """Return the leave-one-out densities of a record, of a sample's channels together in units of EI/L and EI/L².

    Next to first contact and snap-off the posterior has none of the contours that the record without a sample allows:
    these samples are predicted from a posterior without any of them, and have no k̂. If the load cell drifts or has an
    unknown bias, or beside a discrepancy, they are NaN.
    """
    model = problem.model
    logs = _densities(model, sampled.draws)
    found = left_out(logs)
    events = model.likelihood.segments.event_samples(problem.loaded)
    chosen = np.unique(events[events >= 0])
    log_density, error, k = (np.array(part) for part in found)
    k[chosen] = np.nan
    if _is_correlated(model):
        log_density[chosen] = error[chosen] = np.nan
        return LeftOut(log_density, error, k)
    seeds = spawn(seed, 2)
    without = np.zeros(logs.shape[-1], dtype=bool)
    without[chosen] = True
    wider = problem.without(without)
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
        one = left_out_from_wider(of_events, i)
        log_density[of_sample], error[of_sample] = one.log_density, one.standard_error
    return LeftOut(log_density, error, k)


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
