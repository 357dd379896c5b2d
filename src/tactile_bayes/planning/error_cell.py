"""One cell of an error map: an object at a distance, swept once and measured repeatedly."""

from __future__ import annotations

import math
import warnings
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
import xarray as xr

from tactile_bayes.arrays import Floats
from tactile_bayes.contours import Contour
from tactile_bayes.errors import ContourError, InferenceError, ReachError
from tactile_bayes.inference.contour import sampled
from tactile_bayes.inference.contour_problem import contour_problem
from tactile_bayes.inference.ensembles import SamplerSettings
from tactile_bayes.numerics.random_numbers import Seed, child
from tactile_bayes.planning.amplification import METHODS, amplification
from tactile_bayes.planning.expected_band import band_factor, deviation_of_heights, height_slopes, stretches
from tactile_bayes.planning.plan import Plan
from tactile_bayes.planning.record_information import prior_precision, record_information
from tactile_bayes.sweep import Rotation
from tactile_bayes.uncertainty.band import contour_band

# Settings of posteriors, which only need to yield a band.
_SETTINGS = SamplerSettings(ensembles=2, block_steps=25, max_r_hat=1.05, min_ess=200.0, max_steps=1000)
_FEWEST_WALKERS = 24


@dataclass(frozen=True)
class MapCell:
    """Coordinates of a cell in the map."""

    contour: str  # name of the contour
    distance: float  # height of the contour's lowest point above the pivot [length]
    noise_factor: float  # factor on the noise of the load cell


@dataclass(frozen=True, eq=False)
class MapTask:
    """The whole map: inputs of all cells."""

    contours: Mapping[str, Contour]
    cells: tuple[MapCell, ...]
    plan: Plan  # plan of the sweeps, for any of the contours
    drive: Rotation  # its drive, with a pivot at the height 0
    replicates: int
    posteriors: Mapping[int, int]  # number of replicates for which posteriors are inferred, by index of the cell
    probability: float
    seed: Seed


class CellOutcome(NamedTuple):
    """Outcome of a cell."""

    numbers: Mapping[str, float]  # results by name
    message: str  # "ok", or the error by which the cell is empty


def error_cell(task: tuple[MapTask, int]) -> CellOutcome:
    """Return the outcome of one cell: measure and reconstruct repeatedly, and infer some of the records."""
    study, number = task
    cell = study.cells[number]
    contour = study.contours[cell.contour]
    pivot = study.drive.base[0], float(contour.point(0.0)[1]) - cell.distance
    plan = replace(study.plan, contour=contour, drive=replace(study.drive, base=pivot))
    plan = plan.with_noise(cell.noise_factor)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            scan = plan.scan
    except (ReachError, ContourError) as error:
        return CellOutcome({}, f"{type(error).__name__}: {error}")
    numbers: dict[str, float] = {}
    numbers["gap_width"] = sum(stretch.end - stretch.begin for stretch in stretches(scan) if stretch.name == "gap")
    numbers |= _expected(plan, study.probability)
    seeds = child(study.seed, number).spawn(study.replicates)
    rig = replace(plan.rig, load_cell=plan.cell)
    measured = [rig.measure(scan.record, rng=seed) for seed in seeds]
    numbers |= _reconstructed(plan, measured)
    numbers |= _inferred(
        plan, measured[: study.posteriors.get(number, 0)], study.probability, child(study.seed, number, 1)
    )
    return CellOutcome(numbers, "ok")


def _expected(plan: Plan, probability: float) -> dict[str, float]:
    """Return the mean widths of the expected bands."""
    model, point = plan.model, plan.point
    precision = record_information(model, point).matrix + prior_precision(model)
    wide = band_factor(probability)
    widths: dict[str, list[Floats]] = {"touched": [], "gap": []}
    for stretch in stretches(plan.scan):
        widths[stretch.name].append(deviation_of_heights(height_slopes(model, point, stretch.x), precision))
    return {
        f"expected_{name}_width": wide * float(np.concatenate(found).mean()) if found else math.nan
        for name, found in widths.items()
    }


