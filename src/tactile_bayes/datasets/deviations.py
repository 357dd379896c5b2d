"""Deviations of the rigs of records from what their data sheets state: read, drawn and applied."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import product
from typing import Any

import numpy as np

from tactile_bayes.arrays import Floats
from tactile_bayes.datasets.specification import Specification
from tactile_bayes.datasets.variations import Variation, quantity_of
from tactile_bayes.errors import SpecificationError
from tactile_bayes.record import CHANNELS
from tactile_bayes.rig.parameters import GROUPS, MEMORY, NEUTRAL, parameter_named
from tactile_bayes.rig.rig import Rig, unknown_of
from tactile_bayes.rig.rig_file import unit_of_unknown
from tactile_bayes.rig.rig_prior import RigPrior
from tactile_bayes.rig.stated import Stated, within_bounds
from tactile_bayes.rig.unknown import DEFAULT, NOTHING, expanded, of_pivots
from tactile_bayes.sweep import ManyUnits

_DISCRETE = ("constant", "choice", "each")

# Parameters that add to entries of the load cell's data sheet.
_OF_CELL = {
    **dict(zip(GROUPS["bias"], (f"bias_{channel}" for channel in CHANNELS), strict=True)),
    **{name: name for name in GROUPS["lever"]},
    "drive_angle_offset": "drive_angle_offset",
    "backlash": "drive_angle_backlash",
}
# Parameters that replace numbers of the data sheets, by the keys of these.
_IN_PLACE = {
    **{f"rod.{name}": name for name in ("length", "rest_curvature", "taper", "stem")},
    **{f"load_cell.{name}": name for name in GROUPS["moment_curve"]},
}


def deviations_of_table(
    said: Mapping[str, Any] | str | None,
    is_si: bool,
    *,
    pivots: int,
    turns_back: bool,
    load_cell: Mapping[str, Variation],
    calibration: RigPrior | None,
) -> dict[str, Variation]:
    """Return the deviations that the table `unknown` of a specification states, without those that are as stated."""
    found = () if calibration is None else tuple(calibration.priors)
    if said is None:
        said = {name: value for name, value in expanded(NOTHING).items() if name not in found}
    table: Mapping[str, Any] = NOTHING if isinstance(said, str) else said
    given = {
        name: Variation(DEFAULT)
        if value == DEFAULT
        else quantity_of(value, f"unknown.{name}", unit_of_unknown(name), is_si)
        for name, value in table.items()
    }
    if isinstance(said, str) and said != "nothing":
        raise SpecificationError(f'unknown is {said!r}: give a table [unknown], or "nothing"')
    rig = Rig(unknown=_checked(given), calibration=calibration)
    own = of_pivots(expanded(given), pivots)  # type: ignore[arg-type]
    channels = zip(GROUPS["bias"], CHANNELS, strict=True)
    uncertain = [name for name, channel in channels if f"bias_uncertainty_{channel}" in load_cell]
    every: dict[str, Any] = {name: own.get(name, Variation(DEFAULT)) for name in unknown_of(rig, pivots, uncertain)}
    if not turns_back and not rig.is_named("backlash"):
        del every["backlash"]
    if gauge := [name for name in GROUPS["gauge"] if name in every]:
        raise SpecificationError(f"unknown.{gauge[0]} is of the record of a gauge: leave it out of a data set")
    neutral = {name: getattr(parameter_named(name), "neutral", None) for name in every}
    kept = {name: of for name, of in every.items() if of.kind != "constant" or of.numbers[0] != neutral[name]}
    return {**kept, **dict.fromkeys(found, Variation("calibrated"))}


def _checked(given: Mapping[str, Variation]) -> dict[str, Any]:
    """Return what is said of parameters as a rig takes it, after a check of the numbers of lists."""
    for name, variation in given.items():
        if variation.kind in ("choice", "each"):
            for number in variation.numbers:
                Rig(unknown={name: number})
    return {
        name: v.numbers[0] if v.kind == "constant" else DEFAULT if v.kind in (*_DISCRETE, DEFAULT) else v.frozen
        for name, v in given.items()
    }


def is_around_the_stated(key: str, variation: Variation) -> bool:
    """Return True for a deviation that `drawn_deviations` draws."""
    return key.startswith("unknown.") and variation.kind not in _DISCRETE


def drawn_deviations(
    spec: Specification, values: Mapping[str, Floats], shares: Mapping[str, Floats]
) -> dict[str, Floats]:
    """Return deviations drawn around what data sheets state, shape (n,), by the keys of their distributions."""
    drawn = {name: v for name, v in spec.unknown.items() if v.kind not in _DISCRETE}
    if not drawn:
        return {}
    stated, found = _stated(values, len(next(iter(shares.values())))), dict[str, Floats]()
    for name, variation in drawn.items():
        if variation.kind != "calibrated":
            distribution = stated.default(name) if variation.kind == DEFAULT else variation.frozen
            found[name] = within_bounds(name, distribution, shares[f"unknown.{name}"])
    if spec.calibration is not None:
        joint = np.stack([shares[f"unknown.{name}"] for name in spec.calibration.priors], axis=1)
        found |= spec.calibration.at_shares(joint)
    return {f"unknown.{name}": numbers for name, numbers in found.items()}


def _stated(values: Mapping[str, Floats], count: int) -> Stated:
    """Return what the data sheets of many rigs state."""

    def column(key: str, default: float = 0.0) -> Floats:
        return values.get(key, np.full(count, default))

    length, rigidity = column("rod.length", 1.0), column("rod.flexural_rigidity", 1.0)
    of_rod = {name: column(f"rod.{name}") for name in ("rest_curvature", "taper", "stem")}
    sensor = {name: column(f"load_cell.{name}") for name in GROUPS["moment_curve"]}
    gains = [np.abs(column(f"load_cell.gain_{name}_{name}", 1.0)) for name in CHANNELS]
    return Stated(
        ManyUnits(length, rigidity / length, rigidity / length**2),
        {**NEUTRAL, **of_rod, **sensor, "length": length},
        [np.where(gain > 0.0, gain, 1.0) for gain in gains],
        column("rod.rest_curvature_deviation"),
    )


def as_built(spec: Specification, values: Mapping[str, Floats]) -> dict[str, Floats]:
    """Return numbers of rods, load cells and pivots, shape (n,), with the deviations from what data sheets state."""
    built = dict(values)
    off = {name: values[f"unknown.{name}"] for name in spec.unknown}
    if not off:
        return built
    one = np.ones(len(next(iter(off.values()))))
    if "rigidity_scale" in off:
        built["rod.flexural_rigidity"] = off["rigidity_scale"] * built.get("rod.flexural_rigidity", one)
    if "length" in off and "rod.rest_curvature" in built:  # it keeps its turn from base to tip
        built["rod.rest_curvature"] = built["rod.rest_curvature"] * built.get("rod.length", one) / off["length"]
    built |= {key: off[name] for key, name in _IN_PLACE.items() if name in off}
    for name, entry in _OF_CELL.items():
        if name in off:
            built[f"load_cell.{entry}"] = built.get(f"load_cell.{entry}", 0.0 * one) + off[name]
    for what, names in MEMORY.items():
        keys = [f"load_cell.{what}_{channel}" for channel in CHANNELS]
        built |= dict.fromkeys(keys, off[what]) if what in off else {}
        built |= {key: off[name] for key, name in zip(keys, names, strict=True) if name in off}
    gains = dict(zip(CHANNELS, GROUPS["gain"], strict=True))
    for to, of in product(CHANNELS, CHANNELS):
        key = f"load_cell.gain_{to}_{of}"
        if gains[of] in off and (to == of or key in built):
            built[key] = off[gains[of]] * built.get(key, one)
    built |= {key: built[key] + off[name] for key, name in pivot_keys(spec).items() if name in off}
    return built


def pivot_keys(spec: Specification) -> dict[str, str]:
    """Return the parameters that shift pivots, or places where the base begins, by the keys of their distributions."""
    places = [f"scan.bases[{k}]" for k in range(len(spec.bases))]
    places += [f"scan.translations[{k}].base" for k in range(len(spec.translations))]
    return {
        f"{place}[{axis}]": f"base_{number}_{'xy'[axis]}"
        for number, place in enumerate(places, start=1)
        for axis in (0, 1)
    }


def drifts_of(values: Mapping[str, Floats], count: int) -> Floats | None:
    """Return the changes of the zeros of channels from the first sample to the last, shape (n, 3); None without."""
    drifts = [values.get(f"unknown.{name}") for name in GROUPS["drift"]]
    if all(drift is None for drift in drifts):
        return None
    return np.stack([np.zeros(count) if drift is None else drift for drift in drifts], axis=1)
