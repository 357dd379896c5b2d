"""Error map: errors of contacts and bands over noise level, distance and shape, by Monte Carlo."""

from __future__ import annotations

import json
import math
import os
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from itertools import product
from typing import Any, NamedTuple

import numpy as np
import xarray as xr

from tactile_bayes.arrays import Flags, Floats
from tactile_bayes.checks import (
    TINY,
    check_kind,
    check_mapping,
    check_names,
    check_numbers,
    check_probability,
    check_whole_number,
    refused,
)
from tactile_bayes.contours import Contour, paper_profile
from tactile_bayes.errors import ContourError, InferenceError, ReachError, StudyError
from tactile_bayes.inference.contour import sampled
from tactile_bayes.inference.ensembles import SamplerSettings
from tactile_bayes.inference.experiment import contour_problem
from tactile_bayes.inference.family import Family
from tactile_bayes.mechanics.rods.rod import Rod
from tactile_bayes.numerics.random_numbers import Rng, Seed, child, seed_sequence, seed_words
from tactile_bayes.planning.amplification import METHODS, along_and_across, contact_errors
from tactile_bayes.planning.expected_band import stretches
from tactile_bayes.planning.information import information
from tactile_bayes.planning.knowledge import unmeasured
from tactile_bayes.planning.plan import Plan, enlarged, family_parameters
from tactile_bayes.rig.rig import Rig, rig_of
from tactile_bayes.sweep import Rotation
from tactile_bayes.tasks import Kind, Workers, keep_outcomes, open_results_store, versions_of
from tactile_bayes.uncertainty.band import contour_band

# Settings of posteriors, which only need to yield a band.
_SETTINGS = SamplerSettings(ensembles=2, block_steps=25, max_r_hat=1.05, min_ess=200.0, max_steps=1000)
_FEWEST_WALKERS = 24
_LIBRARIES = ("tactile-bayes", "numpy", "scipy", "emcee")
# Axes of the map beside the contours, with their usual values.
_AXES = {"distance": (0.5,), "noise_factor": (0.1, 0.3, 1.0, 3.0)}
# Lengths and shares in a cell, those of each reconstruction and the others.
_LENGTHS_OF_METHODS = ("rms_along", "rms_across", "first_order_along", "first_order_across", "median_error")
_SHARES_OF_METHODS = ("without_answer", "ok")
_LENGTHS = ("gap_width", *(f"{of}_{kind}_width" for of in ("expected", "posterior") for kind in ("touched", "gap")))
_SHARES = ("posterior_touched_coverage", "posterior_gap_coverage", "posterior_failed")


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


@dataclass(frozen=True)
class Bands:
    """Bands of the contours of an error map, expected ones in every cell and those of posteriors in some.

    Parameters
    ----------
    probability : float
        Probability of the bands, in (0, 1).
    family : Family, optional
        As in `Plan`: that of all contours, with priors of its parameters.
    posterior_cells : int
        Number of cells, evenly over the map, in which posteriors are inferred; each takes seconds.
    posterior_replicates : int
        Number of posteriors in such a cell.

    Raises
    ------
    ParameterError
        If a number is impossible.

    Examples
    --------
    >>> Bands(probability=0.9).posterior_cells
    0
    """

    probability: float = 0.95
    family: Family | None = None
    posterior_cells: int = 0
    posterior_replicates: int = 2

    def __post_init__(self) -> None:
        object.__setattr__(self, "probability", check_probability("probability", self.probability))
        for name, least in (("posterior_cells", 0), ("posterior_replicates", 1)):
            object.__setattr__(self, name, check_whole_number(name, getattr(self, name), least))


_DRIVE, _BANDS = Rotation(drive_step=float(np.radians(2.0))), Bands()


