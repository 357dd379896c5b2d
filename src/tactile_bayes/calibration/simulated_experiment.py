"""The experiment of a calibration: what inference assumes, the rig and contours of the simulation, and the settings."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field, fields, replace
from functools import cached_property

import numpy as np
import xarray as xr

from tactile_bayes.checks import check_numbers, check_optional, check_probability
from tactile_bayes.contours import Contour, ShapeFree
from tactile_bayes.errors import ParameterError
from tactile_bayes.inference.contour_model import ContourModel
from tactile_bayes.inference.ensembles import SamplerSettings
from tactile_bayes.inference.experiment import ContourProblem, Experiment, contour_problem
from tactile_bayes.inference.family import Family, family_of
from tactile_bayes.inference.parameters.unknowns import RigValues
from tactile_bayes.numerics.random_numbers import Seed, seed_words
from tactile_bayes.record import rod_of
from tactile_bayes.rig.rig import Rig
from tactile_bayes.sweep import Drive
from tactile_bayes.tasks import FieldsAlone, versions_of

_SPOT = 0.1  # standard deviation of a flat spot in slope angle [rad]
# Largest slope angle [rad], and number of knots, of a contour with a flat spot, which is a spline.
_ENDS, _KNOTS = 1.5, 121
_LIBRARIES = ("tactile-bayes", "numpy", "scipy", "emcee", "arviz-stats")


@dataclass(frozen=True)
class Misspecification:
    """Differences between a simulation and what inference assumes, also those that no `Rig` can state; by default none.

    Parameters
    ----------
    rig : Rig, optional
        The rig from which records are simulated, if it is another than inference assumes.
    base_shift : (float, float)
        Shift of all pivots from their recorded positions [length]; those of single ones are `base_2_x` and so on of a
        `Rig`.
    flat_spot : (float, float), optional
        Slope angle [rad], and factor, > 0, by which the radius of curvature is larger there than that of the drawn
        contour; the factor's logarithm falls off as a bell curve with a standard deviation of 0.1 rad.
    family : Family or str, optional
        Family from which contours are drawn, with its own priors, in place of the one that inference assumes.

    Raises
    ------
    ParameterError
        If an entry is impossible, or there is no such family.

    Examples
    --------
    >>> Misspecification(base_shift=(0.01, 0.0))
    Misspecification(base_shift=(0.01, 0.0))
    """

    rig: Rig | None = None
    base_shift: tuple[float, float] = (0.0, 0.0)
    flat_spot: tuple[float, float] | None = None
    family: Family | str | None = None

    def __post_init__(self) -> None:
        check_optional("rig of the misspecification", self.rig, Rig)
        for name in ("base_shift", "flat_spot"):
            if (given := getattr(self, name)) is not None or name == "base_shift":
                numbers = check_numbers(f"{name} of the misspecification", given, "give 2 finite numbers", shape=(2,))
                object.__setattr__(self, name, tuple(numbers.tolist()))
        if self.flat_spot is not None and not self.flat_spot[1] > 0.0:
            raise ParameterError(
                f"the factor of a flat spot of the misspecification is {self.flat_spot[1]:g}: give a positive number"
            )
        if self.family is not None:
            object.__setattr__(self, "family", family_of(self.family))

    def __repr__(self) -> str:
        given = {each.name: getattr(self, each.name) for each in fields(self)}
        differing = (f"{each.name}={given[each.name]!r}" for each in fields(self) if given[each.name] != each.default)
        return f"Misspecification({', '.join(differing)})"

    def contour(self, drawn: Contour) -> Contour:
        """Return the contour of the object, shape (1,), from a drawn one."""
        if self.flat_spot is None:
            return drawn
        slopes = np.linspace(-_ENDS, _ENDS, _KNOTS)
        at, factor = self.flat_spot
        radius = np.asarray(drawn.radius_of_curvature(slopes), dtype=float)
        x, y = (np.ravel(np.asarray(value, dtype=float))[0] for value in drawn.point(0.0))
        flatter = np.log(radius) + np.log(factor) * np.exp(-0.5 * ((slopes - at) / _SPOT) ** 2)
        return ShapeFree(slopes, flatter[None], x=x, y=y, at=0.0)

    def shifted(self, drawn: RigValues, pivots: int) -> RigValues:
        """Return the rig of one contour from the drawn one, with its pivots shifted."""
        shifts = np.zeros((1, pivots, 2))
        if drawn.base_shifts is not None:
            shifts[:, : drawn.base_shifts.shape[1]] += drawn.base_shifts
        return drawn._replace(base_shifts=shifts + np.array(self.base_shift))


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
