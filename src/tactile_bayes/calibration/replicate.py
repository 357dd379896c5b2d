"""One replicate: a simulated record, the posterior inferred from it, and their comparison with the truth."""

from __future__ import annotations

import math
import time
import traceback
from collections.abc import Mapping
from contextlib import suppress
from typing import Any, NamedTuple

import numpy as np
import xarray as xr

from tactile_bayes.arrays import Floats
from tactile_bayes.calibration.simulated_experiment import SimulatedExperiment
from tactile_bayes.calibration.simulation import Simulation, simulate
from tactile_bayes.diagnostics.predictive_check import predictive_check
from tactile_bayes.errors import CalibrationError, InferenceError, TactileBayesError
from tactile_bayes.inference.contour import Sampled, sampled
from tactile_bayes.inference.contour_model import ContourModel
from tactile_bayes.inference.experiment import contact_points
from tactile_bayes.inference.record_likelihood.likelihood import RecordLikelihood
from tactile_bayes.numerics.random_numbers import child
from tactile_bayes.tasks import Kind
from tactile_bayes.uncertainty.band import contour_band
from tactile_bayes.uncertainty.contact_region import contact_region
from tactile_bayes.uncertainty.implied_contacts import contacts_of

DRAWS = 99  # number of draws among which the truth has a rank, from 0 to this number
LOG_LIKELIHOOD = "log_likelihood"  # name of the log-likelihood among the ranked quantities
_GRID_POINTS = 9  # number of grid points of x at which a band is judged, in the gap and on each side of it
# Samples whose contact region is judged, as shares of the way from first contact to snap-off in a segment.
_CONTACTS = (0.1, 0.5, 0.9)
_CONTACT_DRAWS = 200  # number of draws from which a contact region is computed
_FEWEST_WALKERS, _MORE_WALKERS = 20, 2  # least number of walkers, and their excess over twice the parameters


class Outcome(NamedTuple):
    """Outcome of one replicate; missing numbers are NaN, missing ranks are left out."""

    # Ranks of the truth among the draws: of parameters, of the log-likelihood, and of drive angles of snap-off.
    ranks: Mapping[str, int]
    numbers: Mapping[str, float]  # shares, widths, scores and times by name
    message: str  # message of the sampler, or the error by which the replicate was lost
    traceback: str = ""  # traceback of that error; empty if there was none

    @property
    def is_lost(self) -> bool:
        """True if an error ended the replicate before the ranks were computed."""
        return not self.ranks


def _encode(outcome: Outcome) -> dict[str, Any]:
    row = {"ranks": dict(outcome.ranks), "numbers": outcome.numbers, "message": outcome.message}
    return row | ({"traceback": outcome.traceback} if outcome.traceback else {})


def _decode(row: dict[str, Any]) -> Outcome:
    return Outcome(
        {name: int(rank) for name, rank in row["ranks"].items()},
        {name: math.nan if v is None else float(v) for name, v in row["numbers"].items()},
        str(row["message"]),
        str(row.get("traceback", "")),  # older stores have none
    )


REPLICATES = Kind("replicates", CalibrationError, _encode, _decode)


def lost(error: Exception) -> Outcome:
    """Return the outcome of a replicate that an error, which is being handled, ended."""
    return Outcome({}, {}, f"{type(error).__name__}: {error}", traceback.format_exc())


def walkers_of(parameters: int) -> int:
    """Return the number of walkers of an ensemble; few suffice for 200 draws."""
    return max(_FEWEST_WALKERS, 2 * parameters + _MORE_WALKERS)


class Replicate(NamedTuple):
    """One replicate with its intermediate results, as far as they were computed."""

    number: int  # number of the replicate, from 0 up
    outcome: Outcome  # entries of the results store: ranks, numbers, message and traceback
    truth: Mapping[str, float]  # parameters that were drawn, by name, in the record's units; empty if none were
    measured: xr.Dataset | None  # the record
    posterior: xr.DataTree | None  # its posterior


def replicate(task: tuple[SimulatedExperiment, int]) -> Outcome:
    """Return the outcome of one replicate of an experiment; an error is an outcome as well."""
    return make_replicate(*task).outcome


