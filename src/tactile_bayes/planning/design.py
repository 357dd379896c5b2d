"""Where to put the whisker, or its next base, and how fine to step the drive."""

from __future__ import annotations

import hashlib
import json
import math
import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict
from importlib.metadata import version
from itertools import product
from typing import Any, Literal

import numpy as np
import xarray as xr

from tactile_bayes.arrays import Floats
from tactile_bayes.checks import (
    TINY,
    check_choice,
    check_numbers,
    check_path,
    check_probability,
    check_seed,
    check_whole_number,
    refused,
)
from tactile_bayes.errors import ParameterError, ReachError, StudyError
from tactile_bayes.inference.contour_events import events_of
from tactile_bayes.inference.experiment import Experiment, usual_load_cell
from tactile_bayes.inference.nuisances import STANDARD
from tactile_bayes.inference.priors import Prior
from tactile_bayes.load_cell import LoadCell
from tactile_bayes.mechanics.rod import Rod
from tactile_bayes.planning.candidate import Candidate, Expected, Question, expected_of
from tactile_bayes.planning.expected_band import band_factor, deviation_of_heights, height_slopes
from tactile_bayes.planning.knowledge import (
    COARSE,
    Base,
    Knowledge,
    empty_record,
    known_from_posterior,
    known_from_prior,
)
from tactile_bayes.tasks import Kind, TaskProgress, keep_outcomes, open_results_store

__all__ = ["CRITERIA", "design"]

Criterion = Literal["band", "gap", "information"]
CRITERIA: tuple[Criterion, ...] = ("band", "gap", "information")

_LIBRARIES = ("tactile-bayes", "numpy", "scipy")

_PLACES = 25
ACROSS, ABOVE = np.linspace(-0.5, 0.5, 11), np.array([-0.1, 0.0, 0.1])
"""Places of pivots, over the rod's length."""
_NESTED = 400


