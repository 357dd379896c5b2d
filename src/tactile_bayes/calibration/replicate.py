"""One replicate: a record simulated, a posterior inferred, and what is to be said of it beside the truth."""

from __future__ import annotations

import time
import traceback
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
import xarray as xr

from tactile_bayes.arrays import Floats
from tactile_bayes.calibration.simulated_experiment import SimulatedExperiment
from tactile_bayes.calibration.simulation import Simulation, simulate
from tactile_bayes.calibration.world import World
from tactile_bayes.diagnostics.record_check import check_record
from tactile_bayes.errors import InferenceError, TactileBayesError
from tactile_bayes.inference.contour import Sampled, sampled
from tactile_bayes.inference.contour_model import ContourModel
from tactile_bayes.inference.found_rig import contact_points
from tactile_bayes.uncertainty.band import contour_band
from tactile_bayes.uncertainty.contact_region import contact_region
from tactile_bayes.uncertainty.implied_contacts import contacts_of

__all__ = ["DRAWS", "LOG_LIKELIHOOD", "Outcome", "Replicate", "make_replicate", "replicate"]

DRAWS = 99
"""Thinned draws among which the truth has a rank, from 0 to this."""

LOG_LIKELIHOOD = "log_likelihood"
"""What is ranked besides parameters."""

_PLACES = 9
"""At which a band is judged in the gap, and on each side of it."""

_CONTACTS = (0.1, 0.5, 0.9)
"""Places in a stroke, between first contact and snap-off, whose contact region is judged."""

_CONTACT_DRAWS = 200
"""That a contact region is made from."""


class Outcome(NamedTuple):
    """Of one replicate; what could not be had is NaN, or missing among the ranks."""

    ranks: Mapping[str, int]
    """Of the truth among the draws: of parameters, of the log-likelihood, and of what follows from them."""
    numbers: Mapping[str, float]
    """Shares, widths, scores and times by name."""
    message: str
    """How sampling ended, or the error over which the replicate was lost."""
    traceback: str = ""
    """Of that error; empty where there was none."""

    @property
    def is_lost(self) -> bool:
        """Whether an error ended the replicate before the truth had its ranks."""
        return not self.ranks


class Replicate(NamedTuple):
    """One replicate, with all that was made on the way, as far as it came.

    Attributes
    ----------
    number : int
    outcome : Outcome
        What a calibration keeps of it: ``ranks``, ``numbers``, ``message`` and ``traceback``.
    truth : mapping of str to float
        Parameters that were drawn, by name; empty if none were.
    measured : xr.Dataset, optional
        The record.
    posterior : xr.DataTree, optional
        What was inferred from it.
    """

    number: int
    outcome: Outcome
    truth: Mapping[str, float]
    measured: xr.Dataset | None
    posterior: xr.DataTree | None


def replicate(task: tuple[SimulatedExperiment, int]) -> Outcome:
    """Outcome of one replicate of an experiment; an error is an outcome as well."""
    return make_replicate(*task).outcome


def make_replicate(experiment: SimulatedExperiment, number: int, *, throw: bool = False) -> Replicate:
    """Simulate record `number` of an experiment, infer from it, and compare.

    Parameters
    ----------
    experiment : SimulatedExperiment
    number : int
    throw : bool
        Whether an error is raised; else it is the outcome. An interrupt always is.
    """
    simulated, inferred, picked = np.random.SeedSequence(experiment.seed, spawn_key=(number,)).spawn(3)
    simulation: Simulation | None = None
    result: Sampled | None = None
    began = time.perf_counter()
    try:
        simulation = simulate(experiment, np.random.default_rng(simulated))
        began = time.perf_counter()
        problem = experiment.problem_of(simulation.measured)
        result = sampled(problem, seed=inferred, settings=experiment.settings, with_prior=False)
        if not result.draws.converged and experiment.again is not None:
            result = sampled(problem, seed=inferred, settings=experiment.again, with_prior=False)
        seconds = time.perf_counter() - began
        result.draws.refuse_interrupted(f"replicate {number}")
        outcome = _compared(experiment, simulation, problem.model, result, np.random.default_rng(picked))
        outcome = outcome._replace(numbers={"seconds": seconds, **outcome.numbers})
    except Exception as error:
        if throw:
            raise
        numbers = {"seconds": time.perf_counter() - began}
        outcome = Outcome({}, numbers, f"{type(error).__name__}: {error}", traceback.format_exc())
    return Replicate(
        number,
        outcome,
        {} if simulation is None else simulation.truth,
        None if simulation is None else simulation.measured,
        None if result is None else result.tree,
    )


