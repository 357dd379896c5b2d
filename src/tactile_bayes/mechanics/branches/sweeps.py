"""Many sweeps, each of one rod along one contour, about one pivot and in one direction."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tactile_bayes.arrays import Flags, Floats, Index
from tactile_bayes.contours.cells import in_cells
from tactile_bayes.contours.halves import CELLS, OVAL, PARABOLA, POWER_LAW, SLOPES
from tactile_bayes.mechanics.branches.branch import (
    MOST_CHANGES,
    BranchWorkspace,
    branch_workspace,
    follow_branch,
    refuse,
)
from tactile_bayes.mechanics.branches.clearance import travel_into
from tactile_bayes.mechanics.branches.first_contact import clear_angle
from tactile_bayes.mechanics.branches.leg import Accuracy
from tactile_bayes.mechanics.branches.line import NO_LINES, ROTATION, line_of, pivots
from tactile_bayes.mechanics.branches.outline import Outline, OutlineHalf, mirrored
from tactile_bayes.mechanics.branches.readings import STATE, STATE_COLUMNS, PathResults, PathSamples
from tactile_bayes.mechanics.branches.scene import NOWHERE, RigParameters, Scene
from tactile_bayes.mechanics.compiler import cached, compiled
from tactile_bayes.mechanics.phases import TIP
from tactile_bayes.mechanics.poses.beam import Beam, Varied, beam_of, varied_of
from tactile_bayes.mechanics.poses.forward_table import NO_TABLES, Tables, prepare
from tactile_bayes.mechanics.poses.taylor import CLOSE, EXACT, write_shape
from tactile_bayes.mechanics.reachability import Reachability, SnapOff
from tactile_bayes.mechanics.rods.profile import MOST_MODES, Profile
from tactile_bayes.tasks import in_parts

if TYPE_CHECKING:
    from tactile_bayes.contours.base import Contour

# Difference of drive angles [rad] that errors of a likelihood may cause where the contact has no force.
_SAME_ANGLE = 1e-5
_TOUCHES, _TOO_FAR = int(Reachability.TOUCHES), int(Reachability.TOO_FAR)
_BEGINS_INSIDE = int(Reachability.BEGINS_INSIDE)
_NEVER, _RELEASE = int(SnapOff.NEVER), int(SnapOff.RELEASE)

# Accuracy with states and events to rounding.
_EXACT = Accuracy(
    np.full(3, np.inf), 1e-9, np.inf, halvings=12, first_step=4e-16, last_step=4e-16, polished=True, exact=True
)
_SMOOTH = _EXACT._replace(resolved=1e-10, polished=False)  # accuracy with events to rounding and states from series
# Accuracy that noise requires, beside its tolerance.
_FAST = _EXACT._replace(resolved=1e-3, sharp=1e-6, first_step=1e-6, last_step=1e-4, exact=False)
_LAST_STEP_STUCK = 4e-16  # last step where a rod may stick: what hardly slips is lost by coarser ones
_FINER = 1e-6  # resolution of paths that noise would require less of
_EXACT_ORDER, _FAST_ORDER = 32, 12  # numbers of terms of the series of a leg
_FEWEST = 16  # fewest sweeps that another thread shares


class Shapes(NamedTuple):
    """Contours, in their own unit of length."""

    kinds: tuple[int, int]  # kinds of the left and the right half of all contours
    halves: Floats  # size and shape of the left and the right half, and the vertex, shape (n, 6)
    tables: Floats  # tables, shape (n, rows, columns), without rows if there are formulas
    knots: Floats  # parameters at which contours may not be smooth, increasing, shape (n, knots)


def shapes_of(contours: Contour, low: Floats | None = None, high: Floats | None = None) -> Shapes:
    """Contours with parameters of shape (n,), by their formula, or by tables from parameter `low` to `high`."""
    halves = contours.halves
    if halves is None:
        assert low is not None
        assert high is not None
        halves = in_cells(contours, low, high)
    count = contours.shape[0] if contours.shape else halves.x.size
    columns, knots = np.empty((count, 6)), np.empty((count, len(contours.knots)))
    for k, column in enumerate((*halves.left[1:], *halves.right[1:], halves.x, halves.y)):
        columns[:, k] = column
    for k, knot in enumerate(contours.knots):
        knots[:, k] = knot
    tables = np.empty((count, 0, 0)) if halves.tables is None else np.ascontiguousarray(halves.tables)
    return Shapes((halves.left.kind, halves.right.kind), columns, tables, np.sort(knots, axis=1))


class Sweeps(NamedTuple):
    """Sweeps to solve, as arrays of shape (sweeps,)."""

    contour: Index  # index of the contour; the loads of a contour's sweeps are put together
    segment: Index  # index of the sweep segment whose samples are read
    base_x: Floats
    base_y: Floats
    length: Floats
    standoff: Floats
    backward: Flags
    friction_angle: Floats
    compliance: Floats
    yielding: Floats
    # Rest curvature in the laboratory frame, > 0 counter-clockwise [1/L]; with a profile, what is added to its own.
    rest_curvature: Floats
    rest_shape: Floats  # amplitudes of the modes of a profile, shape (sweeps, MOST_MODES)
    taper: Floats  # taper, for rods with a profile
    stem: Floats  # rigid piece between pivot and rod [L]
    offset: Floats  # encoder offset in the laboratory frame [rad]
    rigidity: Floats  # flexural rigidity over the rigidity in the units of loads
    relative_length: Floats  # length of the rod over the length in the units of loads and drives


class Segments(NamedTuple):
    """Samples of sweep segments, one segment after the other."""

    first: Index  # first sample of every segment, and the number of samples at the end
    rows: Index  # row of the results of each sample
    angles: Floats  # drive angles as read, in the sweep frame, increasing in each segment [rad]
    # Lines of the drives that carry the base, in the sweep frame from their beginnings, as in `lines_through`, shape
    # (segments, lines, columns), NaN after the last; without any, the pivots rest. Angles are then travels.
    lines: Floats = NO_LINES
    relative: bool = False  # true if they are shares of the drive angle from first contact to snap-off


class Solutions(NamedTuple):
    """Solutions of sweeps. Drive angles are in the sweep frame; events have the shape (sweeps,), NaN without a path."""

    # Loads in the laboratory frame [EI/L, EI/L² for a rigidity of 1], 0 out of contact, shape (contours, rows, 3).
    loads: Floats
    states: Floats  # states with the columns of `STATE`, shape (contours, rows or 0, columns)
    # States where phases begin, and at the end of the last, shape (sweeps, phases + 1 or 0, columns).
    event_states: Floats
    phases: Index  # number of phases
    reach: NDArray[np.int8]
    distance: Floats  # least distance of contour and pivot [L]
    first_angle: Floats
    first_parameter: Floats
    snap_angle: Floats
    snap_parameter: Floats  # parameter at the end of the path, or at a second contact and the like if there is one
    snap_off: NDArray[np.int8]
    curvature: Floats  # largest curvature of the rod up to snap-off [1/L], if states are computed
    # Drive angle beyond which the unloaded rod is clear [rad]; on lines, the travel from snap-off on at which it lies
    # in the object, −∞ if it does so nowhere; NaN if it is not computed.
    clear_angle: Floats


_INDICES, _FLAGS, _CODES = ("contour", "segment", "phases"), ("backward",), ("reach", "snap_off")


def _side_by_side(names: tuple[str, ...]) -> np.dtype[np.void]:
    """Structured type, so that compiled code takes one array instead of one for each name."""
    kinds = {**dict.fromkeys(_INDICES, np.intp), **dict.fromkeys(_FLAGS, np.bool_), **dict.fromkeys(_CODES, np.int8)}
    shapes = {"rest_shape": (MOST_MODES,)}
    return np.dtype([(name, kinds.get(name, np.float64), shapes.get(name, ())) for name in names], align=True)


_SWEEP, _EVENTS = _side_by_side(Sweeps._fields), _side_by_side(Solutions._fields[3:])


@compiled
def _half(kind: int, size: float, shape: float, length: float) -> OutlineHalf:
    """Half of a contour in rod lengths."""
    if kind == PARABOLA:
        return OutlineHalf(kind, size * length, shape, 1.0)
    if kind == OVAL:
        return OutlineHalf(kind, size / length, shape / length, 1.0)
    if kind == POWER_LAW:
        return OutlineHalf(kind, size * length ** (shape - 1.0), shape, length ** min(1.0, shape - 1.0))
    return OutlineHalf(kind, size, shape, 1.0)


@compiled
def _outline(shapes: Shapes, sweep: Any, table: Floats) -> Outline:
    """Contour of a sweep in the sweep frame; its table is written to `table`."""
    c, length = sweep.contour, sweep.length
    kind, of = shapes.kinds[0], shapes.halves[c]
    left, right = _half(kind, of[0], of[1], length), _half(shapes.kinds[1], of[2], of[3], length)
    if kind in (SLOPES, CELLS):
        begin, end = (2, 2 + 2 * (table.shape[1] - 2) // 3) if kind == CELLS else (0, table.shape[1])
        for r in range(table.shape[0]):
            for k in range(table.shape[1]):
                table[r, k] = shapes.tables[c, r, k] / (length if begin <= k < end else 1.0)
    x, y = (of[4] - sweep.base_x) / length, (of[5] - sweep.base_y) / length
    low = -left.size if kind == SLOPES else left.size
    standoff = sweep.standoff / length
    half_angle = math.atan(standoff * sweep.taper)
    sin, cos = math.sin(half_angle), math.cos(half_angle)
    reach = 1.0 + sweep.stem
    outline = Outline(left, right, low, right.size, 1.0, x, y, standoff * cos, half_angle, sin, reach, table)
    return mirrored(outline) if sweep.backward else outline


@compiled
def _scene(
    shapes: Shapes,
    varied: Varied | None,
    known: Tables,
    sweep: Any,
    room: Floats,
    table: Floats,
) -> Scene:
    """Contour, rod and rig of a sweep in the sweep frame; the contour's table is written to `table`."""
    sign = -1.0 if sweep.backward else 1.0
    offset = sign * sweep.offset if pivots(room) else 0.0  # it is in the lines
    moment = sweep.rigidity / sweep.relative_length
    force = moment / sweep.relative_length
    rig = RigParameters(sweep.friction_angle, sweep.compliance, sweep.yielding, offset, sign, moment, force)
    outline = _outline(shapes, sweep, table)
    beam = _beam(varied, known, sweep, sign, outline.half_angle)
    return Scene(outline, beam, rig, ROTATION, TIP, NOWHERE)


