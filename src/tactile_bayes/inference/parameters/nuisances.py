"""Nuisance parameters: deviations of a rig from the stated one that are inferred beside a contour."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import xarray as xr
from scipy import stats

from tactile_bayes.arrays import Floats
from tactile_bayes.checks import check_names, check_number
from tactile_bayes.errors import ParameterError
from tactile_bayes.inference.parameters.discrepancy import DISCREPANCY, is_discrepancy
from tactile_bayes.inference.parameters.priors import Prior
from tactile_bayes.inference.record_likelihood.rig import Rig
from tactile_bayes.load_cell import LoadCell
from tactile_bayes.load_cell.blocks import elapsed_in
from tactile_bayes.load_cell.curve import curved
from tactile_bayes.mechanics.elastica import MAX_FRICTION_ANGLE
from tactile_bayes.mechanics.rods.profile import STEEPEST_TAPER
from tactile_bayes.mechanics.rods.rod import Rod
from tactile_bayes.record import LOAD_CELL_UNITS, bases_of, carried_sweeps, present_channels, rod_of

if TYPE_CHECKING:
    from tactile_bayes.inference.parameters.rig_prior import RigPrior

__all__ = ["BIAS", "BIASES", "CURVE", "STANDARD", "Nuisances", "belongs", "nuisances_of"]

STANDARD = ("rigidity_scale", "drive_angle_offset", "bias", "lever", "backlash", "friction")
"""Default nuisance parameters, of which those that a record cannot identify are left out."""

_STANDARD = "standard"
"""Name that stands for the default nuisance parameters."""

_SHORT = {"holding_moment": "moment", "force_x": "force_x", "force_y": "force_y"}
_GROUPS = {what: tuple(f"{name}_{what}" for name in _SHORT.values()) for what in ("bias", "drift", "gain")}
_GROUPS["lever"] = ("lever_x", "lever_y")

_GROUPS["moment_curve"] = ("moment_curve_quadratic", "moment_curve_cubic")
_GROUPS["gauge"] = ("gauge_x", "gauge_y")

BIASES, DRIFTS, GAINS, LEVERS, CURVE = (_GROUPS[what] for what in ("bias", "drift", "gain", "lever", "moment_curve"))

BIAS = 0.1
"""Standard deviation of the prior of a bias, in EI/L and EI/L²."""

_RIGIDITY, _OFFSET, _GAIN, _FRICTION, _COMPLIANCE, _SHIFT = 0.05, np.radians(1.0), 0.02, 0.3, 0.05, 0.01
_LEVER, _BACKLASH, _CURVATURE, _TAPER, _STEM, _LENGTH = 0.005, np.radians(0.2), 0.05, 0.05, 0.02, 0.01
_BENT = {"moment_curve_quadratic": 0.05, "moment_curve_cubic": 0.02}
"""Standard deviations (scales of half normals) of the other priors: of ratios; rad; rad per EI/L; L; 1/L; of the
diameter at the base; L; L; and of the curve of the moment, in powers of L/EI."""


_SAME_DIRECTION = 1e-3
"""Range of drive angles [rad] within which a rod keeps its direction."""

_NO_GAUGE = "only the place of a gauge, whose contour is known, is one of the rig's parameters (infer_rig)"

_BASE = re.compile(r"base_(\d+)_([xy])")
"""Shift of a pivot of the record, counted from 1, along an axis."""


class _Kind(NamedTuple):
    """Bounds and unit of a nuisance parameter."""

    low: float
    high: float
    power_of_moment: int = 0
    """Power of the unit of moments (for zeros of forces: of forces) in the parameter's unit."""
    power_of_length: int = 0
    """Power of the unit of length in the parameter's unit."""


_KINDS = {
    "rigidity_scale": _Kind(0.0, np.inf),
    "drive_angle_offset": _Kind(-np.pi, np.pi),
    "backlash": _Kind(-np.pi, np.pi),
    "suspension_compliance": _Kind(0.0, np.inf, power_of_moment=-1),
    "friction": _Kind(0.0, float(np.tan(MAX_FRICTION_ANGLE))),
    "rest_curvature": _Kind(-np.inf, np.inf, power_of_length=-1),
    "taper": _Kind(0.0, STEEPEST_TAPER),
    "stem": _Kind(0.0, np.inf, power_of_length=1),
    "length": _Kind(0.0, np.inf, power_of_length=1),
    **{name: _Kind(-np.inf, np.inf, power_of_moment=1) for name in (*_GROUPS["bias"], *_GROUPS["drift"])},
    **{name: _Kind(0.0, np.inf) for name in _GROUPS["gain"]},
    **{name: _Kind(-np.inf, np.inf, power_of_length=1) for name in (*_GROUPS["lever"], *_GROUPS["gauge"])},
    **{name: _Kind(-np.inf, np.inf, power_of_moment=-power) for power, name in enumerate(CURVE, start=1)},
}
_RIG = {name: name for name in ("drive_angle_offset", "rigidity_scale", "suspension_compliance", "friction")}
_RIG["backlash"] = "drive_angle_backlash"
"""Parameters that change the path or the reading of the drive angle, and their names in `Rig`."""

