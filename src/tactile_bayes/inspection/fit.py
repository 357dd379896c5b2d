"""The fit of single samples: whether any contact gives their loads, and what would have to be otherwise."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import NamedTuple

import numpy as np
import xarray as xr

from tactile_bayes.load_cell import LoadCell
from tactile_bayes.reconstruction import reconstruct
from tactile_bayes.record import CHANNELS, frame_of

__all__ = ["Fit", "fit_of"]

_FEWEST = 10
"""Loaded samples below which nothing is told."""

_REMEDIED = 0.3
"""Share of the misfits that may remain for a remedy to be named."""

_TRIED = 60
"""Loaded samples, about, on which remedies are tried: where nothing fits, each takes long."""

_FRICTIONS = (0.1, 0.2, 0.3, 0.5)

_FRAME_WORDS = {
    "turning": "the load cell turned with the drive (--load-cell-frame turning)",
    "fixed": "the load cell did not turn with the drive (--load-cell-frame fixed)",
}


class Fit(NamedTuple):
    """How many samples no contact explains."""

    share: float
    """Of the loaded samples, those whose status is "does not fit"; NaN of too few."""
    loaded: int
    remedy: str
    """What would make most of them fit, in words; "" if nothing that was tried does."""


def fit_of(record: xr.Dataset, cell: LoadCell, *, most: float, friction: float = 0.0) -> Fit:
    """The share of samples that do not fit, and the remedy where there are more than `most`.

    Parameters
    ----------
    record : xr.Dataset
        A valid record with all load channels.
    cell : LoadCell
        With noise of finite variance on each channel.
    most : float
        Share above which remedies are tried: other signs, another frame, forces that are exchanged,
        friction.
    """
    plain = cell.corrected(record)
    noise = replace(
        LoadCell(),
        force_noise=cell.force_noise,
        moment_noise=cell.moment_noise,
        degrees_of_freedom=cell.degrees_of_freedom,
        relative_noise=cell.relative_noise,
        force_resolution=cell.force_resolution,
        moment_resolution=cell.moment_resolution,
        bias_uncertainty=cell.bias_uncertainty,
        drive_angle_noise=cell.drive_angle_noise,
    )
    share, loaded = _unfit(plain, noise, friction)
    if loaded < _FEWEST:
        return Fit(np.nan, loaded, "")
    if not share > most:
        return Fit(share, loaded, "")
    plain = plain.isel(sample=slice(None, None, max(1, loaded // _TRIED)))
    part = _unfit(plain, noise, friction)[0]
    frame = "turning" if frame_of(plain) == "fixed" else "fixed"
    others = [*_REMEDIES, (_FRAME_WORDS[frame], lambda given: given.assign_attrs(load_cell_frame=frame))]
    tried = [(_unfit(remedy(plain), noise, friction)[0], words) for words, remedy in others]
    for coefficient in _FRICTIONS:
        words = f"there were friction of about {coefficient:g} (have infer find it: --nuisance friction)"
        tried.append((_unfit(plain, noise, coefficient)[0], words))
    best, words = min(tried)
    return Fit(share, loaded, words if best <= _REMEDIED * part else "")


def _unfit(record: xr.Dataset, cell: LoadCell, friction: float) -> tuple[float, int]:
    status = reconstruct(record, method="constrained", load_cell=cell, friction=friction).status.values
    loaded = int(np.count_nonzero(status != "no contact"))
    return float(np.count_nonzero(status == "does not fit")) / max(loaded, 1), loaded


def _with_sign(*names: str) -> Callable[[xr.Dataset], xr.Dataset]:
    def turned_round(record: xr.Dataset) -> xr.Dataset:
        return record.assign({name: (record[name].dims, -record[name].values, record[name].attrs) for name in names})

    return turned_round


def _exchanged(record: xr.Dataset) -> xr.Dataset:
    x, y = record[CHANNELS[1]], record[CHANNELS[2]]
    return record.assign({x.name: (x.dims, y.values, x.attrs), y.name: (y.dims, x.values, y.attrs)})


_REMEDIES: tuple[tuple[str, Callable[[xr.Dataset], xr.Dataset]], ...] = (
    ("force_x had the other sign", _with_sign("force_x")),
    ("force_y had the other sign", _with_sign("force_y")),
    ("both forces had the other sign", _with_sign("force_x", "force_y")),
    ("holding_moment had the other sign", _with_sign("holding_moment")),
    ("force_x and force_y were exchanged", _exchanged),
)
