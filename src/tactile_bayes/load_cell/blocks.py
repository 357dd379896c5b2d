"""Blocks of a record: samples that are means of neighbouring readings."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import xarray as xr

from tactile_bayes.arrays import Flags, Floats, Index
from tactile_bayes.load_cell.contact_bounds import ContactBounds
from tactile_bayes.mechanics.rods.rod import Rod
from tactile_bayes.record import loads_of

BEFORE_ONSET, IN_CONTACT, AFTER_CONTACT = 1, 2, 3  # parts of a sweep, as far as they are certain; 0 is none of them
_LOG_2PI = float(np.log(2.0 * np.pi))


class Blocks(NamedTuple):
    """Samples that stand for blocks of neighbouring readings on a straight line over the drive angle: two points of it,
    with mean, slope and uncertainties of the readings. The likelihood of all readings is that of the two points, times
    that of the scatter about the line, for loads that are straight in the block, and nearly so for curved ones.
    """

    # Number of readings of which it is the mean, or half of those of whose line it is one of two points.
    readings: Floats
    freedom: Floats  # degrees of freedom of `scatter`
    # Sum of the squares of the readings about their straight line over the drive angle, shape (samples, 3).
    scatter: Floats

    @classmethod
    def of(cls, record: xr.Dataset, rod: Rod) -> Blocks | None:
        """Return the blocks that the further columns of a record state, dimensionless; None for single readings."""
        if not are_blocks(record):
            return None
        readings, freedom = (record[f"block_{name}"].values.astype(float) for name in ("readings", "freedom"))
        scatter = loads_of(record, "block_scatter_")
        return cls(readings, freedom, scatter / np.square(rod.load_units))

    def log_density_within(self, deviation: Floats, present: Flags, *, pointwise: bool) -> Floats:
        """Return the log-density of readings given means and slopes; deviation (..., 1 or samples, 3), present (3,)."""
        deviation = deviation[..., present]
        scatter, freedom = self.scatter[:, present], self.freedom[:, None]
        if not pointwise and deviation.shape[-2] == 1:
            scatter, freedom = scatter.sum(axis=0, keepdims=True), freedom.sum(axis=0, keepdims=True)
        terms = -0.5 * scatter / deviation**2 - freedom * (np.log(deviation) + 0.5 * _LOG_2PI)
        return np.asarray(terms.sum(axis=-1 if pointwise else (-2, -1)))


def are_blocks(record: xr.Dataset) -> bool:
    """Return True if the samples of a record are means of blocks."""
    return "blocks" in record.attrs and "block_readings" in record


def elapsed_in(record: xr.Dataset) -> Floats:
    """Return the position of each sample in its record, linear from the first reading (−½) to the last (½)."""
    if "blocks" in record.attrs and "block_elapsed" in record:
        return np.asarray(record["block_elapsed"].values, dtype=float)
    return elapsed(record.sizes["sample"])


def elapsed(samples: int) -> Floats:
    """Return the position of each sample in a record, linear from the first (−½) to the last (½)."""
    return np.linspace(-0.5, 0.5, samples)


def bounds_in_blocks(part: Index, unloaded: Flags) -> ContactBounds:
    """Return the bounds of contact in a sweep of blocks, from its parts, which were found in the readings."""
    begins, ends = np.flatnonzero(part == IN_CONTACT)[[0, -1]] if np.any(part == IN_CONTACT) else (-1, -1)
    before = np.flatnonzero(part[: max(begins, 0)] == BEFORE_ONSET)
    after = ends + 1 + np.flatnonzero(part[ends + 1 :] == AFTER_CONTACT)
    leading = int(np.argmin(unloaded)) if not unloaded.all() else unloaded.size
    trailing = int(np.argmin(unloaded[::-1])) if not unloaded.all() else 0
    return ContactBounds(
        np.nan,
        bool(begins >= 0),
        (int(before[-1]), int(begins)) if before.size else (-1, -1),
        (int(ends), int(after[0])) if begins >= 0 and after.size else (-1, -1),
        leading,
        trailing,
    )
