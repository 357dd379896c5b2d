"""Experimental design: the drive of the next record and its step."""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
import xarray as xr

from tactile_bayes.checks import (
    check_choice,
    check_numbers,
    check_probability,
    check_switch,
    check_whole_number,
    refused,
)
from tactile_bayes.errors import ParameterError, ReachError, StudyError
from tactile_bayes.inference.family import Family, family_of
from tactile_bayes.inference.record_likelihood.likelihood import events_of
from tactile_bayes.inference.result import record_of
from tactile_bayes.mechanics.rods.rod import Rod
from tactile_bayes.numerics.random_numbers import Rng, seed_sequence, seed_words, words
from tactile_bayes.planning.candidate import Candidate, Expected, Question, expected_of
from tactile_bayes.planning.expected_band import band_factor, deviation_of_heights, height_slopes, mean_of_known
from tactile_bayes.planning.knowledge import Knowledge, known_from_posterior, known_from_prior
from tactile_bayes.record import rod_of
from tactile_bayes.rig.rig import Rig, rig_of
from tactile_bayes.sweep import Drive, Rotation, drives_of, recorded_drives
from tactile_bayes.tasks import Kind, Workers, keep_outcomes, open_results_store, versions_of

_LIBRARIES = ("tactile-bayes", "numpy", "scipy")

_GRID_POINTS = 25  # number of grid points of x over the span
# Default positions of pivots, over the rod's length.
_ACROSS, _ABOVE = np.linspace(-0.5, 0.5, 11), np.array([-0.1, 0.0, 0.1])
_NESTED = 400  # number of draws of each nested posterior


CriterionName = Literal["band", "gap", "information"]


@dataclass(frozen=True)
class Criterion:
    """Criterion of the best candidate of a design, and the band that is meant.

    Parameters
    ----------
    name : {"band", "gap", "information"}
        The narrowest band, the smallest gap, or the most information.
    span : (float, float), optional
        Interval of x in which the band matters [length]; by default between the outermost first contacts of the sweeps
        so far, or, for a prior, of sweeps from the origin; medians over the draws.
    probability : float
        Probability of the pointwise band, in (0, 1).

    Raises
    ------
    ParameterError
        If there is no such criterion, the span is empty, or the probability is impossible.

    Examples
    --------
    >>> Criterion("gap", probability=0.9).name
    'gap'
    """

    name: CriterionName = "band"
    span: tuple[float, float] | None = None
    probability: float = 0.95

    def __post_init__(self) -> None:
        check_choice("criterion", self.name, ("band", "gap", "information"))
        object.__setattr__(self, "probability", check_probability("probability", self.probability))
        if self.span is not None:
            correction = "give two values of x, the smaller first"
            left, right = check_numbers("span", self.span, correction, shape=(2,)).tolist()
            if not left < right:
                raise refused("span", self.span, correction)
            object.__setattr__(self, "span", (left, right))


