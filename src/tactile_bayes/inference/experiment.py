"""An experiment: a record, its rig and all priors; its inference problem; and that behind a stored posterior."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, replace
from functools import cached_property
from itertools import product
from typing import Any, NamedTuple

import numpy as np
import xarray as xr

from tactile_bayes.arrays import Flags, Floats
from tactile_bayes.checks import check_kind, check_switch
from tactile_bayes.contours.family import ContourFamily
from tactile_bayes.distributions import Distribution, all_in_words, in_words
from tactile_bayes.errors import InferenceError, ParameterError
from tactile_bayes.inference.contour_model import ContourModel
from tactile_bayes.inference.family import Family, Gauge, family_of
from tactile_bayes.inference.misfit import NO_LOAD
from tactile_bayes.inference.parameters.noise import Noise, noise_of
from tactile_bayes.inference.parameters.priors import default_priors as contour_priors
from tactile_bayes.inference.parameters.priors import refuse_other_rig
from tactile_bayes.inference.parameters.unknowns import Unknowns, belongs, unknowns_of
from tactile_bayes.inference.record_likelihood.likelihood import RecordLikelihood
from tactile_bayes.inference.record_likelihood.record_segments import RecordSegments, without_errors
from tactile_bayes.inference.record_likelihood.shortening import is_long, shortened
from tactile_bayes.inference.result import contour_draws, known_of, posterior_draws, record_of
from tactile_bayes.load_cell import LoadCell
from tactile_bayes.mechanics.rods.rod import Rod
from tactile_bayes.reconstruction import (
    CONTACT_SIDES,
    OTHER_SIDE,
    contacts_of,
    loaded_samples,
    side_of,
    sides_and_doubts,
    with_sides,
)
from tactile_bayes.record import CHANNELS, frame_of, present_channels, record_hash, rod_of, validate, with_rod
from tactile_bayes.record.attributes import rod_attributes
from tactile_bayes.rig.corrected import Corrected, corrected
from tactile_bayes.rig.rig import Rig, rig_of
from tactile_bayes.tasks import FieldsAlone, versions_of
from tactile_bayes.tasks.documents import read_json

_WHOLE = "whole_sha256"  # attribute of a shortened record: the hash of the whole one


@dataclass(frozen=True, eq=False)
class Experiment(FieldsAlone):
    """A record, or a template, its rig and the family of its contour, with priors of all unknown parameters. With a
    `gauge`, the contour is known. `events` says whether unloaded samples count, as in `SamplerSettings`."""

    record: xr.Dataset
    rig: Rig = field(default_factory=Rig)
    family: Family | str = "parabola"
    events: bool = True
    gauge: Gauge | None = None

    def __post_init__(self) -> None:
        check_kind("rig", self.rig, Rig, "give Rig(rod=..., load_cell=...)")
        object.__setattr__(self, "record", with_rod(validate(self.record), self.rig.rod))
        object.__setattr__(self, "family", family_of(self.family))
        object.__setattr__(self, "events", check_switch("events", self.events))

    @cached_property
    def noise(self) -> Noise:
        """Parameters of the noise, and of a discrepancy if it is unknown."""
        return noise_of(self.record, self.rig)

    @cached_property
    def unknowns(self) -> Unknowns:
        """Unknown parameters of the rig."""
        return unknowns_of(self.record, self.rig, self.noise.cell, gauge=self.gauge is not None)

    @property
    def contours(self) -> ContourFamily:
        """Contours of the unknown parameters."""
        return self.own_family.contours if self.gauge is None else self.gauge

    @property
    def own_family(self) -> Family:
        """The family, and what is said of its parameters."""
        assert isinstance(self.family, Family)
        return self.family

    @cached_property
    def priors(self) -> dict[str, Distribution]:
        """Priors of all unknown parameters: the contour's, the rig's and the noise's."""
        base = float(self.record.base_x.mean()), float(self.record.base_y.mean())
        of_contour: dict[str, Distribution] = {}
        if self.gauge is None:
            usual = contour_priors(self.contours, base, rod_of(self.record).length)
            of_contour = {name: self.own_family.priors.get(name, prior) for name, prior in usual.items()}
        return {**of_contour, **self.unknowns.priors, **self.noise.priors}

    @cached_property
    def model(self) -> ContourModel:
        """Prior times likelihood of all samples."""
        if self.rig.calibration is not None:
            refuse_other_rig(self.rig.calibration, self.about)
        return ContourModel(self.record, self.contours, self.unknowns, self.noise, self.priors)

    @cached_property
    def shortened(self) -> Experiment:
        """The experiment with the samples that the likelihood takes, fewer for a long record, but for memory."""
        if self.unknowns.memory:
            return self
        rubs = bool(self.unknowns.friction) or "friction" in self.unknowns.names
        record, cell = shortened(self.record, self.noise.cell, rubs)
        if record is self.record:
            return self
        noted = record.assign_attrs({_WHOLE: record_hash(self.record)})
        if cell.drift == self.noise.cell.drift:
            return replace(self, record=noted)
        stated = self.rig.load_cell or LoadCell.from_record(self.record) or cell
        return replace(self, record=noted, rig=replace(self.rig, load_cell=replace(stated, drift=cell.drift)))

    @property
    def about(self) -> dict[str, Any]:
        """Attributes of a posterior: record, assumptions and priors."""
        attrs, cell = self.record.attrs, self.noise.cell
        sheet = {name: v for name, v in cell.entries().items() if name not in ("frame", *self.noise.names)}
        known = {**self.own_family.known, **self.unknowns.known}
        of_contour = {"family": self.own_family.name, "family_parameters": self.own_family.text}
        if self.gauge is not None:
            of_contour = {"gauge": repr(self.gauge.known)}
        return {
            "data_sha256": attrs.get(_WHOLE) or record_hash(self.record),
            **of_contour,
            "rig": replace(self.rig, load_cell=self.rig.load_cell or LoadCell.from_record(self.record)).text,
            "friction": self.unknowns.friction,
            "known": json.dumps(known),
            "nuisances": json.dumps((*self.unknowns.names, *self.noise.of_discrepancy)),
            "events": int(self.events),
            "priors": all_in_words(self.priors),
            "units": attrs["units"],
            "load_cell_frame": frame_of(self.record),
            **{name: attrs[name] for name in (CONTACT_SIDES, "blocks") if name in attrs},
            **rod_attributes(rod_of(self.record)),
            **({} if self.unknowns.joint is None else self.unknowns.joint.entries),
            "approximations": "; ".join(cell.approximations),
            **{f"load_cell_{name}": value for name, value in sheet.items()},
        }

    @property
    def assumptions(self) -> dict[str, str]:
        """Assumptions of simulations, as text, for the results store."""
        cell, rod = self.rig.load_cell or self.noise.cell, self.rig.rod
        said = {name: v if isinstance(v, float | str) else in_words(v) for name, v in self.rig.said.items()}
        return {
            "family": self.own_family.name,
            "contour": repr(self.own_family),
            "load_cell": json.dumps(cell.entries()),
            "load_cell_frame": cell.frame or "fixed",
            "rod": "dimensionless" if rod is None else json.dumps(asdict(rod)),
            "unknown": json.dumps(said),
            "calibration": "none" if self.rig.calibration is None else json.dumps(self.rig.calibration.entries),
        }