_SENSED = tuple(name for what in ("bias", "drift", "gain", "lever", "moment_curve") for name in _GROUPS[what])
"""Parameters that change only what the load cell senses, not the path."""


@dataclass(frozen=True)
class Nuisances:
    """Parameters of a rig that are inferred beside those of a contour.

    Parameters
    ----------
    names : tuple of str
        Names of the parameters.
    priors : mapping of str to frozen scipy.stats distribution
        Default priors by name, in the record's units.
    rod : Rod
        The stated rod.
    friction : float
        Coulomb's coefficient if it is not inferred.
    elapsed : ndarray, shape (samples,)
        Position of each sample in the record, linear from the first (−½) to the last (½), for drift.
    joint : RigPrior, optional
        Joint prior of the parameters that a calibration of the rig has found; their `priors` are its marginals.
    curve : (float, float)
        Stated curve of the moment [L/EI, (L/EI)²], where it is not inferred.
    pivots : int
        Number of pivots of the record.
    """

    names: tuple[str, ...]
    priors: Mapping[str, Prior]
    rod: Rod
    friction: float
    elapsed: Floats = field(default_factory=lambda: np.zeros(1))
    joint: RigPrior | None = None
    curve: tuple[float, float] = (0.0, 0.0)
    pivots: int = 1
    units: Mapping[str, float] = field(init=False)
    """Unit of each parameter in dimensionless calculations, in the record's units."""

    def __post_init__(self) -> None:
        moment, force, length = self.rod.moment_unit, self.rod.force_unit, self.rod.length_unit
        units = {
            n: (force if n.startswith("force") else moment) ** k.power_of_moment * length**k.power_of_length
            for n, k in _KINDS.items()
        }
        shifts = (n for n in self.names if _BASE.fullmatch(n) or n in _GROUPS["gauge"])
        units |= dict.fromkeys(shifts, 1.0)  # they stay in the record's unit of length
        object.__setattr__(self, "units", units)

    def bounds(self, name: str) -> tuple[float, float]:
        """Return the bounds of a parameter, whatever its prior."""
        kind = _KINDS.get(name)
        return (-np.inf, np.inf) if kind is None else (kind.low, kind.high)

    @property
    def of_path(self) -> tuple[str, ...]:
        """Names of the parameters that change the path, or where along it the samples lie."""
        return tuple(name for name in self.names if name not in _SENSED)

    def unit(self, name: str) -> str:
        """Return the SI unit of a parameter, like "N m"."""
        if name in (*_GROUPS["bias"], *_GROUPS["drift"]):
            return "N m" if name.startswith("moment") else "N"
        if _BASE.fullmatch(name) or name in (*_GROUPS["lever"], *_GROUPS["gauge"], "stem", "length"):
            return "m"
        if name in CURVE:
            return LOAD_CELL_UNITS[name]
        units = {"drive_angle_offset": "rad", "backlash": "rad", "suspension_compliance": "rad/(N m)"}
        units["rest_curvature"] = "1/m"
        return units.get(name, "1")

    def rig(self, values: Mapping[str, Floats]) -> Rig:
        """Return the rig of every point, from values by name in the record's units, each of shape (n,)."""
        known: dict[str, Any] = {"friction": self.friction} if "friction" not in self.names else {}
        if "length" in self.names:
            known["length"] = values["length"] / self.rod.length
        if "rest_curvature" in self.names:
            longer = known.get("length", 1.0)  # the rod of another length has the stated turn from base to tip
            off = longer * values["rest_curvature"] - self.rod.mean_rest_curvature
            known["rest_curvature"] = off / self.units["rest_curvature"]
        if "taper" in self.names:
            known["taper"] = values["taper"] - self.rod.taper
        if "stem" in self.names:
            known["stem"] = (values["stem"] - self.rod.stem) / self.units["stem"]
        return Rig(
            base_shifts=self._base_shifts(values),
            **known,
            **{of_rig: values[name] / self.units[name] for name, of_rig in _RIG.items() if name in self.names},
        )

    def _base_shifts(self, values: Mapping[str, Floats]) -> Floats | None:
        """Return the shifts of pivots, shape (n, pivots, 2), up to the last one that is inferred; None without any.

        A shift of the gauge is one of all pivots to the other side.
        """
        shifted = [(name, _BASE.fullmatch(name)) for name in self.names]
        off = [(name, int(found[1]) - 1, "xy".index(found[2])) for name, found in shifted if found]
        gauge = [name for name in _GROUPS["gauge"] if name in self.names]
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
        """Apply inferred gains, levers and zeros, and the curve, to loads, shape (n, ..., 3) [EI/L, EI/L²], in place.

        Zeros are given as readings, and enter as the loads that the cell reads as such if its own curve is left out.
        """
        curve = [
            values[name] / self.units[name] if name in self.names else stated
            for name, stated in zip(CURVE, self.curve, strict=True)
        ]
        is_bent = any(np.any(v) for v in curve)
        gains = [values.get(name) for name in _GROUPS["gain"]]
        levers = [values[name] / self.units[name] if name in self.names else None for name in _GROUPS["lever"]]
        # Gains act on readings at the lever's end, to which the cell's own lever is applied later.
        own = cell.lever if is_bent or any(gain is not None for gain in gains) else (0.0, 0.0)
        _take_at(loads, *(known if lever is None else known + lever for known, lever in zip(own, levers, strict=True)))
        if is_bent:
            loads[..., 0] = curved(loads[..., 0], *(np.reshape(v, (-1, *(1,) * (loads.ndim - 2))) for v in curve))
        for channel, gain in enumerate(gains):
            if gain is not None:
                loads[..., channel] *= gain.reshape(-1, *(1,) * (loads.ndim - 2))
        _take_at(loads, *(-known for known in own))
        for what, course in (("bias", np.ones(1)), ("drift", self.elapsed)):
            if not set(self.names).isdisjoint(_GROUPS[what]):
                zeros = self._zeros(_GROUPS[what], values, cell)
                for channel, zero in enumerate(zeros.T):  # broadcasting over an axis of three is several times slower
                    loads[..., channel] += zero.reshape(-1, *(1,) * (loads.ndim - 2)) * course
        return loads

    def _zeros(self, names: Sequence[str], values: Mapping[str, Floats], cell: LoadCell) -> Floats:
        """Return the loads that the cell reads as the named zeros, shape (n, 3)."""
        read = [values[name] / self.units[name] if name in self.names else 0.0 for name in names]
        return np.linalg.solve(cell.gain_matrix, np.array(np.broadcast_arrays(*read))).T


