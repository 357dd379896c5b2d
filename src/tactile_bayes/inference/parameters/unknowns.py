"""Unknowns of a rig: its deviations from the stated one that are inferred beside a contour."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import xarray as xr

from tactile_bayes.arrays import Floats
from tactile_bayes.distributions import Distribution
from tactile_bayes.errors import ParameterError
from tactile_bayes.load_cell import LoadCell
from tactile_bayes.load_cell.blocks import elapsed_in
from tactile_bayes.load_cell.curve import curved
from tactile_bayes.load_cell.memory import remembered, steps_of
from tactile_bayes.mechanics.rods.rod import Rod
from tactile_bayes.reconstruction import turned_sweeps
from tactile_bayes.record import bases_of, carried_sweeps, present_channels, rod_of
from tactile_bayes.record.times import times_of
from tactile_bayes.rig.parameters import BASE, COMPLIANCES, GROUPS, MEMORY, PARAMETERS, SENSOR, parameter_named
from tactile_bayes.rig.stated import Stated, by_channel, memory_in, sensor_values, stated_values, unit_of
from tactile_bayes.rig.unknown import of_modes, of_pivots

if TYPE_CHECKING:
    from tactile_bayes.rig.rig import Rig
    from tactile_bayes.rig.rig_prior import RigPrior


class RigValues(NamedTuple):
    """Deviations of a rig from the stated one; numbers, or arrays of shape (n,) with one for every contour."""

    drive_angle_offset: Any = 0.0  # encoder offset in addition to that of the load cell's data sheet [rad]
    rigidity_scale: Any = 1.0  # flexural rigidity over the stated one
    suspension_compliance: Any = 0.0  # turn of the pivot's suspension per holding moment [rad/(EI/L) as stated]
    contact_compliance: Any = 0.0  # way of the object per normal force [L/(EI/L²) as stated]
    friction: Any = 0.0  # Coulomb's coefficient
    drive_angle_backlash: Any = 0.0  # forward less backward reading, in addition to the data sheet [rad]
    rest_curvature: Any = 0.0  # rest curvature of the rod in addition to the stated one [1/L]
    taper: Any = 0.0  # taper of the rod in addition to the stated one
    stem: Any = 0.0  # rigid piece between pivot and rod in addition to the stated one [L]
    length: Any = 1.0  # over the stated one; its rest curvature, and what is added to it, are then per that length
    # Amplitudes of the modes of the rest curvature, shape (n, MOST_MODES); none by default.
    rest_shape: Any = None
    # Shifts of pivots, in the order of the record [length], (n, pivots, 2); those after the last are not shifted.
    base_shifts: Any = None


_SHORT = {"holding_moment": "moment", "force_x": "force_x", "force_y": "force_y"}
_SAME_DIRECTION = 1e-3  # range of drive angles [rad] within which a rod keeps its direction
# Parameters of the noise, which are none of the forward model.
_OF_NOISE = (*GROUPS["discrepancy"], "noise_scale", "moment_noise", "force_noise")
# Parameters that change the path or the reading of the drive angle, and their names in `RigValues`.
_RIG = {name: name for name in ("drive_angle_offset", "rigidity_scale", "friction", *COMPLIANCES)}
_RIG["backlash"] = "drive_angle_backlash"
# Groups that change only what the load cell senses, not the path.
_SENSED = ("bias", "drift", "gain", "lever", *SENSOR)


@dataclass(frozen=True)
class Unknowns:
    """Parameters of a rig that are inferred beside those of a contour."""

    names: tuple[str, ...]
    priors: Mapping[str, Distribution]  # in the record's units
    rod: Rod  # as stated
    known: Mapping[str, float] = field(default_factory=dict)  # not as stated, in the record's units
    # Of each sample, linear from the first (−½) to the last (½).
    elapsed: Floats = field(default_factory=lambda: np.zeros(1))
    joint: RigPrior | None = None  # prior that a calibration found; `priors` are its marginals
    sensor: Mapping[str, float] = field(default_factory=dict)  # stated values of `SENSOR`, dimensionless
    pivots: int = 1
    times: Floats | None = None  # of the samples [s], if a lag is in seconds

    @cached_property
    def units(self) -> dict[str, float]:
        """Unit of each parameter in dimensionless calculations, in the record's units."""
        units = {name: unit_of(name, self.rod) for name in PARAMETERS}
        shifts = (n for n in self.names if BASE.fullmatch(n) or n in GROUPS["gauge"])
        return units | dict.fromkeys(shifts, 1.0)  # they stay in the record's unit of length

    def bounds(self, name: str) -> tuple[float, float]:
        """Return the bounds of a parameter, whatever its prior."""
        parameter = parameter_named(name)
        assert parameter is not None
        return parameter.low, parameter.high

    @property
    def friction(self) -> float:
        """Coulomb's coefficient, if it is known; 0 if it is inferred."""
        return self.known.get("friction", 0.0)

    @cached_property
    def memory(self) -> set[str]:
        """Kinds of memory that the load cell has or may have, by which a sample depends on all before it."""
        return memory_in(self.sensor, self.known, dict.fromkeys(self.names, True))

    def longest_lag(self, priors: Mapping[str, Distribution]) -> float:
        """Return the lag [readings], if it is unknown its median in the prior and two standard deviations."""
        lag, seconds = (
            self._largest(what, priors, lambda prior: prior.median() + 2.0 * prior.std())
            for what in ("lag", "lag_seconds")
        )
        return lag if self.times is None else lag + seconds / float(np.median(steps_of(self.times)))

    def most_play(self, priors: Mapping[str, Distribution]) -> float:
        """Return the play of the readings over the largest load, if it is unknown its 95 % quantile in the prior."""
        return self._largest("play", priors, lambda prior: prior.ppf(0.95))

    def _largest(self, what: str, priors: Mapping[str, Any], most: Callable[[Any], float]) -> float:
        """Return the largest lag or play of a channel, of an unknown one what `most` says of its prior."""
        unknown = {name: most(priors[name]) for name in self.names if belongs(name, what)}
        found = by_channel(self.sensor, self.known, unknown)
        return float(max(found.get(name, 0.0) for name in MEMORY[what]))

    @property
    def of_path(self) -> tuple[str, ...]:
        """Names of the parameters that change the path, or where along it the samples lie."""
        return tuple(name for name in self.names if not any(belongs(name, group) for group in _SENSED))

    def _with_known(self, values: Mapping[str, Floats]) -> dict[str, Floats]:
        """Return values by name, shape (n,), with the known parameters that are not as stated."""
        count = len(next(iter(values.values()))) if values else 1
        return {**{name: np.full(count, value) for name, value in self.known.items()}, **values}

    def rig(self, values: Mapping[str, Floats]) -> RigValues:
        """Return the rig of every point, from values by name in the record's units, each of shape (n,)."""
        values = self._with_known(values)
        off: dict[str, Any] = {"friction": 0.0}
        if "length" in values:
            off["length"] = values["length"] / self.rod.length
        modes = dict(zip(GROUPS["rest_shape"], self.rod.rest_shape_modes, strict=False))
        if shaped := [name for name in modes if name in values]:
            off["rest_shape"] = np.zeros((len(values[shaped[0]]), len(GROUPS["rest_shape"])))
            for name in shaped:
                off["rest_shape"][:, GROUPS["rest_shape"].index(name)] = values[name]
        if "rest_curvature" in values:
            longer = off.get("length", 1.0)  # the rod of another length has the stated turn from base to tip
            mean = self.rod.mean_rest_curvature + sum(modes[name].mean * values[name] for name in shaped)
            off["rest_curvature"] = (longer * values["rest_curvature"] - mean) / self.units["rest_curvature"]
        if "taper" in values or "taper_error" in values:
            taper = values["taper"] if "taper" in values else self.rod.tapered_by(values["taper_error"])
            off["taper"] = taper - self.rod.taper
        if "stem" in values:
            off["stem"] = (values["stem"] - self.rod.stem) / self.units["stem"]
        off |= {of_rig: values[name] / self.units[name] for name, of_rig in _RIG.items() if name in values}
        return RigValues(base_shifts=self._base_shifts(values), **off)

    def _base_shifts(self, values: Mapping[str, Floats]) -> Floats | None:
        """Return the shifts of pivots, (n, pivots, 2), up to the last inferred one; a gauge shifts all back."""
        shifted = [(name, BASE.fullmatch(name)) for name in values]
        off = [(name, int(found[1]) - 1, "xy".index(found[2])) for name, found in shifted if found]
        gauge = [name for name in GROUPS["gauge"] if name in values]
        if not off and not gauge:
            return None
        last = self.pivots if gauge else max(pivot for _, pivot, _ in off) + 1
        shifts = np.zeros((len(values[(gauge or [off[0][0]])[0]]), last, 2))
        for name, pivot, axis in off:
            shifts[:, pivot, axis] = values[name]
        for name in gauge:
            shifts[..., "xy".index(name[-1])] -= values[name][:, None]
        return shifts

    def sensed(self, loads: Floats, values: Mapping[str, Floats], cell: LoadCell) -> Floats:
        """Apply memory, gains, levers, zeros and curve, in place, to loads, (n, ..., samples, 3) [EI/L, EI/L²]. Zeros
        are given as readings, and enter as the loads that the cell reads as such without its own curve."""
        values = self._with_known(values)
        if self.memory:
            of = by_channel(self.sensor, values)
            every = ([_by_point(of.get(name, 0.0), loads) for name in names] for names in MEMORY.values())
            memory = (np.stack(np.broadcast_arrays(*three), axis=-1) for three in every)
            loads[...] = remembered(loads, memory, self.times)
        curve = [self._dimensionless(values, name, self.sensor.get(name, 0.0)) for name in GROUPS["moment_curve"]]
        is_bent = any(np.any(v) for v in curve)
        gains = [values.get(name) for name in GROUPS["gain"]]
        levers = [self._dimensionless(values, name) for name in GROUPS["lever"]]
        # Gains act on readings at the lever's end, to which the cell's own lever is applied later.
        own = cell.lever if is_bent or any(gain is not None for gain in gains) else (0.0, 0.0)
        _take_at(loads, own[0] + levers[0], own[1] + levers[1])
        if is_bent:
            loads[..., 0] = curved(loads[..., 0], *(_by_point(v, loads) for v in curve))
        for channel, gain in enumerate(gains):
            if gain is not None:
                loads[..., channel] *= _by_point(gain, loads)
        _take_at(loads, -own[0], -own[1])
        self._add_zeros(loads, values, cell)
        return loads

    def _add_zeros(self, loads: Floats, values: Mapping[str, Floats], cell: LoadCell) -> None:
        """Add the loads that the cell reads as the unknown zeros, and as their drift along the record, in place."""
        for what, course in (("bias", np.ones(1)), ("drift", self.elapsed)):
            if values.keys().isdisjoint(GROUPS[what]):
                continue
            read = np.broadcast_arrays(*(self._dimensionless(values, name) for name in GROUPS[what]))
            zeros = np.linalg.solve(cell.gain_matrix, np.array(read))
            for channel, zero in enumerate(zeros):  # broadcasting over an axis of three is several times slower
                loads[..., channel] += _by_point(zero, loads) * course

    def _dimensionless(self, values: Mapping[str, Floats], name: str, stated: float = 0.0) -> Floats | float:
        return values[name] / self.units[name] if name in values else stated