def usual_load_cell(rod: Rod) -> LoadCell:
    """Return a load cell with noise of 0.05 EI/L² and 0.02 EI/L, in the units of a rod."""
    return LoadCell(force_noise=0.05 * rod.force_unit, moment_noise=0.02 * rod.moment_unit)


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


def experiment_of(posterior: xr.DataTree, family: Family | None = None, rig: Rig | None = None) -> Experiment:
    """Return the experiment of which a tree is the posterior."""
    contour_draws(posterior)
    attrs: dict[Any, Any] = posterior.attrs
    found = Experiment(
        record_of(posterior),
        Rig.of(posterior) if rig is None else rig_of(rig),
        Family.of(posterior) if family is None else family_of(family),
        events=bool(attrs.get("events", 1)),
    )
    stated = read_json(attrs.get("priors", "{}"), "priors")
    for name, prior in found.priors.items():
        if stated.get(name) != (own := in_words(prior)):
            raise ParameterError(f"the prior of {name} was {stated.get(name, 'none')}, not {own}: give that one")
    return found


def points_of(posterior: xr.DataTree, names: tuple[str, ...]) -> Floats:
    """Return all draws of a posterior as points of its model, shape (chain, draw, parameter)."""
    draws = contour_draws(posterior)
    return np.stack([draws[name].transpose("chain", "draw").values for name in names], axis=-1)


