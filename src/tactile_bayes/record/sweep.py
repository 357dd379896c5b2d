"""A sweep: one motion of the drive in one direction, about one pivot or along a path of the base."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from tactile_bayes.arrays import Floats, Index
from tactile_bayes.record.quantity import unit_of
from tactile_bayes.record.rig_entry import file_entry
from tactile_bayes.record.schema import COLUMNS, DIRECTIONS, LARGEST_DRIVE_ANGLE
from tactile_bayes.record.table import Source


def refuse_impossible_sweeps(values: Mapping[str, NDArray[Any]], source: Source) -> None:
    """Refuse sweeps with several directions or two pivots, or with a drive angle in degrees or against the direction;
    from three places of the base on, or if the drive angle does not move, the drive carries the base.
    """
    direction, angle = values["direction"], values["drive_angle"]
    forward = direction == "forward"
    impossible = np.flatnonzero(~(forward | (direction == "backward")))
    if impossible.size:
        what = f"{str(direction[impossible[0]])!r} is no direction: write 'forward' or 'backward'"
        raise source.cell_error(impossible, "direction", what)
    beyond = np.flatnonzero(np.abs(angle) > LARGEST_DRIVE_ANGLE)
    if beyond.size:
        raise source.cell_error(beyond, "drive_angle", _beyond_a_turn(angle, beyond[0], source))
    plain = _are_plain(values, forward)
    for rows in _sweeps(values["sweep"]):
        first, last = int(rows[0]), int(rows[-1])
        if last - first == rows.size - 1 and plain[first:last].all():
            continue
        sweep = int(values["sweep"][first])
        carried = _is_carried(values["base_x"][rows], values["base_y"][rows], angle[rows])
        for name in ("direction",) if carried else ("direction", "base_x", "base_y"):
            differs = values[name][rows] != values[name][first]
            if differs.any():
                other = int(rows[np.argmax(differs)])
                one, two = values[name][first].item(), values[name][other].item()
                part = "motion of the drive" if name == "direction" else "position of the pivot"
                raise source.error(
                    f"sweep {sweep} mixes two values of {name!r}, {one!r} ({source.row(first)}) and {two!r} "
                    f"({source.row(other)}): give each {part} a sweep number of its own"
                )
        sense = 1 if forward[first] else -1
        if not carried and _runs_backwards(angle[rows], sense):
            one, two = (f"{float(angle[at])!r} rad ({source.row(at)})" for at in (first, last))
            raise source.error(
                f"sweep {sweep} is labelled {DIRECTIONS[sense < 0]!r}, but its drive angle "
                f"{'decreases' if sense > 0 else 'increases'}, from {one} to {two}: label it {DIRECTIONS[sense > 0]!r},"
                " or put its samples in the order in which they were measured"
            )


def _are_plain(values: Mapping[str, NDArray[Any]], forward: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Return whether a drive only turns from one sample to the next: at one base, in the direction of its label."""
    fixed = [forward, values["base_x"], values["base_y"]]
    step = np.diff(values["drive_angle"])
    return np.logical_and.reduce([np.where(forward[1:], step, -step) >= 0.0, *(v[1:] == v[:-1] for v in fixed)])


def _beyond_a_turn(angle: Floats, sample: int, source: Source) -> str:
    """Return a message on an angle beyond a turn: it is in degrees without saying so, or it counts on."""
    stated = source.units.get("drive_angle", "")
    unit = unit_of(stated) if stated else None
    if unit is not None and unit.scale != 1:
        return _counted_on(angle, sample, stated, float(unit.scale), source)
    what = f"{float(angle[sample])!r} is more than a turn (2π), so the angles look like degrees: convert the column to "
    what += "radians, with numpy.radians or times 0.017453292519943295"
    if unit is not None:
        return f"{what}; or, as it is stated in [{stated}], {_counted_on(angle, sample, stated, 1.0, source)}"
    if not source.name:
        return what
    origin = source.origins.get("drive_angle", "drive_angle")
    return f"{what}, or state its unit, as in {file_entry('drive_angle', f'{origin}[deg]')}"


def _counted_on(angle: Floats, sample: int, stated: str, scale: float, source: Source) -> str:
    """Return a message on angles that count on beyond a turn, in the unit that is stated for them."""
    turn, values = 2.0 * math.pi / scale, angle / scale
    turns = round(float(values.min() + values.max()) / 2.0 / turn) or (1 if values[sample] > 0.0 else -1)
    what = f"{float(values[sample]):.6g} {stated} is beyond a turn"
    if np.abs(angle - 2.0 * math.pi * turns).max() > LARGEST_DRIVE_ANGLE:
        return f"{what}, and the angles span two turns or more: count them from zero again in each sweep"
    origin = source.origins.get("drive_angle", "drive_angle")
    if "drive_angle" in source.origins and "drive_angle" not in source.aliases:  # one value for all samples
        return f"{what}: give {values[sample] - turns * turn:.6g}[{stated}]"
    shift = f"{origin}{-turns * turn:+.15g}[{stated}]"
    return f"{what}: {'subtract' if turns > 0 else 'add'} {abs(turns) * turn:.15g}, {file_entry('drive_angle', shift)}"


