"""Remedies for samples that fit no contact: what the loads, or the drive angle, may have been instead."""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterator
from typing import Literal, NamedTuple

import numpy as np
import xarray as xr

from tactile_bayes.record import CHANNELS

__all__ = ["OTHER_ANGLE", "Remedy", "as_it_is", "remedies_for"]

Mend = Callable[[xr.Dataset], xr.Dataset]

OTHER_ANGLE = "the drive angle were counted otherwise"
"""How the words of remedies begin that change the drive angle, and with it perhaps the directions."""

_FRICTIONS = (0.1, 0.2, 0.3, 0.5)

_FRAME_WORDS = {
    "turning": "the load cell turned with the drive (--load-cell-frame turning)",
    "fixed": "the load cell did not turn with the drive (--load-cell-frame fixed)",
}


class Remedy(NamedTuple):
    """What might have to be otherwise."""

    words: str
    """After "nearly all would if"."""
    mended: Mend
    """From the record to what it would be."""
    friction: float
    """For Step 2."""
    changes: int = 1
    """How many things would have to be otherwise."""


def remedies_for(frame: Literal["fixed", "turning"], friction: float) -> list[Remedy]:
    """All that are tried, simple ones first, of a record in a frame that was to have this friction."""
    other: Literal["fixed", "turning"] = "turning" if frame == "fixed" else "fixed"
    simple: list[tuple[str, Mend]] = [
        ("force_x had the other sign", _with_sign("force_x")),
        ("force_y had the other sign", _with_sign("force_y")),
        ("both forces had the other sign", _with_sign("force_x", "force_y")),
        ("holding_moment had the other sign", _with_sign("holding_moment")),
        ("force_x and force_y were exchanged", _exchanged),
        (_FRAME_WORDS[other], lambda record: record.assign_attrs(load_cell_frame=other)),
    ]
    found = [Remedy(words, mended, friction) for words, mended in simple]
    for coefficient in _FRICTIONS:
        words = f"there were friction of about {coefficient:g} (have infer find it: --nuisance friction)"
        found.append(Remedy(words, as_it_is, coefficient))
    return [*found, *(Remedy(words, mended, friction, changes) for words, mended, changes in _angles())]


def as_it_is(record: xr.Dataset) -> xr.Dataset:
    return record


def _with_sign(*names: str) -> Mend:
    def turned_round(record: xr.Dataset) -> xr.Dataset:
        return record.assign({name: (record[name].dims, -record[name].values, record[name].attrs) for name in names})

    return turned_round


def _exchanged(record: xr.Dataset) -> xr.Dataset:
    x, y = record[CHANNELS[1]], record[CHANNELS[2]]
    return record.assign({x.name: (x.dims, y.values, x.attrs), y.name: (y.dims, x.values, y.attrs)})


def _in_turn(*mends: Mend) -> Mend:
    return lambda record: functools.reduce(lambda given, mend: mend(given), mends, record)


def _counted(sense: int, turns: float) -> Mend:
    """With a drive angle that is counted in this sense from a line that lies so many quarter turns off."""

    def counted_anew(record: xr.Dataset) -> xr.Dataset:
        drive, way = record["drive_angle"], record["direction"]
        others = np.where(way.values == "forward", "backward", "forward")
        angles = 0.5 * np.pi * turns + sense * drive.values
        angles -= 2.0 * np.pi * np.round(0.25 * (angles.min() + angles.max()) / np.pi)
        counted = record.assign(
            drive_angle=(drive.dims, angles, drive.attrs),
            direction=(way.dims, way.values if sense > 0 else others, way.attrs),
        )
        return counted.isel(sample=np.abs(angles) < 2.0 * np.pi)  # no record has more, and these carry no load

    return counted_anew


def _angles() -> Iterator[tuple[str, Mend, int]]:
    other_moment = _with_sign("holding_moment")
    for written, sense, turns in (
        ("90-NAME", -1, 1),
        ("-NAME", -1, 0),
        ("180-NAME", -1, 2),
        ("NAME+90", 1, 1),
        ("NAME-90", 1, -1),
        ("NAME+180", 1, 2),
    ):
        words, counted = f"{OTHER_ANGLE} (in degrees: --column 'drive_angle={written}')", _counted(sense, turns)
        yield words, counted, 1
        if sense < 0:
            yield f"{words}, and holding_moment had the other sign", _in_turn(counted, other_moment), 2
        if (sense, turns) == (-1, 1):  # mirrored in the diagonal
            words += ", holding_moment had the other sign, and force_x and force_y were exchanged"
            yield words, _in_turn(counted, other_moment, _exchanged), 3
