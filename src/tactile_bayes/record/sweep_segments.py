"""Sweep segments: the turning points of a drive, or of a base that it carries, and its direction between them."""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import pairwise

import numpy as np

from tactile_bayes.arrays import Flags, Floats
from tactile_bayes.record.parsing import parsed_column
from tactile_bayes.record.positions import end_of_rest
from tactile_bayes.record.schema import LARGEST_DRIVE_ANGLE
from tactile_bayes.record.sweep import trend
from tactile_bayes.record.table import Source, Table

_ROUNDING = 1e-9  # share of the motion that must be across the rod for a side of it to lead
_WIDEST = 0.5  # largest distance of neighbouring samples of a sweep [rad]
_MOST = 0.5  # share of the steps beyond which a base that moves is carried, and not one of several pivots
# Angle that a drive turns about a pivot [rad], and number of samples beyond which a base between pivots is carried.
_LEAST_TURN, _FEW = 0.05, 2
SHARE = 0.1  # least return of the drive angle after a turning point, as a share of its whole range


def turning_points(angle: Floats, least: float) -> list[int]:
    """Find the extremes of an angle after which it returns by more than a threshold, minima and maxima alternating."""
    falls, rises = _left_extreme(angle, 0, 1, least), _left_extreme(angle, 0, -1, least)
    if falls is None or rises is None:
        return []
    sense = 1 if rises[1] < falls[1] else -1
    begin = min(rises, falls, key=lambda extreme: extreme[1])[0]
    found: list[int] = []
    while extreme := _left_extreme(angle, begin, sense, least):
        begin, sense = extreme[0], -sense
        found.append(begin)
    return found


def split_at_turns(table: Table, length: float = 1.0) -> Table:
    """Add sweeps and directions to a table, from its drive angle, or from the motion of its base; see `FileFormat`. A
    base that is carried turns back on the line along which it moves most; a sweep is forward if the middle of the
    unloaded rod, of this length [length], moves to its left on average.
    """
    source = table.source
    table.refuse_empty()
    _refuse_present(table, "sweep", "direction")
    sweeps = [(0, table.samples, True)]
    if "drive_angle" in table.columns:  # else refused later, with the others that are missing
        angle = _finite("drive_angle", table)
        at_origin = np.zeros(angle.size)
        xy = [_finite(name, table) if name in table.columns else at_origin for name in ("base_x", "base_y")]
        base, sweeps = np.stack(xy, axis=1), []
        moved = np.append(False, np.any(base[1:] != base[:-1], axis=1))
        _refuse_wrapped(angle, moved, source)
        for stretch, is_carried in _stretches(angle, moved):
            if is_carried:
                sweeps += _carried_sweeps(stretch, angle, base, length, source)
            else:
                sweeps += _turned_sweeps(stretch, angle, moved, source)
    sizes = [end - begin for begin, end, _ in sweeps]
    sweep = np.repeat(np.arange(len(sweeps)), sizes)
    direction = np.where(np.repeat([is_forward for *_, is_forward in sweeps], sizes), "forward", "backward")
    return replace(table, columns={**table.columns, "sweep": (sweep, {}), "direction": (direction, {})})


def each_row(table: Table) -> Table:
    """Add sweeps to a table of touches, each row one of them."""
    _refuse_present(table, "sweep")
    return replace(table, columns={**table.columns, "sweep": (np.arange(table.samples), {})})


def _refuse_present(table: Table, *names: str) -> None:
    """Refuse columns that are to be derived."""
    for name in names:
        if name in table.columns:
            what = "is there already: do without split_sweeps, or remove the column"
            raise table.source.column_error(name, what)


def _finite(name: str, table: Table) -> Floats:
    """Return the numbers of a column, all of them finite."""
    values: Floats = parsed_column(name, table.columns[name][0], table.source)
    bad = np.flatnonzero(~np.isfinite(values))
    if bad.size:
        what = f"the value is {float(values[bad[0]])!r}: give a finite number, or remove the row"
        raise table.source.cell_error(bad, name, what)
    return values


def _stretches(angle: Floats, moved: Flags) -> list[tuple[slice, bool]]:
    """Return stretches of samples in their order, each with whether the base is carried in it: a base that rests while
    the drive turns is a pivot. `moved` is True where the base is not where it was before.
    """
    turns = np.zeros(angle.size, dtype=bool)
    for begin, end in pairwise([0, *np.flatnonzero(moved).tolist(), angle.size]):
        turns[begin:end] = np.ptp(angle[begin:end]) > _LEAST_TURN
    edges = [0, *(np.flatnonzero(turns[1:] != turns[:-1]) + 1).tolist(), angle.size]
    carried = [(begin, end) for begin, end in pairwise(edges) if not turns[begin] and end - begin > _FEW]
    if not (turns.any() and carried):
        return [(slice(0, angle.size), bool(np.count_nonzero(moved) > max(1.0, _MOST * (angle.size - 1))))]
    jumps = np.append(np.abs(np.diff(angle)) > _WIDEST, False)
    stretches, last = [], 0
    for begin, end in carried:  # its first or last sample may lie at a pivot
        own = slice(begin - int(begin > 1 and jumps[begin - 2]), end + int(jumps[end]) if end < angle.size else end)
        stretches += [(slice(last, own.start), False)] * (own.start > last) + [(own, True)]
        last = own.stop
    return stretches + [(slice(last, angle.size), False)] * (last < angle.size)