@compiled
def _place_lines(lines: Floats, sweep: Any, room: Floats) -> None:
    """Write the lines of a sweep with its encoder offset, and in lengths of its rod, to the room."""
    offset = -sweep.offset if sweep.backward else sweep.offset
    for k in range(room.shape[0]):
        for c in range(room.shape[1]):
            room[k, c] = lines[sweep.segment, k, c] / (sweep.relative_length if c in (0, 1, 3, 4) else 1.0)
        room[k, 2] -= offset


@compiled
def _beam(varied: Varied | None, known: Tables, sweep: Any, sign: float, half_angle: float) -> Beam:
    """Rod of a sweep, with coefficients for its friction, if a table holds it."""
    if varied is None:
        return beam_of(sign * sweep.rest_curvature, varied, sweep.stem)
    edges, curvature, rigidity, _, bend, _, modes, shape = varied.profile
    write_shape(modes, sweep.rest_shape, shape, curvature)
    room = Profile(edges, curvature, rigidity, sweep.taper, bend + sweep.rest_curvature, sign, modes, shape)
    slenderness = 0.0
    for table in known:
        if prepare(table, room, sweep.friction_angle - half_angle, varied.sheet):
            slenderness = table.slenderness
            break
    rod = Varied(room, varied.work, varied.remainder, varied.at_rest, varied.sheet, slenderness, sign)
    return beam_of(0.0, rod, sweep.stem)


