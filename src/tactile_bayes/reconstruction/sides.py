"""The side of the object that each sweep touches: as its direction says, unless the moment contradicts that."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
import xarray as xr

from tactile_bayes.arrays import Floats, Index
from tactile_bayes.errors import ParameterError
from tactile_bayes.load_cell import LoadCell, rough_noise
from tactile_bayes.load_cell.contact_bounds import FEWEST, contact_bounds
from tactile_bayes.record import CHANNELS, present_channels, rod_of

__all__ = [
    "CONTACT_SIDES",
    "OTHER_SIDE",
    "contact_sides",
    "doubtful_sweeps",
    "side_of",
    "sides_and_doubts",
    "with_sides",
]

CONTACT_SIDES = "contact_sides"
"""Of a record: a JSON object from sweep to the direction of a sweep that touches the object from that side."""

OTHER_SIDE = {"forward": "backward", "backward": "forward"}

_CONTRADICTED, _DOUBTED = -6.0, -2.0
"""Mean moment in contact, on the direction's side of the zero, in standard errors, below which the direction is not
believed, and below which it is doubted."""

_UNLIKELY, _IMPOSSIBLE = 3.0, 5.0
"""Standard deviations of a zero of which nothing is known: if the direction is right, and the zero no further off than
the first, it is doubted at most; what is beyond the second is load and no zero, unless contact lies between."""

_ZERO = 0.1
"""Standard deviation of a zero of which nothing is known [EI/L]."""

_WANDER = 0.2
"""That of a zero that moves between contact and the unloaded samples beside it, in standard deviations of the noise."""

_ROUNDING = 4.0 * float(np.finfo(float).eps)
"""Noise of a reading that has none, over the largest."""

_FALSE_ALARM = 1e-3
_ALL_BUT_OUTLIERS = 0.98


def contact_sides(record: xr.Dataset, load_cell: LoadCell | None = None) -> Floats:
    """+1 where the object is touched as in a forward sweep, −1 as in a backward one, shape (samples,).

    It is the side of the sweep's direction, unless the moment contradicts that, since a drive may also turn back in
    contact: in contact the moment is on the other side of its zero by more than six standard errors. The zero is the
    mean of the unloaded samples of the sweep, or else of the record, as `zero_load` finds them, or else none within a
    standard deviation of 0.1 EI/L. A zero beyond five of these is believed only where it stands both before contact and
    after it: elsewhere it is a load. As what looks unloaded may be a load that does not change, the moment must also be
    on the other side of all zeros within three of these. A record may state the sides of its sweeps (`with_sides`).

    Parameters
    ----------
    record : xr.Dataset
        A valid record. Known errors of the load cell are taken out.
    load_cell : LoadCell, optional
        Its noise counts where neighbours differ by less.
    """
    sides = _stated(record)
    if not set(np.unique(record.sweep.values).tolist()) <= sides.keys():
        sides, _ = sides_and_doubts(record, load_cell)
    side = np.ones(record.sizes["sample"])
    for sweep, named in sides.items():
        if named == "backward":
            side[record.sweep.values == sweep] = -1.0
    return side


def doubtful_sweeps(record: xr.Dataset, load_cell: LoadCell | None = None) -> tuple[int, ...]:
    """Sweeps whose moment speaks against their direction, and not clearly, the most doubtful first."""
    return sides_and_doubts(record, load_cell)[1]


def sides_and_doubts(record: xr.Dataset, load_cell: LoadCell | None = None) -> tuple[dict[int, str], tuple[int, ...]]:
    """Sides of all sweeps, as `contact_sides` has them, and `doubtful_sweeps`, judged once."""
    stated, sides, doubted = _stated(record), {}, []
    for one in _judged(record, load_cell):
        said = str(record.direction.values[one.rows[0]])
        sides[one.sweep] = stated.get(one.sweep, OTHER_SIDE[said] if one.is_contradicted else said)
        if one.sweep not in stated and one.score < _DOUBTED and not one.is_contradicted:
            doubted.append(one)
    return sides, tuple(one.sweep for one in sorted(doubted, key=lambda one: one.score))


def side_of(record: xr.Dataset, sweep: int) -> str:
    """The side that the direction of a sweep says."""
    return str(record.direction.values[np.argmax(record.sweep.values == sweep)])


def with_sides(record: xr.Dataset, sides: Mapping[int, str]) -> xr.Dataset:
    """The record with the sides of some sweeps stated: "forward" as a forward sweep touches, or "backward".

    Raises
    ------
    ParameterError
        If a sweep is none of the record, or a side is neither.

    Examples
    --------
    >>> from tactile_bayes import scan
    >>> from tactile_bayes.contours import paper_profile
    >>> record = scan(paper_profile("II", q=0.5), direction="forward").record
    >>> sorted(set(contact_sides(with_sides(record, {0: "backward"})).tolist()))
    [-1.0]
    """
    for sweep, side in sides.items():
        if sweep not in record.sweep.values or side not in ("forward", "backward"):
            raise ParameterError(f"there is no side {side!r} of sweep {sweep!r}: give sweeps, each forward or backward")
    every = {**_stated(record), **{int(sweep): side for sweep, side in sides.items()}}
    return record.assign_attrs({CONTACT_SIDES: json.dumps(every)})


def _stated(record: xr.Dataset) -> dict[int, str]:
    return {int(sweep): side for sweep, side in json.loads(record.attrs.get(CONTACT_SIDES, "{}")).items()}


class _Judged(NamedTuple):
    """What the moment of one sweep says of its direction."""

    sweep: int
    rows: Index
    score: float
    """How far its mean in contact is on the direction's side of the zero, in standard errors."""
    absolute: float
    """The same where nothing is known of the zero."""

    @property
    def is_contradicted(self) -> bool:
        return self.score < _CONTRADICTED and self.absolute < -_UNLIKELY


