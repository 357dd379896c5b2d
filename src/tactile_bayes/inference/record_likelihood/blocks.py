"""Blocks of a record: samples that are means of neighbouring readings."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import xarray as xr

from tactile_bayes.arrays import Flags, Floats, Index
from tactile_bayes.load_cell.averaged_cell import AveragedCell
from tactile_bayes.load_cell.data_sheet import DataSheet
from tactile_bayes.mechanics.rods.rod import Rod
from tactile_bayes.record import CHANNELS, rows_of_sweeps

__all__ = ["AFTER_CONTACT", "BEFORE_ONSET", "IN_CONTACT", "NODES", "Blocks", "elapsed_in", "zero_load_of_blocks"]

BEFORE_ONSET, IN_CONTACT, AFTER_CONTACT = 1, 2, 3
"""Parts of a sweep, as far as they are certain; 0 is none of them."""

NODES = np.array([-1.0, 1.0])
"""Places within a block at which its load is evaluated, in standard deviations of its drive angles. The mean of two is
exact for loads that are cubic in evenly spread drive angles."""

_LOG_2PI = float(np.log(2.0 * np.pi))


class Blocks(NamedTuple):
    """Samples of a record as means of neighbouring readings, each array by sample."""

    readings: Floats
    """Number of readings."""
    spread: Floats
    """Standard deviation of their drive angles [rad]."""
    freedom: Floats
    """Degrees of freedom of `scatter`."""
    scatter: Floats
    """Sum of the squares of the readings about their straight line over the drive angle, shape (samples, 3)."""

    @classmethod
    def of(cls, record: xr.Dataset, rod: Rod) -> Blocks | None:
        """Return the blocks that the further columns of a record state, dimensionless; None for single readings."""
        if "blocks" not in record.attrs or "block_readings" not in record:
            return None
        readings, spread, freedom = (
            record[f"block_{name}"].values.astype(float) for name in ("readings", "spread", "freedom")
        )
        scatter = np.stack([record[f"block_scatter_{name}"].values for name in CHANNELS], axis=-1)
        return cls(readings, spread, freedom, scatter / np.square(rod.load_units))

    def cell(self, cell: DataSheet) -> AveragedCell:
        """Return the cell whose samples are these means."""
        made = AveragedCell.from_entries({**cell.entries()})
        object.__setattr__(made, "readings", self.readings)
        return made

    def log_density_within(self, deviation: Floats, present: Flags, *, pointwise: bool) -> Floats:
        """Return the log-density of the readings of blocks, given their means and slopes.

        Parameters
        ----------
        deviation : ndarray, shape (..., 1 or samples, 3)
            Standard deviation of a reading.
        present : ndarray of bool, shape (3,)
            True for channels that were measured.
        pointwise : bool
            Whether the result is by sample, shape (..., samples), or the sum, shape (...).
        """
        deviation = deviation[..., present]
        scatter, freedom = self.scatter[:, present], self.freedom[:, None]
        if not pointwise and deviation.shape[-2] == 1:
            scatter, freedom = scatter.sum(axis=0, keepdims=True), freedom.sum(axis=0, keepdims=True)
        terms = -0.5 * scatter / deviation**2 - freedom * (np.log(deviation) + 0.5 * _LOG_2PI)
        return np.asarray(terms.sum(axis=-1 if pointwise else (-2, -1)))


def elapsed_in(record: xr.Dataset) -> Floats:
    """Return the position of each sample in its record, linear from the first reading (−½) to the last (½)."""
    if "blocks" in record.attrs and "block_elapsed" in record:
        return np.asarray(record["block_elapsed"].values, dtype=float)
    return np.linspace(-0.5, 0.5, record.sizes["sample"])


def zero_load_of_blocks(record: xr.Dataset) -> xr.Dataset:
    """Return what `zero_load` finds in the readings of a record in blocks: unloaded samples, events, bias and noise."""
    part, unloaded = record["block_part"].values, record["block_unloaded"].values.astype(bool)
    events = [_between(rows, part[rows]) for rows in rows_of_sweeps(record["sweep"].values)]
    readings, freedom = record["block_readings"].values[unloaded], record["block_freedom"].values[unloaded]
    bias, noise = np.full((2, len(CHANNELS)), np.nan)
    for i, name in enumerate(CHANNELS):
        means, scatter = record[name].values[unloaded], record[f"block_scatter_{name}"].values[unloaded]
        if means.size > 1:
            bias[i] = np.average(means, weights=readings)
            squares = scatter.sum() + float(readings @ np.square(means - bias[i]))
            noise[i] = np.sqrt(squares / (freedom.sum() + means.size - 1))
    return xr.Dataset(
        {
            "unloaded": ("sample", unloaded),
            "onset": (("sweep", "side"), np.array([each[:2] for each in events])),
            "snap_off": (("sweep", "side"), np.array([each[2:] for each in events])),
            "bias": ("channel", bias),
            "noise": ("channel", noise),
        }
    )


def _between(rows: Index, part: Index) -> tuple[int, int, int, int]:
    """Return the rows of a sweep between which contact begins, and ends; −1 where there is no such event."""

    def last(which: int) -> int:
        found = np.flatnonzero(part == which)
        return int(rows[found[-1]]) if found.size else -1

    def first(which: int) -> int:
        found = np.flatnonzero(part == which)
        return int(rows[found[0]]) if found.size else -1

    before, begins, ends, after = last(BEFORE_ONSET), first(IN_CONTACT), last(IN_CONTACT), first(AFTER_CONTACT)
    onset = (before, begins) if min(before, begins) >= 0 else (-1, -1)
    snap_off = (ends, after) if min(ends, after) >= 0 else (-1, -1)
    return (*onset, *snap_off)
