"""What the data sheets of a rig state, and the default distributions of deviations from it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any, NamedTuple, Protocol

import numpy as np
from scipy import stats

from tactile_bayes.arrays import Floats
from tactile_bayes.distributions import Distribution, open_share
from tactile_bayes.errors import ParameterError
from tactile_bayes.load_cell import LoadCell
from tactile_bayes.mechanics.rods.rod import Rod
from tactile_bayes.rig.parameters import GROUPS, MAY_VANISH, MEMORY, NEUTRAL, parameter_named

_LOUDEST = 10.0  # largest noise in the default prior of an unknown one [EI/L, EI/L²]


class Units(Protocol):
    """Units of a rod: a `Rod`, or arrays for many rods."""

    @property
    def length_unit(self) -> Any: ...
    @property
    def moment_unit(self) -> Any: ...
    @property
    def force_unit(self) -> Any: ...


def unit_of(name: str, rod: Units) -> Any:
    """Return the unit of a parameter in dimensionless calculations, in those of the rod."""
    parameter = parameter_named(name)
    assert parameter is not None
    load = rod.force_unit if name.startswith("force") else rod.moment_unit
    of_load, of_length = parameter.powers
    return load**of_load * rod.length_unit**of_length


def stated_values(rod: Rod, cell: LoadCell) -> dict[str, float]:
    """Return the parameters of a rig that is as stated, except shifts of pivots, which are 0, and noises."""
    of_rod = {"rest_curvature": rod.mean_rest_curvature, "taper": rod.taper, "stem": rod.stem, "length": rod.length}
    return {**NEUTRAL, **of_rod, **sensor_values(cell)}


def sensor_values(cell: LoadCell) -> dict[str, float]:
    """Return what a load cell states of its curve and its memory, by parameter."""
    own = {name: v for what in MEMORY for name, v in zip(MEMORY[what], np.full(3, getattr(cell, what)), strict=True)}
    return {**dict(zip(GROUPS["moment_curve"], cell.moment_curve, strict=True)), **of_all_channels(own)}


def by_channel(*said: Mapping[str, Any]) -> dict[str, Any]:
    """Return the memory of each channel by what is said of parameters, the last first, and of a channel before all."""
    found: dict[str, Any] = {}
    for each in said:
        for what, names in MEMORY.items():
            found |= dict.fromkeys(names, each[what]) if what in each else {}
            found |= {name: each[name] for name in names if name in each}
    return found


def of_all_channels(own: Mapping[str, float]) -> dict[str, float]:
    """Return the memory of each channel, and of all; NaN if they differ."""
    values = {what: [own[name] for name in names] for what, names in MEMORY.items()}
    return {**own, **{what: each[0] if len({*each}) == 1 else np.nan for what, each in values.items()}}


def memory_in(*said: Mapping[str, Any]) -> set[str]:
    """Return the kinds of memory that a load cell has or may have, by what is said of parameters, the last first."""
    found = by_channel(*said)
    return {what for what, names in MEMORY.items() if any(found.get(name) for name in names)}


class Stated(NamedTuple):
    """What the data sheets of a rig state; with arrays, those of many rigs."""

    units: Units
    # Parameters of a rig that is as stated, as `stated_values`; those that are zero may be left out.
    values: Mapping[str, Any]
    own_gains: Sequence[Any]  # reading of each channel for a unit of its own load, without sign
    rest_curvature_deviation: Any = 0.0
    taper_deviation: float = 0.0

    @classmethod
    def of(cls, rod: Rod, cell: LoadCell) -> Stated:
        """Return what a rod and a load cell state."""
        return cls(
            rod, stated_values(rod, cell), cell.own_gains.tolist(), rod.rest_curvature_deviation, rod.taper_deviation
        )

    def default(self, name: str) -> Distribution:
        """Return the default distribution of a parameter, in the units of the rod."""
        parameter = parameter_named(name)
        assert parameter is not None
        scale = parameter.width * unit_of(name, self.units)
        for names in (GROUPS["bias"], GROUPS["drift"], ("moment_noise", "force_noise")):  # as readings
            if name in names:
                scale = scale * self.own_gains[names.index(name)]
        if name == "rest_curvature":
            scale = np.where(self.rest_curvature_deviation, self.rest_curvature_deviation, scale)[()]
        if name == "taper" and self.taper_deviation:
            scale = self.taper_deviation
        centre = self.values.get(name, 0.0)
        if parameter.default == "log_normal":
            return stats.lognorm(s=parameter.width, scale=centre)
        if parameter.default == "half_normal":
            return stats.halfnorm(scale=scale)
        if parameter.default == "log_uniform":
            return stats.loguniform(scale, _LOUDEST / parameter.width * scale)
        if name in MAY_VANISH:
            ends = ((end - centre) / scale for end in (parameter.low, parameter.high))
            return stats.truncnorm(*ends, loc=centre, scale=scale)
        return stats.norm(centre, scale)


def within_bounds(name: str, distribution: Distribution, share: Floats) -> Floats:
    """Return the quantiles of a parameter at probabilities in [0, 1), as a distribution within its bounds has them."""
    parameter = parameter_named(name)
    assert parameter is not None
    if not (hasattr(distribution, "ppf") and hasattr(distribution, "cdf")):
        raise ParameterError(f"the distribution of {name} has no quantiles: give one with cdf and ppf to draw from it")
    low, high = (distribution.cdf(end) for end in (parameter.low, parameter.high))
    if np.any(high <= low):
        raise ParameterError(
            f"the distribution of {name} lies beyond what it can be, {parameter.low:.4g} to {parameter.high:.4g}"
        )
    found = distribution.ppf(low + open_share(share) * (high - low))
    return np.clip(found, parameter.low, parameter.high)


def cell_with(cell: LoadCell, rig: Mapping[str, float]) -> LoadCell:
    """Return a load cell with the errors that parameters by name give it; drift and noise have no effect."""
    gain = np.array(cell.gain) * [rig.get(name, 1.0) for name in GROUPS["gain"]]
    bias, lever = (
        np.add(stated, [rig.get(name, 0.0) for name in GROUPS[what]]).tolist()
        for what, stated in (("bias", cell.bias), ("lever", cell.lever))
    )
    stated = sensor_values(cell)
    own = {**stated, **rig, **by_channel(stated, rig)}
    several = {"moment_curve": GROUPS["moment_curve"], **MEMORY}
    sensor: dict[str, Any] = {what: [own[name] for name in names] for what, names in several.items()}
    return replace(
        cell,
        gain=gain.tolist(),
        bias=bias,
        lever=lever,
        **sensor,
        drive_angle_offset=cell.drive_angle_offset + rig.get("drive_angle_offset", 0.0),
        drive_angle_backlash=cell.drive_angle_backlash + rig.get("backlash", 0.0),
    )


def rod_with(rod: Rod, rig: Mapping[str, float]) -> Rod:
    """Return a rod of the shape that unknowns of the rig by name give it, others than those of shape without effect."""
    names = GROUPS["rest_shape"][: len(rod.rest_shape_modes)]
    rod, length = rod.shaped([rig.get(name, 0.0) for name in names]), rig.get("length", rod.length)
    curvature = rig.get("rest_curvature", rod.mean_rest_curvature * rod.length / length)
    taper = rig.get("taper", float(rod.tapered_by(rig.get("taper_error", 0.0))))
    return rod.reshaped(curvature, taper, rig.get("stem"), length)
