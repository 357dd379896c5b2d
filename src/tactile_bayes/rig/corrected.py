"""The deviations of a rig in its records: as load cell and encoder read them, and corrected for Step 2."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
import xarray as xr

from tactile_bayes.arrays import Floats
from tactile_bayes.load_cell import LoadCell
from tactile_bayes.load_cell.averaged_cell import AveragedCell
from tactile_bayes.load_cell.blocks import are_blocks, elapsed_in
from tactile_bayes.load_cell.measurement import measured
from tactile_bayes.load_cell.memory import delays_of
from tactile_bayes.mechanics.rods.rod import Rod
from tactile_bayes.numerics.random_numbers import Rng, generator
from tactile_bayes.record import CHANNELS, base_of_sample, frame_of, present_channels, rod_of, to_si, with_rod
from tactile_bayes.record.attributes import without_rod
from tactile_bayes.record.schema import column_of
from tactile_bayes.record.times import times_of
from tactile_bayes.record.validation import completed_record, table_of_columns
from tactile_bayes.rig.parameters import GROUPS
from tactile_bayes.rig.stated import cell_with, rod_with
from tactile_bayes.rig.unknown import pivot_shifts

_NOISES = ("force_noise", "moment_noise", "relative_noise")


class Corrected(NamedTuple):
    """What Step 2 takes to correct a record for the deviations of its rig."""

    record: xr.Dataset  # record with the pivots and the rod's shape as they are, and without drift
    # Load cell with bias, gain (which includes the stiffness of the rod), lever and encoder as they are. Its noise is
    # inferred only where it was not stated: `noise_scale` is not applied, so that misfits show it.
    load_cell: LoadCell
    friction: float = 0.0  # Coulomb's coefficient
    # Turn of the pivot per holding moment, relative to the stated rod [rad/(N m), or rad/(EI/L)].
    suspension_compliance: float = 0.0
    contact_compliance: float = 0.0  # way of the object per normal force, likewise [m/N, or L/(EI/L²)]
    # Units of the record that was measured. Where it is dimensionless and the rod's length was inferred, `record` is in
    # lengths of the stated rod, and SI by name. Empty if they are those of `record`.
    stated_units: str = ""

    @property
    def units(self) -> str:
        """Units of the results."""
        return self.stated_units or str(self.record.attrs["units"])


def corrected(given: xr.Dataset, load_cell: LoadCell, rig: Mapping[str, float]) -> Corrected:
    """Return a record and its rig with deviations from what is stated corrected; other parameters have no effect."""
    averaged = AveragedCell.of(load_cell, given["block_readings"].values) if are_blocks(given) else load_cell
    cell = cell_with(averaged, rig)
    stiffer = rig.get("rigidity_scale", 1.0)
    if stiffer != 1.0:
        quadratic, cubic = cell.moment_curve  # of the moment as it is, stiffer than the one that Step 2 takes
        curve = (stiffer * quadratic, stiffer**2 * cubic)
        cell = replace(cell, gain=(stiffer * np.array(cell.gain)).tolist(), moment_curve=curve)
    fraction = elapsed_in(given)
    drifts = zip(CHANNELS, (rig.get(name, 0.0) for name in GROUPS["drift"]), strict=True)
    columns = {name: given[name] - drift * fraction for name, drift in drifts if drift}
    if np.any(cell.lag) or np.any(cell.lag_seconds):  # play stays, since what it hides is lost
        times = times_of(given) if np.any(cell.lag_seconds) else np.arange(float(given.sizes["sample"]))
        delays = zip(CHANNELS, delays_of(cell.lag, cell.lag_seconds, times).T, strict=True)
        columns |= {name: _ahead(columns.get(name, given[name]), times, delay) for name, delay in delays}
    columns |= {name: given[name] + shift for name, shift in _shifts(given, rig)}
    record = given.assign({name: values.assign_attrs(given[name].attrs) for name, values in columns.items()})
    rod = rod_of(given)
    if "length" in rig:
        record = to_si(record, rod)
    return Corrected(
        with_rod(record, rod_with(rod, rig)),
        replace(cell, lag=0.0, lag_seconds=0.0, play=0.0),
        rig.get("friction", 0.0),
        rig.get("suspension_compliance", 0.0) * stiffer,
        rig.get("contact_compliance", 0.0) * stiffer,
        str(given.attrs["units"]),
    )


def measured_by(
    rod: Rod | None, stated: LoadCell, known: Mapping[str, float], record: xr.Dataset, rng: Rng
) -> xr.Dataset:
    """Return an ideal record as a rig with known deviations reads it, with the pivots stated; see `Rig.measure`."""
    louder = known.get("noise_scale", 1.0)
    built = replace(cell_with(stated, known), **{name: louder * getattr(stated, name) for name in _NOISES})
    drift = np.array([known.get(name, 0.0) for name in GROUPS["drift"]])
    made = measured(built, record, generator(rng), elapsed_in(record)[:, None] * drift)
    columns: dict[str, Any] = {str(name): made[name].values for name in made.data_vars}
    columns |= {name: made[name] for name in columns if column_of(name) is None}  # with their units
    columns |= {name: columns[name] - shift for name, shift in _shifts(made, known)}
    attrs = {n: v for n, v in without_rod(made.attrs).items() if not str(n).startswith(("load_cell_", "units"))}
    attrs |= {f"load_cell_{name}": value for name, value in stated.entries().items() if name != "frame"}
    missing = [name for name in CHANNELS if name not in present_channels(made)]
    return completed_record(table_of_columns(columns, attrs), rod, missing, frame_of(made))


def _ahead(readings: xr.DataArray, times: Floats, delay: Floats) -> xr.DataArray:
    """Return readings as they are later by a delay: to first order those without a lag."""
    return readings.copy(data=np.interp(times + delay, times, readings.values))


def _shifts(record: xr.Dataset, rig: Mapping[str, float]) -> Iterator[tuple[str, Floats]]:
    """Yield the coordinates of the base that are shifted against the stated ones, with the shift of each sample."""
    pivots, of_sample = base_of_sample(record)
    for name, shifts in zip(("base_x", "base_y"), pivot_shifts(rig, len(pivots)).T, strict=True):
        if shifts.any():
            yield name, shifts[of_sample]
