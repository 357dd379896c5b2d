"""A contour to be inferred from a measured record, and from the same with other sides of contact."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from importlib.metadata import version
from itertools import product
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tactile_bayes.errors import InferenceError
from tactile_bayes.inference.contour_model import ContourModel
from tactile_bayes.inference.experiment import Experiment
from tactile_bayes.inference.likelihood import without_errors
from tactile_bayes.reconstruction import OTHER_SIDE, doubtful_sweeps, loaded_samples, side_of, with_sides

__all__ = ["ContourProblem", "contour_problem"]


_MOST_DOUBTFUL = 2
"""Sweeps of which both sides are tried, the most doubtful: each of them doubles what there is to compare."""

_BELIEVED = float(np.log(10.0))
"""Logarithm of how much likelier a direction is to say the side than not, where the record leaves doubt."""


class ContourProblem(NamedTuple):
    """Prior times likelihood, and in words what they are made from."""

    model: ContourModel
    about: Mapping[str, Any]
    loaded: NDArray[np.bool_]
    """Which of the record's samples carry a load that noise does not explain."""

    others: tuple[ContourProblem, ...] = ()
    """The same with other sides of contact, where the record leaves doubt of them."""
    log_prior_odds: float = 0.0
    """Of its sides of contact over those that directions say."""

    @property
    def identity(self) -> dict[str, str]:
        """What a run that goes on must have in common with the one that was stopped."""
        words = {"data_sha256": "record (its SHA-256)"}
        return {words.get(name, name): str(value) for name, value in self.about.items()} | {
            "version of tactile-bayes": version("tactile-bayes")
        }

    def without(self, samples: NDArray[np.bool_]) -> ContourModel:
        """The model of the record without some of its samples."""
        model, kept = self.model, ~samples
        rig = replace(model.nuisances, way=model.nuisances.way[kept])
        measured = model.measured.isel(sample=np.flatnonzero(kept))
        return ContourModel(measured, model.family, rig, model.noise, model.priors)


def contour_problem(experiment: Experiment) -> ContourProblem:
    """What is to be inferred from a record, with the problems of other sides of contact beside it."""
    problem = _of_sides(experiment)
    record, cell = experiment.record, experiment.noise.cell
    doubtful = doubtful_sweeps(without_errors(problem.model.measured, cell), cell)[:_MOST_DOUBTFUL]
    if not doubtful:
        return problem
    stated = {sweep: side_of(record, sweep) for sweep in doubtful}
    every = []
    for turned in product((False, True), repeat=len(doubtful)):
        sides = {
            sweep: OTHER_SIDE[stated[sweep]] if turn else stated[sweep]
            for sweep, turn in zip(doubtful, turned, strict=True)
        }
        odds = -_BELIEVED * sum(turned)
        other = replace(experiment, record=with_sides(record, sides))
        every.append(_of_sides(other)._replace(log_prior_odds=odds))
    return every[0]._replace(others=tuple(every[1:]))


def _of_sides(experiment: Experiment) -> ContourProblem:
    """The problem of a record whose sides of contact are those that it states.

    Raises
    ------
    InferenceError
        If no sample carries a load.
    """
    loaded = loaded_samples(experiment.record, experiment.noise.stated_cell)
    if not loaded.any():
        raise InferenceError(
            "no sample carries a load that noise does not explain: was anything touched, and is the load cell's noise "
            "in the record's units?"
        )
    problem = ContourProblem(experiment.model, experiment.about, loaded)
    if experiment.events:
        return problem
    return problem._replace(model=problem.without(~loaded), loaded=loaded[loaded])
