"""The experiment that is repeated: rig, drive and prior, what is inferred and how, and in what the world differs."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, fields
from functools import cached_property
from importlib.metadata import version
from typing import Any

import numpy as np
import xarray as xr

from tactile_bayes.calibration.world import NUMBERS, World
from tactile_bayes.checks import check_probability
from tactile_bayes.contours.families import family_named
from tactile_bayes.errors import ParameterError
from tactile_bayes.inference.contour_model import ContourModel
from tactile_bayes.inference.contour_problem import (
    Assumptions,
    ContourProblem,
    contour_priors,
    contour_problem,
    prior_in_words,
)
from tactile_bayes.inference.ensembles import SamplerSettings
from tactile_bayes.inference.likelihood import bases_of
from tactile_bayes.inference.noise import noise_of
from tactile_bayes.inference.nuisances import STANDARD, nuisances_of
from tactile_bayes.inference.priors import Prior, refuse_wrong_priors
from tactile_bayes.load_cell import LoadCell
from tactile_bayes.mechanics.rod import Rod
from tactile_bayes.sweep import record_template

__all__ = ["Experiment"]

_LIBRARIES = ("tactile-bayes", "numpy", "scipy", "emcee", "arviz-stats")


@dataclass(frozen=True)
class Experiment:
    """One record, drawn, measured and inferred from; `calibrate` says what each entry means."""

    family: str
    load_cell: LoadCell
    drive_angles: tuple[float, ...]
    rod: Rod | None = None
    bases: tuple[tuple[float, float], ...] = ((0.0, 0.0),)
    directions: tuple[str, ...] = ("forward", "backward")
    priors: Mapping[str, Prior] = field(default_factory=dict)
    nuisances: tuple[str, ...] = STANDARD
    friction: float | None = None
    events: bool = True
    settings: SamplerSettings = field(default_factory=SamplerSettings)
    again: SamplerSettings | None = None
    """Of a second run, where the first has not converged."""
    probability: float = 0.9
    seed: int = 0
    world: World = field(default_factory=World)

    def __post_init__(self) -> None:
        object.__setattr__(self, "probability", check_probability("probability", self.probability))
        if not any(self.load_cell.standard_deviations.values()):
            raise ParameterError(
                "the load cell has no noise, so that there is nothing to be calibrated: give "
                "LoadCell(force_noise=0.05, moment_noise=0.02), in the record's units"
            )
        own = {*family_named(self.family).parameters, *self.model.nuisances.names, *self.model.noise.names}
        for whose, priors, names in (("", self.priors, own), ("of the world ", self.world.priors, self.model.names)):
            refuse_wrong_priors(priors, sorted(names), whose)

    def __getstate__(self) -> dict[str, Any]:
        """Without what follows from the rest, to travel lightly."""
        return {each.name: getattr(self, each.name) for each in fields(self)}

    @cached_property
    def template(self) -> xr.Dataset:
        """The record without loads: its drive angles are those read where the encoder makes no error of its own."""
        angles = np.asarray(self.drive_angles, dtype=float)
        return record_template(self.bases, self.directions, angles, self.rod, self.load_cell)

    @cached_property
    def model(self) -> ContourModel:
        """What truths are drawn from, and to full accuracy what they would make the rod's base feel."""
        noise = noise_of(self.template, self.load_cell)
        rig = nuisances_of(self.template, self.nuisances, self.priors, noise.cell, self.friction)
        family = family_named(self.world.family or self.family)
        defaults = {**contour_priors(self.template, family), **rig.priors, **noise.priors}
        priors = {**defaults, **self.priors, **self.world.priors}
        priors = {name: priors[name] for name in (*family.parameters, *rig.names, *noise.names)}
        model = ContourModel(self.template, family, rig, noise, priors)
        model.likelihood.exact = True
        if self.world.friction or self.world.flat_spot:  # a family that is always clear without may be not with them
            model.likelihood.is_always_clear = False
        return model

    @property
    def is_of_family(self) -> bool:
        """Whether contours are of the family that inference takes them for."""
        return self.world.family in (None, self.family) and self.world.flat_spot is None

    @property
    def parameters(self) -> int:
        """How many are inferred."""
        own = family_named(self.family).parameters
        return len(own) + len(self.model.nuisances.names) + len(self.model.noise.names)

    @property
    def pivots(self) -> int:
        return len(bases_of(self.template))

    def problem_of(self, measured: xr.Dataset) -> ContourProblem:
        """What is inferred from a record."""
        given = self.family, self.load_cell, self.priors
        return contour_problem(measured, Assumptions(*given, None, self.friction, self.nuisances, self.events))

    @property
    def words(self) -> dict[str, str]:
        """What its numbers follow from; the same words, the same numbers."""
        world = self.world
        told = {
            "family": self.family,
            "load_cell": json.dumps(self.load_cell.entries()),
            "load_cell_frame": self.load_cell.frame or "fixed",
            "drive_angles": json.dumps(self.drive_angles),
            "rod": "dimensionless" if self.rod is None else json.dumps(asdict(self.rod)),
            "bases": json.dumps(self.bases),
            "directions": json.dumps(self.directions),
            "priors": json.dumps({name: prior_in_words(prior) for name, prior in self.priors.items()}),
            "nuisances": json.dumps(self.nuisances),
            "friction": repr(self.friction),
            "events": repr(self.events),
            "settings": json.dumps(asdict(self.settings), default=_plain),
            "again": "never" if self.again is None else json.dumps(asdict(self.again), default=_plain),
            "probability": repr(self.probability),
            "seed": repr(self.seed),
        }
        told["world_family"] = world.family or self.family
        told |= {f"world_{name}": repr(getattr(world, name)) for name in NUMBERS}
        told["world_load_cell"] = "as stated" if world.load_cell is None else json.dumps(world.load_cell.entries())
        told["world_priors"] = json.dumps({name: prior_in_words(prior) for name, prior in world.priors.items()})
        return told | {f"version of {name}": version(name) for name in _LIBRARIES}


def _plain(value: Any) -> Any:
    """A number of NumPy as one of Python."""
    return value.item()
