"""Parameters of a load cell's noise that are inferred beside a contour."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import NamedTuple

import xarray as xr
from scipy import stats

from tactile_bayes.errors import ParameterError
from tactile_bayes.inference.parameters.priors import Prior
from tactile_bayes.load_cell import LoadCell
from tactile_bayes.record import CHANNELS, present_channels, rod_of

__all__ = ["Noise", "noise_of"]


class Noise(NamedTuple):
    """Parameters of a load cell's noise, with their priors."""

    cell: LoadCell
    """Load cell in the record's units, whose noise the parameters scale."""
    names: tuple[str, ...]
    """Names of the parameters: of the white noise, and then of the discrepancy, if it is inferred."""
    channels: tuple[tuple[str, ...], ...]
    """Channels that each parameter of the white noise scales."""
    priors: dict[str, Prior]
    """Default priors by name, in the record's units."""

    @property
    def of_white(self) -> tuple[str, ...]:
        """Names of the parameters of the white noise."""
        return self.names[: len(self.channels)]

    @property
    def of_discrepancy(self) -> tuple[str, ...]:
        """Names of the parameters of the discrepancy; empty if there is none."""
        return self.names[len(self.channels) :]

    @property
    def stated_cell(self) -> LoadCell | None:
        """The cell, if its noise is stated up to a factor; otherwise None."""
        return self.cell if self.of_white == ("noise_scale",) else None

    @property
    def inferred(self) -> tuple[str, ...]:
        """Entries of the cell that are inferred, and the frame, which is an attribute of its own."""
        return ("frame", *self.names)


def noise_of(measured: xr.Dataset, load_cell: LoadCell | None, discrepancy: Mapping[str, Prior] | None = None) -> Noise:
    """Return the noise parameters of a record: a factor on the stated noise, or the scales if none is stated.

    Parameters
    ----------
    measured : xr.Dataset
        A valid record.
    load_cell : LoadCell, optional
        In the record's units; by default the data sheet in the record.
    discrepancy : mapping of str to frozen scipy.stats distribution, optional
        Default priors of the parameters of a discrepancy, if it is inferred.

    Raises
    ------
    ParameterError
        If the load cell states only noise in proportion to the load.
    """
    smooth = dict(discrepancy or {})
    cell = load_cell or LoadCell.from_record(measured)
    present = present_channels(measured)
    if cell is not None and any(cell.standard_deviations[name] > 0.0 for name in present):
        return Noise(cell, ("noise_scale", *smooth), (CHANNELS,), {"noise_scale": stats.lognorm(s=0.5), **smooth})
    if cell is not None and cell.relative_noise:
        raise ParameterError("the load cell states only relative_noise: state its force_noise and moment_noise as well")
    gains = (cell or LoadCell()).own_gains
    moment, force = gains[:2] * rod_of(measured).load_units[:2]
    sources = {"moment_noise": (("holding_moment",), moment), "force_noise": (CHANNELS[1:], force)}
    sources = {name: source for name, source in sources.items() if set(source[0]) & set(present)}
    return Noise(
        replace(cell or LoadCell(), force_noise=1.0, moment_noise=1.0),
        (*sources, *smooth),
        tuple(channels for channels, _ in sources.values()),
        {name: stats.loguniform(1e-6 * unit, 10.0 * unit) for name, (_, unit) in sources.items()} | smooth,
    )
