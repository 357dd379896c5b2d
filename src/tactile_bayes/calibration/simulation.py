"""Simulation of a record: a truth drawn from the prior, and its measurement by the misspecified rig."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import NamedTuple

import numpy as np
import xarray as xr

from tactile_bayes.arrays import Floats
from tactile_bayes.calibration.simulated_experiment import SimulatedExperiment
from tactile_bayes.contours import Contour
from tactile_bayes.errors import ReachError
from tactile_bayes.inference.contour_events import events_of
from tactile_bayes.inference.record_likelihood.rig import Rig
from tactile_bayes.load_cell.averaged_cell import AveragedCell
from tactile_bayes.load_cell.corruption import corrupted_angles
from tactile_bayes.mechanics.elastica import MAX_FRICTION_ANGLE
from tactile_bayes.record import CHANNELS

__all__ = ["Simulation", "simulate"]

_TRIALS = 200
"""Largest number of truths that are drawn until the misspecified rig reaches one."""


class Simulation(NamedTuple):
    """A simulated record and its truth."""

    measured: xr.Dataset
    """The record."""
    truth: Mapping[str, float]
    """Parameters by name, in the record's units, with what is misspecified of them."""
    contour: Contour
    """Contour of the object, shape (1,)."""
    rig: Rig
    """The rig, with its misspecification."""
    events: Mapping[str, Floats]
    """Drive angles and contact points of first contact and snap-off, each of shape (segments,)."""


def simulate(experiment: SimulatedExperiment, rng: np.random.Generator) -> Simulation:
    """Draw a truth, sweep along it and measure.

    Loads are exact, from `Paths` and not from the compiled code of inference.

    Parameters
    ----------
    experiment : SimulatedExperiment
    rng : np.random.Generator

    Raises
    ------
    ReachError
        If the rod hardly ever reaches a contour of the prior.
    """
    model, world = experiment.model, experiment.world
    likelihood = model.likelihood
    stated = experiment.load_cell
    cell = stated if world.load_cell is None else world.load_cell
    misread = {
        name: getattr(cell, name) - getattr(stated, name) for name in ("drive_angle_offset", "drive_angle_backlash")
    }
    for _ in range(_TRIALS):
        point, _ = model.draw_prior(rng, 1)
        contour = world.contour(model.contours(point))
        rig = world.rig(model.rig(point), experiment.pivots)
        rig = rig._replace(**{name: getattr(rig, name) + off for name, off in misread.items()})
        if np.any(np.arctan(rig.friction) > MAX_FRICTION_ANGLE):  # the drawn friction and the additional one
            continue
        loads, reached = likelihood.predict(contour, rig)
        if reached[0]:
            break
    else:
        raise ReachError(
            f"the misspecified rig reaches none of {_TRIALS} contours from the prior, or its friction is too large: "
            "reduce the misspecification"
        )
    values = model.values(point)
    rod = likelihood.rod
    measures = cell.dimensionless(rod)
    if likelihood.blocks is not None:
        measures = AveragedCell.of(measures, likelihood.blocks.readings)
    discrepancy = model.discrepancy(point, loads)
    sensed = replace(model.nuisances, curve=measures.moment_curve).sensed(loads, values, measures)
    units = rod.load_units
    scale = model.noise_scale(point)
    readings = measures.straight.simulate(sensed, seed=rng, noise_scale=scale, discrepancy=discrepancy)[0] * units
    course = model.nuisances.elapsed[:, None]
    readings = readings + np.array(world.bias) + np.array(world.drift) * course
    template = experiment.assumed.record
    # The template has the readings without noise and resolution; systematic errors are in the angles of the rod.
    direction = template.direction.values
    angles = corrupted_angles(cell, template.drive_angle.values - cell.misread(direction), direction, rng)
    columns = {name: ("sample", readings[:, i], template[name].attrs) for i, name in enumerate(CHANNELS)}
    measured = template.assign(columns).assign(drive_angle=("sample", angles, template.drive_angle.attrs))
    events = {name: found[0] for name, found in events_of(likelihood, contour, rig).items()}
    truth = world.truth({name: float(value[0]) for name, value in values.items()}, stated, rod.curvature_unit)
    return Simulation(measured, truth, contour, rig, events)
