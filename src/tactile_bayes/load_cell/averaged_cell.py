"""A load cell each of whose readings is the mean of several."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from tactile_bayes.arrays import Floats
from tactile_bayes.load_cell.cell import LoadCell
from tactile_bayes.load_cell.data_sheet import DataSheet
from tactile_bayes.mechanics.rods.rod import Rod


@dataclass(frozen=True)
class AveragedCell(LoadCell):
    """A load cell with white normal noise, of which each sample is the mean of `readings` readings at one load. The
    noise of the entries is that of a single reading. Its steps count as noise, since a mean has none.
    """

    readings: Floats = field(default_factory=lambda: np.ones(1), compare=False)  # shape (samples,)

    @classmethod
    def of(cls, cell: DataSheet, readings: Floats) -> AveragedCell:
        """Return the cell whose samples are means of so many readings of a cell."""
        return replace(cls.from_entries(cell.entries()), readings=readings)

    def dimensionless(self, rod: Rod) -> AveragedCell:
        return replace(super().dimensionless(rod), readings=self.readings)

    @property
    def resolution(self) -> Floats:
        return np.zeros(3)

    @property
    def is_alike(self) -> bool:
        return False

    @property
    def limit(self) -> Floats:
        return np.full(3, np.inf)

    def deviation_of_readings(self, loads: Floats) -> Floats:
        """Return the scale of the noise of a single reading of loads, shape (..., 3), or (3,) if it is the same."""
        return np.hypot(super().deviation(loads), super().resolution / np.sqrt(12.0))

    def deviation(self, loads: Floats) -> Floats:
        return np.asarray(self.deviation_of_readings(loads) / np.sqrt(self.readings)[:, None])
