"""What is inferred about the noise of a load cell beside a contour."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import xarray as xr
from scipy import stats

from tactile_bayes.errors import ParameterError
from tactile_bayes.inference.priors import Prior
from tactile_bayes.load_cell import LoadCell
from tactile_bayes.record import CHANNELS, present_channels, rod_of

__all__ = ["Noise", "noise_of"]


class Noise(NamedTuple):
    """What is inferred about the load cell's noise."""

    cell: LoadCell
    """In the record's units; the scale's factor applies to it."""
    names: tuple[str, ...]
    channels: tuple[tuple[str, ...], ...]
    """The channels that each parameter scales."""
    priors: dict[str, Prior]

    @property
    def stated_cell(self) -> LoadCell | None:
        """The cell, if its noise is stated but for a factor; None where nothing is."""
        return self.cell if self.names == ("noise_scale",) else None

    @property
    def inferred(self) -> tuple[str, ...]:
        """Entries of the cell that are not known beforehand, or stated elsewhere."""
        return ("frame", *self.names)


def noise_of(measured: xr.Dataset, load_cell: LoadCell | None) -> Noise:
    """What is to be inferred of the noise in a record: a factor on what is stated, or else its scales.

    Raises
    ------
    ParameterError
        If the load cell states noise in proportion to the load alone.
    """
    cell = load_cell or LoadCell.from_record(measured)
    present = present_channels(measured)
    if cell is not None and any(cell.standard_deviations[name] > 0.0 for name in present):
        return Noise(cell, ("noise_scale",), (CHANNELS,), {"noise_scale": stats.lognorm(s=0.5)})
    if cell is not None and cell.relative_noise:
        raise ParameterError("the load cell has relative_noise alone: state its force_noise and moment_noise as well")
    rod = rod_of(measured)
    sources = {"moment_noise": (("holding_moment",), rod.moment_unit), "force_noise": (CHANNELS[1:], rod.force_unit)}
    sources = {name: source for name, source in sources.items() if set(source[0]) & set(present)}
    return Noise(
        replace(cell or LoadCell(), force_noise=1.0, moment_noise=1.0),
        tuple(sources),
        tuple(channels for channels, _ in sources.values()),
        {name: stats.loguniform(1e-6 * unit, 10.0 * unit) for name, (_, unit) in sources.items()},
    )
