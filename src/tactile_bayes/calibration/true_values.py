"""True values of parameters: what a simulated rig and contour have, relative to what inference assumes."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from tactile_bayes.inference.experiment import Experiment
from tactile_bayes.load_cell import LoadCell
from tactile_bayes.record import rod_of
from tactile_bayes.rig.parameters import GROUPS, parameter_named
from tactile_bayes.rig.stated import by_channel, of_all_channels, rod_with, sensor_values

_NOISES = ("force_noise", "moment_noise", "relative_noise")


def true_values(simulated: Experiment, assumed: Experiment, drawn: Mapping[str, float]) -> dict[str, float]:
    """Return the true values of parameters by name, those drawn first, relative to the rod and load cell assumed.

    Left out is what has none: a noise scale if channels differ, noise of a cell that states none, the length of a
    discrepancy that is not simulated, modes of a trace if the rod is not what it says, parameters of another family.
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
    more = _differences(cell, stated_cell)
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


def _differences(cell: LoadCell, stated: LoadCell) -> dict[str, float]:
    """Return what a load cell has in addition to the stated one, by parameter."""
    return {
        "drive_angle_offset": cell.drive_angle_offset - stated.drive_angle_offset,
        "backlash": cell.drive_angle_backlash - stated.drive_angle_backlash,
        **dict(zip(GROUPS["bias"], np.subtract(cell.bias, stated.bias).tolist(), strict=True)),
        **dict(zip(GROUPS["lever"], np.subtract(cell.lever, stated.lever).tolist(), strict=True)),
    }


def _ratios(cell: LoadCell, stated: LoadCell) -> dict[str, float]:
    """Return what a load cell has over the stated one, by parameter; that of noises is NaN if they have several."""
    noises = ((getattr(each, name) for each in (cell, stated)) for name in _NOISES)
    louder = [own / other if other else math.inf for own, other in noises if own or other]
    ratio = louder[0] if np.allclose(louder, louder[0], rtol=1e-9) else math.nan
    return {
        "noise_scale": ratio,
        **dict(zip(GROUPS["gain"], (cell.own_gains / stated.own_gains).tolist(), strict=True)),
    }