def design(
    known: xr.DataTree | str = "parabola",
    *,
    seed: int,
    bases: Sequence[tuple[float, float]] | None = None,
    drive_steps: Sequence[float] = (float(np.radians(2.0)),),
    criterion: Criterion = "band",
    nested: bool = False,
    draws: int = 24,
    span: tuple[float, float] | None = None,
    probability: float = 0.95,
    load_cell: LoadCell | None = None,
    rod: Rod | None = None,
    friction: float | None = None,
    nuisances: Sequence[str] = STANDARD,
    priors: Mapping[str, Prior] | None = None,
    out: str | os.PathLike[str] | None = None,
    workers: int | None = 1,
    scheduler: str | None = None,
    progress: Callable[[TaskProgress], object] | None = None,
) -> xr.Dataset:
    """What to expect of the next record from every place a pivot could have, and which is the best.

    Objects are drawn from what is known; of each the information of the next record is added to what is known, and the
    band that results is averaged. Every record is a forward and a backward sweep.

    Parameters
    ----------
    known : xr.DataTree or str
        What `infer_contour` made of the records so far, for the next base or a second whisker of the same kind; or the
        name of a family, of which nothing but its prior is known.
    seed : int
    bases : sequence of (float, float), optional
        Pivots to choose from [length]; by default eleven from half a rod's length to the left of the pivot so far to
        half to the right, at its height and a tenth of the rod's length below and above.
    drive_steps : sequence of float
        Steps of the drive to choose from [rad].
    criterion : {"band", "gap", "information"}
        What the best is to have: the narrowest band, the smallest gap, or the most information.
    nested : bool
        Whether each candidate's posteriors are sampled, too, by nested Monte Carlo, which checks Laplace's
        approximation, and counts what the snap-off tells.
    draws : int
        Objects that are drawn.
    span : (float, float), optional
        Between which x the band matters [length]; by default between the outermost first contacts of the sweeps so far,
        or, of a prior, of sweeps from the origin; medians over the draws.
    probability : float
        Of the pointwise band.
    load_cell, rod, friction, nuisances, priors
        As in `infer_contour`, where a family is given; a posterior has its own.
    out : path-like, optional
        Folder in which what was found of each candidate is kept, in candidates.json: the same call goes on where it was
        stopped, or is made again at once.
    workers, scheduler
        As in `calibrate`; by default in this process.
    progress : callable, optional
        Is given a `TaskProgress` after each candidate.

    Returns
    -------
    xr.Dataset
        Over "candidate", with base_x, base_y [length] and drive_step [rad]:

        width, width_error
            Mean width of the band over the span that is to be expected [length], and its standard error over draws. Of
            objects that the rod does not reach it is the width of what is known, and few of them decide the mean: with
            more draws, and a look at `reached`, it is told whether they are there.
        gap, gap_error
            Width of what no sweep touches, those so far included, between the outermost contacts [length].
        information, information_error
            Expected gain in information [nats].
        reached
            Share of the draws that the rod reaches from there.
        nested_width, nested_width_error, nested_information, nested_information_error, nested_draws
            The same by nested Monte Carlo, of the draws that are reached; NaN without. Effective draws are the median.

        Over "pivot", those of the records so far, present_base_x and present_base_y [length]. Numbers: present_width,
        of the band without a further record [length]; best, the index of the best candidate.

    Raises
    ------
    ParameterError
        If an argument is impossible, or the contour is shape-free.
    InferenceError
        If the tree is no posterior of a contour.
    ReachError
        If the rod hardly ever reaches a contour of the prior, or from none of the candidates.
    StudyError
        If the folder holds candidates of another design.

    Notes
    -----
    To first order, the precision of a posterior is what was known plus Fisher's information of the record (Laplace's
    approximation); its mean over objects is that of the expected band, and half its logarithmic determinant over that
    before is the expected information (Lindley 1956; Long et al. 2013, doi 10.1016/j.cma.2013.02.017). Nested Monte
    Carlo draws a record of each object, and its posterior by importance sampling from a t distribution about the mode
    (Ryan 2003; Beck et al. 2018, doi 10.1016/j.cma.2018.01.053).

    Examples
    --------
    >>> from scipy import stats
    >>> priors = {"a": stats.lognorm(0.3, scale=0.6), "q": stats.uniform(0.4, 0.2), "x_c": stats.norm(0.0, 0.05)}
    >>> found = design("parabola", priors=priors, bases=[(0.0, 0.0), (0.0, -0.3)], draws=4, seed=1)
    >>> bool(found.width[1] > found.width[0])  # farther away
    True
    """
    check_choice("criterion", criterion, CRITERIA)
    check_whole_number("draws", draws, 2)
    check_seed(seed)
    check_probability("probability", probability)
    rng = np.random.default_rng([int(seed), 1])
    if isinstance(known, str):
        cell, own = load_cell or usual_load_cell(rod or Rod()), {} if priors is None else priors
        empty = empty_record([(0.0, 0.0)], COARSE, rod, cell)
        experiment = Experiment(empty, known, cell, own, rod, friction, nuisances)
        told = known_from_prior(experiment, draws=int(draws), rng=rng)
    else:
        given = {"load_cell": load_cell, "rod": rod, "priors": priors}
        taken = [name for name, value in given.items() if value is not None]
        if taken:
            raise ParameterError(f"{', '.join(taken)} and a posterior, which has its own: leave one of the two")
        told = known_from_posterior(known, draws=int(draws), rng=rng)
    remedy = "give positive angles in radians, at most 0.5"
    several = drive_steps if np.iterable(drive_steps) else [drive_steps]
    steps = check_numbers("drive_steps", several, remedy, shape=(None,), least=TINY, most=0.5)
    candidates = tuple(Candidate(base, float(step)) for base, step in product(_bases(bases, told), steps))
    x = np.linspace(*_span(span, told), _PLACES)
    question = Question(told, candidates, x, float(probability), _NESTED if nested else 0, int(seed))
    folder = None if out is None else check_path("out", out).resolve()
    with open_results_store(_words(question), folder, CANDIDATES) as ledger:
        found = keep_outcomes(
            ledger, expected_of, question, len(candidates), workers=workers, scheduler=scheduler, progress=progress
        )
    if not any(expected.reached for expected in found.values()):
        raise ReachError(_out_of_reach(question))
    return _labelled(question, [found[number] for number in range(len(candidates))], criterion)


def _out_of_reach(question: Question) -> str:
    known, pivots = question.known, np.array([candidate.base for candidate in question.candidates])
    unit = "" if known.rod.is_dimensionless else " m"
    (left, low), (right, high) = pivots.min(axis=0), pivots.max(axis=0)
    here = f"x = {left:g}" if left == right else f"x from {left:g} to {right:g}"
    there = f"y = {low:g}" if low == high else f"y from {low:g} to {high:g}"
    return (
        f"from none of the candidates, at {here}{unit} and {there}{unit}, does the rod, {known.rod.length:g}"
        f"{unit or ' L'} long, reach an object that may be there: give pivots nearer to it, in that unit"
    )


