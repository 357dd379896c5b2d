"""Error map: errors of contacts and bands over noise level, distance and shape, by Monte Carlo."""

from __future__ import annotations

import json
import math
import os
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from itertools import product
from typing import Any

import numpy as np
import xarray as xr

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
from tactile_bayes.errors import StudyError
from tactile_bayes.inference.family import Family
from tactile_bayes.mechanics.rods.rod import Rod
from tactile_bayes.numerics.random_numbers import Rng, seed_sequence, seed_words
from tactile_bayes.planning.amplification import METHODS
from tactile_bayes.planning.error_cell import CellOutcome, MapCell, MapTask, error_cell
from tactile_bayes.planning.family_parameters import enlarged, family_parameters
from tactile_bayes.planning.knowledge import unmeasured
from tactile_bayes.planning.plan import Plan
from tactile_bayes.rig.rig import Rig, rig_of
from tactile_bayes.sweep import Rotation
from tactile_bayes.tasks import Kind, Workers, keep_outcomes, open_results_store, versions_of

_LIBRARIES = ("tactile-bayes", "numpy", "scipy", "emcee")

# Axes of the map beside the contours, with their usual values.
_AXES = {"distance": (0.5,), "noise_factor": (0.1, 0.3, 1.0, 3.0)}
# Lengths and shares in a cell, those of each reconstruction and the others.
_LENGTHS_OF_METHODS = ("rms_along", "rms_across", "first_order_along", "first_order_across", "median_error")
_SHARES_OF_METHODS = ("without_answer", "ok")
_LENGTHS = ("gap_width", *(f"{of}_{kind}_width" for of in ("expected", "posterior") for kind in ("touched", "gap")))
_SHARES = ("posterior_touched_coverage", "posterior_gap_coverage", "posterior_failed")


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
    return [_grid(name, given.get(name, usual)) for name, usual in _AXES.items()]


def _grid(name: str, values: Sequence[float]) -> list[float]:
    numbers = check_numbers(name, values, "give a list of positive numbers", shape=(None,), least=TINY).tolist()
    if len(set(numbers)) < len(numbers):
        raise refused(name, values, "one of them is given twice")
    return numbers


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
