"""Simulation-based calibration around one record: do its intervals hold for objects and rigs like this one."""

from __future__ import annotations

import hashlib
import os
import time
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
import xarray as xr

from tactile_bayes.arrays import Floats
from tactile_bayes.assessment.split_prediction import predicted_readings
from tactile_bayes.calibration.replicate import (
    REPLICATES,
    Outcome,
    compared,
    contact_coverage,
    grid_points_of,
    lost,
    walkers_of,
)
from tactile_bayes.calibration.simulation import Simulation
from tactile_bayes.calibration.summary import coverage_p_value, summary
from tactile_bayes.errors import InferenceError
from tactile_bayes.inference.contour import sampled
from tactile_bayes.inference.contour_model import ContourModel
from tactile_bayes.inference.coordinates import in_coordinates
from tactile_bayes.inference.densities import Proposal, approximate, flattened, refined
from tactile_bayes.inference.ensembles import SamplerSettings, scatter_walkers
from tactile_bayes.inference.experiment import ContourProblem, Experiment, points_of, predicted_points
from tactile_bayes.inference.record_likelihood.likelihood import events_of
from tactile_bayes.inference.starts.contour_start import Walk
from tactile_bayes.numerics.random_numbers import Seed, child, seed_words, words
from tactile_bayes.numerics.selection import evenly_spread
from tactile_bayes.record import CHANNELS
from tactile_bayes.tasks import FieldsAlone, Workers, keep_outcomes, open_results_store, versions_of
from tactile_bayes.uncertainty.band import contour_band

# As in `calibrate`, with more steps: shape-free posteriors take some thousand.
_SETTINGS = SamplerSettings(ensembles=2, block_steps=25, max_r_hat=1.05, min_ess=200.0, max_steps=2000)
_STARTS = 400  # number of posterior draws of which the start of a joint posterior is made
_LEAST_EFFECTIVE = 4  # least number of effective starting draws per parameter
_RATIO = "ratio"  # beginning of the names of numbers that hold distances over half widths of the band


class JointModel(ContourModel):
    """Prior times likelihood of a record and of further readings at the same drive angles."""

    def __init__(self, model: ContourModel, further: ContourModel) -> None:
        self.__dict__.update(vars(model))
        self._further = further

    def log_likelihood(self, points: Floats, *, pointwise: bool = False) -> Floats:
        loads, reached, discrepancy = self.loads_and_discrepancy(points)
        scale = self.noise_scale(points)
        first, further = (
            likelihood.score(loads, reached, scale, pointwise=pointwise, discrepancy=discrepancy)
            for likelihood in (self.likelihood, self._further.likelihood)
        )
        return first + further


@dataclass(frozen=True, eq=False)
class PosteriorExperiment(FieldsAlone):
    """A record with its posterior, and truths and records drawn from that."""

    experiment: Experiment
    truths: Floats  # draws of the posterior, shape (replicates, d)
    # Predicted readings of each, in the record's units, shape (replicates, samples, 3); NaN where a channel is missing.
    readings: Floats
    starts: Floats  # draws of the posterior from which the start of a joint posterior is made, shape (n, d)
    probability: float  # probability of the intervals that are tested
    seed: Seed
    settings: SamplerSettings

    @cached_property
    def exact_model(self) -> ContourModel:
        """Model of the record with loads to full accuracy."""
        model = replace(self.experiment).model
        model.likelihood.exact = True
        return model

    @property
    def identity(self) -> dict[str, str]:
        """Everything that determines the results, as text, for the results store."""
        return {name: str(value) for name, value in self.experiment.about.items()} | {
            "draws": hashlib.sha256(self.starts.tobytes()).hexdigest(),
            "probability": repr(self.probability),
            "seed": seed_words(self.seed),
            "settings": repr(self.settings),
            **versions_of("tactile-bayes"),
        }


def posterior_calibration(
    posterior: xr.DataTree,
    experiment: Experiment,
    *,
    seed: Seed,
    replicates: int = 100,
    probability: float = 0.95,
    out: str | os.PathLike[str] | None = None,
    workers: int | str | Workers | None = None,
) -> xr.Dataset:
    """Test whether the intervals of a posterior hold here: for truths drawn from it, and records predicted from them.
    Each truth is inferred from the record and the predicted one together: if posterior and sampler are right, its rank
    is uniform (Säilynoja, Schmitt, Bürkner & Vehtari 2025, arXiv:2502.03279). It is no test of the assumptions."""
    task = _task(posterior, experiment, replicates, probability, seed)
    with open_results_store(task.identity, out, REPLICATES) as store:
        kept = keep_outcomes(store, _replicate, task, replicates, workers=workers)
    return _summary(task, kept)


def _task(
    posterior: xr.DataTree, experiment: Experiment, replicates: int, probability: float, seed: Seed
) -> PosteriorExperiment:
    """Return the truths and their records, from the predictions of the posterior."""
    names = experiment.model.names
    points = points_of(posterior, names).reshape(-1, len(names))
    readings = predicted_readings(posterior)
    available = len(readings)
    if available < replicates:
        raise InferenceError(f"the posterior holds {available} predictions of the record, {replicates} are needed")
    chosen = np.random.default_rng([*words(seed), 1]).permutation(available)[:replicates]
    truths, starts = predicted_points(posterior, names)[chosen], points[evenly_spread(len(points), _STARTS)]
    settings = replace(_SETTINGS, walkers=walkers_of(len(names)))
    return PosteriorExperiment(experiment, truths, readings[chosen], starts, probability, seed, settings)