def error_map(
    contours: Mapping[str, Contour] | Sequence[str] = ("II",),
    rig: Rig | None = None,
    *,
    rng: Rng,
    over: Mapping[str, Sequence[float]] | None = None,
    drive: Rotation = _DRIVE,
    replicates: int = 20,
    bands: Bands = _BANDS,
    out: str | os.PathLike[str] | None = None,
    workers: int | str | Workers | None = None,
) -> xr.Dataset:
    """Return the errors of reconstruction over contour, distance and noise, from repeated simulations of records.

    Parameters
    ----------
    contours : mapping of str to Contour, or sequence of str
        Objects by name, in the unit of the rod's length; or names of the paper's profiles, for the dimensionless rod or
        scaled to the rod's length.
    rig : Rig, optional
        As in `Plan`.
    rng : int, numpy.random.SeedSequence or numpy.random.Generator
        Seed of all random numbers; the results do not depend on the number of workers.
    over : mapping of str to sequence of float, optional
        The axes of the map: "distance", heights of the lowest point of each contour above the pivot [rod lengths], by
        default 0.5; "noise_factor", factors on the noise of the load cell, by default 0.1, 0.3, 1 and 3.
    drive : Rotation
        The sweeps of every cell, with a pivot whose height the distance gives; by default at x = 0 in steps of 2°.
    replicates : int
        Number of records in each cell.
    bands : Bands
        The bands of the contour, and the cells in which posteriors are inferred, by default none.
    out : path-like, optional
        Folder of the results store cells.json: a run that was killed resumes.
    workers
        As in `calibrate`.

    Returns
    -------
    xr.Dataset
        Over "contour", "distance" and "noise_factor", and if stated over "reconstruction" ("raw" and "constrained");
        lengths in metres, or in rod lengths for a dimensionless rod:

        rms_along, rms_across (…, reconstruction)
            Root mean square errors of contact points along and across the contour, for samples with the status "ok".
        first_order_along, first_order_across (…, reconstruction)
            Predictions of these errors by their amplification, to first order.
        median_error (…, reconstruction)
            Median distance of contact points from the true ones, for all samples that have an answer.
        without_answer, ok (…, reconstruction)
            Shares of loaded samples that have no answer, and that have the status "ok".
        gap_width
            Width in x of the arc that no sweep touches; 0 if there is none.
        expected_touched_width, expected_gap_width
            Expected mean widths of the bands, from Fisher's information.
        posterior_touched_width, posterior_gap_width, posterior_touched_coverage, posterior_gap_coverage
            Mean widths of posterior bands, and share of grid points at which they contain the contour; NaN in cells
            without posteriors.
        posterior_failed
            Share of records whose inference failed.
        message
            "ok", or the error by which a cell is empty, for example because the rod does not reach the object.

    Raises
    ------
    ParameterError
        If an argument is impossible.
    StudyError
        If `out` holds cells of another study, or another run uses it.
    TaskError
        If processes died repeatedly in a cell.

    Examples
    --------
    >>> found = error_map(["II"], over={"noise_factor": [0.1, 1.0]}, replicates=2, rng=1, workers=1)
    >>> found.rms_across.sel(reconstruction="constrained").values.ravel().round(4) < 0.02
    array([ True,  True])
    """
    rig = rig_of(rig)
    rod = rig.rod or Rod()
    objects = _objects(contours, rod)
    distances, noise_factors = _axes(over)
    replicates = check_whole_number("replicates", replicates, 1)
    check_kind("bands", bands, Bands, "give Bands(probability=..., posterior_cells=...)")
    if not isinstance(drive, Rotation) or drive.base[1] != 0.0:
        raise refused("drive", drive, "give a Rotation((x, 0.0)), as the distance gives the height of the pivot")
    heights = [distance * rod.length for distance in distances]
    cells = tuple(MapCell(*each) for each in product(objects, heights, noise_factors))
    plan, *_ = [Plan(each, rig, drive, bands.family) for each in objects.values()]
    chosen = np.unique(np.linspace(0, len(cells) - 1, min(bands.posterior_cells, len(cells))).round().astype(int))
    posteriors = dict.fromkeys(chosen.tolist(), min(bands.posterior_replicates, replicates))
    task = MapTask(objects, cells, plan, drive, replicates, posteriors, bands.probability, seed_sequence(rng))
    with open_results_store(_identity(task), out, CELLS) as store:
        kept = keep_outcomes(store, error_cell, task, len(cells), workers=workers)
    return _labelled(task, kept, distances, noise_factors)


