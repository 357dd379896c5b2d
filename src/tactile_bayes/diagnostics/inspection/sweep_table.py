"""The sweeps of a record in a table: where they go, and where contact begins and ends."""

from __future__ import annotations

import numpy as np
import xarray as xr

from tactile_bayes.arrays import Index

__all__ = ["sweep_table"]


def sweep_table(record: xr.Dataset, found: xr.Dataset, sweeps: list[Index]) -> xr.Dataset:
    """See `Inspection`; `found` is what `zero_load` returns."""
    angle, unloaded = record["drive_angle"].values, found["unloaded"].values
    first = np.array([rows[0] for rows in sweeps])
    steps = [float(np.median(np.abs(np.diff(angle[rows])))) if rows.size > 1 else np.nan for rows in sweeps]
    length = {"units": record["base_x"].attrs["units"]}
    of_angle = {"units": "rad"}
    table = xr.Dataset(
        {
            "direction": ("sweep", record["direction"].values[first]),
            "samples": ("sweep", [rows.size for rows in sweeps]),
            "base_x": ("sweep", record["base_x"].values[first], length),
            "base_y": ("sweep", record["base_y"].values[first], length),
            "drive_angle_from": ("sweep", angle[first], of_angle),
            "drive_angle_to": ("sweep", angle[[rows[-1] for rows in sweeps]], of_angle),
            "drive_step": ("sweep", steps, of_angle),
            "unloaded": ("sweep", [int(np.count_nonzero(unloaded[rows])) for rows in sweeps]),
        },
        coords={"sweep": found["sweep"].values, "side": found["side"].values},
    )
    names = ("contact", "p_value", "onset_drive_angle", "snap_off_drive_angle")
    return table.assign({name: found[name].variable for name in names})