def _reconstructed(plan: Plan, measured: list[xr.Dataset]) -> dict[str, float]:
    """Return root mean square errors of contacts with the status "ok" over all replicates, and those of first order."""
    record = plan.scan.record
    loaded = record.truth_contact_phase.values != "none"
    grown = amplification(plan.at_angles(record.drive_angle.values))
    first = {
        name: {
            (int(sweep), float(angle)): value
            for sweep, angle, value in zip(grown.sweep.values, grown.drive_angle.values, values.T, strict=True)
        }
        for name, values in (("along", grown.sd_along.values), ("across", grown.sd_across.values))
    }
    keys = list(zip(record.sweep.values[loaded].tolist(), record.drive_angle.values[loaded].tolist(), strict=True))
    slope = record.truth_slope_angle.values[loaded]
    cos, sin = np.cos(slope), np.sin(slope)
    numbers: dict[str, float] = {}
    for m, method in enumerate(METHODS):
        sd = {name: np.array([of[key][m] for key in keys]) for name, of in first.items()}
        squares, counts = {"along": 0.0, "across": 0.0}, 0
        predicted = {"along": 0.0, "across": 0.0}
        unanswered, every = 0, 0
        sizes: list[Floats] = []
        for one in measured:
            found = plan.reconstruct(one, method)
            x = found.contact_x.values[loaded] - record.truth_contact_x.values[loaded]
            y = found.contact_y.values[loaded] - record.truth_contact_y.values[loaded]
            ok = found.status.values[loaded] == "ok"
            errors = {"along": cos * x + sin * y, "across": cos * y - sin * x}
            for name, error in errors.items():
                squares[name] += float(np.sum(error[ok] ** 2))
                predicted[name] += float(np.sum(sd[name][ok] ** 2))
            counts += int(ok.sum())
            missing = np.isnan(x)
            unanswered, every = unanswered + int(missing.sum()), every + missing.size
            sizes.append(np.hypot(x, y)[~missing])
        for name in squares:
            numbers[f"{method}_rms_{name}"] = math.sqrt(squares[name] / counts) if counts else math.nan
            numbers[f"{method}_first_order_{name}"] = math.sqrt(predicted[name] / counts) if counts else math.nan
        joined = np.concatenate(sizes)
        numbers[f"{method}_median_error"] = float(np.median(joined)) if joined.size else math.nan
        numbers[f"{method}_without_answer"] = unanswered / every if every else math.nan
        numbers[f"{method}_ok"] = counts / every if every else math.nan
    return numbers


def _inferred(
    plan: Plan, measured: list[xr.Dataset], probability: float, seed: np.random.SeedSequence
) -> dict[str, float]:
    """Return mean widths of posterior bands, and the share of grid points at which they contain the contour."""
    numbers: dict[str, float] = {}
    widths: dict[str, list[float]] = {"touched": [], "gap": []}
    held: dict[str, list[float]] = {"touched": [], "gap": []}
    failed = 0
    for one, own in zip(measured, seed.spawn(len(measured)), strict=True):
        try:
            posterior = sampled(
                contour_problem(replace(plan.experiment, record=one)),
                settings=replace(_SETTINGS, walkers=max(_FEWEST_WALKERS, 2 * len(plan.model.names))),
                seed=own,
            ).tree
        except InferenceError:
            failed += 1
            continue
        for stretch in stretches(plan.scan):
            band = contour_band(posterior, stretch.x, probability)
            height = np.asarray(plan.contour.height(stretch.x))
            widths[stretch.name].append(float(np.mean(band.upper.values - band.lower.values)))
            held[stretch.name].append(float(np.mean((band.lower.values <= height) & (height <= band.upper.values))))
    for name in widths:
        numbers[f"posterior_{name}_width"] = float(np.mean(widths[name])) if widths[name] else math.nan
        numbers[f"posterior_{name}_coverage"] = float(np.mean(held[name])) if held[name] else math.nan
    if measured:
        numbers["posterior_failed"] = failed / len(measured)
    return numbers