def make_replicate(experiment: SimulatedExperiment, number: int, *, throw: bool = False) -> Replicate:
    """Simulate record `number` of an experiment, infer from it, and compare."""
    for_record, for_posterior, for_ranks = child(experiment.seed, number).spawn(3)
    simulation: Simulation | None = None
    result: Sampled | None = None
    began = time.perf_counter()
    try:
        simulation = simulate(experiment, np.random.default_rng(for_record))
        began = time.perf_counter()
        problem = experiment.problem_of(simulation.measured)
        result = sampled(problem, seed=for_posterior, settings=experiment.settings, with_prior=False)
        if not result.draws.converged and experiment.again is not None:
            result = sampled(problem, seed=for_posterior, settings=experiment.again, with_prior=False)
        seconds = time.perf_counter() - began
        result.draws.refuse_interrupted(f"replicate {number}")
        outcome = _compared(experiment, simulation, problem.model, result, np.random.default_rng(for_ranks))
    except Exception as error:
        if throw:
            raise
        outcome, seconds = lost(error), time.perf_counter() - began
    return Replicate(
        number,
        outcome._replace(numbers={"seconds": seconds, **outcome.numbers}),
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
    """Compare a posterior with the truth."""
    assumed, probability = experiment.assumed, experiment.probability
    outcome = compared(model, result, simulation, probability, rng, is_of_family=experiment.is_of_family)
    numbers = dict(outcome.numbers)
    if assumed.events:  # without events, inference uses fewer samples
        direction, exact = assumed.record.direction.values, experiment.model.likelihood
        true_angles = assumed.record.drive_angle.values - experiment.simulated.noise.cell.misread(direction)
        angles = simulation.measured.drive_angle.values - assumed.noise.cell.misread(direction)
        numbers |= contact_coverage(model, result, simulation, exact, true_angles, angles, probability, rng)
    return outcome._replace(numbers=numbers | _checks(result.tree, simulation, experiment))


def compared(
    model: ContourModel,
    result: Sampled,
    simulation: Simulation,
    probability: float,
    rng: np.random.Generator,
    *,
    is_of_family: bool = True,
) -> Outcome:
    """Compare a posterior with a truth: ranks, bands in the gap and beside it, angles of snap-off."""
    draws = result.draws
    numbers = {
        "converged": float(draws.converged),
        "effective_draws": float(np.min([draws.ess_bulk, draws.ess_tail])),
        "evaluations": float(draws.evaluations),
    }
    ranks = _ranks(model, result, simulation.truth, is_of_family, rng)
    ranks |= _ranks_of_events(result.tree, simulation, rng)
    numbers |= _bands(result.tree, simulation, probability)
    numbers |= _snap_offs(result.tree, simulation, probability)
    return Outcome(ranks, numbers, draws.message)


def _ranks(
    model: ContourModel, result: Sampled, truth: Mapping[str, float], is_of_family: bool, rng: np.random.Generator
) -> dict[str, int]:
    """Rank the true parameters and their log-likelihood among draws picked at random: neighbours are correlated.

    What has no true value has no rank, nor has one at an end of its prior, beyond which there are no draws.
    """
    picked = _picked(_points(result), DRAWS, rng)
    first = 0 if is_of_family else len(model.family.parameters)
    point = np.array([truth.get(name, np.nan) for name in model.names])
    ends = model.ends
    inside = np.flatnonzero((point > ends.low) & (point < ends.high))
    ranks = {model.names[i]: _rank(picked[:, i], float(point[i]), rng) for i in inside[inside >= first]}
    if first or np.isnan(point).any():
        return ranks
    values = model.log_likelihood(np.vstack([point, picked]))
    return ranks | {LOG_LIKELIHOOD: _rank(values[1:], values[0], rng)}


def _ranks_of_events(tree: xr.DataTree, simulation: Simulation, rng: np.random.Generator) -> dict[str, int]:
    """Rank the true drive angle of snap-off in each sweep segment among the draws."""
    events = tree["events"].to_dataset()
    angles = _picked(_travels(events).stack(all=("chain", "draw")).values.T, DRAWS, rng)  # (draws, segments)
    of_segments = zip(_segment_names(events), angles.T, _travels(simulation.events), strict=True)
    return {f"snap_off_{name}": _rank(draws, truth, rng) for name, draws, truth in of_segments}


def _points(result: Sampled) -> Floats:
    """Return the draws of all walkers, shape (n, d)."""
    return result.draws.samples.reshape(-1, result.draws.samples.shape[-1])


def _picked(draws: Floats, count: int, rng: np.random.Generator) -> Floats:
    """Return draws picked at random, all of them if they are fewer."""
    return draws[rng.choice(len(draws), min(count, len(draws)), replace=False)]


def _travels(events: Any) -> Any:
    """Return how far along the drive contact ends, in a data set or a dictionary of events."""
    return events["snap_off_travel" if "snap_off_travel" in events else "snap_off_drive_angle"]


def _segment_names(events: xr.Dataset) -> list[str]:
    """Return a distinct name for each sweep segment: its direction, with a number if there are several."""
    directions = [str(direction) for direction in events.segment.values]
    return [
        direction if directions.count(direction) == 1 else f"{direction}_{directions[: k + 1].count(direction)}"
        for k, direction in enumerate(directions)
    ]


def _rank(draws: Floats, truth: float, rng: np.random.Generator) -> int:
    """Return the number of draws below the truth, and a random share of those that equal it (ends of a record).

    With fewer than `DRAWS` draws the rank is scaled to that number.
    """
    below, equal = int(np.sum(draws < truth)), int(np.sum(draws == truth))
    rank = below + int(rng.integers(equal + 1))
    return rank if draws.size == DRAWS else int((rank + rng.random()) * (DRAWS + 1) / (draws.size + 1))


def _bands(tree: xr.DataTree, simulation: Simulation, probability: float) -> dict[str, float]:
    """Compare pointwise and simultaneous bands with the true contour."""
    numbers: dict[str, float] = {}
    for region, x in grid_points_of(simulation).items():
        height = np.asarray(simulation.contour.height(x))
        band, whole = (contour_band(tree, x, probability, simultaneous) for simultaneous in (False, True))
        inside, all_inside = ((each.lower.values <= height) & (height <= each.upper.values) for each in (band, whole))
        known, all_known = (np.isfinite(each.lower.values) for each in (band, whole))
        off = band["median"].values - height
        numbers |= {
            f"pointwise_{region}": float(inside[known].mean()) if known.any() else np.nan,
            f"width_{region}": float(np.mean(band.upper.values - band.lower.values)),
            f"bias_{region}": float(np.mean(off)),
            f"off_{region}": float(np.max(np.abs(off))),
            f"simultaneous_{region}": float(all_inside.all()) if all_known.all() else np.nan,
        }
    return numbers


def grid_points_of(simulation: Simulation) -> dict[str, Floats]:
    """Return values of x beside the gap, from last to first contact, and in it, between the last contacts.

    The gap has none if both directions overlap, or the record has only one.
    """
    ends, begins = simulation.events["snap_off_contact_x"], simulation.events["first_contact_x"]
    is_forward = begins > ends
    beside = [np.linspace(end, begin, _GRID_POINTS + 1)[1:] for end, begin in zip(ends, begins, strict=True)]
    grid = {"beside": np.concatenate(beside)}
    if is_forward.any() and not is_forward.all():
        left, right = ends[~is_forward].max(), ends[is_forward].min()
        if left < right:
            grid["in_gap"] = np.linspace(left, right, _GRID_POINTS + 2)[1:-1]
    return grid


def _snap_offs(tree: xr.DataTree, simulation: Simulation, probability: float) -> dict[str, float]:
    """Return the share of segments whose snap-off lies in the central interval of the predicted one."""
    angles = _travels(tree["events"].to_dataset())
    low, high = np.quantile(angles.values, [0.5 - 0.5 * probability, 0.5 + 0.5 * probability], axis=(0, 1))
    true = _travels(simulation.events)
    return {"snap_off": float(np.mean((low <= true) & (true <= high)))}


def contact_coverage(
    model: ContourModel,
    result: Sampled,
    simulation: Simulation,
    likelihood: RecordLikelihood,
    true_angles: Floats,
    angles: Floats,
    probability: float,
    rng: np.random.Generator,
) -> dict[str, float]:
    """Return the share of the chosen contacts that lie in their region."""
    true = contacts_of(likelihood, simulation.contour, simulation.rig, true_angles)
    chosen: list[int] = []
    for samples_of_segment in likelihood.segments.samples:
        in_contact = samples_of_segment[np.isfinite(true["contact_x"][0, samples_of_segment])]
        if in_contact.size:
            chosen += [int(in_contact[round(share * (in_contact.size - 1))]) for share in _CONTACTS]
    if not chosen:
        return {}
    points = _picked(_points(result), _CONTACT_DRAWS, rng)
    asked = np.full(angles.size, np.nan)
    asked[chosen] = angles[chosen]
    found = contacts_of(model.likelihood, model.contours(points), model.rig(points), asked, exact=False)
    dims = ("chain", "draw", "sample")
    columns = {name: (dims, found[name][None][..., chosen]) for name in ("contact_x", "contact_y")}
    implied = xr.Dataset(columns, coords={"sample": chosen})
    held = []
    for sample in chosen:
        try:
            region = contact_region(implied, sample, probability)
        except InferenceError:  # too few contours of the posterior are touched there
            held.append(False)
            continue
        held.append(bool(region.contains(true["contact_x"][0, sample], true["contact_y"][0, sample])))
    return {"contact_region": float(np.mean(held))}


def _checks(tree: xr.DataTree, simulation: Simulation, experiment: SimulatedExperiment) -> dict[str, float]:
    """Apply the checks that users see: of the posterior's predictions, and of the loads of single samples."""
    of_samples = ("misfit_probability", "axial_score")
    numbers = dict.fromkeys(("check_p_value", "check_passed", *of_samples), np.nan)
    with suppress(InferenceError):  # a run that was cut short has too few predictions
        check = predictive_check(tree)
        if not check.attrs["not_checked"]:
            numbers |= {"check_p_value": float(check.overall_p_value), "check_passed": float(check.attrs["passed"])}
    if experiment.is_as_assumed:  # nothing to detect; this saves a tenth of the time
        return numbers
    contacts = None
    with suppress(TactileBayesError):  # a channel without noise
        contacts = contact_points(simulation.measured, tree, experiment.assumed.noise.cell)
    if contacts is None:
        return numbers
    return numbers | {name: float(contacts.attrs[name]) for name in of_samples}