def _compared(
    experiment: SimulatedExperiment,
    simulation: Simulation,
    model: ContourModel,
    result: Sampled,
    rng: np.random.Generator,
) -> Outcome:
    """A posterior beside the truth."""
    tree, draws = result.tree, result.draws
    numbers = {
        "converged": float(draws.converged),
        "effective_draws": float(np.min([draws.ess_bulk, draws.ess_tail])),
        "evaluations": float(draws.evaluations),
    }
    ranks = _ranks(model, draws.samples, simulation.truth, experiment.is_of_family, rng)
    ranks |= _ranks_of_events(tree, simulation, rng)
    numbers |= _bands(tree, simulation, experiment.probability)
    numbers |= _snap_offs(tree, simulation, experiment.probability)
    numbers |= _contacts(model, draws.samples, simulation, experiment, rng)
    numbers |= _checks(tree, simulation, experiment)
    return Outcome(ranks, numbers, draws.message)


def _ranks(
    model: ContourModel,
    samples: Floats,
    truth: Mapping[str, float],
    is_of_family: bool,
    rng: np.random.Generator,
) -> dict[str, int]:
    """Among draws picked at random, as neighbours in a walker's history are alike.

    Of a contour that is none of the family there are no true parameters.
    """
    draws = samples.reshape(-1, samples.shape[-1])
    picked = draws[rng.choice(len(draws), min(DRAWS, len(draws)), replace=False)]
    ranked = model.names if is_of_family else model.names[len(model.family.parameters) :]
    ranks = {name: _rank(picked[:, model.names.index(name)], truth[name], rng) for name in ranked}
    if not is_of_family:
        return ranks
    point = np.array([truth[name] for name in model.names])
    every = np.vstack([point, picked])
    loads, reached = model.loads_with_errors(every)
    values = model.likelihood.score(loads, reached, model.noise_scale(every))
    return ranks | {LOG_LIKELIHOOD: _rank(values[1:], values[0], rng)}


def _ranks_of_events(tree: xr.DataTree, simulation: Simulation, rng: np.random.Generator) -> dict[str, int]:
    """Of the snap-off's drive angle in each stroke."""
    events = tree["events"].to_dataset()
    angles = events.snap_off_drive_angle.stack(all=("chain", "draw")).values  # (stroke, draws)
    picked = rng.choice(angles.shape[1], min(DRAWS, angles.shape[1]), replace=False)
    names = _stroke_names(events)
    truths = simulation.events["snap_off_drive_angle"]
    return {
        f"snap_off_{name}": _rank(of_stroke[picked], truth, rng)
        for name, of_stroke, truth in zip(names, angles, truths, strict=True)
    }


def _stroke_names(events: xr.Dataset) -> list[str]:
    strokes = [str(stroke) for stroke in events.stroke.values]
    counted = dict.fromkeys(strokes, 0)
    names = []
    for stroke in strokes:
        counted[stroke] += 1
        names.append(stroke if strokes.count(stroke) == 1 else f"{stroke}_{counted[stroke]}")
    return names


def _rank(draws: Floats, truth: float, rng: np.random.Generator) -> int:
    """Draws below the truth, and of those that equal it, as at the end of a record, a random number.

    Where there are fewer than `DRAWS` the rank is stretched to as many.
    """
    below, equal = int(np.sum(draws < truth)), int(np.sum(draws == truth))
    rank = below + int(rng.integers(equal + 1))
    return rank if draws.size == DRAWS else int((rank + rng.random()) * (DRAWS + 1) / (draws.size + 1))


def _bands(tree: xr.DataTree, simulation: Simulation, probability: float) -> dict[str, float]:
    numbers: dict[str, float] = {}
    for region, x in _places(simulation).items():
        height = np.asarray(simulation.contour.height(x))
        if not x.size:
            continue
        for simultaneous in (False, True):
            band = contour_band(tree, x, probability, simultaneous)
            inside = (band.lower.values <= height) & (height <= band.upper.values)
            known = np.isfinite(band.lower.values)
            if simultaneous:
                numbers[f"simultaneous_{region}"] = float(inside.all()) if known.all() else np.nan
                continue
            off = band["median"].values - height
            numbers |= {
                f"pointwise_{region}": float(inside[known].mean()) if known.any() else np.nan,
                f"width_{region}": float(np.mean(band.upper.values - band.lower.values)),
                f"bias_{region}": float(np.mean(off)),
                f"off_{region}": float(np.max(np.abs(off))),
            }
    return numbers


