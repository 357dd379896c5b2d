"""Many sweeps: every lane is one contour as one rod sees it from one pivot, in one direction."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tactile_bayes.arrays import Floats, Index
from tactile_bayes.contours.halves import CELLS, OVAL, PARABOLA, POWER_LAW, SLOPES
from tactile_bayes.mechanics.compiler import compiled, kept
from tactile_bayes.mechanics.fates import Reach
from tactile_bayes.mechanics.outline import Half, Outline, mirrored
from tactile_bayes.mechanics.path import MOST_CHANGES, Work, follow, work
from tactile_bayes.mechanics.reach import clear_angle
from tactile_bayes.mechanics.readings import STATE_COLUMNS, Found, Samples
from tactile_bayes.mechanics.states import Rig, Scene
from tactile_bayes.mechanics.stretches import Accuracy
from tactile_bayes.mechanics.tables import MOST_FRICTION, Room, Tables, prepare, room, tables

__all__ = ["Answers", "Lanes", "Shapes", "Strokes", "answered"]

_TOUCHES = int(Reach.TOUCHES)

_EXACT = Accuracy(resolved=1e-8, sharp=np.inf, halvings=8, first_step=4e-16, last_step=4e-16, polished=True)
"""States and events to rounding."""

_SMOOTH = _EXACT._replace(resolved=1e-10, polished=False)
"""Events to rounding, and states from series."""

_FAST = Accuracy(resolved=1e-3, sharp=1e-6, halvings=12, first_step=1e-6, last_step=1e-4, polished=True)
"""As well as noise asks."""

_EXACT_ORDER, _FAST_ORDER = 32, 16
"""Nodes on a stretch."""

_NEVER_MISSED = np.full(3, np.inf)


class Shapes(NamedTuple):
    """Contours in their own unit of length."""

    kinds: tuple[int, int]
    """Of the left and the right half of all of them."""
    halves: Floats
    """Sizes and shapes of left and right half, and the vertex, shape (n, 6)."""
    tables: Floats
    """Shape (n, rows, columns), without rows if there are formulas."""
    knots: Floats
    """Where contours may not be smooth, increasing, shape (n, knots)."""


class Lanes(NamedTuple):
    """Sweeps that are asked for, arrays of shape (lanes,)."""

    contour: Index
    """Which of the contours; loads of a contour's lanes are put together."""
    stroke: Index
    """Which of the strokes of samples."""
    base_x: Floats
    base_y: Floats
    length: Floats
    standoff: Floats
    backward: NDArray[np.bool_]
    friction_angle: Floats
    compliance: Floats
    offset: Floats
    """What the encoder reads too much, in the world's sense [rad]."""
    rigidity: Floats
    """Flexural rigidity over that in the unit of loads."""


class Strokes(NamedTuple):
    """Samples that are seen together lie side by side."""

    first: Index
    """Where the samples of every stroke begin, and at last their number."""
    rows: Index
    """Where what is found of a sample goes."""
    angles: Floats
    """Drive angles, as read and as seen in forward sweeps, increasing in each stroke."""
    relative: bool = False
    """Whether they are shares of the way from first contact to snap-off."""


class Answers(NamedTuple):
    """What is found. Drive angles are as seen in forward sweeps; events are of shape (lanes,), NaN where none is."""

    loads: Floats
    """In the world's signs, in EI/L and EI/L² for a rigidity of one, zero out of contact, shape (contours, rows, 3)."""
    states: Floats
    """See `Found`, shape (contours, rows or 0, columns)."""
    changes: Floats
    """See `Found`, shape (lanes, phases or 0, 2)."""
    phases: Index
    """How many there are."""
    reach: NDArray[np.int8]
    distance: Floats
    first_angle: Floats
    first_parameter: Floats
    snap_angle: Floats
    snap_parameter: Floats
    snap_off: NDArray[np.int8]
    curvature: Floats
    """The largest one of the rod up to snap-off [1/L], where states are wanted."""
    clear_angle: Floats
    """From which on the straight rod is clear; NaN if it is not asked."""


_INDICES, _FLAGS, _CODES = ("contour", "stroke", "phases"), ("backward",), ("reach", "snap_off")


def _side_by_side(names: tuple[str, ...]) -> np.dtype[np.void]:
    """Numbers that lie side by side, so that compiled code is handed one array and not one for each name."""
    kinds = {**dict.fromkeys(_INDICES, np.intp), **dict.fromkeys(_FLAGS, np.bool_), **dict.fromkeys(_CODES, np.int8)}
    return np.dtype([(name, kinds.get(name, np.float64)) for name in names], align=True)


_LANE, _EVENTS = _side_by_side(Lanes._fields), _side_by_side(Answers._fields[3:])


@compiled
def _half(kind: int, size: float, shape: float, length: float) -> Half:
    """One in rod lengths."""
    if kind == PARABOLA:
        return Half(kind, size * length, shape, 1.0)
    if kind == OVAL:
        return Half(kind, size / length, shape / length, 1.0)
    if kind == POWER_LAW:
        return Half(kind, size * length ** (shape - 1.0), shape, length ** min(1.0, shape - 1.0))
    return Half(kind, size, shape, 1.0)