def _judged(record: xr.Dataset, load_cell: LoadCell | None) -> list[_Judged]:
    """Every sweep of a record, in the order of their numbers."""
    unit = rod_of(record).moment_unit
    cell = load_cell or LoadCell()
    known = float(np.sqrt(cell.covariance(np.zeros((1, 3)))[0, 0, 0]))
    unknown = float(np.hypot(_ZERO * unit, cell.bias_uncertainty[0]))
    present = present_channels(record)
    sweep, moment = record.sweep.values, record.holding_moment.values
    order = np.argsort(sweep, kind="stable")
    parts = np.split(order, np.flatnonzero(np.diff(sweep[order])) + 1)
    if CHANNELS[0] not in present:
        return [_Judged(int(sweep[rows[0]]), rows, np.inf, np.inf) for rows in parts]
    readings = np.stack([record[name].values for name in present], axis=-1)
    readings /= np.maximum(np.abs(readings).max(axis=0), 1e-100 * unit)  # squares of large ones would overflow
    floor = np.full(len(present), _ROUNDING**2)
    loaded, unloaded, enclosed = [], [], []
    for rows in parts:
        bounds = contact_bounds(readings[rows], _FALSE_ALARM, floor)
        end = len(rows) - bounds.after
        loaded.append(rows[bounds.before : end] if bounds.found else rows)
        unloaded.append(np.concatenate([rows[: bounds.before], rows[end:]]))
        enclosed.append(bounds.found and min(bounds.before, bounds.after) >= FEWEST)
    found = []
    for rows, inside, own, is_enclosed in zip(parts, loaded, unloaded, enclosed, strict=True):
        noise = max(rough_noise(moment[rows]), known, _ROUNDING * float(np.abs(moment[rows]).max()), 1e-100 * unit)
        sign = -1.0 if record.direction.values[rows[0]] == "backward" else 1.0

        def score(samples: Index, zero: float, error: float, noise: float = noise, sign: float = sign) -> float:
            apart = moment[samples] - zero
            most = np.quantile(np.abs(apart), _ALL_BUT_OUTLIERS)
            error = float(np.hypot(error, noise * np.hypot(_WANDER, 1.0 / np.sqrt(samples.size))))
            return float(sign * np.clip(apart, -most, most).mean() / error)

        absolute = score(inside, 0.0, unknown)
        zeros = moment[own if own.size >= FEWEST and inside.size < rows.size else np.concatenate(unloaded)]
        zero = float(zeros.mean()) if zeros.size >= FEWEST else np.inf
        if is_enclosed or abs(zero) < _IMPOSSIBLE * unknown:
            relative = score(inside, zero, noise / np.sqrt(zeros.size))
        else:
            absolute = relative = score(rows, 0.0, unknown)
        found.append(_Judged(int(sweep[rows[0]]), rows, relative, absolute))
    return found
