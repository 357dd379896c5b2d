"""The fit of single samples by contacts, and the correction of a record that would make them fit."""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Literal, NamedTuple

import numpy as np
import xarray as xr

from tactile_bayes.load_cell import LoadCell
from tactile_bayes.load_cell.lone_samples import wandering_deviation
from tactile_bayes.reconstruction import contacts_of
from tactile_bayes.record import CHANNELS, frame_of, loads_of
from tactile_bayes.record.origin import column_entry
from tactile_bayes.record.rig_entry import rig_entries, rig_entry
from tactile_bayes.record.schema import LARGEST_DRIVE_ANGLE
from tactile_bayes.rig.corrected import Corrected

Transform = Callable[[xr.Dataset], xr.Dataset]

# Beginning of the texts of corrections that change the drive angle, and with it perhaps the directions.
OTHER_ANGLE = "the drive angle were counted otherwise"
_FRICTIONS = (0.1, 0.2, 0.3, 0.5)
_FRAME_TEXTS = {
    "turning": f"the load cell turned with the drive ({rig_entry('frame', 'turning', 'load_cell')})",
    "fixed": f"the load cell did not turn with the drive ({rig_entry('frame', 'fixed', 'load_cell')})",
}
_FEWEST = 10  # number of loaded samples below which the fit is not judged
_CORRECTED = 1 / 3  # share of the misfits that may remain for a correction to be named
# Share of the samples that a further change must correct: loads that are mirrored twice fit as well as before.
_CHANGE = 0.1
_TRIED = 40  # largest number of loaded samples on which corrections are tried: where nothing fits, each takes long


class Correction(NamedTuple):
    """A change of a record with which its samples may fit."""

    text: str  # text that follows "nearly all would if"
    apply: Transform  # function from the record to the corrected record
    friction: float  # coefficient of friction for Step 2
    changes: int = 1  # number of things that are changed


def corrections_for(record: xr.Dataset, friction: float) -> list[Correction]:
    """Return all corrections to try, simple ones first, for a record with this assumed friction."""
    other: Literal["fixed", "turning"] = "turning" if frame_of(record) == "fixed" else "fixed"
    simple: list[tuple[str, Transform]] = [
        (f"force_x had the other sign{_entries(record, 'force_x')}", _with_sign("force_x")),
        (f"force_y had the other sign{_entries(record, 'force_y')}", _with_sign("force_y")),
        (f"both forces had the other sign{_entries(record, 'force_x', 'force_y')}", _with_sign("force_x", "force_y")),
        (f"holding_moment had the other sign{_entries(record, 'holding_moment')}", _with_sign("holding_moment")),
        ("force_x and force_y were exchanged", _exchanged),
        (_FRAME_TEXTS[other], lambda record: record.assign_attrs(load_cell_frame=other)),
    ]
    rubs = "there were friction of about {:g} (have infer find it, which is the default)"
    return [
        *(Correction(text, apply, friction) for text, apply in simple),
        *(Correction(rubs.format(coefficient), as_it_is, coefficient) for coefficient in _FRICTIONS),
        *(Correction(text, apply, friction, changes) for text, apply, changes in _angles(record)),
    ]


def _entries(record: xr.Dataset, *names: str, sense: int = -1, added: float = 0.0) -> str:
    """Return the entries that read columns so, in brackets; "" if the record does not know them."""
    entries = {name: column_entry(record[name], sense=sense, added=added, digits=12) for name in names}
    return f" ({rig_entries(entries)})" if all(entries.values()) else ""


def as_it_is(record: xr.Dataset) -> xr.Dataset:
    return record


def _with_sign(*names: str) -> Transform:
    return lambda record: record.assign({name: record[name].copy(data=-record[name].values) for name in names})


def _exchanged(record: xr.Dataset) -> xr.Dataset:
    x, y = record["force_x"], record["force_y"]
    return record.assign(force_x=x.copy(data=y.values), force_y=y.copy(data=x.values))


def _in_turn(*transforms: Transform) -> Transform:
    return lambda record: functools.reduce(lambda given, transform: transform(given), transforms, record)


def _counted(sense: int, turns: float) -> Transform:
    """Return a transform that counts the drive angle in this sense, with its zero moved by so many quarter turns."""

    def counted_anew(record: xr.Dataset) -> xr.Dataset:
        drive, way = record["drive_angle"], record["direction"]
        others = np.where(way.values == "forward", "backward", "forward")
        angles = 0.5 * np.pi * turns + sense * drive.values
        angles -= 2.0 * np.pi * np.round(0.25 * (angles.min() + angles.max()) / np.pi)
        counted = record.assign(
            drive_angle=drive.copy(data=angles), direction=way.copy(data=way.values if sense > 0 else others)
        )
        return counted.isel(sample=np.abs(angles) < LARGEST_DRIVE_ANGLE)  # those beyond carry no load

    return counted_anew


def _angles(record: xr.Dataset) -> Iterator[tuple[str, Transform, int]]:
    other_moment = _with_sign("holding_moment")
    moment = f"holding_moment had the other sign{_entries(record, 'holding_moment')}"
    for sense, turns in ((-1, 1), (-1, 0), (-1, 2), (1, 1), (1, -1), (1, 2)):
        option = _entries(record, "drive_angle", sense=sense, added=0.5 * np.pi * turns)
        text, counted = f"{OTHER_ANGLE}{option}", _counted(sense, turns)
        yield text, counted, 1
        if sense < 0:
            yield f"{text}, and {moment}", _in_turn(counted, other_moment), 2
        if (sense, turns) == (-1, 1):  # mirrored in the diagonal
            text += f", {moment}, and force_x and force_y were exchanged"
            yield text, _in_turn(counted, other_moment, _exchanged), 3


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
        changed = correction.apply(loads)
        # As a noise-free cell would read them, so that the cell's noise is in proportion to the loads.
        columns = zip(CHANNELS, alone.expected(loads_of(changed)).T, strict=True)
        read = changed.assign({name: changed[name].copy(data=values) for name, values in columns})
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
