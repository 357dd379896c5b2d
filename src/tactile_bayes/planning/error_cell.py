"""One cell of an error map: an object at a distance, swept once and measured repeatedly."""

from __future__ import annotations

import math
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
import xarray as xr

from tactile_bayes.arrays import Flags, Floats
from tactile_bayes.contours import Contour
from tactile_bayes.errors import ContourError, InferenceError, ReachError
from tactile_bayes.inference.contour import sampled
from tactile_bayes.inference.ensembles import SamplerSettings
from tactile_bayes.inference.experiment import contour_problem
from tactile_bayes.numerics.random_numbers import Seed, child
from tactile_bayes.planning.amplification import METHODS, along_and_across, contact_errors
from tactile_bayes.planning.expected_band import stretches
from tactile_bayes.planning.information import information
from tactile_bayes.planning.plan import Plan
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
    gap_width = sum(stretch.end - stretch.begin for stretch in stretches(scan) if stretch.name == "gap")
    expected = information(plan, probability=study.probability)
    widths = {f"expected_{kind}_width": float(expected[f"{kind}_width"]) for kind in ("touched", "gap")}
    seeds = child(study.seed, number).spawn(study.replicates)
    rig = replace(plan.rig, load_cell=plan.cell)
    measured = [rig.measure(scan.record, rng=seed) for seed in seeds]
    some = measured[: study.posteriors.get(number, 0)]
    inferred = _inferred(plan, some, study.probability, child(study.seed, number, 1))
    return CellOutcome({"gap_width": gap_width, **widths, **_reconstructed(plan, measured), **inferred}, "ok")


def _reconstructed(plan: Plan, measured: list[xr.Dataset]) -> dict[str, float]:
    """Return root mean square errors of contacts with the status "ok" over all replicates, and those of first order."""
    truth = plan.scan.record
    loaded = np.flatnonzero(truth.truth_contact_phase.values != "none")
    truth, grown = truth.isel(sample=loaded), contact_errors(plan)
    numbers: dict[str, float] = {}
    for method in METHODS:
        found = [plan.reconstruct(one, method).isel(sample=loaded) for one in measured]
        x, y = (
            np.stack([one[name].values for one in found]) - truth[f"truth_{name}"].values
            for name in ("contact_x", "contact_y")
        )
        ok = np.stack([one.status.values == "ok" for one in found])
        errors = zip(("along", "across"), along_and_across(x, y, truth.truth_slope_angle.values), strict=True)
        for name, error in errors:
            sd = np.broadcast_to(grown[f"sd_{name}"].sel(reconstruction=method).values, ok.shape)
            numbers[f"{method}_rms_{name}"] = math.sqrt(_mean(error[ok] ** 2))
            numbers[f"{method}_first_order_{name}"] = math.sqrt(_mean(sd[ok] ** 2))
        has_answer = ~np.isnan(x)
        sizes = np.hypot(x, y)[has_answer]
        numbers[f"{method}_median_error"] = float(np.median(sizes)) if sizes.size else math.nan
        numbers[f"{method}_without_answer"] = _mean(~has_answer)
        numbers[f"{method}_ok"] = _mean(ok)
    return numbers


def _inferred(
    plan: Plan, measured: list[xr.Dataset], probability: float, seed: np.random.SeedSequence
) -> dict[str, float]:
    """Return mean widths of posterior bands, and the share of grid points at which they contain the contour."""
    widths: dict[str, list[float]] = {"touched": [], "gap": []}
    held: dict[str, list[float]] = {"touched": [], "gap": []}
    failed = []
    for one, own in zip(measured, seed.spawn(len(measured)), strict=True):
        try:
            posterior = sampled(
                contour_problem(replace(plan.experiment, record=one)),
                settings=replace(_SETTINGS, walkers=max(_FEWEST_WALKERS, 2 * len(plan.model.names))),
                seed=own,
            ).tree
        except InferenceError:
            failed.append(True)
            continue
        failed.append(False)
        for stretch in stretches(plan.scan):
            band = contour_band(posterior, stretch.x, probability)
            height = np.asarray(plan.contour.height(stretch.x))
            widths[stretch.name].append(float(np.mean(band.upper.values - band.lower.values)))
            held[stretch.name].append(float(np.mean((band.lower.values <= height) & (height <= band.upper.values))))
    numbers = {f"posterior_{name}_width": _mean(of) for name, of in widths.items()}
    numbers |= {f"posterior_{name}_coverage": _mean(of) for name, of in held.items()}
    return {**numbers, "posterior_failed": _mean(failed)}


def _mean(values: Floats | Flags | Sequence[float]) -> float:
    """Return the mean of values; NaN if there are none."""
    return float(np.mean(values)) if np.size(values) else math.nan
