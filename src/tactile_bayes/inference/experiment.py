"""An experiment: a record, the knowledge of its rig, and priors of all unknown parameters."""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass, field, replace
from functools import cached_property
from typing import Any

import xarray as xr

from tactile_bayes.checks import check_kind, check_switch
from tactile_bayes.contours.family import ContourFamily
from tactile_bayes.distributions import Distribution, all_in_words, in_words
from tactile_bayes.inference.contour_model import ContourModel
from tactile_bayes.inference.family import Family, Gauge, family_of
from tactile_bayes.inference.parameters.noise import Noise, noise_of
from tactile_bayes.inference.parameters.priors import default_priors as contour_priors
from tactile_bayes.inference.parameters.rig_prior import refuse_other_rig
from tactile_bayes.inference.parameters.unknowns import Unknowns, unknowns_of
from tactile_bayes.inference.record_likelihood.shortening import shortened
from tactile_bayes.load_cell import LoadCell
from tactile_bayes.mechanics.rods.rod import Rod
from tactile_bayes.reconstruction import CONTACT_SIDES
from tactile_bayes.record import frame_of, record_hash, rod_of, validate, with_rod
from tactile_bayes.record.attributes import rod_attributes
from tactile_bayes.rig import Rig
from tactile_bayes.tasks import FieldsAlone

_WHOLE = "whole_sha256"  # attribute of a shortened record: the hash of the whole one


@dataclass(frozen=True, eq=False)
class Experiment(FieldsAlone):
    """A record, or a template, its rig and the family of its contour, with priors of all unknown parameters.

    With a `gauge`, the contour is known. `events` says whether unloaded samples count, as in `SamplerSettings`.
    """

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
