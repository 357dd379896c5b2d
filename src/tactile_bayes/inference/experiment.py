"""An experiment: a record, the knowledge of its rig, and priors of all unknown parameters."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field, fields, replace
from functools import cached_property
from typing import Any

import xarray as xr

from tactile_bayes.checks import check_names, check_optional, check_switch
from tactile_bayes.contours.families import family_named
from tactile_bayes.contours.family import Family
from tactile_bayes.errors import ParameterError
from tactile_bayes.inference.contour_model import ContourModel
from tactile_bayes.inference.gauge import Gauge
from tactile_bayes.inference.parameters.discrepancy import discrepancy_priors
from tactile_bayes.inference.parameters.noise import Noise, noise_of
from tactile_bayes.inference.parameters.nuisances import STANDARD, Nuisances, nuisances_of
from tactile_bayes.inference.parameters.prior_text import priors_in_words
from tactile_bayes.inference.parameters.priors import Prior, check_priors, refuse_unknown_priors
from tactile_bayes.inference.parameters.priors import default_priors as contour_priors
from tactile_bayes.inference.parameters.rig_prior import RigPrior
from tactile_bayes.inference.record_likelihood.shortening import shortened
from tactile_bayes.load_cell import LoadCell
from tactile_bayes.mechanics.rods.rod import Rod
from tactile_bayes.reconstruction import CONTACT_SIDES
from tactile_bayes.record import frame_of, record_hash, rod_of, validate, with_rod
from tactile_bayes.record.attributes import rod_attributes

__all__ = ["Experiment", "default_priors", "usual_load_cell"]

_WHOLE = "whole_sha256"
"""Attribute of a shortened record: the hash of the whole one."""


@dataclass(frozen=True, eq=False)
class Experiment:
    """A record, the knowledge of contour and rig, and priors of all unknown parameters.

    Parameters
    ----------
    record : xr.Dataset
        Measured record, or a template.
    family, load_cell, priors, rod, friction, nuisances, events
        As in `infer_contour`.
    gauge : Gauge, optional
        The known contour, in place of a family.
    joint : RigPrior, optional
        Joint prior of the rig's parameters that a calibration has found.

    Raises
    ------
    RecordError, ParameterError
        As in `infer_contour`.

    Examples
    --------
    >>> from tactile_bayes import scan
    >>> from tactile_bayes.contours import paper_profile
    >>> experiment = Experiment(scan(paper_profile("II", q=0.5)).record, nuisances=["friction"])
    >>> experiment.model.names
    ('a', 'q', 'x_c', 'friction', 'moment_noise', 'force_noise')
    """

    record: xr.Dataset
    family: str = "parabola"
    load_cell: LoadCell | None = None
    priors: Mapping[str, Prior] = field(default_factory=dict)
    rod: Rod | None = None
    friction: float | None = None
    nuisances: Sequence[str] = STANDARD
    events: bool = True
    gauge: Gauge | None = None
    joint: RigPrior | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "record", with_rod(validate(self.record), self.rod))
        check_optional("load_cell", self.load_cell, LoadCell, "give LoadCell(force_noise=0.05, moment_noise=0.02)")
        object.__setattr__(self, "events", check_switch("events", self.events))
        check_priors("priors", self.priors)
        object.__setattr__(self, "nuisances", tuple(check_names("nuisances", self.nuisances)))
        both = sorted(set(self.priors) & set(self.joint.priors)) if self.joint is not None else []
        if both:
            raise ParameterError(f"there is a prior of {', '.join(both)} beside that of the rig: leave one of the two")
        more = ", and of the rig moment_gain, friction and so on, which help(infer_contour) lists"
        refuse_unknown_priors(self.priors, self.default_priors, more=more)

    def __getstate__(self) -> dict[str, Any]:
        """Return the fields alone: the model is built again where it is needed."""
        return {each.name: getattr(self, each.name) for each in fields(self)}

    @cached_property
    def noise(self) -> Noise:
        """Parameters of the noise, and of a discrepancy if it is asked for."""
        return noise_of(self.record, self.load_cell, discrepancy_priors(self.nuisances, self.priors))

    @cached_property
    def rig(self) -> Nuisances:
        """Nuisance parameters of the rig."""
        given = self.record, self.nuisances, self.priors, self.noise.cell, self.friction, self.joint
        return nuisances_of(*given, gauge=self.gauge is not None)

    @property
    def shapes(self) -> Family:
        """Family of the contour."""
        return family_named(self.family) if self.gauge is None else self.gauge

    @cached_property
    def default_priors(self) -> dict[str, Prior]:
        """Default priors of all parameters: the contour's, the rig's and the noise's."""
        base = float(self.record.base_x.mean()), float(self.record.base_y.mean())
        known = self.gauge is not None
        of_contour = {} if known else contour_priors(self.shapes, base, rod_of(self.record).length)
        return {**of_contour, **self.rig.priors, **self.noise.priors}

    @cached_property
    def model(self) -> ContourModel:
        """Prior times likelihood of all samples."""
        priors = {**self.default_priors, **self.priors}
        return ContourModel(self.record, self.shapes, self.rig, self.noise, priors)

    @cached_property
    def shortened(self) -> Experiment:
        """The experiment with the samples that the likelihood takes, which are fewer for a long record."""
        record, cell = shortened(self.record, self.noise.cell)
        if record is self.record:
            return self
        noted = record.assign_attrs({_WHOLE: record_hash(self.record)})
        if cell.drift == self.noise.cell.drift:
            return replace(self, record=noted)
        stated = self.load_cell or LoadCell.from_record(self.record) or cell
        return replace(self, record=noted, load_cell=replace(stated, drift=cell.drift))

    @property
    def about(self) -> dict[str, Any]:
        """Attributes of a posterior: record, assumptions and priors."""
        attrs, cell = self.record.attrs, self.noise.cell
        return {
            "data_sha256": attrs.get(_WHOLE) or record_hash(self.record),
            **({"family": self.family} if self.gauge is None else {"gauge": repr(self.gauge.known)}),
            "friction": self.rig.friction,
            "nuisances": json.dumps((*self.rig.names, *self.noise.of_discrepancy)),
            "events": int(self.events),
            "priors": priors_in_words({**self.default_priors, **self.priors}),
            "units": attrs["units"],
            "load_cell_frame": frame_of(self.record),
            **{name: attrs[name] for name in (CONTACT_SIDES, "blocks") if name in attrs},
            **rod_attributes(rod_of(self.record)),
            **({} if self.rig.joint is None else self.rig.joint.entries),
            "approximations": "; ".join(cell.approximations),
            **{f"load_cell_{name}": v for name, v in cell.entries().items() if name not in self.noise.inferred},
        }

    @property
    def assumptions(self) -> dict[str, str]:
        """Assumptions of simulations, as text, for the results store."""
        cell = self.load_cell or self.noise.cell
        return {
            "family": self.family,
            "load_cell": json.dumps(cell.entries()),
            "load_cell_frame": cell.frame or "fixed",
            "rod": "dimensionless" if self.rod is None else json.dumps(asdict(self.rod)),
            "priors": priors_in_words(self.priors),
            "nuisances": json.dumps(self.nuisances),
            "friction": repr(self.friction),
        }


def usual_load_cell(rod: Rod) -> LoadCell:
    """Return a load cell with noise of 0.05 EI/L² and 0.02 EI/L, in the units of a rod."""
    return LoadCell(force_noise=0.05 * rod.force_unit, moment_noise=0.02 * rod.moment_unit)


def default_priors(
    measured: xr.Dataset,
    family: str = "parabola",
    load_cell: LoadCell | None = None,
    nuisances: Sequence[str] = STANDARD,
) -> dict[str, Prior]:
    """Return the default priors of `infer_contour`, in the record's units; its notes describe them.

    Parameters
    ----------
    measured, family, load_cell, nuisances
        As in `infer_contour`.

    Returns
    -------
    dict of str to frozen scipy.stats distribution

    Raises
    ------
    RecordError, ParameterError
        As in `infer_contour`.

    Examples
    --------
    >>> from tactile_bayes import scan
    >>> from tactile_bayes.contours import paper_profile
    >>> list(default_priors(scan(paper_profile("II", q=0.5)).record, nuisances=["friction"]))
    ['a', 'q', 'x_c', 'friction', 'moment_noise', 'force_noise']
    """
    return Experiment(measured, family, load_cell, nuisances=nuisances).default_priors