def belongs(name: str, group: str) -> bool:
    """Return True for the name of a nuisance parameter, or of one of a group.

    Examples
    --------
    >>> belongs("force_x_gain", "gain"), belongs("base_2_x", "base"), belongs("discrepancy_length", "length")
    (True, True, False)
    """
    return name == group or name in _GROUPS.get(group, ()) or (group == "base" and bool(_BASE.fullmatch(name)))


def _take_at(loads: Floats, x: Floats | float, y: Floats | float) -> None:
    """Move the reference point of the moment of loads, shape (n, ..., 3), from the pivot to (x, y), in place."""
    for channel, arm in ((2, -np.asarray(x)), (1, np.asarray(y))):
        if np.any(arm):
            loads[..., 0] += arm.reshape(-1, *(1,) * (loads.ndim - 2)) * loads[..., channel]


def nuisances_of(
    measured: xr.Dataset,
    chosen: Sequence[str],
    priors: Mapping[str, Prior],
    cell: LoadCell,
    friction: float | None,
    joint: RigPrior | None = None,
    gauge: bool = False,
) -> Nuisances:
    """Return the nuisance parameters that are chosen by name or have a prior, with default priors.

    A bias with a bias_uncertainty of the load cell is not among them: the likelihood integrates it out already. Of the
    `STANDARD` ones those that are not identifiable are left out, and friction if it is given. The parameters of a
    discrepancy are not among them: they belong to the noise.

    Parameters
    ----------
    measured : xr.Dataset
        A valid record.
    chosen : sequence of str
        Names of parameters or groups.
    priors : mapping of str to frozen scipy.stats distribution
        Given priors; names of other parameters are ignored.
    cell : LoadCell
        In the record's units.
    friction : float, optional
        Coulomb's coefficient if it is known.
    joint : RigPrior, optional
        Joint prior from a calibration of the rig. Its parameters are inferred, and need not be identifiable from this
        record, except those that no measured channel shows, which are left out.
    gauge : bool
        Whether the contour is that of a gauge, whose place can be inferred.

    Raises
    ------
    ParameterError
        If a name is no nuisance parameter, or the parameter is not identifiable.
    """
    chosen = [name for name in check_names("nuisances", chosen) if not is_discrepancy(name)]
    unidentifiable = _unidentifiable(measured)
    if not gauge:
        unidentifiable |= dict.fromkeys(("gauge", *_GROUPS["gauge"]), _NO_GAUGE)
    present = [_SHORT[name] for name in present_channels(measured)]
    every_gain = [f"{name}_gain" for name in present]
    if joint is not None:
        joint = joint.without([name for name in joint.priors if not _is_shown(name, present)])
    found = set(joint.priors) if joint is not None else set()
    known = set() if friction is None else {"friction"}
    if set(every_gain) <= found:
        known.add("rigidity_scale")
    standard = [name for name in STANDARD if name not in unidentifiable.keys() | known]
    if tuple(chosen) == STANDARD:
        chosen = [_STANDARD]
    chosen = [each for name in chosen for each in (standard if name == _STANDARD else [name])]
    uncertain = dict(zip(_GROUPS["bias"], cell.bias_uncertainty, strict=True))
    names: list[str] = []
    of_priors = (name for name in priors if name in _KINDS or _BASE.fullmatch(name))
    for name in (*chosen, *of_priors, *(joint.priors if joint is not None else ())):
        if name in ("base", "base_x", "base_y") or _BASE.fullmatch(name):
            names += _bases_off(name, measured)
            continue
        if name not in _KINDS and name not in _GROUPS:
            offered = [n for n in (_STANDARD, *_GROUPS, *_KINDS, DISCREPANCY) if gauge or not n.startswith("gauge")]
            raise ParameterError(f"there is no nuisance parameter {name!r}: choose from {', '.join(offered)}, or base")
        if name in unidentifiable and name not in found:
            raise ParameterError(f"{name} cannot be inferred: {unidentifiable[name]}")
        members = [n for n in _GROUPS[name] if _is_measured(n, present)] if name in _GROUPS else [name]
        for member in members:
            if not _is_measured(member, present):
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
    friction = 0.0 if friction is None else friction
    check_number("friction", friction, f"give a coefficient from 0 to {most:.2f}", least=0.0, most=most)
    if "friction" in names and friction:
        raise ParameterError(f"friction is {friction!r} and to be inferred as well: leave one of the two")
    if "rigidity_scale" in names and set(every_gain) <= set(names) - found:
        raise ParameterError(
            f"rigidity_scale and {', '.join(every_gain)} cannot all be inferred: a stiffer rod and larger gains "
            "have the same effect; leave one of them out"
        )
    rod = rod_of(measured)
    elapsed = elapsed_in(measured)
    curve = cell.dimensionless(rod).moment_curve
    nuisances = Nuisances(tuple(names), {}, rod, friction, elapsed, curve=curve, pivots=len(bases_of(measured)))
    of_place = (*(name for name in names if _BASE.fullmatch(name)), *_GROUPS["gauge"])
    scales = {name: rod.length if name in of_place else nuisances.units[name] for name in names}
    for what in ("bias", "drift"):  # as readings
        for name, gain in zip(_GROUPS[what], cell.own_gains.tolist(), strict=True):
            scales[name] = gain * nuisances.units[name]
    defaults = {name: _default_prior(name, scales[name]) for name in names}
    if "rest_curvature" in defaults:
        deviation = rod.rest_curvature_deviation or _CURVATURE * rod.curvature_unit
        defaults["rest_curvature"] = stats.norm(rod.mean_rest_curvature, deviation)
    for name in set(CURVE) & defaults.keys():
        stated = cell.moment_curve[CURVE.index(name)]
        defaults[name] = stats.norm(stated, _BENT[name] * nuisances.units[name])
    if "taper" in defaults:
        ends = ((end - rod.taper) / _TAPER for end in nuisances.bounds("taper"))
        defaults["taper"] = stats.truncnorm(*ends, loc=rod.taper, scale=_TAPER)
    if "length" in defaults:
        defaults["length"] = stats.norm(rod.length, _LENGTH * rod.length)
    if "stem" in defaults:
        deviation = _STEM * rod.length
        defaults["stem"] = stats.truncnorm(-rod.stem / deviation, np.inf, loc=rod.stem, scale=deviation)
        _refuse_shifted_stem(measured, names, gauge)
    if joint is None or not found:
        return replace(nuisances, priors=defaults)
    return replace(nuisances, priors={**defaults, **joint.priors}, joint=joint)


