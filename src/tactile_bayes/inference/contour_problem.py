"""The inference problem of a contour, for the stated sides of contact and for the alternatives."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from itertools import product
from typing import Any, NamedTuple

import numpy as np

from tactile_bayes.arrays import Flags
from tactile_bayes.errors import InferenceError
from tactile_bayes.inference.contour_model import ContourModel
from tactile_bayes.inference.experiment import Experiment
from tactile_bayes.inference.misfit import NO_LOAD
from tactile_bayes.inference.record_likelihood.record_segments import without_errors
from tactile_bayes.inference.record_likelihood.shortening import is_long
from tactile_bayes.reconstruction import (
    OTHER_SIDE,
    loaded_samples,
    side_of,
    sides_and_doubts,
    with_sides,
)
from tactile_bayes.tasks import versions_of

_MOST_DOUBTFUL = 2  # sweeps of which both sides are tried, the most doubtful first: each doubles the problems
_BELIEVED = float(np.log(10.0))  # log prior odds that the direction of a doubtful sweep states its side of contact


class ContourProblem(NamedTuple):
    """Prior times likelihood, and a description of both."""

    model: ContourModel
    about: Mapping[str, Any]  # attributes of the posterior
    loaded: Flags  # True for samples with a load that noise does not explain, shape (samples,)
    others: tuple[ContourProblem, ...] = ()  # problems with other sides of contact, if these are doubtful
    log_prior_odds: float = 0.0  # of the sides of contact over those that the directions state

    def without(self, samples: Flags) -> ContourModel:
        """Return the model of the record without some samples, a mask of shape (samples,)."""
        model, kept = self.model, ~samples
        elapsed, times = model.unknowns.elapsed[kept], model.unknowns.times
        rig = replace(model.unknowns, elapsed=elapsed, times=None if times is None else times[kept])
        measured = model.measured.isel(sample=np.flatnonzero(kept))
        return ContourModel(measured, model.family, rig, model.noise, model.priors)


def identity_of(about: Mapping[str, Any]) -> dict[str, str]:
    """Return the attributes of a posterior, and the version, as the identity of a computation that can be resumed."""
    labels = {"data_sha256": "record (its SHA-256)"}
    return {labels.get(name, name): str(value) for name, value in about.items()} | versions_of("tactile-bayes")


def contour_problem(experiment: Experiment) -> ContourProblem:
    """Return the inference problem of an experiment, and those of other sides of contact if they are doubtful."""
    record, cell = experiment.record, experiment.noise.cell
    if is_long(record):  # each sweep is judged once, by all of its samples
        sides, doubtful = sides_and_doubts(without_errors(record, cell), cell)
        record = with_sides(record, sides)
        problem = _of_sides(replace(experiment, record=record))
    else:
        problem = _of_sides(experiment)
        _, doubtful = sides_and_doubts(without_errors(problem.model.measured, cell), cell)
    if not (doubtful := doubtful[:_MOST_DOUBTFUL]):
        return problem
    stated = {sweep: side_of(record, sweep) for sweep in doubtful}
    every = []
    for turned in product((False, True), repeat=len(doubtful)):
        pairs = zip(stated.items(), turned, strict=True)
        sides = {sweep: OTHER_SIDE[side] if turn else side for (sweep, side), turn in pairs}
        other = _of_sides(replace(experiment, record=with_sides(record, sides)))
        every.append(other._replace(log_prior_odds=-_BELIEVED * sum(turned)))
    return every[0]._replace(others=tuple(every[1:]))


def _of_sides(experiment: Experiment) -> ContourProblem:
    """Return the problem of an experiment, shortened, with the sides of contact that its record states."""
    experiment = experiment.shortened
    loaded = loaded_samples(experiment.record, experiment.noise.stated_cell)
    if not loaded.any():
        raise InferenceError(NO_LOAD)
    problem = ContourProblem(experiment.model, experiment.about, loaded)
    if experiment.events:
        return problem
    return problem._replace(model=problem.without(~loaded), loaded=loaded[loaded])
