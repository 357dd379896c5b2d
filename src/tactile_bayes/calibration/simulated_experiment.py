"""The experiment of a calibration: rig, drive, prior, inference, and the misspecification of the simulated rig."""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass, field, fields, replace
from functools import cached_property
from importlib.metadata import version
from typing import Any

import xarray as xr

from tactile_bayes.calibration.misspecification import NUMBERS, Misspecification
from tactile_bayes.checks import check_probability
from tactile_bayes.contours.families import family_named
from tactile_bayes.errors import ParameterError
from tactile_bayes.inference.contour_model import ContourModel
from tactile_bayes.inference.contour_problem import ContourProblem, contour_problem
from tactile_bayes.inference.ensembles import SamplerSettings
from tactile_bayes.inference.experiment import Experiment
from tactile_bayes.inference.parameters.prior_text import priors_in_words
from tactile_bayes.inference.parameters.priors import refuse_unknown_priors
from tactile_bayes.load_cell import LoadCell
from tactile_bayes.record import bases_of
from tactile_bayes.sweep import Carried, Drive

__all__ = ["SimulatedExperiment"]

_LIBRARIES = ("tactile-bayes", "numpy", "scipy", "emcee", "arviz-stats")


@dataclass(frozen=True)
class SimulatedExperiment:
    """Simulation of a record and inference from it; `calibrate` describes the entries."""

    assumed: Experiment
    """Assumptions of inference, on a template whose drive angles are readings of an encoder without errors."""
    drive_angles: tuple[float, ...]
    bases: tuple[tuple[float, float], ...]
    directions: tuple[str, ...]
    settings: SamplerSettings
    again: SamplerSettings | None = None
    """Settings of a second run if the first has not converged; None for no second run."""
    probability: float = 0.9
    seed: int = 0
    world: Misspecification = field(default_factory=Misspecification)
    drives: tuple[Drive, ...] = ()
    """Drives, unless they are rotations about `bases`."""

    def __post_init__(self) -> None:
        object.__setattr__(self, "probability", check_probability("probability", self.probability))
        if self.assumed.noise.stated_cell is None:
            raise ParameterError(
                "the load cell has no noise, so that there is nothing to calibrate: give "
                "LoadCell(force_noise=0.05, moment_noise=0.02), in the record's units"
            )
        refuse_unknown_priors(self.world.priors, self.names, "of the misspecification (world) ")

    def __getstate__(self) -> dict[str, Any]:
        """Return the fields alone: the model is built again where it is needed."""
        return {each.name: getattr(self, each.name) for each in fields(self)}

    @property
    def load_cell(self) -> LoadCell:
        """Load cell that inference assumes."""
        return self.assumed.noise.cell

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the parameters of a truth, in the order of the model."""
        family = family_named(self.world.family or self.assumed.family)
        return (*family.parameters, *self.assumed.rig.names, *self.assumed.noise.names)

    @cached_property
    def model(self) -> ContourModel:
        """Model from which truths are drawn, with loads to full accuracy."""
        names, priors = self.names, {**self.assumed.priors, **self.world.priors}
        own = {name: prior for name, prior in priors.items() if name in names}
        model = replace(self.assumed, family=self.world.family or self.assumed.family, priors=own).model
        model.likelihood.exact = True
        if self.world.friction or self.world.flat_spot:  # these may obstruct a rod that is clear without them
            model.likelihood.is_always_clear = False
        return model

    @property
    def is_of_family(self) -> bool:
        """True if contours are of the family that inference assumes."""
        return self.world.family in (None, self.assumed.family) and self.world.flat_spot is None

    @property
    def parameters(self) -> int:
        """Number of inferred parameters."""
        return len(self.assumed.default_priors)

    @property
    def pivots(self) -> int:
        """Number of pivots."""
        return len(bases_of(self.assumed.record))

    def problem_of(self, measured: xr.Dataset) -> ContourProblem:
        """Return the inference problem of a measured record."""
        return contour_problem(replace(self.assumed, record=measured))

    @property
    def identity(self) -> dict[str, str]:
        """Everything that determines the results, as text, for the results store."""
        world = self.world
        entries = self.assumed.assumptions | {
            "drive_angles": json.dumps(self.drive_angles),
            "bases": json.dumps(self.bases),
            "directions": json.dumps(self.directions),
            "events": repr(self.assumed.events),
            "settings": json.dumps(asdict(self.settings), default=_plain),
            "again": "never" if self.again is None else json.dumps(asdict(self.again), default=_plain),
            "probability": repr(self.probability),
            "seed": repr(self.seed),
        }
        if self.drives:
            entries["drives"] = json.dumps([_described(drive) for drive in self.drives])
        if world != Misspecification():
            entries["world_truth"] = "of the simulated rig"
        entries["world_family"] = world.family or self.assumed.family
        entries |= {f"world_{name}": repr(getattr(world, name)) for name in NUMBERS}
        entries["world_load_cell"] = "as stated" if world.load_cell is None else json.dumps(world.load_cell.entries())
        entries["world_priors"] = priors_in_words(world.priors)
        return entries | {f"version of {name}": version(name) for name in _LIBRARIES}


def _described(drive: Drive) -> Any:
    return drive.poses.tolist() if isinstance(drive, Carried) else drive.base


def _plain(value: Any) -> Any:
    """Convert a NumPy number to a Python number."""
    return value.item()
