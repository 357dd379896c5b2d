"""A plan of sweeps: contour, rig and drive."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, Literal

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike

from tactile_bayes.arrays import Floats
from tactile_bayes.checks import check_choice, check_optional, check_positive
from tactile_bayes.contours import Contour, Joined
from tactile_bayes.contours.base import check_single
from tactile_bayes.contours.families import FLANKS, family_named, sides_of
from tactile_bayes.errors import ClearanceWarning, ParameterError
from tactile_bayes.inference.contour_model import ContourModel
from tactile_bayes.inference.experiment import Experiment, usual_load_cell
from tactile_bayes.inference.family import Family
from tactile_bayes.load_cell import LoadCell
from tactile_bayes.load_cell.data_sheet import CERTAIN, MEMORY
from tactile_bayes.mechanics.rods.rod import Rod
from tactile_bayes.planning.record_information import ReadingSlopes, reading_slopes
from tactile_bayes.reconstruction import contacts_of
from tactile_bayes.record import CHANNELS, validate, with_rod
from tactile_bayes.rig.corrected import corrected
from tactile_bayes.rig.rig import Rig, rig_of
from tactile_bayes.rig.stated import stated_values
from tactile_bayes.sweep import Drive, Rotation, Scan, drives_of, scan

SAMPLE_COLUMNS = ["sweep", "direction", "base_x", "base_y", "drive_angle"]  # columns of a record that results repeat


def family_parameters(contour: Contour) -> tuple[str, dict[str, float]]:
    """Return the name of a contour's family, as in `infer_contour`, and its parameters."""
    if not isinstance(contour, Contour):
        raise ParameterError(f"{contour!r} is no contour: give one of tb.contours, like paper_profile('II', q=0.5)")
    if contour.shape != ():
        raise ParameterError(f"{contour!r} is a list of contours: give a single one")
    halves: list[Any] = [contour.left, contour.right] if isinstance(contour, Joined) else [contour]
    names = [name for half in halves for name, flank in FLANKS.items() if isinstance(half, flank.contour)]
    if len(names) < len(halves) or len(vertices := {(float(half.q), float(half.x_c)) for half in halves}) > 1:
        raise ParameterError(
            f"{type(contour).__name__} is of no family with parameters: give a parabola, circle, ellipse or power law, "
            "or two of these joined at their vertex"
        )
    ((q, x_c),) = vertices
    family = "/".join(names)
    own = {
        f"{side}{parameter}": float(getattr(half, parameter))
        for half, (side, flank) in zip(halves, sides_of(family).items(), strict=True)
        for parameter in FLANKS[flank].table
    }
    return family, {**own, "q": q, "x_c": x_c}


def enlarged(contour: Contour, factor: float) -> Contour:
    """Return a contour scaled by a factor about the origin."""
    name, values = family_parameters(contour)
    family = family_named(name)
    return family.build(*(values[p] * factor ** family.length_powers[p] for p in family.parameters))


