"""The fit of single samples by contacts, and the correction of a record that would make them fit."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import NamedTuple

import numpy as np
import xarray as xr

from tactile_bayes.diagnostics.inspection.corrections import Correction, as_it_is, corrections_for
from tactile_bayes.load_cell import LoadCell
from tactile_bayes.load_cell.lone_samples import wandering_deviation
from tactile_bayes.reconstruction import contacts_of
from tactile_bayes.record import CHANNELS, loads_of
from tactile_bayes.rig.corrected import Corrected

_FEWEST = 10  # number of loaded samples below which the fit is not judged
_CORRECTED = 1 / 3  # share of the misfits that may remain for a correction to be named
# Share of the samples that a further change must correct: loads that are mirrored twice fit as well as before.
_CHANGE = 0.1
_TRIED = 40  # largest number of loaded samples on which corrections are tried: where nothing fits, each takes long


class Fit(NamedTuple):
    """Shares of samples that no contact above the pivot explains."""

    share: float  # share of the loaded samples whose status is "does not fit"; NaN if there are too few
    below: float  # share of the loaded samples whose contact would lie below the pivot, where no object is
    loaded: int  # number of samples that carry a load and are not cut off
    # Text of the correction with which most of them fit above the pivot; "" if none of those tried does.
    correction: str


def fit_of(found: Corrected, *, most: float, progress: Callable[[int, int], object] = lambda done, count: None) -> Fit:
    """Return the shares of samples that fit no contact above the pivot, and a correction where one exceeds `most`."""
    record, cell = found.record, found.load_cell
    contacts = contacts_of(found, "constrained")
    share, below, loaded = _shares(contacts)
    if loaded < _FEWEST:
        return Fit(np.nan, np.nan, loaded, "")
    if not max(share, below) > most:
        progress(0, 0)
        return Fit(share, below, loaded, "")
    loads = cell.corrected(record).isel(sample=contacts.status.values != "cut off")
    loads = loads.isel(sample=slice(None, None, -(-loaded // _TRIED)))
    alone = _of_any_samples(cell, record.sizes["sample"])

    def share_if(correction: Correction) -> float:
        read = _read_by(alone, correction.apply(loads))
        otherwise = found._replace(record=read, load_cell=alone, friction=correction.friction)
        return sum(_shares(contacts_of(otherwise, "constrained"))[:2])

    corrections = corrections_for(loads, found.friction)
    progress(0, len(corrections))
    part = share_if(Correction("", as_it_is, found.friction))
    left = []
    for correction in corrections:
        left.append(share_if(correction))
        progress(len(left), len(corrections))
    best = int(np.argmin(np.add(left, [_CHANGE * correction.changes for correction in corrections])))
    return Fit(share, below, loaded, corrections[best].text if left[best] <= _CORRECTED * part else "")


def _shares(contacts: xr.Dataset) -> tuple[float, float, int]:
    """Return the shares of loaded samples that fit no contact, and that fit one below the pivot; and their number."""
    status = contacts.status.values
    is_loaded = (status != "no contact") & (status != "cut off")
    is_unfit = status == "does not fit"
    is_below = is_loaded & ~is_unfit & (contacts.contact_y.values < contacts.base_y.values)
    loaded = int(np.count_nonzero(is_loaded))
    return np.count_nonzero(is_unfit) / max(loaded, 1), np.count_nonzero(is_below) / max(loaded, 1), loaded


def _of_any_samples(cell: LoadCell, samples: int) -> LoadCell:
    """Return the cell for a selection of samples: an unknown bias of the same size stands for drift."""
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
    """Return the loads as a noise-free cell would read them, so that the cell's noise is in proportion to them."""
    read = cell.expected(loads_of(loads))
    return loads.assign({name: loads[name].copy(data=read[:, index]) for index, name in enumerate(CHANNELS)})