def _turned_sweeps(stretch: slice, angle: Floats, moved: Flags, source: Source) -> list[tuple[int, int, bool]]:
    """Return begin and end of each sweep about pivots, and whether it is forward."""
    least, starts = SHARE * float(np.ptp(angle[stretch])), []
    moves = stretch.start + 1 + np.flatnonzero(moved[stretch][1:])
    for begin, end in pairwise([stretch.start, *moves.tolist(), stretch.stop]):
        turns = turning_points(angle[begin:end], least)
        starts.append(begin)
        for turn in _starts(turns):
            starts.append(end_of_rest(angle[:end], starts[-1], begin + turn))
    sweeps = []
    for begin, end in pairwise([*starts, stretch.stop]):
        slope = trend(angle[begin:end])
        if slope == 0.0:
            what = f"a sweep has one sample, {source.row(begin)}, and so no direction: give more samples"
            if end - begin > 1:
                what = f"the drive angle does not move from {source.row(begin)} to {source.row(end - 1)}, so that the "
                what += "sweep has no direction: remove these samples"
            raise source.error(f"{what}, or give columns 'sweep' and 'direction'")
        sweeps.append((begin, end, slope > 0.0))
    return sweeps


def _carried_sweeps(
    stretch: slice, angle: Floats, base: Floats, length: float, source: Source
) -> list[tuple[int, int, bool]]:
    """Return begin and end of each sweep in which the base is carried, and whether it is forward."""
    offset = base[stretch] - base[stretch].mean(axis=0)
    along = offset @ np.linalg.eigh(offset.T @ offset)[1][:, -1]
    turns = turning_points(along, SHARE * float(np.ptp(along)))
    starts = [stretch.start, *(stretch.start + turn for turn in _starts(turns))]
    sweeps = []
    for begin, end in pairwise([*starts, stretch.stop]):
        step, middle = np.diff(base[begin:end], axis=0), 0.5 * (angle[begin : end - 1] + angle[begin + 1 : end])
        left = -np.sin(middle) * step[:, 0] + np.cos(middle) * step[:, 1] + 0.5 * length * np.diff(angle[begin:end])
        if not abs(left.sum()) > _ROUNDING * np.abs(step).sum():
            what = f"from {source.row(begin)} to {source.row(end - 1)} the base moves along the rod, or not at all, so "
            what += "that no side of the rod leads and the sweep has no direction: give columns 'sweep' and 'direction'"
            raise source.error(what)
        sweeps.append((begin, end, left.sum() > 0.0))
    return sweeps


def _starts(turns: list[int]) -> list[int]:
    """Return where sweeps begin after the first, from turning points: not after those by which a drive was reset."""
    is_reset = [False, *(turn == before + 1 for before, turn in pairwise(turns))]
    return [turn + 1 for turn, reset in zip(turns, is_reset, strict=False) if not reset]


def _refuse_wrapped(angle: Floats, moved: Flags, source: Source) -> None:
    """Refuse an angle that jumps by about a turn: only the user knows whether it wraps, or the drive was reset."""
    if np.abs(angle).max() > LARGEST_DRIVE_ANGLE:  # probably degrees, which are refused later
        return
    step = np.diff(angle)
    wrapped = (np.abs(np.abs(step) - 2.0 * math.pi) < _WIDEST) & ~moved[1:]
    if wrapped.any():
        before = int(np.argmax(wrapped))
        one, two = float(angle[before]), float(angle[before + 1])
        raise source.error(
            f"the drive angle jumps by about a turn, from {one!r} rad ({source.row(before)}) to {two!r} rad "
            f"({source.row(before + 1)}), as angles modulo 360° do: unwrap them (numpy.unwrap), so that none is beyond "
            "a turn (±2π), or, if the drive was reset there, give columns 'sweep' and 'direction'"
        )


def _left_extreme(angle: Floats, begin: int, sense: int, least: float) -> tuple[int, int] | None:
    """First maximum (sense 1) or minimum (−1) after which the angle returns by a threshold, and the sample of that."""
    top, place = -np.inf, begin
    size = 256
    while begin < angle.size:
        block = sense * angle[begin : begin + size]
        back = np.maximum(np.maximum.accumulate(block), top) - block > least
        is_left = bool(back.any())
        stop = int(np.argmax(back)) if is_left else block.size - 1
        highest = int(np.argmax(block[: stop + 1]))
        if block[highest] > top:
            top, place = float(block[highest]), begin + highest
        if is_left:
            return place, begin + stop
        begin, size = begin + size, min(2 * size, 1 << 20)
    return None
