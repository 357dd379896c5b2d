"""The side of the object that each sweep touches: that of its direction, unless the moment contradicts it."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping

import numpy as np
import xarray as xr

from tactile_bayes.arrays import Floats, Index
from tactile_bayes.load_cell import LoadCell
from tactile_bayes.load_cell.contact_bounds import FEWEST, contact_bounds
from tactile_bayes.numerics.scatter import rough_noise
from tactile_bayes.record import CHANNELS, present_channels, rod_of, rows_of_sweeps
from tactile_bayes.tasks.documents import read_json

# Attribute of a record: a JSON object that maps a sweep to the direction in which a sweep touches the same side.
CONTACT_SIDES = "contact_sides"
OTHER_SIDE = {"forward": "backward", "backward": "forward"}

# Mean moment in contact, with the sign of the direction, in standard errors, below which the direction is rejected, and
# below which it is doubtful.
_CONTRADICTED, _DOUBTED = -6.0, -2.0
# Limits of an unknown zero, in standard deviations: a correct direction with a zero within the first is doubtful at
# most; beyond the second the value is a load and not a zero, unless it stands both before and after contact.
_UNLIKELY, _IMPOSSIBLE = 3.0, 5.0
_ZERO = 0.1  # standard deviation of an unknown zero [EI/L]
# Standard deviation of a shift of the zero between contact and the unloaded samples, over that of the noise.
_WANDER = 0.2
_ROUNDING = 4.0 * float(np.finfo(float).eps)  # noise of a reading without noise, over the largest reading
_FALSE_ALARM = 1e-3
_ALL_BUT_OUTLIERS = 0.98


def contact_sides(record: xr.Dataset, load_cell: LoadCell | None = None) -> Floats:
    """Return the side of contact of every sample: +1 as in a forward sweep, −1 as in a backward one, (samples,). It is
    the side of the sweep's direction unless the moment in contact contradicts it by more than six standard errors, for
    its zero before or after contact, as `zero_load` finds it, and for all zeros that are likely: seemingly unloaded
    samples may have a constant load. A record may state the sides (`with_sides`)."""
    sides, _ = sides_and_doubts(record, load_cell)
    backward = [sweep for sweep, side in sides.items() if side == "backward"]
    return np.where(record.sweep.isin(backward), -1.0, 1.0)


def sides_and_doubts(record: xr.Dataset, load_cell: LoadCell | None = None) -> tuple[dict[int, str], tuple[int, ...]]:
    """Return the sides of all sweeps as in `contact_sides`, and those whose moment contradicts their direction, but not
    significantly, the most doubtful first."""
    stated, sides, doubts = _stated(record), {}, dict[int, float]()
    sweeps = np.unique(record.sweep.values).tolist()
    if set(sweeps) <= stated.keys():
        return {sweep: stated[sweep] for sweep in sweeps}, ()
    for sweep, score, is_contradicted in _judged(record, load_cell):
        said = side_of(record, sweep)
        sides[sweep] = stated.get(sweep, OTHER_SIDE[said] if is_contradicted else said)
        if sweep not in stated and score < _DOUBTED and not is_contradicted:
            doubts[sweep] = score
    return sides, tuple(sorted(doubts, key=doubts.__getitem__))


def side_of(record: xr.Dataset, sweep: int) -> str:
    """Side of contact that the direction of a sweep implies, "forward" or "backward"."""
    return str(record.direction.values[np.argmax(record.sweep.values == sweep)])


def with_sides(record: xr.Dataset, sides: Mapping[int, str]) -> xr.Dataset:
    """State the sides of sweeps: "forward" for the side that a forward sweep touches, or "backward"."""
    every = {**_stated(record), **{int(sweep): side for sweep, side in sides.items()}}
    return record.assign_attrs({CONTACT_SIDES: json.dumps(every)})


def _stated(record: xr.Dataset) -> dict[int, str]:
    return {int(sweep): side for sweep, side in read_json(record.attrs.get(CONTACT_SIDES, "{}"), CONTACT_SIDES).items()}


def _are_plain(sign: Floats, moment: Floats, parts: list[Index]) -> bool:
    """Return whether no moment contradicts the direction of its sweep, and each sweep is exactly without load at either
    end."""
    ends = (moment[rows[:FEWEST]].any() and moment[rows[-FEWEST:]].any() for rows in parts)
    return bool((sign * moment >= 0.0).all()) and not any(ends)


def _judged(record: xr.Dataset, load_cell: LoadCell | None) -> Iterator[tuple[int, float, bool]]:
    """Yield every sweep of a record, the mean moment in contact less the zero, with the sign of its direction, in
    standard errors, and whether it contradicts the direction, for any likely zero."""
    unit = rod_of(record).moment_unit
    cell = load_cell or LoadCell()
    known = float(np.sqrt(cell.covariance(np.zeros((1, 3)))[0, 0, 0]))
    unknown = float(np.hypot(_ZERO * unit, cell.bias_uncertainty[0]))
    present = present_channels(record)
    sweep, moment = record.sweep.values, record.holding_moment.values
    sign = np.where(record.direction.values == "backward", -1.0, 1.0)
    parts = rows_of_sweeps(sweep)
    if CHANNELS[0] not in present or _are_plain(sign, moment, parts):
        yield from ((int(sweep[rows[0]]), np.inf, False) for rows in parts)
        return
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
    everywhere = np.concatenate(unloaded)
    for rows, inside, own, is_enclosed in zip(parts, loaded, unloaded, enclosed, strict=True):
        noise = max(rough_noise(moment[rows]), known, _ROUNDING * float(np.abs(moment[rows]).max()), 1e-100 * unit)

        def score(samples: Index, zero: float, error: float, noise: float = noise) -> float:
            apart = moment[samples] - zero
            most = np.quantile(np.abs(apart), _ALL_BUT_OUTLIERS)
            error = float(np.hypot(error, noise * np.hypot(_WANDER, 1.0 / np.sqrt(samples.size))))
            return float(sign[samples[0]] * np.clip(apart, -most, most).mean() / error)

        absolute = score(inside, 0.0, unknown)
        zeros = moment[own if own.size >= FEWEST and inside.size < rows.size else everywhere]
        zero = float(zeros.mean()) if zeros.size >= FEWEST else np.inf
        if is_enclosed or abs(zero) < _IMPOSSIBLE * unknown:
            relative = score(inside, zero, noise / np.sqrt(zeros.size))
        else:
            absolute = relative = score(rows, 0.0, unknown)
        yield int(sweep[rows[0]]), relative, relative < _CONTRADICTED and absolute < -_UNLIKELY