def belongs(name: str, group: str) -> bool:
    """Return True for the name of a parameter, or of one of a group."""
    members = GROUPS.get(group, MEMORY.get(group, ()))
    return name == group or name in members or (group == "base" and bool(BASE.fullmatch(name)))


def _by_point(values: Floats | float, loads: Floats) -> Floats:
    """Return values of points in the shape of one channel of loads, (n, ..., 3)."""
    return np.reshape(values, (-1, *(1,) * (loads.ndim - 2)))


def _take_at(loads: Floats, x: Floats | float, y: Floats | float) -> None:
    """Move the reference point of the moment of loads, shape (n, ..., 3), from the pivot to (x, y), in place."""
    for channel, arm in ((2, -np.asarray(x)), (1, np.asarray(y))):
        if np.any(arm):
            loads[..., 0] += _by_point(arm, loads) * loads[..., channel]


def unknowns_of(measured: xr.Dataset, rig: Rig, cell: LoadCell, *, gauge: bool = False) -> Unknowns:
    """Return the parameters of a rig that are unknown and that the record shows, with their priors. Noise, discrepancy,
    and a bias that the likelihood integrates out are not among them."""
    present = [_SHORT[name] for name in present_channels(measured)]
    rod, pivots, joint = rod_of(measured), len(bases_of(measured)), rig.calibration
    if joint is not None:
        joint = joint.without([name for name in joint.priors if not _is_shown(name, present)])
    of_joint = {} if joint is None else dict(joint.priors)
    said = {name: v for name, v in rig.said.items() if name not in (*of_joint, *_OF_NOISE)}
    said = of_modes(of_pivots(said, pivots), rod)
    hidden = _hidden(measured, rig, cell, present, gauge)
    own = [name for name, value in said.items() if not isinstance(value, float) and name not in hidden]
    names = (*_told_apart(own, rig, present, of_joint), *of_joint)
    if "stem" in names:
        _refuse_shifted_stem(measured, names, gauge)
    known = {n: v for n, v in said.items() if isinstance(v, float) and (gauge or n not in GROUPS["gauge"])}
    known, sensor = deviating(known, names, rod, cell), sensor_values(cell.dimensionless(rod))
    is_timed = "lag_seconds" in memory_in(sensor, known, dict.fromkeys(names, True))
    stated = Stated.of(rod, cell)
    priors = {n: stated.default(n) if isinstance(v := said[n], str | float) else v for n in names if n not in of_joint}
    return Unknowns(
        names,
        priors | of_joint,
        rod,
        known,
        elapsed_in(measured),
        joint,
        sensor,
        pivots,
        times_of(measured) if is_timed else None,
    )