@compiled
def _clear_angle(scene: Scene, lines: Floats, event: Any, accuracy: Accuracy) -> float:
    """Travel beyond which the unloaded rod is clear; on lines, that from snap-off on at which it is not. A rod that is
    released touches there without load, which small errors alone would decide: −∞ if it does so nowhere else."""
    if pivots(lines):
        clear = clear_angle(scene.outline, scene.beam, accuracy.first_step)
        return -math.inf if event.snap_off == _RELEASE and clear < event.snap_angle + _SAME_ANGLE else clear
    if event.snap_off == _NEVER:
        return -math.inf
    return travel_into(scene.outline, scene.beam, lines, event.snap_angle, accuracy.exact)


@compiled
def _is_inside_before(scene: Scene, lines: Floats, first: float) -> bool:
    """True if a drive carries the unloaded rod into the object before it touches there from this side, if it does."""
    if pivots(lines):
        return False
    inside = travel_into(scene.outline, scene.beam, lines, line_of(lines, 0).travel, True)
    return -math.inf < inside < first - _SAME_ANGLE


@cached
def _solve(
    shapes: Shapes,
    varied: Varied | None,
    known: Tables,
    sweeps: Any,
    segments: Segments,
    room: Floats,
    asks_clearance: bool,
    workspace: BranchWorkspace,
    finer: BranchWorkspace,
    table: Floats,
    loads: Floats,
    all_states: Any,
    event_states: Any,
    events: Any,
) -> None:
    """Follow the path of every sweep, and write the results of its samples. Sweeps are a structured array with fields
    as in `Sweeps`; loads and the last three are as in `Solutions`, but structured. Room is for the lines of one sweep,
    `table` for that of one contour, and the finer workspace for paths that the other leaves in doubt."""
    count, knots, accuracy = shapes.knots.shape[1], workspace.knots, workspace.leg.accuracy
    for i in range(sweeps.size):
        sweep, event, c = sweeps[i], events[i], sweeps[i].contour
        _place_lines(segments.lines, sweep, room)
        scene = _scene(shapes, varied, known, sweep, room, table)
        for k in range(count):
            knots[k] = -shapes.knots[c, k] if sweep.backward else shapes.knots[c, count - 1 - k]
        first, last = segments.first[sweep.segment], segments.first[sweep.segment + 1]
        samples = PathSamples(segments.angles[first:last], segments.rows[first:last], segments.relative)
        found = PathResults(loads[c], all_states[c], event_states[i], event)
        is_clear = follow_branch(scene, room, samples, workspace, found)
        if not (is_clear or accuracy.exact):
            follow_branch(scene, room, samples, finer, found)
        event.clear_angle = math.nan
        if asks_clearance and event.reach == _TOUCHES:
            event.clear_angle = _clear_angle(scene, room, event, accuracy)
        if asks_clearance and accuracy.exact and event.reach in (_TOUCHES, _TOO_FAR):
            first = event.first_angle if event.reach == _TOUCHES else math.inf
            if _is_inside_before(scene, room, first):
                refuse(_BEGINS_INSIDE, math.nan, event)