def carried_sweeps(record: xr.Dataset) -> tuple[int, ...]:
    """Return the numbers of the sweeps in which the drive carries the base, in the order of the record."""
    columns = [record[name].values for name in ("base_x", "base_y", "drive_angle")]
    sweep = record.sweep.values
    if all((values == values[0]).all() for values in columns[:2]):
        return ()
    found = {int(sweep[rows[0]]): _is_carried(*(values[rows] for values in columns)) for rows in _sweeps(sweep)}
    return tuple(number for number, carried in found.items() if carried)


def _is_carried(base_x: Floats, base_y: Floats, angle: Floats) -> bool:
    """Return whether the base of a sweep is carried."""
    if (base_x == base_x[0]).all() and (base_y == base_y[0]).all():
        return False
    return bool((angle == angle[0]).all()) or len(set(zip(base_x.tolist(), base_y.tolist(), strict=True))) > 2


def base_of_sample(record: xr.Dataset) -> tuple[list[tuple[float, float]], Index]:
    """Return the bases of a record, and the index of that of each sample. Returns shape index (samples,)."""
    x, y, sweep = record.base_x.values.copy(), record.base_y.values.copy(), record.sweep.values
    for number in carried_sweeps(record):
        rows = sweep == number
        x[rows], y[rows] = x[np.argmax(rows)], y[np.argmax(rows)]
    moved = np.append(True, (x[1:] != x[:-1]) | (y[1:] != y[:-1]))
    places: dict[tuple[float, float], int] = {}
    index = [places.setdefault(place, len(places)) for place in zip(x[moved].tolist(), y[moved].tolist(), strict=True)]
    return list(places), np.array(index, dtype=np.intp)[np.cumsum(moved) - 1]


def travels_of(record: xr.Dataset) -> Floats:
    """Return the drive angle [rad], or the way of a base that is carried since its sweep began [length], by sample."""
    travels, sweep = record.drive_angle.values.astype(float), record.sweep.values
    for number in carried_sweeps(record):
        rows = np.flatnonzero(sweep == number)
        steps = np.hypot(np.diff(record.base_x.values[rows]), np.diff(record.base_y.values[rows]))
        travels[rows] = np.append(0.0, np.cumsum(steps))
    return travels


def travel_unit(record: xr.Dataset) -> str:
    """Return the unit of travels: "rad", that of lengths, or both for drives of either kind."""
    carried = len(carried_sweeps(record))
    lengths = COLUMNS["base_x"].unit_in(record.attrs["units"])
    return lengths if carried == len(np.unique(record.sweep)) else f"rad, {lengths}" if carried else "rad"


def bases_of(record: xr.Dataset) -> list[tuple[float, float]]:
    """Return the pivots (x, y) of a record, and where drives that carry the base begin [length], in its order."""
    return base_of_sample(record)[0]


def rows_of_sweeps(sweep: NDArray[np.integer]) -> list[Index]:
    """Return the rows of each sweep, from sweep numbers of shape (samples,), in the order of these numbers."""
    order = np.argsort(sweep, kind="stable")
    return np.split(order, np.flatnonzero(np.diff(sweep[order])) + 1)


def _sweeps(sweep: NDArray[np.int64]) -> list[Index]:
    """Return the rows of each sweep, in the order in which sweeps begin."""
    return sorted(rows_of_sweeps(sweep), key=lambda rows: int(rows[0]))


def _runs_backwards(angle: Floats, sense: int) -> bool:
    """Return whether a sequence runs against its sense by more than the noise of the encoder (see `validate`)."""
    if angle.size < 2:
        return False
    angle = angle - angle[0]
    time = np.arange(angle.size) - (angle.size - 1) / 2
    squares = _product(time, time)
    slope = sense * trend(angle) / squares
    if slope >= 0:
        return False
    if (sense * angle[1:] < sense * angle[:-1]).all():
        return True
    residual = angle - angle.mean() - sense * slope * time
    variance_of_slope = _product(residual, residual) / max(angle.size - 2, 1) / squares
    return slope < -6 * math.sqrt(variance_of_slope)


def trend(angle: Floats) -> float:
    """Slope of a straight line fitted to a sequence, times a positive factor; exactly 0 for a drive at rest."""
    return _product(np.arange(angle.size) - (angle.size - 1) / 2, angle - angle[0])


def _product(one: NDArray[np.floating[Any]], other: NDArray[np.floating[Any]]) -> float:
    """Scalar product without the threads of BLAS, for many short sweeps."""
    return float(np.einsum("i,i->", one, other))
