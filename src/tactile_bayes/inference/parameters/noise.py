"""Parameters of a load cell's noise, and of a discrepancy of the model, that are inferred beside a contour."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple

import xarray as xr

from tactile_bayes.distributions import Distribution
from tactile_bayes.errors import ParameterError
from tactile_bayes.load_cell import LoadCell
from tactile_bayes.record import CHANNELS, present_channels, rod_of
from tactile_bayes.rig.parameters import GROUPS
from tactile_bayes.rig.stated import Stated

if TYPE_CHECKING:
    from tactile_bayes.rig.rig import Rig


class Noise(NamedTuple):
    """Parameters of a load cell's noise, with their priors."""

    cell: LoadCell  # load cell in the record's units, whose noise the parameters scale
    names: tuple[str, ...]  # of the white noise, and then of the discrepancy, if it is inferred
    channels: tuple[tuple[str, ...], ...]  # channels that each parameter of the white noise scales
    priors: dict[str, Distribution]  # priors by name, in the record's units

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


def noise_of(measured: xr.Dataset, rig: Rig) -> Noise:
    """Return the noise parameters of a record: a factor on the stated noise, or the scales if none is stated."""
    cell = rig.load_cell or LoadCell.from_record(measured)
    present = present_channels(measured)
    if cell is not None and any(cell.standard_deviations[name] > 0.0 for name in present):
        scales: dict[str, tuple[str, ...]] = {"noise_scale": CHANNELS}
        if (factor := rig.known.get("noise_scale")) is not None:
            scales = {}
            louder = {n: factor * getattr(cell, n) for n in ("force_noise", "moment_noise", "relative_noise")}
            cell = replace(cell, **louder)
    else:
        if cell is not None and cell.relative_noise:
            raise ParameterError(
                "the load cell states only relative_noise: state its force_noise and moment_noise as well"
            )
        cell = replace(cell or LoadCell(), force_noise=1.0, moment_noise=1.0)
        scales = {"moment_noise": CHANNELS[:1], "force_noise": CHANNELS[1:]}
        scales = {name: channels for name, channels in scales.items() if set(channels) & set(present)}
        if known := [name for name in scales if name in rig.known]:
            raise ParameterError(f"{known[0]} is known: state it in LoadCell({known[0]}=...), and noise_scale = 1")
    names = (*scales, *_of_discrepancy(rig))
    stated = Stated.of(rod_of(measured), cell)
    priors = {name: rig.distributions.get(name, stated.default(name)) for name in names}
    return Noise(cell, names, tuple(scales.values()), priors)


def _of_discrepancy(rig: Rig) -> tuple[str, ...]:
    """Return the parameters of the discrepancy, if it is unknown; none if nothing or zero is said of it."""
    said = {name: value for name, value in rig.said.items() if name in GROUPS["discrepancy"]}
    if known := [name for name, value in said.items() if isinstance(value, float) and value]:
        raise ParameterError(
            f"{known[0]} is a number: a discrepancy has no known size, so give a distribution, or 0 for none"
        )
    return GROUPS["discrepancy"] if any(not isinstance(value, float) for value in said.values()) else ()