@compiled
def _outline(shapes: Shapes, lane: Any, table: Floats) -> Outline:
    """As the rod of a lane sees it; the table is put where there is room for it."""
    c, length = lane.contour, lane.length
    kind, of = shapes.kinds[0], shapes.halves[c]
    left, right = _half(kind, of[0], of[1], length), _half(shapes.kinds[1], of[2], of[3], length)
    if kind in (SLOPES, CELLS):
        begin, end = (2, 2 + 2 * (table.shape[1] - 2) // 3) if kind == CELLS else (0, table.shape[1])
        for r in range(table.shape[0]):
            for k in range(table.shape[1]):
                table[r, k] = shapes.tables[c, r, k] / (length if begin <= k < end else 1.0)
    x, y = (of[4] - lane.base_x) / length, (of[5] - lane.base_y) / length
    low = -left.size if kind == SLOPES else left.size
    outline = Outline(left, right, low, right.size, 1.0, x, y, lane.standoff / length, table)
    return mirrored(outline) if lane.backward else outline


@kept
def _sweep(
    shapes: Shapes,
    lanes: Any,
    strokes: Strokes,
    exact: bool,
    accuracy: Accuracy,
    tolerance: Floats,
    asks_clearance: bool,
    known: Tables,
    states: Room,
    room: Work,
    table: Floats,
    loads: Floats,
    all_states: Floats,
    changes: Floats,
    events: Any,
) -> None:
    """Follow the path of every lane, and put what its samples feel into the answers.

    Parameters
    ----------
    lanes : ndarray, shape (lanes,)
        As in `Lanes`, side by side.
    exact : bool
        Whether states are computed to rounding, also where there are tables.
    tolerance : ndarray, shape (3,)
        By how much loads may miss, of moment and forces [EI/L and EI/L²].
    states, room
        Room for one state, and for one path.
    table : ndarray, shape (rows, columns)
        Room for the table of one contour.
    loads, all_states, changes, events
        As in `Answers`, the events side by side.
    """
    count, knots, prepared = shapes.knots.shape[1], room.knots, math.nan
    for i in range(lanes.size):
        lane, event = lanes[i], events[i]
        outline = _outline(shapes, lane, table)
        c, sign = lane.contour, -1.0 if lane.backward else 1.0
        for k in range(count):
            knots[k] = -shapes.knots[c, k] if lane.backward else shapes.knots[c, count - 1 - k]
        first, last = strokes.first[lane.stroke], strokes.first[lane.stroke + 1]
        samples = Samples(strokes.angles[first:last], strokes.rows[first:last], strokes.relative)
        if lane.friction_angle != prepared:
            prepared = lane.friction_angle
            prepare(known, prepared, states)
        rig = Rig(lane.friction_angle, lane.compliance, sign * lane.offset, sign, lane.rigidity)
        found = Found(loads[c], all_states[c], changes[i])
        scene = Scene(outline, rig, exact or prepared > MOST_FRICTION, known, states)
        ends = follow(scene, knots, samples, accuracy, tolerance, room, found)
        event.reach, event.distance = ends.reach, ends.distance
        event.first_angle, event.first_parameter = ends.first_angle, ends.first_parameter
        event.snap_angle, event.snap_parameter = ends.snap_angle, ends.snap_parameter
        event.snap_off, event.phases, event.curvature = ends.snap_off, ends.phases, ends.curvature
        event.clear_angle = math.nan
        if asks_clearance and ends.reach == _TOUCHES:
            event.clear_angle = clear_angle(outline, accuracy.first_step)


def answered(
    shapes: Shapes,
    lanes: Lanes,
    strokes: Strokes,
    shape: tuple[int, int],
    *,
    tolerance: Floats | None = None,
    states: bool = False,
    polished: bool = True,
    asks_clearance: bool = True,
) -> Answers:
    """Follow paths, and tell what samples feel.

    Parameters
    ----------
    shapes : Shapes
    lanes : Lanes
    strokes : Strokes
    shape : (int, int)
        How many contours, and rows for each.
    tolerance : ndarray, shape (3,), optional
        By how much loads may miss, of moment and forces [EI/L and EI/L²]; by default events are exact, and loads right
        to some 1e-8 of the largest.
    states : bool
        Whether states are wanted.
    polished : bool
        Whether they are exact; or else as good as series, 1e-10 of the largest, and without derivatives.
    asks_clearance : bool
        Whether it is asked from which angle on the straight rod is clear.
    """
    accuracy, order = _FAST, _FAST_ORDER
    if tolerance is None:
        accuracy, order = _EXACT if polished else _SMOOTH, _EXACT_ORDER
    count, rows = shape
    lane = np.empty(lanes.contour.size, dtype=_LANE)
    for name, values in zip(Lanes._fields, lanes, strict=True):
        lane[name] = values
    loads = np.zeros((count, rows, 3))
    all_states = np.zeros((count, rows if states else 0, STATE_COLUMNS))
    changes = np.empty((lane.size, MOST_CHANGES if states else 0, 2))
    events = np.empty(lane.size, dtype=_EVENTS)
    longest = int(np.diff(strokes.first).max(initial=0))
    _sweep(
        shapes,
        lane,
        strokes,
        tolerance is None,
        accuracy,
        _NEVER_MISSED if tolerance is None else tolerance,
        asks_clearance,
        tables(),
        room(),
        work(longest, order, shapes.knots.shape[1]),
        np.empty(shapes.tables.shape[1:]),
        loads,
        all_states,
        changes,
        events,
    )
    return Answers(loads, all_states, changes, *(np.ascontiguousarray(events[name]) for name in _EVENTS.names or ()))