def design(
    known: xr.DataTree | str | Family = "parabola",
    rig: Rig | None = None,
    *,
    rng: Rng,
    drives: Sequence[Drive | Sequence[Drive]] | None = None,
    criterion: CriterionName | Criterion = "band",
    nested: bool = False,
    draws: int = 24,
    out: str | os.PathLike[str] | None = None,
    workers: int | str | Workers | None = 1,
) -> xr.Dataset:
    """Return the expected results of the next record for every candidate drive, and the best candidate.

    Parameters
    ----------
    known : xr.DataTree, str or Family
        Result of `infer_contour` for the records so far, for the next base or a second whisker of the same kind; or a
        family, as in `infer_contour`, of which only the prior is known.
    rig : Rig, optional
        As in `Plan`, if a family is given; a posterior has its own. Pivots are where they are planned: shifts of them
        are left out, of a posterior, too.
    rng : int, numpy.random.SeedSequence or numpy.random.Generator
        Seed of all random numbers.
    drives : sequence of Rotation, Translation, Motion or sequences of them, optional
        Candidates; each sequence is one, whose sweeps are one record. Rotations without a grid of their own go from
        −30° to 210° in steps of 2°, and drives that carry the base have as many samples. By default `usual_drives`.
    criterion : {"band", "gap", "information"} or Criterion
        Criterion of the best candidate; a `Criterion` also states where the band matters, and its probability.
    nested : bool
        Whether each candidate's posteriors are also sampled by nested Monte Carlo, which checks Laplace's
        approximation, and includes the information of the snap-off.
    draws : int
        Number of objects that are drawn, at least 2.
    out : path-like, optional
        Folder of the results store candidates.json: the same call resumes from it, or returns at once.
    workers
        As in `calibrate`; by default in this process.

    Returns
    -------
    xr.Dataset
        Over "candidate", with base_x, base_y (the pivot, or where the first drive begins) [length], drive_step (of the
        first drive, or of a rotation with as many samples) [rad], drive, in words, is_pivot (whether it turns about one
        pivot), and samples, the number of readings of its record:

        width, width_error
            Expected mean width of the band over the span, as far as an object has heights there [length], and its
            standard error over draws. For objects that the rod does not reach it is the present width, and few of them
            dominate the mean.
        gap, gap_error
            Width of the arcs that no sweep touches, those so far included, between the outermost contacts [length].
        information, information_error
            Expected gain in information [nats].
        reached
            Share of the draws that the rod reaches from the pivot.
        nested_width, nested_width_error, nested_information, nested_information_error, nested_draws
            The same by nested Monte Carlo, over the draws that are reached; NaN without. nested_draws is the median of
            the effective draws.

        Over "pivot", those of the records so far, present_base_x and present_base_y [length]. Scalars: present_width,
        of the band without a further record [length]; best, the index of the best candidate.

    Raises
    ------
    ParameterError
        If an argument is impossible, or the contour is shape-free.
    InferenceError
        If the tree is no posterior of a contour.
    ReachError
        If the rod hardly ever reaches a contour of the prior, or reaches none of the objects from any candidate.
    StudyError
        If the folder holds candidates of another design.
    TaskError
        If processes died repeatedly in a candidate.

    Notes
    -----
    Objects are drawn from the prior or the posterior so far. To first order, the precision of the next posterior of
    each is the present one plus Fisher's information of the record (Laplace's approximation). The width of the band is
    averaged over objects, and so is the gain in information, half the change of the logarithmic determinant (Lindley
    1956; Long et al. 2013, doi 10.1016/j.cma.2013.02.017).
    Nested Monte Carlo simulates a record of each object, and samples its posterior from a t distribution about the mode
    (Ryan 2003; Beck et al. 2018, doi 10.1016/j.cma.2018.01.053).

    Examples
    --------
    >>> from scipy import stats
    >>> known = Family("parabola", a=stats.lognorm(0.3, scale=0.6), q=stats.uniform(0.4, 0.2), x_c=stats.norm(0, 0.05))
    >>> found = design(known, drives=[Rotation(), Rotation((0.0, -0.3))], draws=4, rng=1)
    >>> bool(found.width[1] > found.width[0])  # farther away
    True
    """
    criterion = criterion if isinstance(criterion, Criterion) else Criterion(criterion)
    draws = check_whole_number("draws", draws, 2)
    check_switch("nested", nested)
    seed, candidates = seed_sequence(rng), _candidates(usual_drives(known, rig) if drives is None else drives)
    draws_from = np.random.default_rng([*words(seed), 1])
    if isinstance(known, str | Family):
        knowledge = known_from_prior(rig_of(rig), family_of(known), draws=draws, rng=draws_from)
    elif rig is not None:
        raise ParameterError("a rig and a posterior, which has its own: leave one of the two")
    else:
        knowledge = known_from_posterior(known, draws=draws, rng=draws_from)
    x = np.linspace(*(criterion.span or _span(knowledge)), _GRID_POINTS)
    question = Question(knowledge, candidates, x, criterion.probability, _NESTED if nested else 0, seed)
    with open_results_store(_identity(question), out, CANDIDATES) as store:
        found = keep_outcomes(store, expected_of, question, len(candidates), workers=workers)
    if not any(expected.reached for expected in found.values()):
        raise ReachError(_out_of_reach(question))
    return _labelled(question, [found[number] for number in range(len(candidates))], criterion.name)


def usual_drives(
    known: xr.DataTree | str | Family = "parabola", rig: Rig | None = None, drive_step: float | None = None
) -> list[Rotation]:
    """Return the default candidates of `design`, rotations about 33 pivots.

    They are from half a rod's length to the left of the pivot so far to half to the right, at its height and a tenth of
    the rod's length below and above.

    Parameters
    ----------
    known, rig
        As in `design`.
    drive_step : float, optional
        As in `Rotation`.

    Examples
    --------
    >>> drives = usual_drives()
    >>> len(drives), drives[0].base
    (33, (-0.5, -0.1))
    """
    drives, rod = [], rig_of(rig).rod or Rod()
    if isinstance(known, xr.DataTree):
        record = record_of(known)
        drives, rod = recorded_drives(record), rod_of(record)
    x, y = next((drive.base for drive in drives if isinstance(drive, Rotation)), (0.0, 0.0))
    pivots = [(float(x + rod.length * dx), float(y + rod.length * dy)) for dy in _ABOVE for dx in _ACROSS]
    return [Rotation(pivot, drive_step=drive_step) for pivot in pivots]