def _places(simulation: Simulation) -> dict[str, Floats]:
    """Values of x beside the gap, from last to first contact, and in it, between the last contacts of both directions.

    None are in it where the sweeps leave no gap, or are of one direction.
    """
    ends, begins = simulation.events["snap_off_contact_x"], simulation.events["first_contact_x"]
    is_forward = begins > ends
    beside = [np.linspace(end, begin, _PLACES + 1)[1:] for end, begin in zip(ends, begins, strict=True)]
    places = {"beside": np.concatenate(beside)}
    if is_forward.any() and not is_forward.all():
        left, right = ends[~is_forward].max(), ends[is_forward].min()
        if left < right:
            places["in_gap"] = np.linspace(left, right, _PLACES + 2)[1:-1]
    return places


def _snap_offs(tree: xr.DataTree, simulation: Simulation, probability: float) -> dict[str, float]:
    """Share of strokes whose snap-off lies in the central interval of the predicted one."""
    angles = tree["events"].to_dataset().snap_off_drive_angle
    low, high = np.quantile(angles.values, [0.5 - 0.5 * probability, 0.5 + 0.5 * probability], axis=(0, 1))
    true = simulation.events["snap_off_drive_angle"]
    return {"snap_off": float(np.mean((low <= true) & (true <= high)))}


def _contacts(
    model: ContourModel,
    samples: Floats,
    simulation: Simulation,
    experiment: SimulatedExperiment,
    rng: np.random.Generator,
) -> dict[str, float]:
    """Share of the contacts looked at that lie in their region."""
    likelihood = experiment.model.likelihood
    known = experiment.load_cell.misread(experiment.assumed.record.direction.values)
    read = experiment.assumed.record.drive_angle.values - known
    true = contacts_of(likelihood, simulation.contour, simulation.rig, read)
    chosen: list[int] = []
    for stroke in likelihood.strokes:
        touching = stroke.samples[np.isfinite(true["contact_x"][0, stroke.samples])]
        if touching.size:
            chosen += [int(touching[round(share * (touching.size - 1))]) for share in _CONTACTS]
    if not chosen or not experiment.assumed.events:  # without events the record that is inferred from has fewer samples
        return {}
    draws = samples.reshape(-1, samples.shape[-1])
    points = draws[rng.choice(len(draws), min(_CONTACT_DRAWS, len(draws)), replace=False)]
    asked = np.full(read.size, np.nan)
    asked[chosen] = (simulation.measured.drive_angle.values - known)[chosen]
    found = contacts_of(model.likelihood, model.contours(points), model.rig(points), asked, exact=False)
    dims = ("chain", "draw", "sample")
    columns = {name: (dims, found[name][None][..., chosen]) for name in ("contact_x", "contact_y")}
    implied = xr.Dataset(columns, coords={"sample": chosen})
    held = []
    for sample in chosen:
        try:
            region = contact_region(implied, sample, experiment.probability)
        except InferenceError:  # hardly any contour of the posterior is touched there
            held.append(False)
            continue
        held.append(bool(region.contains(true["contact_x"][0, sample], true["contact_y"][0, sample])))
    return {"contact_region": float(np.mean(held))}


def _checks(tree: xr.DataTree, simulation: Simulation, experiment: SimulatedExperiment) -> dict[str, float]:
    """What the checks say that a user sees: of the posterior's predictions, and of the loads of single samples."""
    numbers = {"check_p_value": np.nan, "check_passed": np.nan, "misfit_probability": np.nan, "axial_score": np.nan}
    try:
        check = check_record(tree)
        numbers |= {"check_p_value": float(check.overall_p_value), "check_passed": float(check.attrs["passed"])}
    except InferenceError:  # too few predictions of a run that was cut short
        pass
    if experiment.world == World():  # nothing to be noticed, and a tenth of the time
        return numbers
    try:
        contacts = contact_points(simulation.measured, experiment.load_cell, tree)
    except TactileBayesError:  # a channel without noise
        return numbers
    if contacts is None:
        return numbers
    return numbers | {name: float(contacts.attrs[name]) for name in ("misfit_probability", "axial_score")}
