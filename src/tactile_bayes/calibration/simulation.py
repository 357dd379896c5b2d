"""Simulation of a record: a truth drawn from the prior, and its measurement."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
import xarray as xr

from tactile_bayes.arrays import Floats
from tactile_bayes.calibration.simulated_experiment import SimulatedExperiment
from tactile_bayes.calibration.true_values import true_values
from tactile_bayes.contours import Contour
from tactile_bayes.errors import ReachError
from tactile_bayes.inference.record_likelihood.likelihood import events_of
from tactile_bayes.inference.record_likelihood.rig_values import RigValues
from tactile_bayes.load_cell.measurement import corrupted_angles
from tactile_bayes.record import CHANNELS, bases_of

_TRIALS = 200  # largest number of truths that are drawn until the simulated rig reaches one


class Simulation(NamedTuple):
    """A simulated record and its truth."""

    measured: xr.Dataset  # the record
    # Parameters by name, in the record's units, relative to the rod and load cell that inference assumes.
    truth: Mapping[str, float]
    contour: Contour  # contour of the object, shape (1,)
    rig: RigValues  # the rig that was simulated, relative to its own rod and load cell
    # Drive angles and contact points of first contact and snap-off, each of shape (segments,).
    events: Mapping[str, Floats]


def simulate(experiment: SimulatedExperiment, rng: np.random.Generator) -> Simulation:
    """Draw a truth, sweep along it and measure.

    Loads are exact, from `Paths` and not from the compiled code of inference.
    """
    model, truth = experiment.model, experiment.truth
    likelihood = model.likelihood
    for _ in range(_TRIALS):
        point, _ = model.draw_prior(rng, 1)
        contour = truth.contour(model.contours(point))
        rig = truth.shifted(model.rig(point), len(bases_of(experiment.assumed.record)))
        loads, reached = likelihood.predict(contour, rig)
        if reached[0]:
            break
    else:
        raise ReachError(
            f"the simulated rig reaches none of {_TRIALS} contours from the prior: reduce the misspecification"
        )
    values, cell, scale = model.values(point), likelihood.load_cell, model.noise_scale(point)
    discrepancy = model.discrepancy(point, loads)
    sensed = model.unknowns.sensed(loads, values, cell)
    readings = cell.simulate(sensed, rng=rng, noise_scale=scale, discrepancy=discrepancy)[0]
    readings = readings * likelihood.rod.load_units
    template, cell = experiment.assumed.record, experiment.simulated.noise.cell
    # The template has the readings without noise and resolution; systematic errors are in the angles of the rod.
    direction = template.direction.values
    angles = corrupted_angles(cell, template.drive_angle.values - cell.misread(direction), direction, rng)
    columns = {name: ("sample", readings[:, i], template[name].attrs) for i, name in enumerate(CHANNELS)}
    measured = template.assign(columns).assign(drive_angle=("sample", angles, template.drive_angle.attrs))
    events = {name: found[0] for name, found in events_of(likelihood, contour, rig).items()}
    drawn = {name: float(value[0]) for name, value in values.items()}
    own = true_values(experiment.simulated, experiment.assumed, drawn)
    return Simulation(measured, own, contour, rig, events)
