"""What is not as stated about a rig, and inferred beside a contour."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np
import xarray as xr
from numpy.typing import NDArray
from scipy import stats

from tactile_bayes.checks import check_names, check_number
from tactile_bayes.elastica import MAX_FRICTION_ANGLE
from tactile_bayes.errors import ParameterError
from tactile_bayes.inference.families import Prior
from tactile_bayes.inference.likelihood import Rig, bases_of
from tactile_bayes.load_cell import LoadCell
from tactile_bayes.record import present_channels, rod_of
from tactile_bayes.rod import Rod

__all__ = ["BIAS", "BIASES", "MAY_VANISH", "STANDARD", "Nuisances", "nuisances_of"]

Floats = NDArray[np.float64]

STANDARD = ("rigidity_scale", "drive_angle_offset", "bias")
"""What is inferred unless something else is asked for."""

MAY_VANISH = ("friction", "suspension_compliance")
"""What is not negative, and likely none."""

_SHORT = {"holding_moment": "moment", "force_x": "force_x", "force_y": "force_y"}
_GROUPS = {what: tuple(f"{name}_{what}" for name in _SHORT.values()) for what in ("bias", "drift", "gain")}

BIASES = _GROUPS["bias"]

BIAS = 0.1
"""Standard deviation of the prior of a bias, in EI/L and EI/L²."""

_RIGIDITY, _OFFSET, _GAIN, _FRICTION, _COMPLIANCE, _SHIFT = 0.05, np.radians(1.0), 0.02, 0.3, 0.05, 0.01
"""Standard deviations (scales of half normals) of the other priors: of ratios; rad; rad per EI/L; and L."""


_BASE = re.compile(r"base_(\d+)_([xy])")
"""How much a pivot of the record, counted from 1, is off."""


class _Kind(NamedTuple):
    """One nuisance parameter."""

    low: float
    high: float
    power_of_moment: int = 0
    """Of the unit of moments in its unit; for zeros of forces that of forces stands in for it."""


_KINDS = {
    "rigidity_scale": _Kind(0.0, np.inf),
    "drive_angle_offset": _Kind(-np.pi, np.pi),
    "suspension_compliance": _Kind(0.0, np.inf, power_of_moment=-1),
    "friction": _Kind(0.0, float(np.tan(MAX_FRICTION_ANGLE))),
    **{name: _Kind(-np.inf, np.inf, power_of_moment=1) for name in (*_GROUPS["bias"], *_GROUPS["drift"])},
    **{name: _Kind(0.0, np.inf) for name in _GROUPS["gain"]},
}
_RIG = ("drive_angle_offset", "rigidity_scale", "suspension_compliance", "friction")


@dataclass(frozen=True)
class Nuisances:
    """Parameters of a rig that are inferred beside those of a contour.

    Parameters
    ----------
    names : tuple of str
    priors : mapping
        By name, in the record's units.
    rod : Rod
        As stated.
    friction : float
        Coulomb's coefficient where it is not inferred.
    way : ndarray, shape (samples,)
        How far each sample is on the way from the record's first (−½) to its last (½).
    """

    names: tuple[str, ...]
    priors: Mapping[str, Prior]
    rod: Rod
    friction: float
    way: Floats = field(default_factory=lambda: np.zeros(1))
    units: Mapping[str, float] = field(init=False)
    """Of each name, in the record's units, what is one inside."""

    def __post_init__(self) -> None:
        moment, force = self.rod.moment_unit, self.rod.force_unit
        units = {n: (force if n.startswith("force") else moment) ** k.power_of_moment for n, k in _KINDS.items()}
        units |= {n: 1.0 for n in self.names if _BASE.fullmatch(n)}  # lengths are the record's inside, too
        object.__setattr__(self, "units", units)

    def bounds(self, name: str) -> tuple[float, float]:
        """Between which values it lies, whatever a prior says."""
        kind = _KINDS.get(name)
        return (-np.inf, np.inf) if kind is None else (kind.low, kind.high)

    def unit(self, name: str) -> str:
        """Of an SI record, in words."""
        if name in (*_GROUPS["bias"], *_GROUPS["drift"]):
            return "N m" if name.startswith("moment") else "N"
        if _BASE.fullmatch(name):
            return "m"
        return {"drive_angle_offset": "rad", "suspension_compliance": "rad/(N m)"}.get(name, "1")

    def rig(self, values: Mapping[str, Floats]) -> Rig:
        """The rig of every point, from values by name, each of shape (n,)."""
        known = {"friction": self.friction} if "friction" not in self.names else {}
        return Rig(
            base_shifts=self._base_shifts(values),
            **known,
            **{name: values[name] / self.units[name] for name in _RIG if name in self.names},
        )

    def _base_shifts(self, values: Mapping[str, Floats]) -> Floats | None:
        """Shape (n, pivots, 2), to the last that is off."""
        shifted = [(name, _BASE.fullmatch(name)) for name in self.names]
        off = [(name, int(found[1]) - 1, "xy".index(found[2])) for name, found in shifted if found]
        if not off:
            return None
        shifts = np.zeros((len(values[off[0][0]]), max(pivot for _, pivot, _ in off) + 1, 2))
        for name, pivot, axis in off:
            shifts[:, pivot, axis] = values[name]
        return shifts

    def sensed(self, loads: Floats, values: Mapping[str, Floats], cell: LoadCell) -> Floats:
        """Loads, shape (n, ..., 3), with errors of calibration, and with what the cell will read as a bias."""
        gains = [values.get(name) for name in _GROUPS["gain"]]
        for channel, gain in enumerate(gains):
            if gain is not None:
                loads[..., channel] *= gain.reshape(-1, *(1,) * (loads.ndim - 2))
        for what, course in (("bias", np.ones(1)), ("drift", self.way)):
            if not set(self.names).isdisjoint(_GROUPS[what]):
                zeros = self._zeros(_GROUPS[what], values, cell)
                loads += zeros.reshape(len(zeros), *(1,) * (loads.ndim - 2), -1) * course[:, None]
        return loads

    def _zeros(self, names: Sequence[str], values: Mapping[str, Floats], cell: LoadCell) -> Floats:
        """Loads that the cell reads as what is named, by channel, shape (n, 3)."""
        read = [values[name] / self.units[name] if name in self.names else 0.0 for name in names]
        return np.linalg.solve(np.asarray(cell.gain, dtype=float), np.array(np.broadcast_arrays(*read))).T


