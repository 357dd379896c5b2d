"""The attributes of a record: units, rod, data sheet and frame of the load cell, and remarks."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from tactile_bayes.errors import ParameterError
from tactile_bayes.mechanics.rods.along import Along, text_along
from tactile_bayes.mechanics.rods.rod import Rod
from tactile_bayes.record.attribute_names import misspelt
from tactile_bayes.record.parsing import number_in
from tactile_bayes.record.schema import ATTRIBUTE_UNITS, FRAMES, SIGNED, UNITS, Frame
from tactile_bayes.record.storable import not_storable
from tactile_bayes.record.table import Source

# Properties by which a rod differs from a straight, uniform one.
_SHAPE = (
    *("rest_curvature", "taper", "rigidity_profile", "rest_curvature_deviation"),
    *("stem", "rest_shape_modes", "taper_deviation"),
)
# Points at which properties along rods are compared, and the difference over the largest value that counts as zero.
_POINTS, _SAME = 101, 1e-9


def rod_attributes(rod: Rod) -> dict[str, Any]:
    """Convert a rod to attributes of a record, with `rod_shape_attributes`; `stated_rod` is the inverse."""
    attrs = {"rod_length": rod.length, "rod_flexural_rigidity": rod.flexural_rigidity, "rod_diameter": rod.diameter}
    return attrs | rod_shape_attributes(rod)


def rod_shape_attributes(rod: Rod) -> dict[str, Any]:
    """Return the properties by which a rod differs from a straight, uniform one: numbers, or polynomials as text."""
    values = {f"rod_{name}": getattr(rod, name) for name in _SHAPE}
    return {name: text_along(value) for name, value in values.items() if value not in (0.0, None, ())}


def without_rod(attrs: Mapping[str, Any]) -> dict[str, Any]:
    """Return attributes of a record without those of the rod."""
    return {name: value for name, value in attrs.items() if not (name.startswith("rod_") and name in ATTRIBUTE_UNITS)}


def stated_rod(attrs: Mapping[str, Any], source: Source) -> Rod:
    """Return the rod that the attributes of a record state; a dimensionless record may leave out values of 1."""
    units = attrs.get("units")
    if not isinstance(units, str) or units not in UNITS:
        found = "states no units" if units is None else f"has units {units!r}"
        raise source.error(f"the record {found}: its attribute 'units' has to be 'SI' or 'dimensionless'")
    if units == "dimensionless":
        attrs = {**rod_attributes(Rod()), **attrs}
    absent = [name for name in ("rod_length", "rod_flexural_rigidity") if name not in attrs]
    if absent:
        raise source.error(
            f"the record is {units}, but {' and '.join(absent)} of its rod {'are' if absent[1:] else 'is'} not stated: "
            "give rod=Rod(length=..., flexural_rigidity=...), length and flexural_rigidity under [rod] of rig.toml, or "
            "state them as attributes (in a CSV file by header lines '# rod_length: 0.1 [m]' and "
            "'# rod_flexural_rigidity: 1.2e-05 [N m²]')"
        )
    names = ("length", "flexural_rigidity", "diameter", *_SHAPE)
    stated = {name: attrs[f"rod_{name}"] for name in names if f"rod_{name}" in attrs}
    for name, value in stated.items():
        is_text = name in _SHAPE and isinstance(value, str) and value.lstrip().startswith("{")
        if not is_text and name != "rest_shape_modes":
            stated[name] = _quantity(f"rod_{name}", value, source)
    try:
        rod = Rod(**stated)
    except ParameterError as error:
        raise source.error(str(error)) from error
    if units == "dimensionless" and not rod.is_dimensionless:
        size = f"rod_length {rod.length!r} and rod_flexural_rigidity {rod.flexural_rigidity!r}"
        what = f"the record is dimensionless, but states {size}, which are the units there, 1.0"
        raise source.error(f"{what}: if the columns are SI, say so in 'units'; else remove the two")
    return rod


def stated_frame(attrs: Mapping[str, Any], source: Source) -> Frame:
    """Return the frame of the load cell that the attributes of a record state, "fixed" by default."""
    frame = attrs.get("load_cell_frame", "fixed")
    if not (isinstance(frame, str) and frame in FRAMES):
        raise source.error(
            f"attribute 'load_cell_frame' is {frame!r}: write 'fixed' for a load cell that measures along the axes of "
            "the laboratory, or 'turning' for one that turns with the drive and measures along the rod and across it"
        )
    return frame


def same_rod(one: Rod, other: Rod) -> bool:
    """Return whether two rods are equal up to the rounding of a few operations."""
    names = ("length", "flexural_rigidity", "diameter", *_SHAPE)
    return all(_alike(getattr(one, name), getattr(other, name)) for name in names)


def _alike(one: Any, other: Any) -> bool:
    if isinstance(one, tuple):
        return len(one) == len(other) and all(map(_alike, one, other))
    if isinstance(one, Along) and isinstance(other, Along):
        shares = np.linspace(0.0, 1.0, _POINTS)
        values = one(shares * one.edges[-1]), other(shares * other.edges[-1])
        return bool(np.allclose(*values, rtol=0.0, atol=_SAME * np.abs(values[0]).max()))
    if isinstance(one, float | int) and isinstance(other, float | int):
        return math.isclose(one, other, rel_tol=1e-12)
    return one is other


def completed_attributes(
    attrs: Mapping[str, Any], rod: Rod | None, frame: Frame | None, source: Source
) -> dict[str, Any]:
    """Complete attributes by units, rod and frame, as stated, as given, or by default."""
    completed = dict(attrs)
    if frame is not None:
        completed = {"load_cell_frame": frame, **completed}
        stated_in = stated_frame(completed, source)
        if stated_in != frame:
            what = f"the record states load_cell_frame {stated_in!r}, but {frame!r} was given"
            raise source.error(f"{what}: leave out the wrong one; to convert a record use in_frame(record, frame)")
    if "units" not in completed:
        of_the_rod = [name for name in attrs if name not in without_rod(attrs)]
        if of_the_rod:
            what = f"{of_the_rod[0]!r} is stated, but no units: state units 'SI' or 'dimensionless' "
            raise source.error(f"{what}(in a CSV file by a header line '# units: SI')")
        rod = rod or Rod()
        completed["units"] = "dimensionless" if rod.is_dimensionless else "SI"
    if rod is None:
        return completed
    completed = {**rod_attributes(rod), **completed}
    stated = stated_rod(completed, source)
    if not same_rod(stated, rod):
        way_out = "leave out the one that is wrong"
        if completed["units"] == "dimensionless":
            way_out = "read it without a rod, and convert it with to_si(record, rod)"
        raise source.error(f"the {completed['units']} record states {stated}, but {rod} was given: {way_out}")
    return completed


def checked_attributes(attrs: Mapping[str, Any], source: Source) -> dict[str, Any]:
    """Return the attributes as strings and numbers, units and rod first, or raise an error."""
    rod = stated_rod(attrs, source)
    stated_frame(attrs, source)
    checked: dict[str, Any] = {"units": attrs["units"], **rod_attributes(rod)}
    for name, value in attrs.items():
        if name in checked:
            continue
        plain = value.item() if isinstance(value, np.generic | np.ndarray) and value.size == 1 else value
        if name in ATTRIBUTE_UNITS:
            plain = _quantity(name, plain, source)
            signed = name.removeprefix("load_cell_").startswith(SIGNED)
            if not (math.isfinite(plain) and (signed or plain >= 0)):
                what = "a finite number" if signed else "zero or a positive number"
                raise source.attribute_error(name, f"is {plain!r}: give {what}")
        elif why := misspelt(name, plain):
            raise source.attribute_error(name, f"is {plain!r}, but {why}")
        if isinstance(plain, str) and (reason := not_storable(plain)):
            raise source.attribute_error(name, f"{reason}, which no file can store: remove it")
        is_whole = isinstance(plain, int) and not isinstance(plain, bool) and -(2**63) <= plain < 2**63
        if not (is_whole or isinstance(plain, str | float)):
            raise source.attribute_error(name, f"is {value!r}: attributes of a record are strings or numbers")
        checked[name] = plain
    return checked


def _quantity(name: str, value: Any, source: Source) -> float:
    number = None if value is None or isinstance(value, bool | np.bool_) else number_in(value)
    if number is None:
        raise source.attribute_error(name, f"is {value!r}: give a number [{ATTRIBUTE_UNITS[name]}]")
    return number
