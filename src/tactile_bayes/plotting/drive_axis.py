"""The coordinate over which readings are drawn: what moves along the drive."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
import xarray as xr

from tactile_bayes.arrays import Floats, Index
from tactile_bayes.plotting.labels import DRIVE_ANGLE, set_unit
from tactile_bayes.record import carried_sweeps, travels_of

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.axis import Axis

# Widths [degrees] between which an axis of angles has ticks at multiples of 15° or 30°.
_SHORTEST, _LONGEST = 60.0, 400.0


@dataclass(frozen=True)
class DriveAxis:
    """Coordinate of every sample along the drive.

    It is the drive angle where the drive turns in all sweeps, the travel of the base where it carries it in all, and
    the number of the sample if there are sweeps of both kinds.
    """

    kind: Literal["angle", "travel", "sample"]
    values: Floats  # shape (samples,): degrees, lengths in the record's unit, or numbers of samples
    travels: Floats  # shape (samples,), from `travels_of`
    starts: Floats  # numbers between sweeps, if they are drawn side by side
    attrs: dict[Any, Any]

    def place_of(self, events: xr.Dataset, name: str, rows: Index) -> float:
        """Return where an event of the sweep with these samples is drawn, by its drive angle or travel; NaN without."""
        if self.kind == "angle":
            return float(np.degrees(events[f"{name}_drive_angle"].values.mean()))
        travel = float(events[f"{name}_travel"].values.mean())
        if self.kind == "travel" or not np.isfinite(travel):
            return travel
        order = rows[np.argsort(self.travels[rows], kind="stable")]
        return float(np.interp(travel, self.travels[order], self.values[order]))

    def draw_below(self, ax: Axes) -> None:
        """Draw the line of zero readings, and lines between sweeps that are side by side."""
        ax.axhline(0.0, color="0.85", linewidth=0.8, zorder=0)
        for start in self.starts:
            ax.axvline(start, color="0.6", linewidth=0.8, zorder=0)

    def label(self, axis: Axis, *, with_ticks: bool = True) -> None:
        """Label an axis with what it shows and its unit, with ticks at round angles."""
        if self.kind == "travel":
            set_unit(axis, "travel of the base ", "base_x", self.attrs, self.values)
            return
        axis.set_label_text(DRIVE_ANGLE if self.kind == "angle" else "sample")
        low, high = axis.get_view_interval()
        if with_ticks and self.kind == "angle" and _SHORTEST < high - low < _LONGEST:
            from matplotlib.ticker import MultipleLocator

            axis.set_major_locator(MultipleLocator(15.0 if high - low < 150.0 else 30.0))


def drive_axis(record: xr.Dataset) -> DriveAxis:
    """Return the coordinate over which a record is drawn."""
    carried, sweep = carried_sweeps(record), record["sweep"].values
    attrs = dict(record["base_x"].attrs)
    travels, none = travels_of(record), np.empty(0)
    if not carried:
        return DriveAxis("angle", np.degrees(travels), travels, none, attrs)
    if set(np.unique(sweep).tolist()) == set(carried):
        return DriveAxis("travel", travels, travels, none, attrs)
    starts: Floats = np.flatnonzero(np.diff(sweep) != 0).astype(float) + 0.5
    return DriveAxis("sample", np.arange(sweep.size, dtype=float), travels, starts, attrs)
