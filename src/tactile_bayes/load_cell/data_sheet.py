"""The data sheet of a load cell: its properties, and their form in a record's attributes."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, fields, replace
from itertools import combinations, product
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike

from tactile_bayes.arrays import Flags, Floats, Index
from tactile_bayes.checks import (
    as_number,
    check_array,
    check_choice,
    check_kind,
    check_number,
    check_numbers,
    check_positive,
    refused,
)
from tactile_bayes.errors import ParameterError
from tactile_bayes.load_cell.curve import curved, slope_of, straightened
from tactile_bayes.load_cell.drift import Drift, OrnsteinUhlenbeck, RandomWalk
from tactile_bayes.mechanics.rods.rod import Rod
from tactile_bayes.record import CHANNELS, FRAMES, LOAD_CELL_UNITS, Frame
from tactile_bayes.record.attribute_names import no_entry

Triple = tuple[float, float, float]

# Deterministic entries: known errors, for which a record can be corrected.
CERTAIN = ("bias", "gain", "lever", "moment_curve", "drive_angle_offset", "drive_angle_backlash")
# Entries of the memory: one number for all channels, or three.
MEMORY = ("lag", "lag_seconds", "play")
_LOADS = f"give an array of shape (..., 3), with the channels {', '.join(CHANNELS)}"

_IDENTITY = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
_DRIFTS: dict[type[Drift], str] = {RandomWalk: "random_walk", OrnsteinUhlenbeck: "ornstein_uhlenbeck"}
_PAIRS = tuple(combinations(CHANNELS, 2))
# Names of the numbers of each entry with several numbers.
SEVERAL: dict[str, tuple[str, ...]] = {
    "bias": tuple(f"bias_{name}" for name in CHANNELS),
    "bias_uncertainty": tuple(f"bias_uncertainty_{name}" for name in CHANNELS),
    "gain": tuple(f"gain_{to}_{of}" for to, of in product(CHANNELS, CHANNELS)),
    "lever": ("lever_x", "lever_y"),
    "moment_curve": ("moment_curve_quadratic", "moment_curve_cubic"),
    "correlation": tuple(f"correlation_{one}_{other}" for one, other in _PAIRS),
    **{name: tuple(f"{name}_{channel}" for channel in CHANNELS) for name in MEMORY},
}
_OF_CHANNELS = f"give three finite numbers ({', '.join(CHANNELS)})"
_CORRECTIONS = {
    "bias": _OF_CHANNELS,
    "bias_uncertainty": _OF_CHANNELS,
    "gain": "give three rows of three numbers, ((1, 0, 0), (0, 1, 0), (0, 0, 1)) being that of an ideal cell",
    "lever": "give two finite numbers (x, y)",
    "moment_curve": "give two finite numbers (quadratic, cubic), (0, 0) for a reading in proportion to the moment",
    "correlation": f"give three finite numbers ({', '.join(' with '.join(pair) for pair in _PAIRS)})",
    **{
        f"{channel}_{name}": f"give {what}, zero or positive [{unit}, or dimensionless]"
        for name, what in (("noise", "a standard deviation"), ("resolution", "a step"))
        for channel, unit in (("force", "N"), ("moment", "N m"), ("drive_angle", "rad"))
    },
    "relative_noise": "give a share, zero or positive",
    **{
        name: f"give {what}, zero or positive, or three ({', '.join(CHANNELS)})"
        for name, what in zip(MEMORY, ("readings", "seconds", "a share of the largest load"), strict=True)
    },
    **dict.fromkeys(("drive_angle_offset", "drive_angle_backlash"), "give an angle [rad]"),
    **dict.fromkeys(("force_range", "moment_range", "degrees_of_freedom"), "give a positive number, inf for none"),
}
_SCALARS = tuple(name for name in LOAD_CELL_UNITS if name in _CORRECTIONS and name not in MEMORY)


@dataclass(frozen=True)
class DataSheet:
    """Properties of a load cell; `LoadCell` describes the entries."""

    force_noise: float = 0.0
    moment_noise: float = 0.0
    degrees_of_freedom: float = math.inf
    relative_noise: float = 0.0
    correlation: Triple = (0.0, 0.0, 0.0)
    bias: Triple = (0.0, 0.0, 0.0)
    bias_uncertainty: Triple = (0.0, 0.0, 0.0)
    drift: Drift | None = None
    gain: tuple[Triple, Triple, Triple] = _IDENTITY
    lever: tuple[float, float] = (0.0, 0.0)
    moment_curve: tuple[float, float] = (0.0, 0.0)
    lag: float | Triple = 0.0
    lag_seconds: float | Triple = 0.0
    play: float | Triple = 0.0
    force_range: float = math.inf
    moment_range: float = math.inf
    force_resolution: float = 0.0
    moment_resolution: float = 0.0
    drive_angle_offset: float = 0.0
    drive_angle_backlash: float = 0.0
    drive_angle_noise: float = 0.0
    drive_angle_resolution: float = 0.0
    frame: Frame | None = None

    def __post_init__(self) -> None:
        for name in _SCALARS:
            object.__setattr__(self, name, self._number(name))
        for name, names in SEVERAL.items():
            shape, value = (3, 3) if name == "gain" else (len(names),), getattr(self, name)
            least = -math.inf
            if name in MEMORY:
                least, value = 0.0, value if as_number(value) is None else (value,) * 3
            numbers = check_numbers(f"the load cell's {name}", value, _CORRECTIONS[name], shape=shape, least=least)
            rows = tuple(map(tuple, numbers.tolist()) if name == "gain" else numbers.tolist())
            object.__setattr__(self, name, rows[0] if name in MEMORY and len(set(rows)) == 1 else rows)
        self._refuse_the_impossible()
        if self.drift is not None and not np.any(self.drift.sizes):
            object.__setattr__(self, "drift", None)

    def _number(self, name: str) -> float:
        """Return a scalar entry; only a range and degrees of freedom may be infinite."""
        value, what, correction = getattr(self, name), f"the load cell's {name}", _CORRECTIONS[name]
        if as_number(value) is None:
            raise refused(what, value, "give a number")
        if name.endswith(("_range", "_freedom")):
            return math.inf if value == math.inf else check_positive(what, value, correction)
        return check_number(what, value, correction, least=-math.inf if correction.startswith("give an angle") else 0.0)

    def _refuse_the_impossible(self) -> None:
        for channel in ("force", "moment"):
            step, limit = getattr(self, f"{channel}_resolution"), getattr(self, f"{channel}_range")
            if not step <= limit:
                raise ParameterError(
                    f"the load cell's {channel}_resolution is {step!r}, more than its {channel}_range, {limit!r}: give "
                    "the step of a reading, and the largest reading, in the same unit"
                )
        if min(self.bias_uncertainty) < 0.0:
            correction = "give three standard deviations, each zero or positive"
            raise refused("the load cell's bias_uncertainty", self.bias_uncertainty, correction)
        if np.linalg.eigvalsh(self.correlation_matrix)[0] <= 1e-9:
            between = ", ".join(" and ".join(pair) for pair in _PAIRS)
            correction = f"no noise has these coefficients between {between}: give smaller ones"
            raise refused("the load cell's correlation", self.correlation, correction)
        if np.linalg.cond(np.array(self.gain)) > 1e9:
            correction = "such a cell cannot distinguish three loads: give rows that are independent, like (1, 0, 0)"
            raise refused("the load cell's gain", self.gain, correction)
        if self.drift is not None and not isinstance(self.drift, RandomWalk | OrnsteinUhlenbeck):
            raise refused("the load cell's drift", self.drift, "give RandomWalk(...) or OrnsteinUhlenbeck(...)")
        if self.frame is not None:
            check_choice("the load cell's frame", self.frame, FRAMES, "choose 'fixed' or 'turning', or None")
        if math.isfinite(self.degrees_of_freedom) and any(self.correlation):
            raise ParameterError(
                "noise with outliers (degrees_of_freedom) and noise that is correlated between channels go together in "
                "more than one way: leave one of the two out"
            )

    # ---- by channel, in the order of CHANNELS

    @property
    def noise(self) -> Floats:
        """Scale of the white noise of each channel, shape (3,)."""
        return np.array([self.moment_noise, self.force_noise, self.force_noise])

    @property
    def has_variances(self) -> bool:
        """True if the white noise of every channel has a positive, finite variance, which weights the channels."""
        return self.degrees_of_freedom > 2.0 and bool(np.all(self.noise > 0.0))

    @property
    def unrest(self) -> Flags:
        """True for channels whose readings vary without load, shape (3,)."""
        drift = 0.0 if self.drift is None else self.drift.sizes
        return np.asarray(self.noise + self.resolution + np.array(self.bias_uncertainty) + drift > 0.0)

    @property
    def resolution(self) -> Floats:
        """Steps of the readings, shape (3,); 0 for continuous readings."""
        return np.array([self.moment_resolution, self.force_resolution, self.force_resolution])

    @property
    def limit(self) -> Floats:
        """Largest size of a reading, shape (3,): the last step of the reading in the range."""
        limit = np.array([self.moment_range, self.force_range, self.force_range])
        whole = (self.resolution > 0.0) & np.isfinite(limit)
        with np.errstate(over="ignore"):
            steps = limit[whole] / self.resolution[whole]
        # A range of a whole number of steps stays so in other units, where rounding may reduce it.
        limit[whole] = np.where(np.isinf(steps), limit[whole], np.floor(steps + 1e-9) * self.resolution[whole])
        return limit

    @property
    def gain_matrix(self) -> Floats:
        """Reading of each channel (rows) by each load at the pivot (columns), shape (3, 3), with gains and lever."""
        x, y = self.lever
        return np.array(self.gain) @ [[1.0, y, -x], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]

    @property
    def own_gains(self) -> Floats:
        """Reading of each channel for a unit of its own load, without sign, shape (3,); 1 for one that has none."""
        gains = np.abs(np.diag(self.gain))
        return np.where(gains > 0.0, gains, 1.0)

    @property
    def correlation_matrix(self) -> Floats:
        """Correlation matrix of the white noise of the channels, shape (3, 3)."""
        matrix = np.eye(3)
        for (i, j), value in zip(combinations(range(3), 2), self.correlation, strict=True):
            matrix[i, j] = matrix[j, i] = value
        return matrix

    @property
    def is_alike(self) -> bool:
        """True if the errors of all samples have the same covariance, whatever the loads."""
        return self.drift is None and not self.relative_noise

    @property
    def straight(self) -> Self:
        """The same without the curve of the moment, and without memory."""
        if not any((*self.moment_curve, self.lag, self.lag_seconds, self.play)):
            return self
        return replace(self, moment_curve=(0.0, 0.0), lag=0.0, lag_seconds=0.0, play=0.0)

    def cut(self, readings: Floats) -> Floats:
        """Return readings, shape (..., 3), cut off at the ends of the range."""
        is_limited = math.isfinite(min(self.force_range, self.moment_range))
        return np.clip(readings, -self.limit, self.limit) if is_limited else readings

    def expected(self, loads: Floats) -> Floats:
        """Readings of loads, shape (..., 3), without noise: lever, curve of the moment, gain and bias. A channel that
        was not measured is NaN throughout; it affects others only through cross-talk, or the moment through its lever.
        """
        loads = check_array("loads", loads, _LOADS)
        if loads.shape[-1:] != (len(CHANNELS),):
            raise refused("loads", loads, _LOADS)
        if self.gain == _IDENTITY and not any((*self.lever, *self.moment_curve)):
            return loads + np.array(self.bias) if any(self.bias) else loads
        if any(self.moment_curve):
            loads = self._bent(loads)
            gain = np.array(self.gain)
        else:
            gain = self.gain_matrix
        read = [sum(loads[..., j] * gain[i, j] for j in range(3) if gain[i, j]) for i in range(3)]
        return np.stack(np.broadcast_arrays(*read), axis=-1) + np.array(self.bias)

    def _bent(self, loads: Floats) -> Floats:
        """Return loads with the moment at the lever's end, as the curve changes it."""
        x, y = self.lever
        moment = loads[..., 0]
        for arm, force in ((y, 1), (-x, 2)):
            moment = moment + arm * loads[..., force] if arm else moment
        return np.stack([curved(moment, *self.moment_curve), loads[..., 1], loads[..., 2]], axis=-1)

    def loads_of(self, readings: Floats, present: slice | Index = slice(None)) -> Floats:
        """Return the loads, shape (..., channels), of readings of the present channels without bias. Where the curve of
        the moment turns back, readings beyond are taken for the last one before.
        """
        if not any(self.moment_curve) or 0 not in np.arange(len(CHANNELS))[present]:
            return np.asarray(readings @ np.linalg.inv(self.gain_matrix[present][:, present]).T)
        loads = np.asarray(readings @ np.linalg.inv(np.array(self.gain)[present][:, present]).T)
        arms = replace(self.straight, gain=_IDENTITY).gain_matrix[present][:, present]
        loads[..., 0] = straightened(loads[..., 0], *self.moment_curve)
        return np.asarray(loads @ np.linalg.inv(arms).T)

    def slopes(self, loads: Floats) -> Floats:
        """Return the change of readings with loads, shape (..., 3, 3) or (3, 3) if it is the same for all."""
        if not any(self.moment_curve):
            return self.gain_matrix
        at_end = replace(self.straight, gain=_IDENTITY)
        moment = at_end.expected(loads)[..., 0] - self.bias[0]
        bent = np.broadcast_to(np.eye(3), (*moment.shape, 3, 3)).copy()
        bent[..., 0, 0] = slope_of(moment, *self.moment_curve)
        return np.asarray(np.array(self.gain) @ bent @ at_end.gain_matrix)

    def deviation(self, loads: Floats) -> Floats:
        """Scale of the white noise on the readings of loads, shape (..., 3), or (3,) if it is the same for all."""
        if not self.relative_noise:
            return self.noise
        return np.hypot(self.noise, self.relative_noise * (self.expected(loads) - np.array(self.bias)))

    def misread(self, direction: ArrayLike) -> Floats:
        """Encoder offset, including backlash, while the drive moves "forward" or "backward", without noise [rad]."""
        sense = np.where(np.asarray(direction) == "backward", -0.5, 0.5)
        return np.asarray(self.drive_angle_offset + self.drive_angle_backlash * sense)

    def cuts_off(self, readings: Floats, present: slice | Index = slice(None)) -> Flags:
        """Return which readings of the present channels are at the end of the range, and stand for values beyond."""
        return np.asarray(np.abs(readings) >= (self.limit * (1.0 - 1e-9) - 0.5 * self.resolution)[present])

    # ---- units and attributes

    def dimensionless(self, rod: Rod) -> Self:
        """Load cell in the units of a rod: forces in EI/L², moments in EI/L, lengths in L."""
        check_kind("rod", rod, Rod, "give the Rod with which the cell is used")
        sizes = rod.unit_sizes
        entries = dict(self._all_entries())
        for name, unit in LOAD_CELL_UNITS.items():
            if name in entries and unit in sizes:
                entries[name] /= sizes[unit]
        return self.from_entries(entries)

    def entries(self) -> dict[str, float | str]:
        """Entries unlike an ideal sensor, by the names in `LOAD_CELL_UNITS` and "frame"; see `from_entries`."""
        ideal = dict(DataSheet()._all_entries())
        return {name: value for name, value in self._all_entries() if value != ideal.get(name, 0.0)}

    def _all_entries(self) -> Iterator[tuple[str, Any]]:
        for name in _SCALARS:
            yield name, float(getattr(self, name))
        for name, names in SEVERAL.items():
            numbers = np.ravel(getattr(self, name)).tolist()
            yield from zip(names if len(numbers) > 1 else (name,), numbers, strict=True)
            if name == "bias_uncertainty" and self.drift is not None:
                prefix = _DRIFTS[type(self.drift)]
                yield from ((f"{prefix}_{field.name}", getattr(self.drift, field.name)) for field in fields(self.drift))
        if self.frame is not None:
            yield "frame", self.frame

    @classmethod
    def from_entries(cls, entries: Mapping[str, Any]) -> Self:
        """Build a load cell from entries; missing ones are ideal."""
        unknown = [name for name in entries if name not in LOAD_CELL_UNITS and name != "frame"]
        if unknown:
            raise ParameterError(no_entry(unknown[0]))

        options: dict[str, Any] = {name: entries[name] for name in (*_SCALARS, "frame") if name in entries}
        ideal = dict(DataSheet()._all_entries())
        for name, names in SEVERAL.items():
            numbers = [entries.get(one, entries.get(name, ideal.get(one, 0.0))) for one in names]
            options[name] = [numbers[:3], numbers[3:6], numbers[6:]] if name == "gain" else numbers
        processes = [kind for kind, prefix in _DRIFTS.items() if any(name.startswith(f"{prefix}_") for name in entries)]
        if len(processes) > 1:
            raise ParameterError("a load cell drifts by a random walk or an Ornstein-Uhlenbeck process, not by both")
        for kind in processes:
            named = {field.name: f"{_DRIFTS[kind]}_{field.name}" for field in fields(kind)}
            options["drift"] = kind(**{name: entries[entry] for name, entry in named.items() if entry in entries})
        return cls(**options)