def nuisances_of(
    measured: xr.Dataset, chosen: Sequence[str], priors: Mapping[str, Prior], cell: LoadCell, friction: float
) -> Nuisances:
    """Nuisance parameters that are asked for by name, or by having a prior; with default priors for the others.

    A bias that the load cell states an uncertainty of is not among them: the likelihood integrates it out already.

    Raises
    ------
    ParameterError
        If a name is none of a nuisance parameter, or cannot be identified.
    """
    chosen = check_names("nuisances", chosen)
    present = [_SHORT[name] for name in present_channels(measured)]
    uncertain = dict(zip(_GROUPS["bias"], cell.bias_uncertainty, strict=True))
    names: list[str] = []
    for name in (*chosen, *(name for name in priors if name in _KINDS or _BASE.fullmatch(name))):
        if name in ("base", "base_x", "base_y") or _BASE.fullmatch(name):
            names += _bases_off(name, measured)
            continue
        if name not in _KINDS and name not in _GROUPS:
            raise ParameterError(
                f"there is no nuisance parameter {name!r}: choose from {', '.join([*_GROUPS, *_KINDS])}, or base"
            )
        members = [n for n in _GROUPS[name] if n.rpartition("_")[0] in present] if name in _GROUPS else [name]
        for member in members:
            if member.rpartition("_")[0] not in present and any(member in group for group in _GROUPS.values()):
                raise ParameterError(f"{member} cannot be inferred: the record has no such channel")
            if uncertain.get(member, 0.0) > 0.0:
                if name in _GROUPS:
                    continue
                raise ParameterError(
                    f"{member} is in the load cell's bias_uncertainty already, and integrated out: leave one of the two"
                )
            names.append(member)
    names = list(dict.fromkeys(names))
    most = _KINDS["friction"].high
    check_number("friction", friction, f"give a coefficient from 0 to {most:.2f}", least=0.0, most=most)
    if "friction" in names and friction:
        raise ParameterError(f"friction is {friction!r} and to be inferred as well: leave one of the two")
    every_gain = [f"{name}_gain" for name in present]
    if "rigidity_scale" in names and set(every_gain) <= set(names):
        raise ParameterError(
            f"rigidity_scale and {', '.join(every_gain)} cannot all be inferred: a stiffer rod and larger gains "
            "measure the same; leave one of them"
        )
    rod = rod_of(measured)
    way = np.linspace(-0.5, 0.5, measured.sizes["sample"])
    nuisances = Nuisances(tuple(names), {}, rod, friction, way)
    defaults = {name: _default_prior(name, rod.length if "base" in name else nuisances.units[name]) for name in names}
    return replace(nuisances, priors=defaults)


def _bases_off(name: str, measured: xr.Dataset) -> list[str]:
    """Names of the pivots' shifts that a name stands for."""
    number, found = len(bases_of(measured)), _BASE.fullmatch(name)
    if number == 1 or (found and found[1] == "1"):
        raise ParameterError(
            f"{name} cannot be inferred: if pivot and object are shifted together nothing measured changes. "
            f"Results are relative to the {'first ' if number > 1 else ''}pivot as stated; add to them what is not "
            "known of its place"
        )
    if found and not 2 <= int(found[1]) <= number:
        raise ParameterError(f"there is no {name}: the record has {number} pivots, base_2_x is of the second")
    if found:
        return [f"base_{int(found[1])}_{found[2]}"]
    return [f"base_{k}_{axis}" for k in range(2, number + 1) for axis in (name[5:] or "xy")]


def _default_prior(name: str, unit: float) -> Prior:
    match name:
        case "rigidity_scale":
            return stats.lognorm(s=_RIGIDITY)
        case "drive_angle_offset":
            return stats.norm(0.0, _OFFSET)
        case "friction":
            return stats.halfnorm(scale=_FRICTION)
        case "suspension_compliance":
            return stats.halfnorm(scale=_COMPLIANCE * unit)
        case _ if name in _GROUPS["gain"]:
            return stats.norm(1.0, _GAIN)
        case _ if _BASE.fullmatch(name):
            return stats.norm(0.0, _SHIFT * unit)
    return stats.norm(0.0, BIAS * unit)