def _replicate(task: tuple[PosteriorExperiment, int]) -> Outcome:
    """Return the outcome of one replicate; an error is an outcome as well."""
    experiment, number = task
    began = time.perf_counter()
    try:
        outcome = _made(experiment, number)
    except Exception as error:
        outcome = lost(error)
    return outcome._replace(numbers={"seconds": time.perf_counter() - began, **outcome.numbers})


def _made(experiment: PosteriorExperiment, number: int) -> Outcome:
    for_start, for_posterior, for_ranks = child(experiment.seed, number).spawn(3)
    model, rng = experiment.experiment.model, np.random.default_rng(for_ranks)
    simulation = _simulation(experiment, number)
    joint = JointModel(model, replace(experiment.experiment, record=simulation.measured).model)
    walk = _walk(joint, experiment, for_start)
    problem = ContourProblem(joint, experiment.experiment.about, np.zeros(len(model.likelihood.measured), dtype=bool))
    result = sampled(problem, seed=for_posterior, settings=experiment.settings, walk=walk, with_prior=False)
    result.draws.refuse_interrupted(f"replicate {number}")
    probability, record = experiment.probability, experiment.experiment.record
    outcome = compared(joint, result, simulation, probability, rng)
    angles = record.drive_angle.values - experiment.experiment.noise.cell.misread(record.direction.values)
    exact = experiment.exact_model.likelihood
    contacts = contact_coverage(joint, result, simulation, exact, angles, angles, probability, rng)
    return outcome._replace(numbers={**outcome.numbers, **contacts, **_ratios(result.tree, simulation, probability)})


def _simulation(experiment: PosteriorExperiment, number: int) -> Simulation:
    """Return a truth and its record."""
    model, record = experiment.exact_model, experiment.experiment.record
    point = experiment.truths[number][None]
    columns = {
        name: ("sample", experiment.readings[number, :, i], record[name].attrs) for i, name in enumerate(CHANNELS)
    }
    truth = {name: float(value[0]) for name, value in model.values(point).items()}
    contour, rig = model.contours(point), model.rig(point)
    events = {name: found[0] for name, found in events_of(model.likelihood, contour, rig).items()}
    return Simulation(record.assign(columns), truth, contour, rig, events)


def _walk(joint: JointModel, experiment: PosteriorExperiment, seed: np.random.SeedSequence) -> Walk:
    """Return the start of the walkers, from draws of the posterior weighted by the further readings."""
    rng, size = np.random.default_rng(seed), len(joint.names)
    coordinates, ends, of_record = joint.coordinates, joint.walked_ends, experiment.experiment.model
    target = in_coordinates(joint.log_probability, coordinates)
    surplus = joint.log_probability(experiment.starts) - of_record.log_probability(experiment.starts)
    if not np.isfinite(surplus).any():
        raise InferenceError("no draw of the posterior is possible together with a record that it predicts")
    fitted = Proposal.fitted(coordinates.of(experiment.starts), flattened(surplus, _LEAST_EFFECTIVE * size), ends)
    proposal = approximate(target, fitted.mean, fitted.root @ fitted.root.T, rng, ends=ends)
    start = scatter_walkers(
        lambda points: joint.log_probability(coordinates.parameters(points)[0]),
        proposal.draw_unbounded,
        parameters=size,
        seed=seed,
        settings=experiment.settings,
    )
    return Walk(start, replace(coordinates, proposal=refined(target, proposal, rng)))


def _ratios(tree: xr.DataTree, simulation: Simulation, probability: float) -> dict[str, float]:
    """Return the distances of the true contour from the band's median, over its half width on that side."""
    numbers: dict[str, float] = {}
    for region, x in grid_points_of(simulation).items():
        band = contour_band(tree, x, probability)
        off = np.asarray(simulation.contour.height(x)) - band["median"].values
        half = np.where(off > 0.0, (band.upper - band["median"]).values, (band["median"] - band.lower).values)
        with np.errstate(divide="ignore", invalid="ignore"):
            ratios = np.abs(off) / half
        numbers |= {f"{_RATIO}_{region}_{k}": float(ratio) for k, ratio in enumerate(ratios)}
    return numbers


def _summary(task: PosteriorExperiment, outcomes: Mapping[int, Outcome]) -> xr.Dataset:
    """Return the result of a calibration, and factors of the band."""
    plain = {
        k: row._replace(numbers={name: v for name, v in row.numbers.items() if not name.startswith(_RATIO)})
        for k, row in outcomes.items()
    }
    found = summary(task.identity, task.probability, plain)
    regions, factors, needed = ["in_gap", "beside"], [], []
    for region in regions:
        start, claim = f"{_RATIO}_{region}_", f"pointwise_{region}"
        ratios = np.array([v for row in outcomes.values() for name, v in row.numbers.items() if name.startswith(start)])
        ratios = ratios[np.isfinite(ratios)]
        factors.append(float(np.quantile(ratios, task.probability)) if ratios.size else np.nan)
        needed.append(int(claim in found.claim and _is_too_narrow(found.sel(claim=claim), found.attrs)))
    return found.assign_coords(region=regions).assign(factor=("region", factors), corrected=("region", needed))


def _is_too_narrow(claim: xr.Dataset, attrs: Mapping[Any, Any]) -> bool:
    """Return True if a band holds less often than stated, at the level of the calibration."""
    share, count, stated = float(claim.coverage), int(claim.coverage_replicates), float(attrs["probability"])
    return share < stated and bool(coverage_p_value(share, count, stated, is_whole=False) <= attrs["level"])