def predicted_points(posterior: xr.DataTree, names: tuple[str, ...]) -> Floats:
    """Return the draws of a posterior of which it holds predicted records, in their order; shape (records, d)."""
    predicted = posterior["posterior_predictive"].to_dataset()
    draws = contour_draws(posterior).sel(chain=predicted["chain"], draw=predicted["draw"])
    return np.stack([draws[name].transpose("chain", "draw").values.ravel() for name in names], axis=-1)


def likelihood_of(posterior: xr.DataTree, record: xr.Dataset) -> tuple[RecordLikelihood, Unknowns]:
    """Return the likelihood of a posterior's record, of which the paths are, and the unknowns of its rig."""
    inferred = read_json(posterior.attrs.get("nuisances", "[]"), "nuisances")
    names = tuple(name for name in inferred if not belongs(name, "discrepancy"))
    unknowns = Unknowns(names, {}, rod_of(record), known_of(posterior.attrs))
    # `infer_contour` gives a cell whose noise it infers a noise of 1.
    noises: dict[str, Any] = {name: 1.0 for name in ("force_noise", "moment_noise") if name in posterior["posterior"]}
    cell = replace(LoadCell.from_record(record) or LoadCell(), **noises)
    return RecordLikelihood(record, cell, unknowns.friction, rubs="friction" in unknowns.names), unknowns


def segments_of(posterior: xr.DataTree, record: xr.Dataset) -> RecordSegments:
    """Return the sweep segments of a posterior's record, in the order of its events."""
    rubs = posterior.attrs.get("friction", 0.0) > 0.0
    rubs |= "friction" in read_json(posterior.attrs.get("nuisances", "[]"), "nuisances")
    return RecordSegments(record, LoadCell.from_record(record) or LoadCell(), rubs)


def found_rig(measured: xr.Dataset, posterior: xr.DataTree, load_cell: LoadCell | None = None) -> Corrected:
    """Return the rig with the posterior medians of its parameters."""
    draws = posterior_draws(posterior)
    found = {str(name): float(values.median()) for name, values in draws.data_vars.items()}
    stated = load_cell or LoadCell.from_record(measured) or LoadCell()
    names = read_json(posterior.attrs.get("nuisances", "[]"), "nuisances")
    noise: dict[str, Any] = {name: found[name] for name in ("moment_noise", "force_noise") if name in found}
    rig = {name: value for name, value in found.items() if name in names}
    return corrected(measured, replace(stated, **noise), {**known_of(posterior.attrs), **rig})


def contact_points(
    measured: xr.Dataset, posterior: xr.DataTree, load_cell: LoadCell | None = None
) -> xr.Dataset | None:
    """Return contact points by Step 2, with the inferred noise, biases, stiffness, offset and friction."""
    if set(present_channels(measured)) != set(CHANNELS):
        return None
    found = found_rig(measured, posterior, load_cell)
    return contacts_of(found, "constrained" if found.load_cell.has_variances else "raw")
