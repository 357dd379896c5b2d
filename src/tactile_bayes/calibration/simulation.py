"""Simulation of a record: a truth drawn from the prior, and its measurement."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
import xarray as xr

from tactile_bayes.arrays import Floats
from tactile_bayes.calibration.simulated_experiment import SimulatedExperiment
from tactile_bayes.contours import Contour
from tactile_bayes.errors import ReachError
from tactile_bayes.inference.experiment import Experiment
from tactile_bayes.inference.parameters.unknowns import RigValues
from tactile_bayes.inference.record_likelihood.likelihood import events_of
from tactile_bayes.load_cell import LoadCell
from tactile_bayes.load_cell.measurement import corrupted_angles
from tactile_bayes.record import CHANNELS, bases_of, rod_of
from tactile_bayes.rig.parameters import GROUPS, parameter_named
from tactile_bayes.rig.stated import by_channel, of_all_channels, rod_with, sensor_values

_TRIALS = 200  # largest number of truths that are drawn until the simulated rig reaches one
_NOISES = ("force_noise", "moment_noise", "relative_noise")


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


def true_values(simulated: Experiment, assumed: Experiment, drawn: Mapping[str, float]) -> dict[str, float]:
    """Return the true values of parameters by name, those drawn first, relative to the rod and load cell assumed.

    Left out is what has none, like a noise scale if channels differ in it, and parameters of another family.
    """
    known = {**simulated.own_family.known, **simulated.unknowns.known, **drawn}
    rod, stated = rod_of(simulated.record), rod_of(assumed.record)
    cell, stated_cell = simulated.noise.cell, assumed.noise.cell
    values: dict[str, float | None] = {
        "rest_curvature": rod_with(rod, known).mean_rest_curvature,
        "taper": rod.taper,
        "stem": rod.stem,
        "length": rod.length,
        **sensor_values(cell),
        **known,
        **of_all_channels(by_channel(sensor_values(cell), known)),
    }
    if rod.rest_curvature != stated.rest_curvature:
        values |= dict.fromkeys(GROUPS["rest_shape"])
    more = {
        "drive_angle_offset": cell.drive_angle_offset - stated_cell.drive_angle_offset,
        "backlash": cell.drive_angle_backlash - stated_cell.drive_angle_backlash,
        **dict(zip(GROUPS["bias"], np.subtract(cell.bias, stated_cell.bias).tolist(), strict=True)),
        **dict(zip(GROUPS["lever"], np.subtract(cell.lever, stated_cell.lever).tolist(), strict=True)),
    }
    times = {**_ratios(cell, stated_cell), "rigidity_scale": rod.flexural_rigidity / stated.flexural_rigidity}
    found = {}
    for name in dict.fromkeys((*drawn, *assumed.priors)):
        value, factor = values.get(name, _neutral(name)), times.get(name, 1.0)
        if value is not None and math.isfinite(factor * value):
            found[name] = factor * (value + more.get(name, 0.0))
    return found


def _neutral(name: str) -> float | None:
    """Return the value of a parameter of a rig that is as stated; None if there is none."""
    if name == "discrepancy_scale":
        return 0.0
    parameter = parameter_named(name)
    return None if parameter is None or name == "discrepancy_length" else parameter.neutral


def _ratios(cell: LoadCell, stated: LoadCell) -> dict[str, float]:
    """Return what a load cell has over the stated one, by parameter; that of noises is NaN if they have several."""
    noises = ((getattr(each, name) for each in (cell, stated)) for name in _NOISES)
    louder = [own / other if other else math.inf for own, other in noises if own or other]
    ratio = louder[0] if np.allclose(louder, louder[0], rtol=1e-9) else math.nan
    return {
        "noise_scale": ratio,
        **dict(zip(GROUPS["gain"], (cell.own_gains / stated.own_gains).tolist(), strict=True)),
    }