def _unidentifiable(measured: xr.Dataset) -> dict[str, str]:
    """Return the parameters that a record cannot identify, with the reasons."""
    reasons: dict[str, str] = {}
    if "holding_moment" not in present_channels(measured):
        names = ("lever", *_GROUPS["lever"], "moment_curve", *CURVE)
        reasons |= dict.fromkeys(names, "it shows in the moment, which was not measured")
    turned = measured.direction.values[~np.isin(measured.sweep.values, carried_sweeps(measured))]
    if turned.size == 0:
        reasons["backlash"] = "the drive carries the base in every sweep, and turns no encoder to and fro"
    elif len(np.unique(turned)) == 1:
        reasons["backlash"] = (
            f"every sweep is {turned[0]}, and in one direction it cannot be distinguished from drive_angle_offset; "
            "infer that"
        )
    return reasons


def _refuse_shifted_stem(measured: xr.Dataset, names: Sequence[str], gauge: bool) -> None:
    """Refuse a stem where it only shifts the place of the object and the point of the moment's reference.

    A rod that keeps its direction, on a pivot that does not yield, has its beginning at a constant distance from it.
    """
    turned = not np.all(np.isin(measured.sweep.values, carried_sweeps(measured)))
    placed = gauge and not set(_GROUPS["gauge"]) <= set(names)
    angles = measured.drive_angle.values
    if turned or placed or "suspension_compliance" in names or np.ptp(angles) > _SAME_DIRECTION:
        return
    if any(name in names for name in _GROUPS["lever"]):
        raise ParameterError(
            "stem cannot be inferred beside lever: in every sweep the base is carried without turning, and a longer "
            "stem is the same as another lever and place of the object; leave one of the two, or turn the rod"
        )


