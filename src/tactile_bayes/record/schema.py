"""The schema of a record: its columns and attributes, and their meaning."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from itertools import combinations, product
from typing import Any, Literal

import numpy as np
import xarray as xr

from tactile_bayes.arrays import Floats

Frame = Literal["fixed", "turning"]
Kind = Literal["integer", "number", "text"]
Scale = Literal["length_unit", "moment_unit", "force_unit"]

# Largest drive angle of a record in radians: a turn, and what the zero of an encoder may be off by.
LARGEST_DRIVE_ANGLE = 2.0 * math.pi + 0.5


@dataclass(frozen=True)
class Column:
    """Meaning of a column of a record."""

    name: str
    kind: Kind
    unit: str  # in an SI record, "1" for pure numbers and text
    scale: Scale | None  # property of `Rod` by which a dimensionless value is multiplied in SI, if it is
    long_name: str
    turning_name: str | None = None  # description for a load cell that turns with the drive, if it differs

    def unit_in(self, units: str) -> str:
        """Return the unit of the column in a record of the given units, "SI" or "dimensionless"."""
        return "1" if units == "dimensionless" and self.scale else self.unit

    def long_name_in(self, frame: Frame) -> str:
        """Return the description of the column for a fixed or a turning load cell."""
        return self.turning_name if frame == "turning" and self.turning_name else self.long_name


# Channels of the load cell, in the order of every array with a channel axis.
CHANNELS = ("holding_moment", "force_x", "force_y")
# Columns of a record; all others are further columns.
MEASURED = ("sweep", "direction", "base_x", "base_y", "drive_angle", *CHANNELS)
# Columns that a table must have to be a record (a channel may be empty); base_x and base_y are 0 by default.
REQUIRED = ("sweep", "direction", "drive_angle", *CHANNELS)
# All columns with a known meaning; the prefix `truth_` means the same quantity without error.
COLUMNS: Mapping[str, Column] = {
    column.name: column
    for column in (
        Column("sweep", "integer", "1", None, "number of the sweep"),
        Column("direction", "text", "1", None, "sense of the drive"),
        Column("base_x", "number", "m", "length_unit", "horizontal position of the pivot"),
        Column("base_y", "number", "m", "length_unit", "vertical position of the pivot"),
        Column("drive_angle", "number", "rad", None, "slope of the rod at the pivot"),
        Column("holding_moment", "number", "N m", "moment_unit", "moment that the drive must hold"),
        Column("force_x", "number", "N", "force_unit", "horizontal support reaction", "axial support reaction"),
        Column("force_y", "number", "N", "force_unit", "vertical support reaction", "transversal support reaction"),
        Column("slope_angle", "number", "rad", None, "slope angle of the contour at the contact"),
        Column("tip_angle", "number", "rad", None, "slope of the rod at the contact"),
        Column("contact_x", "number", "m", "length_unit", "horizontal position of the contact"),
        Column("contact_y", "number", "m", "length_unit", "vertical position of the contact"),
        Column("contact_arclength", "number", "m", "length_unit", "arc length from pivot to contact"),
        Column("contact_phase", "text", "1", None, "phase of the contact"),
    )
}
DIRECTIONS = ("forward", "backward")  # senses of the drive: increasing and decreasing drive angles
# Values of the attribute `load_cell_frame` of a record: force_x and force_y along the axes x and y of the laboratory,
# or along the rod at the pivot, (cos φ0, sin φ0), and across it, (−sin φ0, cos φ0).
FRAMES: tuple[Frame, Frame] = ("fixed", "turning")
RECORD_FORMAT = 1  # that of the files of a record
UNITS = ("SI", "dimensionless")  # values of the attribute `units` of a record
_GAIN_UNITS = {("N", "N m"): "1/m", ("N m", "N"): "m"}

# Quantities in a load cell's data sheet, with their units in SI; `LoadCell` describes them. As attributes of a record
# their names begin with "load_cell_".
LOAD_CELL_UNITS: Mapping[str, str] = {
    "force_noise": "N",
    "moment_noise": "N m",
    "degrees_of_freedom": "1",
    "relative_noise": "1",
    **{f"correlation_{one}_{other}": "1" for one, other in combinations(CHANNELS, 2)},
    **{f"bias_{name}": COLUMNS[name].unit for name in CHANNELS},
    **{f"bias_uncertainty_{name}": COLUMNS[name].unit for name in CHANNELS},
    "random_walk_moment": "N m",
    "random_walk_force": "N",
    "ornstein_uhlenbeck_moment": "N m",
    "ornstein_uhlenbeck_force": "N",
    "ornstein_uhlenbeck_time": "1",
    **{
        f"gain_{to}_{of}": _GAIN_UNITS.get((COLUMNS[to].unit, COLUMNS[of].unit), "1")
        for to, of in product(CHANNELS, CHANNELS)
    },
    "lever_x": "m",
    "lever_y": "m",
    "moment_curve_quadratic": "1/N/m",
    "moment_curve_cubic": "1/N²/m²",
    **{
        entry: unit
        for name, unit in (("lag", "1"), ("lag_seconds", "s"), ("play", "1"))
        for entry in (name, *(f"{name}_{channel}" for channel in CHANNELS))
    },
    "force_range": "N",
    "moment_range": "N m",
    "force_resolution": "N",
    "moment_resolution": "N m",
    "drive_angle_offset": "rad",
    "drive_angle_backlash": "rad",
    "drive_angle_noise": "rad",
    "drive_angle_resolution": "rad",
}
# Beginnings of the names of those that may be negative.
SIGNED = ("bias_h", "bias_f", "gain_", "correlation_", "lever_", "moment_curve_", "drive_angle_o", "drive_angle_b")
# Attributes that are quantities, with their units in an SI record.
ATTRIBUTE_UNITS: Mapping[str, str] = {
    "rod_length": "m",
    "rod_flexural_rigidity": "N m²",
    "rod_diameter": "m",
    "rod_rest_curvature": "1/m",
    "rod_rest_curvature_deviation": "1/m",
    "rod_taper": "1",
    "rod_rigidity_profile": "1",
    "rod_stem": "m",
    "rod_rest_shape_modes": "1/m",
    "rod_taper_deviation": "1",
    **{f"load_cell_{name}": unit for name, unit in LOAD_CELL_UNITS.items()},
}


def column_of(name: str) -> Column | None:
    """Return the meaning of a column, with or without the prefix `truth_`; None if it is unknown."""
    known = COLUMNS.get(name.removeprefix("truth_"))
    if known is None or known.name == name:
        return known
    turning_name = known.turning_name and f"true {known.turning_name}"
    return replace(known, name=name, long_name=f"true {known.long_name}", turning_name=turning_name)


def column_attributes(name: str, units: str) -> dict[str, str]:
    """Return the attributes of a column of `COLUMNS` among data of the given units, "SI" or "dimensionless"."""
    return {"units": COLUMNS[name].unit_in(units), "long_name": COLUMNS[name].long_name}


def present_channels(record: xr.Dataset) -> tuple[str, ...]:
    """Return the channels of a record that are not NaN throughout."""
    return tuple(name for name in CHANNELS if not np.isnan(record[name].values).all())


def loads_of(record: xr.Dataset | Mapping[str, Any], prefix: str = "") -> Floats:
    """Return the columns of a record's channels, of names that begin with `prefix`, as one array, shape (..., 3)."""
    return np.stack([np.asarray(record[f"{prefix}{name}"]) for name in CHANNELS], axis=-1)
