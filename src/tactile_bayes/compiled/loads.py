"""Loads of many contours in all the sweeps of a record."""

from __future__ import annotations

import functools
import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from tactile_bayes.compiled.compiler import compiled, kept
from tactile_bayes.compiled.lane import Lane, bearing, mirrored
from tactile_bayes.compiled.limits import first_contact
from tactile_bayes.compiled.path import Nodes, Work, follow, nodes, work
from tactile_bayes.compiled.states import Tables, tables
from tactile_bayes.contours.halves import OVAL, PARABOLA, TABLE, Halves
from tactile_bayes.reach import Reach

__all__ = ["Strokes", "loads_of"]

Floats = NDArray[np.float64]

_TOUCHES = int(Reach.TOUCHES)


class Strokes(NamedTuple):
    """Samples that have a pivot and a direction in common lie side by side."""

    base_x: Floats
    base_y: Floats
    backward: NDArray[np.bool_]
    first: NDArray[np.intp]
    """Where the samples of every stroke begin, and at last their number."""
    samples: NDArray[np.intp]
    """Their place in the record."""
    angles: Floats
    """Drive angles, as seen in forward sweeps."""


def loads_of(
    halves: Halves,
    strokes: Strokes,
    rod: tuple[float, float],
    rig: Floats,
    shifts: Floats,
    tolerance: Floats,
    *,
    is_always_clear: bool,
) -> tuple[Floats, NDArray[np.bool_], Floats]:
    """Loads in EI/L and EI/L², zero out of contact, shape (n, samples, 3), which contours are usable, shape (n,), and
    drive angles of first contact and snap-off, as read and as seen in forward sweeps, shape (n, strokes, 2).

    Usable are contours that every stroke reaches, and that the rod has passed once it has snapped off.

    Parameters
    ----------
    halves : Halves
        With parameters of shape (n,), in the same unit as bases and rod.
    rod : (float, float)
        Its length, and half its diameter.
    rig : ndarray, shape (n, strokes, 2)
        What the encoder reads too much [rad], and the suspension's compliance [rad/(EI/L)].
    shifts : ndarray, shape (n, strokes, 2)
        By how much the pivot of every stroke is off.
    tolerance : ndarray, shape (3,)
        By how much loads may miss, of moment and forces [EI/L and EI/L²].
    """
    known, on = _constants()
    columns = (*halves.left[1:], *halves.right[1:], halves.x, halves.y)
    contours = np.stack([np.broadcast_to(column, halves.x.shape) for column in columns], axis=1)
    out = np.zeros((halves.x.size, strokes.samples.size, 3))
    usable = np.ones(halves.x.size, dtype=bool)
    events = np.empty((halves.x.size, strokes.base_x.size, 2))
    kinds, room = (halves.left.kind, halves.right.kind), work(int(np.diff(strokes.first).max()), known)
    both = contours, None if halves.tables is None else halves.tables / rod[0]
    _fill(
        kinds,
        both,
        halves.has_knot,
        strokes,
        rod,
        (rig, shifts, tolerance),
        is_always_clear,
        (known, on),
        room,
        (out, usable, events),
    )
    return out, usable, events


@functools.cache
def _constants() -> tuple[tuple[Tables, Tables], Nodes]:
    return (tables(roughly=True), tables(roughly=False)), nodes()


@compiled
def _in_rod_lengths(kind: int, size: float, shape: float, length: float) -> tuple[float, float]:
    if kind == PARABOLA:
        return size * length, shape
    if kind == OVAL:
        return size / length, shape / length
    if kind == TABLE:
        return size, shape
    return size * length ** (shape - 1.0), shape


@compiled
def _table_of(tables: Floats | None, i: int) -> Floats | None:
    return None if tables is None else tables[i]


@kept
def _fill(
    kinds: tuple[int, int],
    both: tuple[Floats, Floats | None],
    has_knot: bool,
    strokes: Strokes,
    rod: tuple[float, float],
    rigs: tuple[Floats, Floats, Floats],
    is_always_clear: bool,
    constants: tuple[tuple[Tables, Tables], Nodes],
    room: Work,
    found: tuple[Floats, NDArray[np.bool_], Floats],
) -> None:
    left, right = kinds
    out, usable, events = found
    contours, tables = both
    length, standoff = rod
    rig, shifts, tolerance = rigs
    known, on = constants
    for i in range(contours.shape[0]):
        l_size, l_shape = _in_rod_lengths(left, contours[i, 0], contours[i, 1], length)
        r_size, r_shape = _in_rod_lengths(right, contours[i, 2], contours[i, 3], length)
        table = _table_of(tables, i)
        for k in range(strokes.base_x.size):
            x = (contours[i, 4] - strokes.base_x[k] - shifts[i, k, 0]) / length
            y = (contours[i, 5] - strokes.base_y[k] - shifts[i, k, 1]) / length
            lane = Lane(left, l_size, l_shape, right, r_size, r_shape, x, y, standoff / length, table)
            sign = 1.0
            if strokes.backward[k]:
                lane, sign = mirrored(lane), -1.0
            of_stroke = slice(strokes.first[k], strokes.first[k + 1])
            angles, samples = strokes.angles[of_stroke], strokes.samples[of_stroke]
            off, yielding = rig[i, k]
            reach, first, snap = follow(
                lane, has_knot, angles, samples, sign, off, yielding, tolerance, known, on, room, out[i]
            )
            events[i, k, 0], events[i, k, 1] = first + sign * off, snap + sign * off
            if reach != _TOUCHES:
                usable[i] = False
            elif not is_always_clear:
                opposite = mirrored(lane)
                if not snap > math.pi - bearing(opposite, first_contact(opposite)):
                    usable[i] = False