def _bases(bases: Sequence[Base] | None, told: Knowledge) -> list[Base]:
    if bases is None:
        x, y = told.bases[0] if told.bases else (0.0, 0.0)
        return [(float(x + told.rod.length * dx), float(y + told.rod.length * dy)) for dy in ABOVE for dx in ACROSS]
    pivots = check_numbers("bases", bases, "give a list of pivots, [(x, y), (x, y)]", shape=(None, 2))
    if len(np.unique(pivots, axis=0)) < len(pivots):
        raise refused("bases", bases, "one of them is given twice")
    return [(x, y) for x, y in pivots.tolist()]


def _span(span: tuple[float, float] | None, told: Knowledge) -> tuple[float, float]:
    if span is not None:
        remedy = "give two values of x, the smaller first"
        left, right = check_numbers("span", span, remedy, shape=(2,)).tolist()
        if not left < right:
            raise refused("span", span, remedy)
        return left, right
    model = told.experiment.model
    events = events_of(model.likelihood, model.contours(told.points), model.rig(told.points), exact=False)
    first = events["first_contact_x"]
    return float(np.nanmedian(np.nanmin(first, axis=1))), float(np.nanmedian(np.nanmax(first, axis=1)))


def _labelled(question: Question, expected: Sequence[Expected], criterion: Criterion) -> xr.Dataset:
    known, candidates = question.known, question.candidates
    metres = {"units": "1" if known.rod.is_dimensionless else "m"}

    def column(name: str, part: int, attrs: Mapping[str, Any]) -> tuple[str, Floats, Mapping[str, Any]]:
        return "candidate", np.array([getattr(row, name)[part] for row in expected]), attrs

    variables: dict[str, Any] = {
        "base_x": ("candidate", np.array([candidate.base[0] for candidate in candidates]), metres),
        "base_y": ("candidate", np.array([candidate.base[1] for candidate in candidates]), metres),
        "drive_step": ("candidate", np.array([candidate.drive_step for candidate in candidates]), {"units": "rad"}),
        "reached": ("candidate", np.array([row.reached for row in expected])),
        "nested_draws": ("candidate", np.array([row.nested_draws for row in expected])),
    }
    for name, attrs in (
        ("width", metres),
        ("gap", metres),
        ("information", {"units": "nat"}),
        ("nested_width", metres),
        ("nested_information", {"units": "nat"}),
    ):
        variables[name], variables[f"{name}_error"] = column(name, 0, attrs), column(name, 1, attrs)
    wanted = {"band": "width", "gap": "gap", "information": "information"}[criterion]
    values = variables[wanted][1]
    order = -values if criterion == "information" else values
    best = int(np.nanargmin(np.where(np.isfinite(order), order, np.inf)))
    for k, name in enumerate(("present_base_x", "present_base_y")):
        variables[name] = ("pivot", np.array([base[k] for base in known.bases], dtype=float), metres)
    return xr.Dataset(
        {**variables, "present_width": ((), _present_width(question), metres), "best": ((), best)},
        coords={"x": ("x", question.x, metres)},
        attrs={"criterion": criterion, "probability": question.probability, "family": known.experiment.family},
    )


def _present_width(question: Question) -> float:
    """Of the band without a further record."""
    known = question.known
    wide = band_factor(question.probability)
    slopes = [height_slopes(known.experiment.model, point, question.x) for point in known.points]
    return wide * float(np.mean([deviation_of_heights(of, known.precision).mean() for of in slopes]))


def _words(question: Question) -> dict[str, str]:
    """What the expectations follow from."""
    known = question.known
    return known.experiment.assumptions | {
        "what is known": hashlib.sha256(known.points.tobytes()).hexdigest(),
        "bases": json.dumps(known.bases),
        "candidates": json.dumps([asdict(candidate) for candidate in question.candidates]),
        "span": json.dumps([float(question.x[0]), float(question.x[-1])]),
        "probability": repr(question.probability),
        "nested": repr(question.nested),
        "seed": repr(question.seed),
        **{f"version of {name}": version(name) for name in _LIBRARIES},
    }


def _decode(row: dict[str, Any]) -> Expected:
    def read(value: Any) -> Any:
        if isinstance(value, list):
            mean, error = value
            return read(mean), read(error)
        return math.nan if value is None else float(value)

    return Expected(**{name: read(row[name]) for name in Expected._fields})


CANDIDATES = Kind("candidates", StudyError, Expected._asdict, _decode)
