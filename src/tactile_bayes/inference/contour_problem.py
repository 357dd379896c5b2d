"""A contour to be inferred from a record: what is asked, checked and put together."""

from __future__ import annotations

import json
import zlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from importlib.metadata import version
from itertools import product
from typing import Any, NamedTuple

import numpy as np
import xarray as xr
from numpy.typing import NDArray
from scipy.stats import rv_histogram

from tactile_bayes.checks import check_mapping, check_optional, check_switch
from tactile_bayes.contours.families import family_named
from tactile_bayes.contours.family import Family
from tactile_bayes.errors import InferenceError
from tactile_bayes.inference import priors as families
from tactile_bayes.inference.contour_model import ContourModel
from tactile_bayes.inference.likelihood import without_errors
from tactile_bayes.inference.noise import noise_of
from tactile_bayes.inference.nuisances import STANDARD, nuisances_of
from tactile_bayes.inference.priors import Prior, refuse_wrong_priors
from tactile_bayes.load_cell import LoadCell
from tactile_bayes.mechanics.rod import Rod
from tactile_bayes.reconstruction import (
    CONTACT_SIDES,
    OTHER_SIDE,
    doubtful_sweeps,
    loaded_samples,
    side_of,
    with_sides,
)
from tactile_bayes.record import frame_of, record_hash, rod_of, validate, with_rod

__all__ = ["Assumptions", "ContourProblem", "contour_priors", "contour_problem", "default_priors", "prior_in_words"]


_MOST_DOUBTFUL = 2
"""Sweeps of which both sides are tried, the most doubtful: each of them doubles what there is to compare."""

_BELIEVED = float(np.log(10.0))
"""Logarithm of how much likelier a direction is to say the side than not, where the record leaves doubt."""


@dataclass(frozen=True)
class Assumptions:
    """What is taken for known about a contour and the rig that met it, and what is not: see `infer_contour`."""

    family: str
    load_cell: LoadCell | None = None
    priors: Mapping[str, Prior] | None = None
    rod: Rod | None = None
    friction: float | None = None
    nuisances: Sequence[str] = STANDARD
    events: bool = True


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


def contour_problem(measured: xr.Dataset, assumed: Assumptions) -> ContourProblem:
    """What is to be inferred from a record, with the problems of other sides of contact beside it."""
    problem = _of_sides(measured, assumed)
    cell = problem.model.noise.cell
    doubtful = doubtful_sweeps(without_errors(problem.model.measured, cell), cell)[:_MOST_DOUBTFUL]
    if not doubtful:
        return problem
    measured = validate(measured)
    stated = {sweep: side_of(measured, sweep) for sweep in doubtful}
    every = []
    for turned in product((False, True), repeat=len(doubtful)):
        sides = {
            sweep: OTHER_SIDE[stated[sweep]] if turn else stated[sweep]
            for sweep, turn in zip(doubtful, turned, strict=True)
        }
        odds = -_BELIEVED * sum(turned)
        every.append(_of_sides(with_sides(measured, sides), assumed)._replace(log_prior_odds=odds))
    return every[0]._replace(others=tuple(every[1:]))


def _of_sides(measured: xr.Dataset, assumed: Assumptions) -> ContourProblem:
    """The problem of a record whose sides of contact are those that it states."""
    measured = with_rod(validate(measured), assumed.rod)
    check_optional("load_cell", assumed.load_cell, LoadCell, "give LoadCell(force_noise=0.05, moment_noise=0.02)")
    check_switch("events", assumed.events)
    check_mapping("priors", assumed.priors, "give distributions by name, like {'q': scipy.stats.norm(0.5, 0.1)}")
    given = assumed.priors or {}
    chosen = family_named(assumed.family)
    noise = noise_of(measured, assumed.load_cell)
    rig = nuisances_of(measured, assumed.nuisances, given, noise.cell, assumed.friction)
    priors = {**contour_priors(measured, chosen), **rig.priors, **noise.priors}
    more = ", and of what is not known of the rig moment_gain, friction and so on, which help(infer_contour) names"
    refuse_wrong_priors(given, priors, more=more)
    priors.update(given)
    data_sha256 = record_hash(measured)
    loaded = loaded_samples(measured, noise.stated_cell)
    if not loaded.any():
        raise InferenceError(
            "no sample carries a load that noise does not explain: was anything touched, and is the load cell's noise "
            "in the record's units?"
        )
    if not assumed.events:
        measured = measured.isel(sample=np.flatnonzero(loaded))
        rig = replace(rig, way=rig.way[loaded])
        loaded = loaded[loaded]
    about = {
        "data_sha256": data_sha256,
        "family": assumed.family,
        "friction": rig.friction,
        "nuisances": json.dumps(rig.names),
        "events": int(assumed.events),
        "priors": json.dumps({name: prior_in_words(prior) for name, prior in priors.items()}),
        "units": measured.attrs["units"],
        "load_cell_frame": frame_of(measured),
        **{name: measured.attrs[name] for name in (CONTACT_SIDES,) if name in measured.attrs},
        **{name: measured.attrs[name] for name in ("rod_length", "rod_flexural_rigidity", "rod_diameter")},
        "approximations": "; ".join(noise.cell.approximations),
        **{f"load_cell_{name}": value for name, value in noise.cell.entries().items() if name not in noise.inferred},
    }
    return ContourProblem(ContourModel(measured, chosen, rig, noise, priors), about, loaded)


def default_priors(
    measured: xr.Dataset,
    family: str = "parabola",
    load_cell: LoadCell | None = None,
    nuisances: Sequence[str] = STANDARD,
) -> dict[str, Prior]:
    """The priors that `infer_contour` takes where it is given none, in the record's units; its notes say which.

    Examples
    --------
    >>> from tactile_bayes import scan
    >>> from tactile_bayes.contours import paper_profile
    >>> list(default_priors(scan(paper_profile("II", q=0.5)).record, nuisances=["friction"]))
    ['a', 'q', 'x_c', 'friction', 'moment_noise', 'force_noise']
    """
    measured = validate(measured)
    noise = noise_of(measured, load_cell)
    rig = nuisances_of(measured, nuisances, {}, noise.cell, friction=None)
    return {**contour_priors(measured, family_named(family)), **rig.priors, **noise.priors}


def contour_priors(measured: xr.Dataset, family: Family) -> dict[str, Prior]:
    """Default priors of a contour, from where the pivots are, and how long the rod is."""
    base = float(measured.base_x.mean()), float(measured.base_y.mean())
    return families.default_priors(family, base, rod_of(measured).length)


def prior_in_words(prior: Prior) -> str:
    """A distribution as an attribute."""
    law = getattr(prior, "dist", None)
    if law is None:
        return repr(prior)
    if isinstance(law, rv_histogram):
        counts, edges = law._histogram  # type: ignore[attr-defined]
        return f"histogram of {len(counts)} bins ({zlib.crc32(np.concatenate([counts, edges]).tobytes()):08x})"
    arguments = [f"{a:g}" for a in prior.args] + [f"{k}={v:g}" for k, v in prior.kwds.items()]  # type: ignore[attr-defined]
    return f"{law.name}({', '.join(arguments)})"
