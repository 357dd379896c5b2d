"""Knowledge of a contour and a rig before the next record: a prior, or the posterior so far."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import xarray as xr

from tactile_bayes.arrays import Floats
from tactile_bayes.contours.families import family_named
from tactile_bayes.contours.shape_free_family import ShapeFreeFamily
from tactile_bayes.errors import ParameterError
from tactile_bayes.inference.contour_model import ContourModel
from tactile_bayes.inference.experiment import Experiment, usual_load_cell
from tactile_bayes.inference.family import Family
from tactile_bayes.inference.result import contour_draws, known_of, posterior_draws, record_of
from tactile_bayes.load_cell import LoadCell
from tactile_bayes.mechanics.rods.rod import Rod
from tactile_bayes.record import rod_of
from tactile_bayes.rig.rig import Rig
from tactile_bayes.rig.unknown import DEFAULT, NOTHING, Unknown
from tactile_bayes.sweep import Drive, Rotation, blind_angles, record_template, recorded_drives
from tactile_bayes.tasks.documents import read_json

STEP = float(np.radians(2.0))  # step of the drive if a rotation has no grid of its own [rad]
COARSE = float(np.radians(5.0))  # step of the drive for records of which only the events are used [rad]


@dataclass(frozen=True, eq=False)
class Knowledge:
    """Draws of the possible truth, and models of records from other pivots."""

    # Experiment on an empty record of the drives so far, or of a rotation about the origin if there are none.
    experiment: Experiment
    points: Floats  # draws of the parameters of contour, rig and noise, as `model` names them, shape (n, d)
    precision: Floats  # inverse of the covariance of the draws, shape (d, d)
    drives: tuple[Drive, ...]  # drives of the sweeps so far

    @property
    def rod(self) -> Rod:
        """The rod of the experiment."""
        return rod_of(self.experiment.record)

    def model_from(self, drives: Sequence[Drive], drive_step: float = STEP) -> ContourModel:
        """Return the model of an empty record by these drives; the step is of those without a grid of their own."""
        return self.model(record_template(drives, blind_angles(drive_step), self.rod, self.experiment.noise.cell))

    def model(self, record: xr.Dataset) -> ContourModel:
        """Return the model of a record, empty or measured, without the unknowns that it does not show."""
        return replace(self.experiment, record=record).model

    def of(self, model: ContourModel) -> Knowledge:
        """Return the knowledge of the parameters of a model, some or all of these."""
        names = self.experiment.model.names
        if names == model.names:
            return self
        own = np.array([names.index(name) for name in model.names])
        covariance = np.linalg.inv(self.precision)[np.ix_(own, own)]
        return replace(self, points=self.points[:, own], precision=np.linalg.inv(covariance))


def unmeasured(rig: Rig, family: Family | str = "parabola", drives: Sequence[Drive] = (Rotation(),)) -> Experiment:
    """Return the experiment of an empty record by some drives, with the usual load cell if the rig states none."""
    rod = rig.rod or Rod()
    cell = rig.load_cell or usual_load_cell(rod)
    return Experiment(record_template(drives, blind_angles(COARSE), rod, cell), replace(rig, load_cell=cell), family)


def known_from_prior(rig: Rig, family: Family, *, draws: int, rng: np.random.Generator) -> Knowledge:
    """Draw truths from the priors of a rig and a family, restricted to contours within reach."""
    _refuse_shape_free(family.name)
    experiment = unmeasured(replace(rig, unknown=_without_shifts(rig.entries)), family)
    points, _ = experiment.model.draw_prior(rng, draws)
    many, _ = experiment.model.draw_prior(rng, 1000)
    return Knowledge(experiment, points, _precision(many), ())


def known_from_posterior(posterior: xr.DataTree, *, draws: int, rng: np.random.Generator) -> Knowledge:
    """Draw truths from a posterior of `infer_contour`, with its rig, load cell and pivots."""
    contour_draws(posterior)
    attrs: dict[Any, Any] = posterior.attrs
    _refuse_shape_free(str(attrs["family"]))
    record = record_of(posterior)
    samples = posterior_draws(posterior)
    columns = {str(name): values.values.ravel() for name, values in samples.data_vars.items()}
    unknown: dict[str, Any] = {n: columns.pop(n).mean() for n in ("force_noise", "moment_noise") if n in columns}
    cell = replace(LoadCell.from_record(record) or LoadCell(), **unknown)
    if unknown:
        columns["noise_scale"] = np.ones(samples.sizes["chain"] * samples.sizes["draw"])
    drives = tuple(recorded_drives(record))
    scale: Unknown = DEFAULT if "noise_scale" in columns else 1.0
    rig, family = _described(attrs)
    rig = replace(rig.with_unknown(noise_scale=scale), rod=rod_of(record), load_cell=cell)
    experiment = unmeasured(rig, family, drives)
    every = np.stack([columns[name] for name in experiment.model.names], axis=1)
    if unknown:  # a constant scale would make the covariance singular
        every[:, experiment.model.names.index("noise_scale")] *= np.exp(0.05 * rng.standard_normal(len(every)))
    chosen = rng.choice(len(every), min(draws, len(every)), replace=False)
    return Knowledge(experiment, every[chosen], _precision(every), drives)


def _described(attrs: Mapping[Any, Any]) -> tuple[Rig, Family]:
    """Return the unknowns of a posterior's rig, except shifts of its pivots, and its family, under default priors."""
    known, family = known_of(attrs), str(attrs["family"])
    of_contour = {name: known.pop(name) for name in family_named(family).parameters if name in known}
    inferred = dict.fromkeys(read_json(attrs.get("nuisances", "[]"), "nuisances"), DEFAULT)
    return Rig(unknown={**NOTHING, **_without_shifts({**known, **inferred})}), Family(family, **of_contour)


def _without_shifts(unknown: Mapping[str, Unknown]) -> dict[str, Unknown]:
    return {name: value for name, value in unknown.items() if not name.startswith("base")}


def _refuse_shape_free(family: str) -> None:
    if isinstance(family_named(family), ShapeFreeFamily):
        raise ParameterError(
            "a design is for a family with parameters, like parabola or parabola/power-law; for a shape-free contour "
            "take the family that comes nearest"
        )


def _precision(points: Floats) -> Floats:
    scale = points.std(axis=0)
    return np.asarray(np.linalg.inv(np.cov((points / scale).T)) / np.outer(scale, scale))
