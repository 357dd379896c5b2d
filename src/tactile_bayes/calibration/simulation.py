"""The simulation of a record: a truth drawn from the prior, and what is measured of it in the world as it is."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
import xarray as xr

from tactile_bayes.arrays import Floats
from tactile_bayes.calibration.simulated_experiment import SimulatedExperiment
from tactile_bayes.contours import Contour
from tactile_bayes.errors import ReachError
from tactile_bayes.inference.contour_events import events_of
from tactile_bayes.inference.likelihood import Rig
from tactile_bayes.load_cell.corruption import corrupted_angles
from tactile_bayes.mechanics.elastica import MAX_FRICTION_ANGLE
from tactile_bayes.record import CHANNELS

__all__ = ["Simulation", "simulate"]

_TRIALS = 200
"""Truths drawn until the rod reaches one in the world as it is."""


class Simulation(NamedTuple):
    """A record of which everything is known."""

    measured: xr.Dataset
    truth: Mapping[str, float]
    """Parameters by name, in the record's units."""
    contour: Contour
    """The object, of shape (1,)."""
    rig: Rig
    """As it is."""
    events: Mapping[str, Floats]
    """First contact and snap-off by stroke, each of shape (strokes,)."""


def simulate(experiment: SimulatedExperiment, rng: np.random.Generator) -> Simulation:
    """Draw a truth, sweep along it and measure.

    Loads come to full accuracy from the arrays of `Paths`, not from the compiled code that inference asks.

    Raises
    ------
    ReachError
        If the rod hardly ever reaches a contour of the prior.
    """
    model, world = experiment.model, experiment.world
    likelihood = model.likelihood
    told = experiment.load_cell
    cell = told if world.load_cell is None else world.load_cell
    misread = {
        name: getattr(cell, name) - getattr(told, name) for name in ("drive_angle_offset", "drive_angle_backlash")
    }
    for _ in range(_TRIALS):
        point, _ = model.draw_prior(rng, 1)
        contour = world.contour(model.contours(point))
        rig = world.rig(model.rig(point), experiment.pivots)
        rig = rig._replace(**{name: getattr(rig, name) + off for name, off in misread.items()})
        if np.any(np.arctan(rig.friction) > MAX_FRICTION_ANGLE):  # what was drawn, and what the world adds
            continue
        loads, reached = likelihood.predict(contour, rig)
        if reached[0]:
            break
    else:
        raise ReachError(
            f"of {_TRIALS} contours from the prior the rod reaches none in the world as it is, or friction is too "
            "large: make it differ less"
        )
    values = model.values(point)
    rod = likelihood.rod
    measures = cell.dimensionless(rod)
    sensed = model.nuisances.sensed(loads, values, measures)[0]
    units = np.array([rod.moment_unit, rod.force_unit, rod.force_unit])
    readings = measures.simulate(sensed, seed=rng, noise_scale=model.noise_scale(point)[0]) * units
    course = model.nuisances.way[:, None]
    readings = readings + np.array(world.bias) + np.array(world.drift) * course
    template = experiment.assumed.record
    # The template has the angles that are read but for noise and steps; what is misread is in those of the rod.
    direction = template.direction.values
    angles = corrupted_angles(cell, template.drive_angle.values - cell.misread(direction), direction, rng)
    columns = {name: ("sample", readings[:, i], template[name].attrs) for i, name in enumerate(CHANNELS)}
    measured = template.assign(columns).assign(drive_angle=("sample", angles, template.drive_angle.attrs))
    events = {name: found[0] for name, found in events_of(likelihood, contour, rig).items()}
    truth = {name: float(value[0]) for name, value in values.items()}
    return Simulation(measured, truth, contour, rig, events)