@dataclass(frozen=True, eq=False)
class Plan:
    """A plan of sweeps: contour, rig and drive.

    Parameters
    ----------
    contour : Contour
        A contour of a family with parameters, in the unit of the rod's length.
    rig : Rig, optional
        As in `infer_contour`; by default with the dimensionless rod. Its load cell has by default force_noise
        0.05 EI/L² and moment_noise 0.02 EI/L. Numbers that are known act in sweeps and readings; what is unknown is as
        stated there.
    drive : Rotation, Translation or Motion, or a sequence of them, optional
        Path of the base, by default a rotation about the origin.
    family : Family, optional
        Family of the contour, with priors of its parameters; by default those of `infer_contour`.

    Raises
    ------
    ParameterError
        If a channel has no noise or noise without a variance, the contour is not of the given family, or an argument
        has a wrong type.

    Examples
    --------
    >>> from tactile_bayes.contours import paper_profile
    >>> Plan(paper_profile("II", q=0.5), Rig(unknown="nothing")).model.names
    ('a', 'q', 'x_c', 'noise_scale')
    """

    contour: Contour
    rig: Rig = field(default_factory=Rig)
    drive: Drive | Sequence[Drive] | None = None
    family: Family | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "rig", rig_of(self.rig))
        check_single("contour", self.contour)
        drives_of(self.drive)
        self._refuse_other_family()
        deviations = self.cell.standard_deviations
        if silent := [name for name in CHANNELS if not 0.0 < deviations[name] < np.inf]:
            raise ParameterError(
                f"the load cell states no finite noise of {', '.join(silent)}: without it errors are "
                "unknown; give LoadCell(force_noise=..., moment_noise=...), from its data sheet, or from_zero_load"
            )

    def _refuse_other_family(self) -> None:
        check_optional("family", self.family, Family, 'give Family("parabola", q=...), with priors of its parameters')
        if self.family is None:
            return
        name, own = family_parameters(self.contour)
        if self.family.name != name:
            raise ParameterError(f"the family is {self.family.name}, but the contour is of the family {name}")
        for parameter, value in self.family.known.items():
            if value != own[parameter]:
                raise ParameterError(
                    f"{parameter} is known to be {value:g} in the family, but is {own[parameter]:g} in the contour"
                )

    @property
    def rod(self) -> Rod:
        """The rod of the rig, or the dimensionless one by default."""
        return self.rig.rod or Rod()

    @property
    def friction(self) -> float:
        """Coulomb's coefficient if it is known, else 0."""
        return self.rig.friction

    @cached_property
    def cell(self) -> LoadCell:
        """The load cell of the rig, or the usual one by default."""
        return self.rig.load_cell or usual_load_cell(self.rod)

    @cached_property
    def scan(self) -> Scan:
        """The sweeps without errors; angles that one direction adds may be those of another turn in the other one."""
        with warnings.catch_warnings():
            warnings.filterwarnings("ignore", message=".* a turn ", category=ClearanceWarning)
            return scan(self.contour, replace(self.rig, rod=self.rod), drive=self.drive)

    @property
    def drives(self) -> list[Drive]:
        """The drives, in their order."""
        return drives_of(self.drive)

    def at_angles(self, drive_angles: ArrayLike) -> Plan:
        """Return the plan with other drive angles of all rotations."""
        angles: dict[str, Any] = {"drive_step": None, "drive_angles": drive_angles}
        drives = [replace(one, **angles) if isinstance(one, Rotation) else one for one in self.drives]
        return replace(self, drive=drives)

    @cached_property
    def record(self) -> xr.Dataset:
        """The record that the load cell would read without random errors."""
        return self.certain(self.scan.record)

    def certain(self, record: xr.Dataset) -> xr.Dataset:
        """Return an ideal record as the load cell reads it without random errors."""
        certain = LoadCell(**{name: getattr(self.cell, name) for name in (*CERTAIN, *MEMORY, "frame")})
        return replace(self.rig, load_cell=certain).measure(record, rng=0)

    def reconstruct(self, record: xr.Dataset, method: Literal["raw", "constrained"]) -> xr.Dataset:
        """Return the contact points of a record of this plan; see `tactile_bayes.reconstruct`."""
        check_choice("method", method, ("raw", "constrained"))
        return contacts_of(corrected(with_rod(validate(record), self.rig.rod), self.cell, self.rig.known), method)

    @cached_property
    def experiment(self) -> Experiment:
        """Inference from the record, with the contour's own family."""
        family = self.family or Family(family_parameters(self.contour)[0])
        return Experiment(self.record, replace(self.rig, load_cell=self.cell), family)

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
        as_stated = stated_values(self.rig.known_rod, self.cell)
        return np.array([own.get(name, as_stated.get(name, 0.0)) for name in self.model.names])

    @cached_property
    def reading_slopes(self) -> ReadingSlopes:
        """Loads and derivatives of the readings at the point, which take longest of all that a plan is asked for."""
        return reading_slopes(self.model, self.point)

    def with_noise(self, factor: float) -> Plan:
        """Return the plan with force_noise and moment_noise of the load cell multiplied by a factor."""
        factor = check_positive("factor", factor)
        louder = {name: factor * getattr(self.cell, name) for name in ("force_noise", "moment_noise")}
        return replace(self, rig=replace(self.rig, load_cell=replace(self.cell, **louder)))