def _axes(over: Mapping[str, Sequence[float]] | None) -> list[list[float]]:
    """Return distances and noise factors."""
    given = over or {}
    check_mapping("over", given, 'give lists of numbers by axis, like {"distance": [0.3, 0.5]}')
    if other := [name for name in given if name not in _AXES]:
        raise refused("over", other[0], f"the axes are {' and '.join(_AXES)}")
    found = []
    for name, usual in _AXES.items():
        values = given.get(name, usual)
        numbers = check_numbers(name, values, "give a list of positive numbers", shape=(None,), least=TINY).tolist()
        if len(set(numbers)) < len(numbers):
            raise refused(name, values, "one of them is given twice")
        found.append(numbers)
    return found


def _objects(contours: Mapping[str, Contour] | Sequence[str], rod: Rod) -> dict[str, Contour]:
    correction = "give names of the paper's profiles, or contours by name"
    if isinstance(contours, Mapping) and contours:
        check_mapping("contours", contours, correction)
        for contour in contours.values():
            family_parameters(contour)  # refuses contours without parameters
        return dict(contours)
    if isinstance(contours, str) or not check_names("contours", contours):
        raise refused("contours", contours, correction)
    if len(set(contours)) < len(contours):
        raise refused("contours", contours, "one of them is given twice")
    return {name: enlarged(paper_profile(name, q=0.5), rod.length) for name in contours}  # type: ignore[arg-type]


def _identity(task: MapTask) -> dict[str, str]:
    """Return everything that determines the results, as text, for the results store."""
    plan = task.plan
    return unmeasured(plan.rig).assumptions | {
        "family": repr(plan.family),
        "contours": json.dumps({name: repr(contour) for name, contour in task.contours.items()}),
        "cells": json.dumps([asdict(cell) for cell in task.cells]),
        "drive": json.dumps([drive.description for drive in plan.drives]),
        "replicates": repr(task.replicates),
        "posteriors": json.dumps(dict(task.posteriors)),
        "probability": repr(task.probability),
        "seed": seed_words(task.seed),
        **versions_of(*_LIBRARIES),
    }


def _labelled(
    task: MapTask, outcomes: Mapping[int, CellOutcome], distances: Sequence[float], factors: Sequence[float]
) -> xr.Dataset:
    """Return the result of an error map; see `error_map`."""
    rows = [outcomes[number] for number in range(len(task.cells))]
    shape, dims = (len(task.contours), len(distances), len(factors)), ("contour", "distance", "noise_factor")
    si, cell = not task.plan.rod.is_dimensionless, task.plan.cell
    length, share = {"units": "m" if si else "1"}, {"units": "1"}

    def values(name: str) -> Any:
        return np.reshape([row.numbers.get(name, math.nan) for row in rows], shape)

    variables: dict[str, Any] = {"message": (dims, np.reshape([row.message for row in rows], shape))}
    for names, unit in ((_LENGTHS, length), (_SHARES, share)):
        variables |= {name: (dims, values(name), unit) for name in names}
    for names, unit in ((_LENGTHS_OF_METHODS, length), (_SHARES_OF_METHODS, share)):
        for name in names:
            of_methods = np.stack([values(f"{method}_{name}") for method in METHODS], axis=-1)
            variables[name] = ((*dims, "reconstruction"), of_methods, unit)
    force, moment = np.multiply.outer([cell.force_noise, cell.moment_noise], factors)
    return xr.Dataset(
        variables,
        coords={
            "contour": list(task.contours),
            "distance": ("distance", distances, {"units": "rod lengths"}),
            "noise_factor": factors,
            "force_noise": ("noise_factor", force, {"units": "N" if si else "EI/L²"}),
            "moment_noise": ("noise_factor", moment, {"units": "N m" if si else "EI/L"}),
            "reconstruction": list(METHODS),
        },
        attrs={"replicates": task.replicates, "probability": task.probability, "seed": seed_words(task.seed)},
    )


def _decode(row: dict[str, Any]) -> CellOutcome:
    numbers = {name: math.nan if value is None else float(value) for name, value in row["numbers"].items()}
    return CellOutcome(numbers, str(row["message"]))


CELLS = Kind("cells", StudyError, CellOutcome._asdict, _decode)
