"""Parameters of a load cell's noise that are inferred beside a contour."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple

import xarray as xr
from scipy import stats

from tactile_bayes.distributions import Distribution
from tactile_bayes.errors import ParameterError
from tactile_bayes.load_cell import LoadCell
from tactile_bayes.record import CHANNELS, present_channels, rod_of
from tactile_bayes.rig.parameters import PARAMETERS

if TYPE_CHECKING:
    from tactile_bayes.rig.rig import Rig

__all__ = ["Noise", "noise_of"]


_LOUDEST = 10.0  # largest noise in the default prior of an unknown one [EI/L, EI/L²]


class Noise(NamedTuple):
    """Parameters of a load cell's noise, with their priors."""

    cell: LoadCell  # load cell in the record's units, whose noise the parameters scale
    names: tuple[str, ...]  # of the white noise, and then of the discrepancy, if it is inferred
    channels: tuple[tuple[str, ...], ...]  # channels that each parameter of the white noise scales
    priors: dict[str, Distribution]  # default priors by name, in the record's units

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
        """The cell, if its noise is known up to a factor, or altogether; otherwise None."""
        return self.cell if self.of_white in (("noise_scale",), ()) else None

    @property
    def inferred(self) -> tuple[str, ...]:
        """Entries of the cell that are inferred, and the frame, which is an attribute of its own."""
        return ("frame", *self.names)


def noise_of(measured: xr.Dataset, rig: Rig, discrepancy: Mapping[str, Distribution]) -> Noise:
    """Return the noise parameters of a record: a factor on the stated noise, or the scales if none is stated."""
    cell = rig.load_cell or LoadCell.from_record(measured)
    present = present_channels(measured)
    if cell is not None and any(cell.standard_deviations[name] > 0.0 for name in present):
        return _scaled(cell, rig, discrepancy)
    if cell is not None and cell.relative_noise:
        raise ParameterError("the load cell states only relative_noise: state its force_noise and moment_noise as well")
    cell = cell or LoadCell()
    moment, force = cell.own_gains[:2] * rod_of(measured).load_units[:2]
    sources = {"moment_noise": (CHANNELS[:1], moment), "force_noise": (CHANNELS[1:], force)}
    sources = {name: source for name, source in sources.items() if set(source[0]) & set(present)}
    if known := [name for name in sources if name in rig.known]:
        raise ParameterError(f"{known[0]} is known: state it in LoadCell({known[0]}=...), and noise_scale = 1")
    usual = {n: stats.loguniform(PARAMETERS[n].width * unit, _LOUDEST * unit) for n, (_, unit) in sources.items()}
    priors = {name: rig.distributions.get(name, default) for name, default in usual.items()}
    return Noise(
        replace(cell, force_noise=1.0, moment_noise=1.0),
        (*sources, *discrepancy),
        tuple(channels for channels, _ in sources.values()),
        {**priors, **discrepancy},
    )


def _scaled(cell: LoadCell, rig: Rig, discrepancy: Mapping[str, Distribution]) -> Noise:
    """Return the noise of a cell that is stated up to a factor, which may be known."""
    factor = rig.known.get("noise_scale")
    if factor is None:
        prior = rig.distributions.get("noise_scale", stats.lognorm(s=PARAMETERS["noise_scale"].width))
        return Noise(cell, ("noise_scale", *discrepancy), (CHANNELS,), {"noise_scale": prior, **discrepancy})
    louder = {n: factor * getattr(cell, n) for n in ("force_noise", "moment_noise", "relative_noise")}
    return Noise(replace(cell, **louder), tuple(discrepancy), (), dict(discrepancy))
