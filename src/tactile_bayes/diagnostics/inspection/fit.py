"""The fit of single samples: whether any contact gives their loads, and what would have to be otherwise."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import NamedTuple

import numpy as np
import xarray as xr

from tactile_bayes.diagnostics.inspection.remedies import Remedy, as_it_is, remedies_for
from tactile_bayes.load_cell import LoadCell
from tactile_bayes.load_cell.covariance import wandering_deviation
from tactile_bayes.reconstruction import reconstruct
from tactile_bayes.record import CHANNELS, frame_of

__all__ = ["Fit", "fit_of"]

_FEWEST = 10
"""Loaded samples below which nothing is told."""

_REMEDIED = 1 / 3
"""Share of the misfits that may remain for a remedy to be named."""

_CHANGE = 0.1
"""Share of the samples that a further change must mend: what is mirrored twice fits as well as what never was."""

_TRIED = 40
"""Loaded samples, at most, on which remedies are tried: where nothing fits, each takes long."""


class Fit(NamedTuple):
    """How many samples no contact explains."""

    share: float
    """Of the loaded samples, those whose status is "does not fit"; NaN of too few."""
    below: float
    """Of the loaded samples, those whose contact would lie below the pivot, where no object is."""
    loaded: int
    """Those that carry a load, and are not cut off."""
    remedy: str
    """What would make most of them fit above the pivot, in words; "" if nothing that was tried does."""


def fit_of(
    record: xr.Dataset,
    cell: LoadCell,
    *,
    most: float,
    friction: float = 0.0,
    progress: Callable[[int, int], object] = lambda done, count: None,
) -> Fit:
    """The shares of samples that fit no contact above the pivot, and the remedy where one is more than `most`.

    Parameters
    ----------
    record : xr.Dataset
        A valid record with all load channels.
    cell : LoadCell
        With noise of finite variance on each channel.
    most : float
        Share above which remedies are tried: other signs, another frame, forces that are exchanged, friction, a drive
        angle that is counted from elsewhere or the other way round.
    progress : callable
        Is given the number of remedies that were tried, and of how many.
    """
    contacts = _contacts(record, cell, friction)
    share, below, loaded = _shares(contacts)
    if loaded < _FEWEST:
        return Fit(np.nan, np.nan, loaded, "")
    if not max(share, below) > most:
        progress(0, 0)
        return Fit(share, below, loaded, "")
    loads = cell.corrected(record).isel(sample=contacts.status.values != "cut off")
    loads = loads.isel(sample=slice(None, None, -(-loaded // _TRIED)))
    alone = _of_any_samples(cell, record.sizes["sample"])

    def share_if(remedy: Remedy) -> float:
        return sum(_shares(_contacts(_read_by(alone, remedy.mended(loads)), alone, remedy.friction))[:2])

    remedies = remedies_for(frame_of(loads), friction)
    progress(0, len(remedies))
    part = share_if(Remedy("", as_it_is, friction))
    left = []
    for remedy in remedies:
        left.append(share_if(remedy))
        progress(len(left), len(remedies))
    best = int(np.argmin([over + _CHANGE * remedy.changes for over, remedy in zip(left, remedies, strict=True)]))
    return Fit(share, below, loaded, remedies[best].words if left[best] <= _REMEDIED * part else "")


def _contacts(record: xr.Dataset, cell: LoadCell, friction: float) -> xr.Dataset:
    return reconstruct(record, method="constrained", load_cell=cell, friction=friction)


def _shares(contacts: xr.Dataset) -> tuple[float, float, int]:
    """Of the loaded samples those that fit no contact, and those that fit one below the pivot; and their number."""
    status = contacts.status.values
    is_loaded = (status != "no contact") & (status != "cut off")
    is_unfit = status == "does not fit"
    is_below = is_loaded & ~is_unfit & (contacts.contact_y.values < contacts.base_y.values)
    loaded = int(np.count_nonzero(is_loaded))
    return np.count_nonzero(is_unfit) / max(loaded, 1), np.count_nonzero(is_below) / max(loaded, 1), loaded


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
        drive_angle_backlash=0.0,
        frame=None,
    )


def _read_by(cell: LoadCell, loads: xr.Dataset) -> xr.Dataset:
    """What a cell without noise would read of loads: so that its noise is of the right size beside them."""
    read = cell.expected(np.stack([loads[name].values for name in CHANNELS], axis=-1))
    return loads.assign(
        {name: (loads[name].dims, read[:, index], loads[name].attrs) for index, name in enumerate(CHANNELS)}
    )
