"""The template of a record: drive angles without loads."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import xarray as xr

from tactile_bayes.arrays import Floats
from tactile_bayes.load_cell import LoadCell
from tactile_bayes.mechanics.rod import Rod
from tactile_bayes.record import CHANNELS, make_record

__all__ = ["record_template"]


def record_template(
    bases: Sequence[tuple[float, float]],
    directions: Sequence[str],
    drive_angles: Floats,
    rod: Rod | None,
    load_cell: LoadCell,
) -> xr.Dataset:
    """Return a record of sweeps about every pivot in every direction, with loads of zero.

    Its drive angles include the encoder's offset and backlash.

    Parameters
    ----------
    bases : sequence of (float, float)
        Pivots, in the unit of length of the record.
    directions : sequence of {"forward", "backward"}
        Directions of the sweeps about each pivot.
    drive_angles : ndarray, shape (n,)
        Drive angles of the rod, in any order [rad].
    rod : Rod, optional
        By default the dimensionless rod.
    load_cell : LoadCell
        Provides the frame, and the encoder's offset and backlash.
    """
    angles = np.sort(drive_angles)
    parts: dict[str, list[Any]] = {name: [] for name in ("sweep", "direction", "base_x", "base_y", "drive_angle")}
    sweep = 0
    for x, y in bases:
        for direction in directions:
            parts["sweep"].append(np.full(angles.size, sweep))
            parts["direction"].append(np.full(angles.size, direction))
            parts["base_x"].append(np.full(angles.size, x))
            parts["base_y"].append(np.full(angles.size, y))
            parts["drive_angle"].append(angles if direction == "forward" else angles[::-1])
            sweep += 1
    columns: dict[str, Any] = {name: np.concatenate(values) for name, values in parts.items()}
    columns["drive_angle"] = columns["drive_angle"] + load_cell.misread(columns["direction"])
    loads = {name: np.zeros(columns["sweep"].size) for name in CHANNELS}
    return make_record(columns | loads, rod=rod, load_cell_frame=load_cell.frame or "fixed")