def _candidates(drives: Any) -> tuple[Candidate, ...]:
    """Return the candidates, each of one drive or several."""
    correction = "give a list of drives, or of lists of them"
    if not isinstance(drives, Sequence) or not drives:
        raise refused("drives", drives, correction)
    candidates = [Candidate(tuple(drives_of(drive))) for drive in drives]
    if len(set(candidates)) < len(candidates):
        raise refused("drives", drives, "one of them is given twice")
    return tuple(candidates)


def _out_of_reach(question: Question) -> str:
    """Return the message that no candidate reaches an object."""
    rod, unit, ranges = question.known.rod, "" if question.known.rod.is_dimensionless else " m", []
    for axis, places in zip("xy", np.transpose([candidate.base for candidate in question.candidates]), strict=True):
        low, high = places.min(), places.max()
        ranges.append(f"{axis} = {low:g}{unit}" if low == high else f"{axis} from {low:g} to {high:g}{unit}")
    return (
        f"the rod, {rod.length:g}{unit or ' L'} long, reaches no possible object from any candidate, at "
        f"{' and '.join(ranges)}: give others, nearer to it, in that unit"
    )


def _span(knowledge: Knowledge) -> tuple[float, float]:
    """Return the interval of x in which the band matters by default."""
    model, points = knowledge.experiment.model, knowledge.points
    events = events_of(model.likelihood, model.contours(points), model.rig(points), exact=False)
    first = events["first_contact_x"]
    return float(np.nanmedian(np.nanmin(first, axis=1))), float(np.nanmedian(np.nanmax(first, axis=1)))


def _labelled(question: Question, expected: Sequence[Expected], criterion: CriterionName) -> xr.Dataset:
    """Return the result of a design; see `design`."""
    known, candidates = question.known, question.candidates
    metres, nats = {"units": "1" if known.rod.is_dimensionless else "m"}, {"units": "nat"}
    columns: dict[str, tuple[Sequence[Any], dict[str, str]]] = {
        "base_x": ([candidate.base[0] for candidate in candidates], metres),
        "base_y": ([candidate.base[1] for candidate in candidates], metres),
        "drive": ([candidate.words for candidate in candidates], {}),
        "is_pivot": ([candidate.is_pivot for candidate in candidates], {}),
        "samples": ([known.model_from(candidate.drives).measured.sizes["sample"] for candidate in candidates], {}),
        "drive_step": ([candidate.drive_step for candidate in candidates], {"units": "rad"}),
        "reached": ([row.reached for row in expected], {}),
        "nested_draws": ([row.nested_draws for row in expected], {}),
    }
    for name in ("width", "gap", "information", "nested_width", "nested_information"):
        means, errors = zip(*(getattr(row, name) for row in expected), strict=True)
        unit = nats if name.endswith("information") else metres
        columns |= {name: (means, unit), f"{name}_error": (errors, unit)}
    values = np.array(columns["width" if criterion == "band" else criterion][0])
    order = -values if criterion == "information" else values
    best = int(np.argmin(np.where(np.isfinite(order), order, np.inf)))
    slopes = [height_slopes(known.experiment.model, point, question.x) for point in known.points]
    present = np.array([mean_of_known(deviation_of_heights(of, known.precision)) for of in slopes])
    bases = np.reshape([drive.base for drive in known.drives if isinstance(drive, Rotation)], (-1, 2)).T
    return xr.Dataset(
        {
            **{name: ("candidate", np.array(numbers), attrs) for name, (numbers, attrs) in columns.items()},
            **{f"present_base_{axis}": ("pivot", of, metres) for axis, of in zip("xy", bases, strict=True)},
            "present_width": ((), band_factor(question.probability) * mean_of_known(present), metres),
            "best": ((), best),
        },
        coords={"x": ("x", question.x, metres)},
        attrs={"criterion": criterion, "probability": question.probability, "family": known.experiment.own_family.name},
    )


def _identity(question: Question) -> dict[str, str]:
    """Return everything that determines the results, as text, for the results store."""
    known = question.known
    return known.experiment.assumptions | {
        "what is known": hashlib.sha256(known.points.tobytes()).hexdigest(),
        "drives": json.dumps([drive.description for drive in known.drives]),
        "candidates": json.dumps([[drive.description for drive in one.drives] for one in question.candidates]),
        "span": json.dumps([float(question.x[0]), float(question.x[-1])]),
        "probability": repr(question.probability),
        "nested": repr(question.nested),
        "seed": seed_words(question.seed),
        **versions_of(*_LIBRARIES),
    }


def _decode(row: dict[str, Any]) -> Expected:
    """Return the results from a row of the store, in which None stands for NaN."""
    return Expected(*(np.array(row[name], dtype=float).tolist() for name in Expected._fields))


CANDIDATES = Kind("candidates", StudyError, Expected._asdict, _decode)
