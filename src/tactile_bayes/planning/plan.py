"""A plan of sweeps: contour, drive, rod, load cell, and the unknowns of the rig."""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Literal

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike

from tactile_bayes.arrays import Floats
from tactile_bayes.checks import check_choice, check_names, check_optional, check_positive
from tactile_bayes.contours import Contour
from tactile_bayes.contours.base import check_single
from tactile_bayes.errors import ClearanceWarning, ParameterError
from tactile_bayes.inference.contour_model import ContourModel
from tactile_bayes.inference.experiment import Experiment, usual_load_cell
from tactile_bayes.inference.parameters.nuisances import STANDARD
from tactile_bayes.inference.parameters.priors import Prior, check_priors
from tactile_bayes.load_cell import LoadCell
from tactile_bayes.load_cell.data_sheet import CERTAIN
from tactile_bayes.mechanics.rods.rod import Rod
from tactile_bayes.planning.family_parameters import family_parameters
from tactile_bayes.planning.record_information import ReadingSlopes, reading_slopes
from tactile_bayes.reconstruction import reconstruct
from tactile_bayes.record import CHANNELS
from tactile_bayes.sweep import Drive, Scan, scan
from tactile_bayes.sweep.path import friction_angle_of
from tactile_bayes.sweep.scanning import drives_of

__all__ = ["Plan"]


@dataclass(frozen=True, eq=False)
class Plan:
    """A plan of sweeps: contour, drive, rod, load cell, and the unknowns of the rig.

    Parameters
    ----------
    contour : Contour
        A contour of a family with parameters, in the unit of the rod's length.
    load_cell : LoadCell, optional
        In the units of the rod; by default force_noise 0.05 EI/L² and moment_noise 0.02 EI/L.
    rod : Rod, optional
        By default the dimensionless rod.
    drive, base, direction, drive_step, drive_angles
        As in `scan`.
    friction, nuisances, priors
        As in `infer_contour`: a friction that is given is known; by default there is none, and inference treats it as
        unknown. Priors of the contour's parameters may be given, too.

    Raises
    ------
    ParameterError
        If a channel has no noise or noise without a variance, or an argument has a wrong type.
    """

    contour: Contour
    load_cell: LoadCell | None = None
    rod: Rod | None = None
    drive: Drive | Sequence[Drive] | None = None
    base: tuple[float, float] | Sequence[tuple[float, float]] = (0.0, 0.0)
    direction: Literal["both", "forward", "backward"] = "both"
    drive_step: float | None = None
    drive_angles: ArrayLike | None = None
    friction: float | None = None
    nuisances: Sequence[str] = STANDARD
    priors: Mapping[str, Prior] = field(default_factory=dict)

    def __post_init__(self) -> None:
        check_optional("rod", self.rod, Rod)
        check_optional("load_cell", self.load_cell, LoadCell)
        check_single("contour", self.contour)
        drives_of(self.drive, self.base)
        check_choice("direction", self.direction, ("both", "forward", "backward"))
        friction_angle_of(0.0 if self.friction is None else self.friction)
        check_priors("priors", self.priors)
        object.__setattr__(self, "nuisances", tuple(check_names("nuisances", self.nuisances)))
        deviations = self.cell.standard_deviations
        silent = [name for name in CHANNELS if not 0.0 < deviations[name] < np.inf]
        if silent:
            raise ParameterError(
                f"the load cell states no finite noise of {', '.join(silent)}: without it errors are "
                "unknown; give LoadCell(force_noise=..., moment_noise=...), from its data sheet, or from_zero_load"
            )

    @property
    def taken_rod(self) -> Rod:
        """The rod, or the dimensionless one by default."""
        return self.rod or Rod()

    @property
    def taken_friction(self) -> float:
        """Coulomb's coefficient, 0 by default."""
        return self.friction or 0.0

    @cached_property
    def cell(self) -> LoadCell:
        """The load cell, or the usual one by default."""
        return self.load_cell or usual_load_cell(self.taken_rod)

    @cached_property
    def scan(self) -> Scan:
        """The sweeps without errors; angles that one direction adds may be those of another turn in the other one."""
        with warnings.catch_warnings():
            warnings.filterwarnings("ignore", message=".* a turn ", category=ClearanceWarning)
            return scan(
                self.contour,
                drive=self.drive,
                direction=self.direction,
                base=self.base,
                drive_step=self.drive_step,
                drive_angles=self.drive_angles,
                rod=self.rod,
                friction=self.taken_friction,
            )

    @cached_property
    def record(self) -> xr.Dataset:
        """The record that the load cell would read without random errors."""
        return self.certain(self.scan.record)

    def certain(self, record: xr.Dataset) -> xr.Dataset:
        """Return an ideal record as the load cell reads it without random errors."""
        certain = LoadCell(**{name: getattr(self.cell, name) for name in (*CERTAIN, "frame")})
        return certain.measure(record, seed=0)

    def reconstruct(self, record: xr.Dataset, method: Literal["raw", "constrained"]) -> xr.Dataset:
        """Return the contact points of a record of this plan; see `tactile_bayes.reconstruct`."""
        return reconstruct(record, method=method, load_cell=self.cell, rod=self.rod, friction=self.taken_friction)

    @cached_property
    def family(self) -> str:
        """Family of the contour."""
        return family_parameters(self.contour)[0]

    @cached_property
    def experiment(self) -> Experiment:
        """Inference from the record, with the contour's own family."""
        return Experiment(self.record, self.family, self.cell, self.priors, self.rod, self.friction, self.nuisances)

    @cached_property
    def model(self) -> ContourModel:
        """The model of the experiment, with loads to full accuracy."""
        model = self.experiment.model
        model.likelihood.exact = True
        return model

    @cached_property
    def point(self) -> Floats:
        """True values of the model's parameters, with the rig as stated, shape (d,).

        A discrepancy has the medians of its priors.
        """
        smooth = self.model.noise.of_discrepancy
        own = {**family_parameters(self.contour)[1], **dict(zip(smooth, self.model.prior_medians(smooth), strict=True))}
        as_stated = {name: 1.0 for name in self.model.names if name.endswith(("_scale", "_gain"))}
        return np.array([own.get(name, as_stated.get(name, 0.0)) for name in self.model.names])

    @cached_property
    def reading_slopes(self) -> ReadingSlopes:
        """Loads and derivatives of the readings at the point, which take longest of all that a plan is asked for."""
        return reading_slopes(self.model, self.point)

    def with_noise(self, factor: float) -> Plan:
        """Return the plan with force_noise and moment_noise of the load cell multiplied by a factor."""
        check_positive("factor", factor)
        noisier = replace(
            self.cell, force_noise=factor * self.cell.force_noise, moment_noise=factor * self.cell.moment_noise
        )
        return replace(self, load_cell=noisier)