def _is_measured(name: str, present: Sequence[str]) -> bool:
    """Return True if the channel of a parameter, if any, was measured."""
    channel, _, what = name.rpartition("_")
    return channel in present or name not in _GROUPS.get(what, ())


def _is_shown(name: str, present: Sequence[str]) -> bool:
    """Return True if a measured channel depends on a parameter."""
    return _is_measured(name, present) and (name not in (*_GROUPS["lever"], *CURVE) or "moment" in present)


def _bases_off(name: str, measured: xr.Dataset) -> list[str]:
    """Return the names of the pivots' shifts that a name stands for."""
    number, found = len(bases_of(measured)), _BASE.fullmatch(name)
    if number == 1 or (found and found[1] == "1"):
        raise ParameterError(
            f"{name} cannot be inferred: a shift of pivot and object together changes no reading. "
            f"Results are relative to the {'first ' if number > 1 else ''}pivot as stated; add the "
            "uncertainty of its position"
        )
    if found and not 2 <= int(found[1]) <= number:
        raise ParameterError(f"there is no {name}: the record has {number} pivots, base_2_x is of the second")
    if found:
        return [f"base_{int(found[1])}_{found[2]}"]
    return [f"base_{k}_{axis}" for k in range(2, number + 1) for axis in (name[5:] or "xy")]


def _default_prior(name: str, unit: float) -> Prior:
    """Return the default prior of a parameter, from its unit in the record's units."""
    match name:
        case "rigidity_scale":
            return stats.lognorm(s=_RIGIDITY)
        case "drive_angle_offset":
            return stats.norm(0.0, _OFFSET)
        case "backlash":
            return stats.norm(0.0, _BACKLASH)
        case "gauge_x" | "gauge_y":
            return stats.norm(0.0, _SHIFT * unit)
        case "lever_x" | "lever_y":
            return stats.norm(0.0, _LEVER * unit)
        case "friction":
            return stats.halfnorm(scale=_FRICTION)
        case "suspension_compliance":
            return stats.halfnorm(scale=_COMPLIANCE * unit)
        case _ if name in _GROUPS["gain"]:
            return stats.norm(1.0, _GAIN)
        case _ if _BASE.fullmatch(name):
            return stats.norm(0.0, _SHIFT * unit)
    return stats.norm(0.0, BIAS * unit)