def _told_apart(names: list[str], rig: Rig, present: Sequence[str], of_joint: Collection[str]) -> list[str]:
    """Return names without the stiffness if all gains, here or calibrated, have its effect; refuse both if named."""
    every_gain = [f"{name}_gain" for name in present]
    if "rigidity_scale" in names and set(every_gain) <= {*names, *of_joint}:
        if not rig.is_named("rigidity_scale"):
            return [name for name in names if name != "rigidity_scale"]
        if set(every_gain) <= set(names):
            raise ParameterError(
                f"rigidity_scale and {', '.join(every_gain)} cannot all be unknown: a stiffer rod and larger gains "
                "have the same effect; say that one of them is known, like rigidity_scale = 1"
            )
    return names


def _hidden(measured: xr.Dataset, rig: Rig, cell: LoadCell, present: Sequence[str], gauge: bool) -> set[str]:
    """Return the unknowns that a record does not show, or that are integrated out."""
    hidden = {name for name in PARAMETERS if not _is_shown(name, present)}
    if not gauge:
        hidden |= set(GROUPS["gauge"])
    for name, uncertainty in zip(GROUPS["bias"], cell.bias_uncertainty, strict=True):
        if uncertainty > 0.0:
            hidden.add(name)
            if name in rig.distributions:
                raise ParameterError(
                    f"{name} is in the load cell's bias_uncertainty already, and integrated out: leave one of the two"
                )
    hidden |= _hidden_backlash(measured, rig, cell)
    return hidden


