"""The fit of single samples: whether any contact gives their loads, and what would have to be otherwise."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import NamedTuple

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from tactile_bayes.load_cell import LoadCell
from tactile_bayes.load_cell.covariance import wandering_deviation
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
    """Those that carry a load, and are not cut off."""
    remedy: str
    """What would make most of them fit, in words; "" if nothing that was tried does."""


def fit_of(
    record: xr.Dataset,
    cell: LoadCell,
    *,
    most: float,
    friction: float = 0.0,
    progress: Callable[[int, int], object] = lambda done, count: None,
) -> Fit:
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
    progress : callable
        Is given the number of remedies that were tried, and of how many.
    """
    status = _statuses(record, cell, friction)
    share, loaded = _unfit(status)
    if loaded < _FEWEST:
        return Fit(np.nan, loaded, "")
    if not share > most:
        progress(0, 0)
        return Fit(share, loaded, "")
    loads = cell.corrected(record).isel(sample=status != "cut off")
    loads = loads.isel(sample=slice(None, None, max(1, loaded // _TRIED)))
    alone = _of_any_samples(cell, record.sizes["sample"])

    def share_if(remedy: Callable[[xr.Dataset], xr.Dataset], friction: float) -> float:
        return _unfit(_statuses(_read_by(alone, remedy(loads)), alone, friction))[0]

    frame = "turning" if frame_of(loads) == "fixed" else "fixed"
    others = [*_REMEDIES, (_FRAME_WORDS[frame], lambda given: given.assign_attrs(load_cell_frame=frame))]
    remedies = [(words, remedy, friction) for words, remedy in others]
    for coefficient in _FRICTIONS:
        words = f"there were friction of about {coefficient:g} (have infer find it: --nuisance friction)"
        remedies.append((words, _as_it_is, coefficient))
    progress(0, len(remedies))
    part = share_if(_as_it_is, friction)
    tried = []
    for words, remedy, coefficient in remedies:
        tried.append((share_if(remedy, coefficient), words))
        progress(len(tried), len(remedies))
    best, words = min(tried)
    return Fit(share, loaded, words if best <= _REMEDIED * part else "")


def _statuses(record: xr.Dataset, cell: LoadCell, friction: float) -> NDArray[np.str_]:
    contacts = reconstruct(record, method="constrained", load_cell=cell, friction=friction)
    return np.asarray(contacts.status.values)


def _unfit(status: NDArray[np.str_]) -> tuple[float, int]:
    loaded = int(np.count_nonzero((status != "no contact") & (status != "cut off")))
    return float(np.count_nonzero(status == "does not fit")) / max(loaded, 1), loaded


def _of_any_samples(cell: LoadCell, samples: int) -> LoadCell:
    """The cell for some samples of a record: drift, which counts samples, is as unknown as a bias of its size."""
    one, two, three = np.sqrt(np.mean(wandering_deviation(cell, samples) ** 2, axis=0)).tolist()
    return replace(
        cell,
        bias_uncertainty=(one, two, three),
        drift=None,
        force_range=np.inf,
        moment_range=np.inf,
        drive_angle_offset=0.0,
        frame=None,
    )


def _read_by(cell: LoadCell, loads: xr.Dataset) -> xr.Dataset:
    """What a cell without noise would read of loads: so that its noise is of the right size beside them."""
    read = cell.expected(np.stack([loads[name].values for name in CHANNELS], axis=-1))
    return loads.assign(
        {name: (loads[name].dims, read[:, index], loads[name].attrs) for index, name in enumerate(CHANNELS)}
    )


def _as_it_is(record: xr.Dataset) -> xr.Dataset:
    return record


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