def solve_sweeps(
    shapes: Shapes,
    sweeps: Sweeps,
    segments: Segments,
    shape: tuple[int, int],
    *,
    profile: Profile | None = None,
    known: Tables = NO_TABLES,
    tolerance: Floats | None = None,
    roughly: bool = False,
    states: bool = False,
    polished: bool = True,
    asks_clearance: bool = True,
) -> Solutions:
    """Follow the paths of sweeps, and compute loads, and states if wanted, of their samples.

    `shape` is the number of contours, and of rows for each. With a `profile`, rest curvature or rigidity vary along the
    rod, the same in all sweeps except for the taper and an addition to its rest curvature; `known` are tables of it,
    for loads with errors of some 1e-6 of the largest, and `roughly` allows these without a table too. `tolerance` are
    tolerated errors of moment and forces [EI/L and EI/L²], at least 1e-10 of the loads; without it events are exact,
    and loads have errors of some 1e-8 of the largest. States are exact if `polished`; otherwise they come from the
    series, with an error of 1e-10 of the largest.
    """
    if tolerance is None:
        accuracy, order = _EXACT if polished else _SMOOTH, _EXACT_ORDER
    else:
        accuracy, order = _FAST._replace(tolerance=tolerance), _FAST_ORDER
        may_stick = segments.lines.size or profile is not None or bool(np.any(sweeps.rest_curvature))
        if may_stick and np.any(sweeps.friction_angle):
            accuracy = accuracy._replace(last_step=_LAST_STEP_STUCK)
    count, rows = shape
    sweep = np.empty(sweeps.contour.size, dtype=_SWEEP)
    for name, values in sweeps._asdict().items():
        sweep[name] = values
    loads, all_states = np.zeros((count, rows, 3)), np.zeros((count, rows if states else 0), dtype=STATE)
    event_states = np.zeros((sweep.size, MOST_CHANGES + 1 if states else 0), dtype=STATE)
    events = np.empty(sweep.size, dtype=_EVENTS)
    longest = int(np.diff(segments.first).max(initial=0))

    def solve(part: slice) -> None:
        rod = None if profile is None else profile.shaped(np.zeros(MOST_MODES))  # with arrays of its own
        workspace = branch_workspace(accuracy, order, longest, shapes.knots.shape[1], segments.lines.shape[1])
        finer = workspace.leg._replace(accuracy=accuracy._replace(resolved=_FINER))
        _solve(
            shapes,
            varied_of(rod, CLOSE if roughly else EXACT),
            known,
            sweep[part],
            segments,
            np.empty(segments.lines.shape[1:]),
            asks_clearance,
            workspace,
            workspace._replace(leg=finer),
            np.empty(shapes.tables.shape[1:]),
            loads,
            all_states,
            event_states[part],
            events[part],
        )

    in_parts(solve, sweep.size, _FEWEST)
    columns = [one.view(np.float64).reshape(*one.shape, len(STATE_COLUMNS)) for one in (all_states, event_states)]
    by_name = {name: np.ascontiguousarray(events[name]) for name in _EVENTS.names or ()}
    return Solutions(loads, columns[0], columns[1], **by_name)
