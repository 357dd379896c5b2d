"""The experiment of a calibration: what inference assumes, the rig and contours of the simulation, and the settings."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field, replace
from functools import cached_property

import xarray as xr

from tactile_bayes.calibration.misspecification import Misspecification
from tactile_bayes.checks import check_probability
from tactile_bayes.errors import ParameterError
from tactile_bayes.inference.contour_model import ContourModel
from tactile_bayes.inference.ensembles import SamplerSettings
from tactile_bayes.inference.experiment import ContourProblem, Experiment, contour_problem
from tactile_bayes.numerics.random_numbers import Seed, seed_words
from tactile_bayes.record import rod_of
from tactile_bayes.sweep import Drive
from tactile_bayes.tasks import FieldsAlone, versions_of

_LIBRARIES = ("tactile-bayes", "numpy", "scipy", "emcee", "arviz-stats")


@dataclass(frozen=True, eq=False)
class SimulatedExperiment(FieldsAlone):
    """Simulation of a record and inference from it; `calibrate` describes the entries."""

    # Assumptions of inference, on a template whose drive angles are readings of an encoder without errors.
    assumed: Experiment
    drives: Sequence[Drive]  # drives of the template
    settings: SamplerSettings
    # Settings of a second run if the first has not converged; None for no second run.
    again: SamplerSettings | None = None
    probability: float = 0.9
    seed: Seed = 0
    truth: Misspecification = field(default_factory=Misspecification)

    def __post_init__(self) -> None:
        object.__setattr__(self, "probability", check_probability("probability", self.probability))
        for whose, experiment in (("", self.assumed), (" of the truth", self.simulated)):
            if experiment.noise.stated_cell is None:
                raise ParameterError(
                    f"the load cell{whose} has no noise, so that there is nothing to calibrate: give "
                    "LoadCell(force_noise=0.05, moment_noise=0.02), in the record's units"
                )
        assumed, simulated = (rod_of(each.record).is_dimensionless for each in (self.assumed, self.simulated))
        if assumed != simulated:
            raise ParameterError("one of the rods of rig and truth is dimensionless: give both in the same units")

    @cached_property
    def simulated(self) -> Experiment:
        """Rig and contours of the simulation, with the load cell and rod of inference unless the truth has others."""
        assumed, truth = self.assumed, self.truth.rig or self.assumed.rig
        rig = replace(truth, load_cell=truth.load_cell or assumed.rig.load_cell, rod=truth.rod or assumed.rig.rod)
        return replace(assumed, rig=rig, family=self.truth.family or assumed.own_family)

    @cached_property
    def model(self) -> ContourModel:
        """Model from which truths are drawn, with loads to full accuracy."""
        model = self.simulated.model
        model.likelihood.exact = True
        if self.truth.flat_spot:  # which may obstruct a rod that is clear without it
            model.likelihood.is_always_clear = False
        return model

    @property
    def is_as_assumed(self) -> bool:
        """True if records are simulated from what inference assumes."""
        return not self._differences

    @property
    def _differences(self) -> dict[str, str]:
        """Differences between the simulation and what inference assumes, as text by name."""
        assumed, simulated = self.assumed.assumptions, self.simulated.assumptions
        found = {f"truth_{name}": text for name, text in simulated.items() if text != assumed[name]}
        beside = replace(self.truth, rig=None, family=None)
        return found if beside == Misspecification() else {**found, "misspecification": repr(beside)}

    @property
    def is_of_family(self) -> bool:
        """True if contours are of the family that inference assumes, with the parameters that it knows."""
        drawn, assumed = self.simulated.own_family, self.assumed.own_family
        is_known = assumed.known.items() <= drawn.known.items()
        return drawn.name == assumed.name and is_known and self.truth.flat_spot is None

    def problem_of(self, measured: xr.Dataset) -> ContourProblem:
        """Return the inference problem of a measured record."""
        return contour_problem(replace(self.assumed, record=measured))

    @property
    def identity(self) -> dict[str, str]:
        """Everything that determines the results, as text, for the results store."""
        entries = {
            **self.assumed.assumptions,
            "drives": json.dumps([drive.description for drive in self.drives]),
            "settings": _in_words(self.settings),
            "again": "never" if self.again is None else _in_words(self.again),
            "probability": repr(self.probability),
            "seed": seed_words(self.seed),
        }
        return entries | self._differences | versions_of(*_LIBRARIES)


def _in_words(settings: SamplerSettings) -> str:
    return json.dumps(asdict(settings), default=lambda number: number.item())  # NumPy numbers as Python's
