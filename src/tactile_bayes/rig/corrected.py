"""A record as a rig reads it, for Step 2: with its deviations corrected in record, rod and load cell."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
import xarray as xr

from tactile_bayes.load_cell import LoadCell
from tactile_bayes.load_cell.averaged_cell import AveragedCell
from tactile_bayes.load_cell.blocks import are_blocks, elapsed_in
from tactile_bayes.record import CHANNELS, base_of_sample, rod_of, to_si, with_rod
from tactile_bayes.rig.parameters import GROUPS
from tactile_bayes.rig.rig import rod_with

__all__ = ["Corrected", "corrected"]

_CHANNEL_NAMES = ("moment", "force_x", "force_y")


class Corrected(NamedTuple):
    """What Step 2 takes to correct a record for the deviations of its rig."""

    record: xr.Dataset
    """Record with the pivots and the rod's shape as they are, and without drift."""
    load_cell: LoadCell
    """Load cell with bias, gain (which includes the stiffness of the rod), lever and encoder as they are.

    Its noise is inferred only where it was not stated: `noise_scale` is not applied, so that misfits show it.
    """
    friction: float = 0.0
    """Coulomb's coefficient."""
    suspension_compliance: float = 0.0
    """Turn of the pivot per holding moment, relative to the stated rod [rad/(N m), or rad/(EI/L)]."""
    stated_units: str = ""
    """Units of the record that was measured. Where it is dimensionless and the rod's length was inferred, `record` is
    in lengths of the stated rod, and SI by name. Empty if they are those of `record`."""

    @property
    def units(self) -> str:
        """Units of the results."""
        return self.stated_units or str(self.record.attrs["units"])


def corrected(measured: xr.Dataset, load_cell: LoadCell, rig: Mapping[str, float]) -> Corrected:
    """Return a record and its rig with deviations from what is stated corrected; other parameters have no effect."""

    def by_channel(kind: str, default: float) -> np.ndarray[Any, np.dtype[np.float64]]:
        return np.array([rig.get(f"{channel}_{kind}", default) for channel in _CHANNEL_NAMES])

    gain: Any = np.array(load_cell.gain) * by_channel("gain", 1.0) * rig.get("rigidity_scale", 1.0)
    quadratic, cubic = (
        rig.get(name, v) for name, v in zip(GROUPS["moment_curve"], load_cell.moment_curve, strict=True)
    )
    bias = np.array(load_cell.bias) + by_channel("bias", 0.0)
    averaged = AveragedCell.of(load_cell, measured["block_readings"].values) if are_blocks(measured) else load_cell
    cell = replace(
        averaged,
        gain=gain,
        lever=(load_cell.lever[0] + rig.get("lever_x", 0.0), load_cell.lever[1] + rig.get("lever_y", 0.0)),
        moment_curve=(quadratic, cubic),
        bias=tuple(bias.tolist()),
        drive_angle_offset=load_cell.drive_angle_offset + rig.get("drive_angle_offset", 0.0),
        drive_angle_backlash=load_cell.drive_angle_backlash + rig.get("backlash", 0.0),
    )
    fraction = elapsed_in(measured)
    columns = {
        name: measured[name] - drift * fraction for name, drift in zip(CHANNELS, by_channel("drift", 0.0), strict=True)
    }
    bases, of_sample = base_of_sample(measured)
    for number in range(1, len(bases) + 1):
        at_pivot = of_sample == number - 1
        for name in ("base_x", "base_y"):
            shift = rig.get(f"base_{number}_{name[-1]}", 0.0)
            columns[name] = columns.get(name, measured[name]) + shift * at_pivot
    record = measured.assign({name: values.assign_attrs(measured[name].attrs) for name, values in columns.items()})
    rod = rod_of(measured)
    if "length" in rig:
        record = to_si(record, rod)
    return Corrected(
        with_rod(record, rod_with(rod, rig)),
        cell,
        rig.get("friction", 0.0),
        rig.get("suspension_compliance", 0.0) * rig.get("rigidity_scale", 1.0),
        str(measured.attrs["units"]),
    )
