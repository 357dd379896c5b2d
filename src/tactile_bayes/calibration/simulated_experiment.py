"""The experiment that is repeated: rig, drive and prior, what is inferred and how, and in what the world differs."""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass, field, fields, replace
from functools import cached_property
from importlib.metadata import version
from typing import Any

import xarray as xr

from tactile_bayes.calibration.world import NUMBERS, World
from tactile_bayes.checks import check_probability
from tactile_bayes.contours.families import family_named
from tactile_bayes.errors import ParameterError
from tactile_bayes.inference.contour_model import ContourModel
from tactile_bayes.inference.contour_problem import ContourProblem, contour_problem
from tactile_bayes.inference.ensembles import SamplerSettings
from tactile_bayes.inference.experiment import Experiment, priors_in_words
from tactile_bayes.inference.likelihood import bases_of
from tactile_bayes.inference.priors import refuse_strangers
from tactile_bayes.load_cell import LoadCell

__all__ = ["SimulatedExperiment"]

_LIBRARIES = ("tactile-bayes", "numpy", "scipy", "emcee", "arviz-stats")


@dataclass(frozen=True)
class SimulatedExperiment:
    """One record, drawn, measured and inferred from; `calibrate` says what each entry means."""

    assumed: Experiment
    """What inference assumes, on a template: its drive angles are those read where the encoder makes no error."""
    drive_angles: tuple[float, ...]
    bases: tuple[tuple[float, float], ...]
    directions: tuple[str, ...]
    settings: SamplerSettings
    again: SamplerSettings | None = None
    """Of a second run, where the first has not converged."""
    probability: float = 0.9
    seed: int = 0
    world: World = field(default_factory=World)

    def __post_init__(self) -> None:
        object.__setattr__(self, "probability", check_probability("probability", self.probability))
        if self.assumed.noise.stated_cell is None:
            raise ParameterError(
                "the load cell has no noise, so that there is nothing to be calibrated: give "
                "LoadCell(force_noise=0.05, moment_noise=0.02), in the record's units"
            )
        refuse_strangers(self.world.priors, self.names, "of the world ")

    def __getstate__(self) -> dict[str, Any]:
        """Return the fields alone: the model is built again where it is needed."""
        return {each.name: getattr(self, each.name) for each in fields(self)}

    @property
    def load_cell(self) -> LoadCell:
        """The load cell that inference assumes."""
        return self.assumed.noise.cell

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the parameters of a truth, in the order of the model."""
        family = family_named(self.world.family or self.assumed.family)
        return (*family.parameters, *self.assumed.rig.names, *self.assumed.noise.names)

    @cached_property
    def model(self) -> ContourModel:
        """What truths are drawn from, and to full accuracy what they would make the rod's base feel."""
        names, priors = self.names, {**self.assumed.priors, **self.world.priors}
        own = {name: prior for name, prior in priors.items() if name in names}
        model = replace(self.assumed, family=self.world.family or self.assumed.family, priors=own).model
        model.likelihood.exact = True
        if self.world.friction or self.world.flat_spot:  # a family that is always clear without may be not with them
            model.likelihood.is_always_clear = False
        return model

    @property
    def is_of_family(self) -> bool:
        """Whether contours are of the family that inference takes them for."""
        return self.world.family in (None, self.assumed.family) and self.world.flat_spot is None

    @property
    def parameters(self) -> int:
        """How many are inferred."""
        return len(self.assumed.default_priors)

    @property
    def pivots(self) -> int:
        return len(bases_of(self.assumed.record))

    def problem_of(self, measured: xr.Dataset) -> ContourProblem:
        """What is inferred from a record."""
        return contour_problem(replace(self.assumed, record=measured))

    @property
    def words(self) -> dict[str, str]:
        """What its numbers follow from; the same words, the same numbers."""
        world = self.world
        told = self.assumed.assumptions | {
            "drive_angles": json.dumps(self.drive_angles),
            "bases": json.dumps(self.bases),
            "directions": json.dumps(self.directions),
            "events": repr(self.assumed.events),
            "settings": json.dumps(asdict(self.settings), default=_plain),
            "again": "never" if self.again is None else json.dumps(asdict(self.again), default=_plain),
            "probability": repr(self.probability),
            "seed": repr(self.seed),
        }
        told["world_family"] = world.family or self.assumed.family
        told |= {f"world_{name}": repr(getattr(world, name)) for name in NUMBERS}
        told["world_load_cell"] = "as stated" if world.load_cell is None else json.dumps(world.load_cell.entries())
        told["world_priors"] = priors_in_words(world.priors)
        return told | {f"version of {name}": version(name) for name in _LIBRARIES}


def _plain(value: Any) -> Any:
    """A number of NumPy as one of Python."""
    return value.item()