def _hidden_backlash(measured: xr.Dataset, rig: Rig, cell: LoadCell) -> set[str]:
    """Return the backlash where no drive, or only one way, shows it, or friction makes loads depend on a history."""
    turned = measured.direction.values[~np.isin(measured.sweep.values, carried_sweeps(measured))]
    if turned.size == 0 or (len(np.unique(turned)) == 1 and not rig.is_named("backlash")):
        return {"backlash"}
    if rig.said.get("friction", 0.0) == 0.0:
        return set()
    turned_back = turned_sweeps(measured, cell)
    if not turned_back:
        return set()
    if rig.is_named("backlash") and not isinstance(rig.said["backlash"], float):
        raise ParameterError(
            f"backlash cannot be inferred beside friction where a drive turns back in contact, as in sweep "
            f"{min(turned_back)}: state the backlash of the encoder (drive_angle_backlash of the load cell)"
        )
    return {"backlash"}


def deviating(known: Mapping[str, float], unknown: Collection[str], rod: Rod, cell: LoadCell) -> dict[str, float]:
    """Return the known parameters that are not as stated, and a curvature that would change with the length."""
    stated = stated_values(rod, cell)
    off = {name: value for name, value in known.items() if value != stated.get(name, 0.0)}
    beside: dict[str, tuple[str, ...]] = {"length": ("rest_curvature",), **MEMORY}
    kept = [name for other in (*unknown, *off) for name in beside.get(other, ())]
    return {name: value for name, value in known.items() if name in off or name in kept}


def _refuse_shifted_stem(measured: xr.Dataset, names: Sequence[str], gauge: bool) -> None:
    """Refuse a stem where, as the rod keeps its direction, it only shifts the object and the moment's reference."""
    turned = not np.all(np.isin(measured.sweep.values, carried_sweeps(measured)))
    placed = gauge and not set(GROUPS["gauge"]) <= set(names)
    angles = measured.drive_angle.values
    if turned or placed or "suspension_compliance" in names or np.ptp(angles) > _SAME_DIRECTION:
        return
    if any(name in names for name in GROUPS["lever"]):
        raise ParameterError(
            "stem cannot be inferred beside lever: in every sweep the base is carried without turning, and a longer "
            "stem is the same as another lever and place of the object; leave one of the two, or turn the rod"
        )


def _is_shown(name: str, present: Sequence[str]) -> bool:
    """Return True if a measured channel depends on a parameter."""
    absent = tuple(f"{channel}_" for channel in _SHORT.values() if channel not in present)
    return not name.startswith(absent) and (name not in GROUPS["lever"] or "moment" in present)
