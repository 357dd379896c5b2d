"""What is said of the unknowns of a rig: numbers are known, distributions are unknown."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping
from types import MappingProxyType
from typing import Any, Literal

import numpy as np

from tactile_bayes.arrays import Floats
from tactile_bayes.checks import as_number, check_kind, check_mapping, shown
from tactile_bayes.distributions import Distribution, check_distribution, frozen
from tactile_bayes.errors import ParameterError
from tactile_bayes.mechanics.rods.rod import Rod
from tactile_bayes.record.spelling import nearest
from tactile_bayes.rig.parameters import BASE, GROUPS, MAY_VANISH, PARAMETERS, STANDARD, members, parameter_named

# What is said of a parameter: a number if it is known, a distribution, or "default" for its default distribution.
Unknown = float | Distribution | Literal["default"]
DEFAULT: Literal["default"] = "default"

# Unknowns of a rig that is as stated: everything that is unknown of a real rig is known, and is as stated.
NOTHING: Mapping[str, float] = MappingProxyType(
    {name: float(PARAMETERS[next(members(name))].neutral or 0.0) for name in STANDARD}
)
_BASES = ("base", "base_x", "base_y")  # names of the shifts of all pivots but the first


def expanded(unknown: Mapping[str, Unknown]) -> dict[str, Unknown]:
    """Return what is said of each parameter, groups first, so that one of a group may be an exception."""
    of_groups = {member: value for name, value in unknown.items() if name in GROUPS for member in GROUPS[name]}
    return {**of_groups, **{name: value for name, value in unknown.items() if name not in GROUPS}}


def of_pivots(said: Mapping[str, Unknown], pivots: int) -> dict[str, Unknown]:
    """Return what is said of each parameter, with the shifts of so many pivots in place of their group."""
    every: dict[str, Unknown] = {}
    for name, value in said.items():
        if name in _BASES:
            shifts = (f"base_{k}_{axis}" for k in range(2, pivots + 1) for axis in (name[5:] or "xy"))
            every = dict.fromkeys(shifts, value) | every
        else:
            every[name] = value
    return {n: v for n, v in every.items() if (shift := BASE.fullmatch(n)) is None or int(shift[1]) <= pivots}


def of_modes(said: Mapping[str, Unknown], rod: Rod) -> dict[str, Unknown]:
    """Return what is said of each parameter, without amplitudes of what was not measured of a rod."""
    absent = GROUPS["rest_shape"][len(rod.rest_shape_modes) :]
    for name in absent:
        if said.get(name, DEFAULT) not in (DEFAULT, 0.0):
            raise ParameterError(
                f"{name} is said to be other than 0, and the rod has {len(rod.rest_shape_modes)} modes of its rest "
                "curvature: only a rod that was traced has them (Rod.from_shape, or shape under [rod])"
            )
    if "taper" in said or not rod.taper_deviation:
        if said.get("taper_error", DEFAULT) not in (DEFAULT, 0.0):
            raise ParameterError(
                "taper_error is said to be other than 0, and the taper itself is said, or was not measured: give "
                "diameters along the rod (Rod.from_shape, or a column of its shape), and say nothing of taper"
            )
        absent = (*absent, "taper_error")
    return {name: value for name, value in said.items() if name not in absent}


def pivot_shifts(known: Mapping[str, float], pivots: int) -> Floats:
    """Return the shifts of pivots against the stated ones, by numbers that are known, shape (pivots, 2)."""
    said = of_pivots(known, pivots)
    return np.array([[said.get(f"base_{k}_{axis}", 0.0) for axis in "xy"] for k in range(1, pivots + 1)], dtype=float)


def checked_unknown(unknown: Any) -> dict[str, Unknown]:
    """Return what is said of parameters and groups, "nothing" written out, or refuse it."""
    if isinstance(unknown, str) and unknown == "nothing":
        return dict(NOTHING)
    correction = 'give numbers and distributions by name, like {"lever": 0.0}, or "nothing"'
    check_kind("unknown", unknown, Mapping, correction)
    check_mapping("unknown", unknown, correction)
    return {name: _said_of(name, frozen(value)) for name, value in unknown.items()}


def _said_of(name: str, value: Any) -> Unknown:
    _refuse_unknown_name(name)
    if isinstance(value, str):
        if value == DEFAULT:
            return DEFAULT
        raise ParameterError(f'unknown[{name!r}] is {shown(value)}: give a number, a distribution, or "default"')
    number = as_number(value)
    if number is None:
        check_distribution(name, value)
        found: Distribution = value
        return found
    for member in members(name):
        parameter = PARAMETERS.get(member)
        low, high = (parameter.low, parameter.high) if parameter is not None else (-np.inf, np.inf)
        if not low and member not in (*MAY_VANISH, *GROUPS["discrepancy"]):
            low = math.ulp(0.0)
        if not (math.isfinite(number) and low <= number <= high):
            raise ParameterError(f"unknown[{name!r}] is {number!r}: give a finite number from {low:.4g} to {high:.4g}")
    return number


def _refuse_unknown_name(name: Any) -> None:
    names: Collection[str] = (*PARAMETERS, *GROUPS, *_BASES)
    if isinstance(name, str) and (name in names or parameter_named(name) is not None):
        if (shift := BASE.fullmatch(name)) and int(shift[1]) < 2:
            raise ParameterError(
                f"{name} is never unknown: a shift of pivot and object together changes no reading. Results are "
                "relative to the first pivot as stated; add the uncertainty of its position"
            )
        return
    near = nearest(str(name), names)
    hint = f"did you mean {near!r}?" if near else f"there are {', '.join((*GROUPS, *PARAMETERS))} and base"
    raise ParameterError(f"a rig has no parameter {name!r}: {hint}")
