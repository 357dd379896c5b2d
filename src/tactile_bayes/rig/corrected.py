"""A record as a rig reads it, for Step 2: with its deviations corrected in record, rod and load cell."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import NamedTuple

import numpy as np
import xarray as xr

from tactile_bayes.load_cell import LoadCell
from tactile_bayes.load_cell.averaged_cell import AveragedCell
from tactile_bayes.load_cell.blocks import are_blocks, elapsed_in
from tactile_bayes.record import CHANNELS, base_of_sample, rod_of, to_si, with_rod
from tactile_bayes.rig.parameters import GROUPS
from tactile_bayes.rig.rig import rod_with
from tactile_bayes.rig.stated import cell_with
from tactile_bayes.rig.unknown import pivot_shifts


class Corrected(NamedTuple):
    """What Step 2 takes to correct a record for the deviations of its rig."""

    record: xr.Dataset  # record with the pivots and the rod's shape as they are, and without drift
    # Load cell with bias, gain (which includes the stiffness of the rod), lever and encoder as they are. Its noise is
    # inferred only where it was not stated: `noise_scale` is not applied, so that misfits show it.
    load_cell: LoadCell
    friction: float = 0.0  # Coulomb's coefficient
    # Turn of the pivot per holding moment, relative to the stated rod [rad/(N m), or rad/(EI/L)].
    suspension_compliance: float = 0.0
    # Units of the record that was measured. Where it is dimensionless and the rod's length was inferred, `record` is in
    # lengths of the stated rod, and SI by name. Empty if they are those of `record`.
    stated_units: str = ""

    @property
    def units(self) -> str:
        """Units of the results."""
        return self.stated_units or str(self.record.attrs["units"])


def corrected(measured: xr.Dataset, load_cell: LoadCell, rig: Mapping[str, float]) -> Corrected:
    """Return a record and its rig with deviations from what is stated corrected; other parameters have no effect."""
    averaged = AveragedCell.of(load_cell, measured["block_readings"].values) if are_blocks(measured) else load_cell
    cell = cell_with(averaged, rig)
    stiffer = rig.get("rigidity_scale", 1.0)
    if stiffer != 1.0:
        quadratic, cubic = cell.moment_curve  # of the moment as it is, stiffer than the one that Step 2 takes
        curve = (stiffer * quadratic, stiffer**2 * cubic)
        cell = replace(cell, gain=(stiffer * np.array(cell.gain)).tolist(), moment_curve=curve)
    fraction = elapsed_in(measured)
    drifts = zip(CHANNELS, (rig.get(name, 0.0) for name in GROUPS["drift"]), strict=True)
    columns = {name: measured[name] - drift * fraction for name, drift in drifts if drift}
    bases, of_sample = base_of_sample(measured)
    for name, shifts in zip(("base_x", "base_y"), pivot_shifts(rig, len(bases)).T, strict=True):
        if shifts.any():
            columns[name] = measured[name] + shifts[of_sample]
    record = measured.assign({name: values.assign_attrs(measured[name].attrs) for name, values in columns.items()})
    rod = rod_of(measured)
    if "length" in rig:
        record = to_si(record, rod)
    return Corrected(
        with_rod(record, rod_with(rod, rig)),
        cell,
        rig.get("friction", 0.0),
        rig.get("suspension_compliance", 0.0) * stiffer,
        str(measured.attrs["units"]),
    )
