"""The readings of a rig: an ideal record as its load cell and its encoder read it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
import xarray as xr

from tactile_bayes.load_cell import LoadCell
from tactile_bayes.load_cell.blocks import elapsed_in
from tactile_bayes.load_cell.measurement import measured
from tactile_bayes.mechanics.rods.rod import Rod
from tactile_bayes.numerics.random_numbers import Rng, generator
from tactile_bayes.record import CHANNELS, base_of_sample, frame_of, present_channels
from tactile_bayes.record.attributes import without_rod
from tactile_bayes.record.construction import completed_record, table_of_columns
from tactile_bayes.rig.parameters import GROUPS
from tactile_bayes.rig.stated import cell_with
from tactile_bayes.rig.unknown import pivot_shifts

_NOISES = ("force_noise", "moment_noise", "relative_noise")


def measured_by(
    rod: Rod | None, stated: LoadCell, known: Mapping[str, float], record: xr.Dataset, rng: Rng
) -> xr.Dataset:
    """Return an ideal record as a rig with known deviations reads it, with the pivots stated; see `Rig.measure`."""
    louder = known.get("noise_scale", 1.0)
    built = replace(cell_with(stated, known), **{name: louder * getattr(stated, name) for name in _NOISES})
    drift = np.array([known.get(name, 0.0) for name in GROUPS["drift"]])
    made = measured(built, record, generator(rng), elapsed_in(record)[:, None] * drift)
    columns: dict[str, Any] = {str(name): made[name].values for name in made.data_vars}
    pivots, of_sample = base_of_sample(made)
    for name, shifts in zip(("base_x", "base_y"), pivot_shifts(known, len(pivots)).T, strict=True):
        if shifts.any():
            columns[name] = columns[name] - shifts[of_sample]
    attrs = {n: v for n, v in without_rod(made.attrs).items() if not str(n).startswith(("load_cell_", "units"))}
    attrs |= {f"load_cell_{name}": value for name, value in stated.entries().items() if name != "frame"}
    missing = [name for name in CHANNELS if name not in present_channels(made)]
    return completed_record(table_of_columns(columns, attrs), rod, missing, frame_of(made))
