"""The pose of rods whose properties vary along them, as polynomials, for likelihoods.

All rods of a likelihood have one profile. Its table holds their pose, as seen from where they begin, as polynomials in

    tip contact:         ψ1 and f Λ(1)²,
    tangential contact:  s1 and f Λ(s1)², up to the tip, and beyond it: the last series of a phase may go on there,

with the length Λ(s) = ∫ EI^(−1/2) ds of a uniform rod that bends as much; and in those of taper, addition to the rest
curvature and friction angle that vary between the rods. These are the same throughout a sweep, and contracted once.

Polynomials interpolate at Chebyshev nodes and at f = 0: there the deficit of the chord, from which the force follows,
is of second order, and an error in it would be one of its square root in the force. They are not extrapolated.
"""

from __future__ import annotations

import math
from itertools import product
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tactile_bayes.arrays import Floats, Index
from tactile_bayes.mechanics.compiler import cached, compiled
from tactile_bayes.mechanics.poses.pose import Pose
from tactile_bayes.mechanics.poses.profile_pose import pose_along
from tactile_bayes.mechanics.poses.profile_shape import chord_along, rest_along
from tactile_bayes.mechanics.poses.taylor import BACKWARD, State, cell_at, rest_curvature_at, rigidity_at, workspace
from tactile_bayes.mechanics.rods.profile import Profile
from tactile_bayes.numerics import chebyshev
from tactile_bayes.tasks import in_parts

__all__ = [
    "GRADES",
    "NO_TABLE",
    "NO_TABLES",
    "PARTS",
    "Box",
    "ForwardTable",
    "RestChord",
    "Tables",
    "chord_in",
    "forward_table",
    "has_parts",
    "is_far",
    "part_in",
    "pose_in",
    "prepare",
    "sheet",
]

_ROWS, _MOST_ROWS, _TERMS = 16, 28, 24
"""Most terms in ψ1 or s1, also of a fine table, and terms in the force and in the distance of the rod at rest."""

_COLUMNS = 3 * _TERMS

_GROUP = 4
"""Terms in ψ1 or s1 that are summed at a time."""

_CACHE_LINE = 64
"""Bytes of a line of the processor's cache: numbers that lie in two of them take longer to load."""

PARTS, _STEPS = 8, 4
"""Number of parts of a rod between which it is sought in `part_in`, and largest number of steps in each."""

_HALVES = 2 * PARTS * _STEPS

_MOST_BENT = 0.1
"""Largest f/EI(s), times the square of a step, in `part_in`."""

_WORST = 1e-5
"""Largest error of the pose with which a table is of use."""

_OUTER, _OUTER_OF_BOTH, _BOTH = (5, 5, 7), (5, 5, 12), 0.7
"""Nodes in a taper, bend and friction angle that vary, also for friction of either sense: angles of a wider range."""

_MOST = max(_OUTER_OF_BOTH)

_NEGLIGIBLE, _AT_ONSET = 2e-7, 100.0
"""Size of terms that are left out, and how much smaller it is without a force."""

_PSI1, _FORCE, _BEYOND = 1.4, 36.0, 0.6
"""Largest ψ1 and f Λ², and largest Λ beyond the tip, over Λ(1)."""

_THRUST = 20.0
"""f Λ² before which sweeps end with a thrust through the pivot; their last series may go on."""

_FINE_FORCES = (_THRUST, 7.0)
"""Largest f Λ² of fine tables; the last is seldom exceeded."""

GRADES = 1 + len(_FINE_FORCES)
"""Number of grades of tables."""

_BELOW, _FINE_BELOW, _FINE_PSI1 = 0.4, 0.1, 2.4
"""Largest amount of ψ1 below that of tangential contact, also in a fine table, and its largest value there."""

_SCALE = 10.0
"""f Λ² from which on polynomials are in its logarithm."""

_ACROSS = 1e-6
"""Cosine of the angle of a chord to the rod that counts as zero."""

_ROUNDING = 1e-12
"""Distance from the end of a range that counts as zero."""

_CHECKS = 400
"""Points at which the error is measured."""


class Box(NamedTuple):
    """Ranges of what differs between the rods of a table; a range without width is a value."""

    taper: tuple[float, float]
    bend: tuple[float, float]
    friction_angle: tuple[float, float]


class Terms(NamedTuple):
    """Coefficients in taper, bend and friction angle that are not negligible."""

    orders: Index
    """Orders of the Chebyshev polynomials, shape (terms, 3)."""
    coefficients: Floats
    """Coefficients of a rod and of its mirror image, shape (2, terms, rows, columns)."""


class ForwardTable(NamedTuple):
    """Coefficients of all rods of a box."""

    tip: Terms
    """Tip contact."""
    tangential: Terms
    """Tangential contact up to the tip."""
    beyond: Terms
    """Tangential contact beyond it."""
    chord: Terms
    """Arc length, bearing and slope of the rod at rest at a distance, in one row."""
    box: Floats
    """Least and largest taper, bend and friction angle, shape (3, 2)."""
    slenderness: float
    """Λ(1) without the taper."""
    psi1: tuple[float, float]
    """Range of ψ1 in tip contact."""
    span: float
    """Logarithm of 1 + f Λ²/10 at the largest force."""


class RestChord(NamedTuple):
    """Chord of a rod at rest; see `beam.Chord`."""

    arclength: float
    at_base: float
    at_point: float
    rate: float


_NONE = Terms(np.zeros((0, 3), dtype=np.intp), np.zeros((2, 0, 0, 0)))

NO_TABLE = ForwardTable(_NONE, _NONE, _NONE, _NONE, np.array([[1.0, 0.0]] * 3), 1.0, (0.0, _PSI1), 1.0)
"""Table without any rod."""

Tables = tuple[ForwardTable, ForwardTable]
"""Tables of which the first that holds a rod serves it."""

NO_TABLES: Tables = (NO_TABLE, NO_TABLE)
"""No tables."""


_SHEET = np.dtype(
    [
        (
            "phases",
            float,
            (3, _MOST_ROWS, _COLUMNS),
        ),  # in tip contact, in tangential contact up to the tip, and beyond it
        ("at_rest", float, (2, 1, _COLUMNS)),  # of the rod, and of its mirror image
        ("sums", float, (2, _COLUMNS)),  # workspace for one pose
        ("outer", float, (3, _MOST)),  # polynomials in taper, bend and friction angle
        ("turn", float, (_HALVES + 1,)),  # of the rod at rest from its tip to halves of the shortest steps [rad]
        ("pliance", float, (_HALVES + 1,)),  # EI(0)/EI there
        ("most_pliance", float),
        ("least_psi1", float),  # ranges of the table
        ("most_psi1", float),
        ("span", float),
        ("sign", float),  # the rod
        ("taper", float),
        ("bend", float),
        ("friction_angle", float),
        ("rows", np.intp, (3,)),  # numbers of terms in ψ1 or s1 of the phases
    ],
    align=True,
)
"""Coefficients of one rod."""


def sheet() -> NDArray[np.void]:
    """Return an array of one `_SHEET`, whose rows begin where cache lines do."""
    room = np.zeros(_SHEET.itemsize + _CACHE_LINE, dtype=np.uint8)
    begin = -room.ctypes.data % _CACHE_LINE
    return room[begin : begin + _SHEET.itemsize].view(_SHEET)


def forward_table(profile: Profile, box: Box, grade: int = 0) -> ForwardTable:
    """Return the table of a profile, or `NO_TABLE` if it would need too many terms.

    A grade of 1 or 2 is a fine table. It has more terms, and smaller ranges of ψ1 and of the force, the smallest for 2,
    except that rods curved backward touch at larger ψ1: it holds rods of strong and uneven curvature, and costs more.
    """
    middle = Box(*((0.5 * (low + high),) * 2 for low, high in box))
    table = NO_TABLE
    for each in dict.fromkeys((middle, box)):  # a single rod tells soon where terms are too few for all
        table = _tabulated(profile, each, grade)
        if _errors(profile, table).max() > _WORST:
            return NO_TABLE
    return table


def _tabulated(profile: Profile, box: Box, grade: int) -> ForwardTable:
    rows, low, high, most = _ROWS, -box.friction_angle[1] - _BELOW, _PSI1, _FORCE
    if grade:
        rows, low, high = _MOST_ROWS, -box.friction_angle[1] - _FINE_BELOW, _FINE_PSI1
        most = _FINE_FORCES[grade - 1]
    span = math.log1p(most / _SCALE)
    wide = box.friction_angle[1] - box.friction_angle[0] > _BOTH
    counts = _OUTER_OF_BOTH if wide else _OUTER
    shares = [chebyshev.nodes(n if end > begin else 1) for n, (begin, end) in zip(counts, box, strict=True)]
    tapers, bends, deltas = (begin + (end - begin) * z for z, (begin, end) in zip(shares, box, strict=True))
    outer = tapers.size, bends.size, deltas.size
    slenderness = _slenderness(profile)
    ways, loading = chebyshev.nodes(rows), np.concatenate([[0.0], chebyshev.nodes(_TERMS - 1)])
    forces = _SCALE * np.expm1(span * loading)
    tip, tangential = np.empty((2, *outer[:2], rows, _TERMS, 3)), np.empty((2, *outer, 2, rows, _TERMS, 3))
    chord, distances = np.empty((2, outer[1], 3, _TERMS)), chebyshev.nodes(_TERMS)
    psi1, at_tip = low + (high - low) * ways, np.ones(rows)
    rods = list(product(enumerate((1.0, -1.0)), enumerate(bends), enumerate(tapers)))

    def write(part: slice) -> None:
        work = workspace()
        for (i, sign), (b, bend), (a, taper) in rods[part]:
            rod = profile._replace(taper=taper, bend=bend, sign=sign)
            _write_poses(rod, psi1, at_tip, forces, slenderness, work, tip[i, a, b])
            for (d, delta), k in product(enumerate(deltas), range(2)):
                lengths, out = (1.0 + _BEYOND * (1.0 - taper) * ways if k else ways), tangential[i, a, b, d, k]
                _write_poses(rod, -delta * at_tip, lengths, forces, slenderness, work, out)
                out[..., :2] /= lengths[:, None, None]
            if a == 0:  # the rod at rest does not depend on the taper
                _write_chords(rod, distances, work, chord[i, b])

    in_parts(write, len(rods), 1)
    felt = np.where(forces > 0.0, forces < _THRUST, _AT_ONSET)[:, None]
    return ForwardTable(
        _phase(tip[:, :, :, None], felt, loading),
        _phase(tangential[..., 0, :, :, :], felt, loading),
        _phase(tangential[..., 1, :, :, :], felt, loading),
        _terms(chord[:, None, :, None, None], _AT_ONSET, (-1, distances)),
        np.array(box, dtype=float),
        slenderness,
        (low, high),
        span,
    )


def _terms(values: Floats, relevance: Floats | float, *inner: tuple[int, Floats]) -> Terms:
    """Terms from values at nodes, those in taper, bend and friction angle along the axes after the first."""
    for axis in (1, 2, 3):
        values = np.moveaxis(chebyshev.coefficients(np.moveaxis(values, axis, -1)), 0, axis)
    size = (relevance * np.abs(values)).max(axis=(0, 4, 5, 6))
    orders = np.ascontiguousarray(np.argwhere(size > _NEGLIGIBLE))
    for axis, points in inner:
        fit = np.linalg.inv(np.vander(2.0 * points - 1.0, increasing=True))
        values = np.moveaxis(np.tensordot(fit, values, (1, axis)), 0, axis)
    coefficients = values.reshape(*values.shape[:4], -1, _COLUMNS)
    return Terms(orders, np.ascontiguousarray(coefficients[:, *orders.T]))


def _phase(values: Floats, relevance: Floats, loading: Floats) -> Terms:
    """Terms of a phase, from as few nodes in ψ1 or s1, along the axis −3, as leave out negligible terms only."""
    coefficients = chebyshev.coefficients(np.moveaxis(values, -3, -1))
    needed = (np.maximum(relevance, 1.0) * np.abs(coefficients)).max(axis=(1, 2, 3, 4, 5, 6)) > _NEGLIGIBLE
    count = min(-(-(1 + np.flatnonzero(needed)[-1]) // _GROUP) * _GROUP, needed.size)
    nodes = chebyshev.nodes(count)
    few = np.moveaxis(np.tensordot(chebyshev.polynomials(count, nodes), coefficients[:count], 1), 0, -3)
    return _terms(few, relevance, (-3, nodes), (-2, loading))


def _slenderness(profile: Profile) -> float:
    """Λ(1) without the taper, to a few digits: it scales the force, no more."""
    s = np.linspace(0.0, 1.0, 201)
    cell = np.searchsorted(profile.edges[1:-1], s, side="right")
    rigidity = np.array(
        [np.polyval(profile.rigidity[c, ::-1], at - profile.edges[c]) for c, at in zip(cell, s, strict=True)]
    )
    return float(np.mean(rigidity**-0.5))


@compiled
def _length(slenderness: float, taper: float, arclength: float) -> tuple[float, float]:
    """Λ, and its derivative by the arc length."""
    if arclength > 1.0:
        rate = slenderness / ((1.0 - taper) * (1.0 - taper))
        return slenderness / (1.0 - taper) + (arclength - 1.0) * rate, rate
    width = 1.0 - taper * arclength
    return slenderness * arclength / width, slenderness / (width * width)


@cached
def _write_poses(
    profile: Profile,
    psi1: Floats,
    arclengths: Floats,
    forces: Floats,
    slenderness: float,
    work: Floats,
    out: Floats,
) -> None:
    for i in range(psi1.size):
        length = _length(slenderness, profile.taper, arclengths[i])[0]
        for k in range(forces.size):
            here = pose_along(profile, psi1[i], arclengths[i], forces[k] / (length * length), work)
            out[i, k, 0], out[i, k, 1], out[i, k, 2] = here.u, here.v, here.turn


@cached
def _write_chords(profile: Profile, distances: Floats, work: Floats, out: Floats) -> None:
    reach = rest_along(profile, 0.0, 1.0, work).distance
    for k in range(distances.size):
        found = chord_along(profile, 0.0, distances[k] * reach, work)
        out[0, k], out[1, k], out[2, k] = found.arclength, found.bearing, found.slope


@compiled
def _is_prepared(table: ForwardTable, profile: Profile, friction_angle: float, own: Any) -> bool:
    """True if the coefficients of a rod are there."""
    low, high = table.psi1
    if not (own.least_psi1 == low and own.most_psi1 == high and own.span == table.span and own.sign == profile.sign):
        return False
    return own.taper == profile.taper and own.bend == profile.bend and own.friction_angle == friction_angle


@compiled
def prepare(table: ForwardTable, profile: Profile, friction_angle: float, sheet: NDArray[np.void]) -> bool:
    """Write the coefficients of one rod, unless they are there, and return False if the table does not hold it."""
    own, box, values = sheet[0], table.box, (profile.taper, profile.bend, friction_angle)
    if _is_prepared(table, profile, friction_angle, own):
        return True
    for c in range(3):
        if not box[c, 0] - _ROUNDING <= values[c] <= box[c, 1] + _ROUNDING:
            return False
    for c in range(3):
        x = (2.0 * values[c] - box[c, 0] - box[c, 1]) / (box[c, 1] - box[c, 0]) if box[c, 1] > box[c, 0] else 0.0
        own.outer[c, 0], own.outer[c, 1] = 1.0, x
        for k in range(2, _MOST):
            own.outer[c, k] = 2.0 * x * own.outer[c, k - 1] - own.outer[c, k - 2]
    own.least_psi1, own.most_psi1 = table.psi1
    own.span, own.sign, own.friction_angle = table.span, profile.sign, friction_angle
    own.taper, own.bend = profile.taper, profile.bend
    mirrored = 0 if profile.sign > 0.0 else 1
    for k, phase in enumerate((table.tip, table.tangential, table.beyond)):
        own.rows[k] = phase.coefficients.shape[2]
        _contract(phase, mirrored, own.outer, own.phases[k])
    _contract(table.chord, mirrored, own.outer, own.at_rest[0])
    _contract(table.chord, 1 - mirrored, own.outer, own.at_rest[1])
    _write_parts(profile, sheet)
    return True


@compiled
def _write_parts(profile: Profile, sheet: NDArray[np.void]) -> None:
    """Write the turn of the rod at rest, by Simpson's rule, and its pliance."""
    own = sheet[0]
    turn, pliance = own.turn, own.pliance
    width, before = 1.0 / _HALVES, rest_curvature_at(profile, cell_at(profile, 1.0, BACKWARD), 1.0)
    turn[0], most = 0.0, 0.0
    for k in range(_HALVES + 1):
        s = 1.0 - k * width
        cell = cell_at(profile, s, BACKWARD)
        pliance[k] = 1.0 / rigidity_at(profile, cell, s)
        most = max(pliance[k], most)
        if k > 0:
            here, middle = rest_curvature_at(profile, cell, s), s + 0.5 * width
            between = rest_curvature_at(profile, cell_at(profile, middle, BACKWARD), middle)
            turn[k] = turn[k - 1] + (before + 4.0 * between + here) * width / 6.0
            before = here
    own.most_pliance = most


@compiled
def _contract(terms: Terms, mirrored: int, outer: Floats, out: Floats) -> None:
    """Write the sum over taper, bend and friction angle, from their polynomials."""
    orders, coefficients = terms.orders, terms.coefficients
    rows = coefficients.shape[2]
    out[:rows] = 0.0
    for k in range(orders.shape[0]):
        weight = outer[0, orders[k, 0]] * outer[1, orders[k, 1]] * outer[2, orders[k, 2]]
        for i in range(rows):
            for j in range(_COLUMNS):
                out[i, j] += weight * coefficients[mirrored, k, i, j]


@compiled
def pose_in(
    sheet: NDArray[np.void], slenderness: float, taper: float, psi1: float, arclength: float, force: float, tip: bool
) -> tuple[bool, Pose, Pose, Pose]:
    """True if there is a pose; the pose, and its derivatives by ψ1 or the arc length, and by the force."""
    length, rate = _length(slenderness, taper, arclength)
    own = sheet[0]
    scaled, span = force * length * length, own.span
    z, by_scaled = 2.0 / span * math.log1p(scaled / _SCALE) - 1.0, 2.0 / (span * (_SCALE + scaled))
    phase, begin, by_x, at = 1, 0.0, 2.0, arclength
    if tip:
        phase, begin, at = 0, own.least_psi1, psi1
        by_x = 2.0 / (own.most_psi1 - begin)
    elif arclength > 1.0:
        phase, begin, by_x = 2, 1.0, 2.0 / (_BEYOND * (1.0 - taper))
    x, by_force = (at - begin) * by_x - 1.0, by_scaled * length * length
    inside = -1.0 <= x <= 1.0 and z <= 1.0
    here, in_x, in_z = _sums(own.phases[phase], own.rows[phase], x, z, own.sums)
    if tip:
        return inside, here, _times(by_x, in_x), _times(by_force, in_z)
    by_s = 2.0 * by_scaled * force * length * rate
    in_s = Pose(by_x * in_x.u + by_s * in_z.u, by_x * in_x.v + by_s * in_z.v, by_x * in_x.turn + by_s * in_z.turn)
    return (
        inside,
        _stretched(arclength, here),
        Pose(here.u + arclength * in_s.u, here.v + arclength * in_s.v, in_s.turn),
        _times(by_force, _stretched(arclength, in_z)),
    )


@compiled
def is_far(slenderness: float, taper: float, arclength: float, force: float) -> bool:
    """True if f Λ² is more than twice the largest one of any table."""
    length, _ = _length(slenderness, taper, arclength)
    return force * length * length > 2.0 * _FORCE


@compiled
def _times(factor: float, pose: Pose) -> Pose:
    return Pose(factor * pose.u, factor * pose.v, factor * pose.turn)


@compiled
def _stretched(factor: float, pose: Pose) -> Pose:
    return Pose(factor * pose.u, factor * pose.v, pose.turn)


@compiled
def _sums(rows: Floats, count: int, x: float, z: float, room: Floats) -> tuple[Pose, Pose, Pose]:
    """Three polynomials in two variables, and their derivatives."""
    at, by, square, power, before = room[0], room[1], x * x, 1.0, 0.0
    for j in range(_COLUMNS):
        at[j], by[j] = 0.0, 0.0
    for i in range(0, count, _GROUP):
        power_1, power_2, power_3 = power * x, power * square, power * square * x
        by_0, by_1, by_2, by_3 = i * before, (i + 1) * power, (i + 2) * power_1, (i + 3) * power_2
        row_0, row_1, row_2, row_3 = rows[i], rows[i + 1], rows[i + 2], rows[i + 3]
        for j in range(_COLUMNS):  # several at a time, and nothing stored before all is loaded
            c_0, c_1, c_2, c_3 = row_0[j], row_1[j], row_2[j], row_3[j]
            value = at[j] + (power * c_0 + power_1 * c_1 + power_2 * c_2 + power_3 * c_3)
            slope = by[j] + (by_0 * c_0 + by_1 * c_1 + by_2 * c_2 + by_3 * c_3)
            at[j], by[j] = value, slope
        power, before = power_2 * square, power_3
    u, v, turn, u_x, v_x, turn_x, u_z, v_z, turn_z = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for j in range(_COLUMNS - 3, -1, -3):
        u_z, v_z, turn_z = u_z * z + u, v_z * z + v, turn_z * z + turn
        u, v, turn = u * z + at[j], v * z + at[j + 1], turn * z + at[j + 2]
        u_x, v_x = u_x * z + by[j], v_x * z + by[j + 1]
        turn_x = turn_x * z + by[j + 2]
    return Pose(u, v, turn), Pose(u_x, v_x, turn_x), Pose(u_z, v_z, turn_z)


@compiled
def has_parts(sheet: NDArray[np.void], force: float) -> bool:
    """True if `part_in` holds under a force."""
    return _is_fine(sheet, force, _STEPS)


@compiled
def _is_fine(sheet: NDArray[np.void], force: float, steps: int) -> bool:
    """True if steps of this number in a part are short enough."""
    return force * sheet[0].most_pliance <= _MOST_BENT * (PARTS * steps) ** 2


@compiled
def part_in(sheet: NDArray[np.void], psi1: float, force: float, part: int, before: State) -> State:
    """State of a rod in tip contact at the end of a part, as seen from the tip, from that at its beginning.

    Parts are counted from the tip. In place of P stands the turn by which the force has bent the rod. Steps of the
    classical Runge–Kutta method lead over a part, with errors of 4e-4 [L] at most.
    """
    turn, pliance, steps = sheet[0].turn, sheet[0].pliance, 1
    while steps < _STEPS and not _is_fine(sheet, force, steps):
        steps *= 2
    h, half, k = 1.0 / (PARTS * steps), _STEPS // steps, 2 * _STEPS * (part - 1)
    psi, bent, u, v = before
    for _ in range(steps):
        cos_1, sin_1, rate_1 = math.cos(psi), math.sin(psi), force * u * pliance[k]
        k += half
        psi_2 = psi1 - turn[k] + bent + 0.5 * h * rate_1
        cos_2, sin_2, rate_2 = math.cos(psi_2), math.sin(psi_2), force * (u + 0.5 * h * cos_1) * pliance[k]
        psi_3 = psi1 - turn[k] + bent + 0.5 * h * rate_2
        cos_3, sin_3, rate_3 = math.cos(psi_3), math.sin(psi_3), force * (u + 0.5 * h * cos_2) * pliance[k]
        k += half
        psi_4 = psi1 - turn[k] + bent + h * rate_3
        cos_4, sin_4, rate_4 = math.cos(psi_4), math.sin(psi_4), force * (u + h * cos_3) * pliance[k]
        bent += h / 6.0 * (rate_1 + 2.0 * (rate_2 + rate_3) + rate_4)
        u += h / 6.0 * (cos_1 + 2.0 * (cos_2 + cos_3) + cos_4)
        v += h / 6.0 * (sin_1 + 2.0 * (sin_2 + sin_3) + sin_4)
        psi = psi1 - turn[k] + bent
    return State(psi, bent, u, v)


@compiled
def chord_in(sheet: NDArray[np.void], mirrored: bool, reach: float, distance: float) -> RestChord:
    """Chord of a rod or its mirror image at rest, continued beyond its tip as an arc.

    There its angle to the rod is exact, and the arc length good enough for a point beside the tip.
    """
    row = sheet[0].at_rest[1 if mirrored else 0, 0]
    x = 2.0 * min(distance / reach, 1.0) - 1.0
    arclength, bearing, slope, to_bearing, to_slope = 0.0, 0.0, 0.0, 0.0, 0.0
    for k in range(_TERMS - 1, -1, -1):
        to_bearing, to_slope = to_bearing * x + bearing, to_slope * x + slope
        arclength = arclength * x + row[k]
        bearing = bearing * x + row[_TERMS + k]
        slope = slope * x + row[2 * _TERMS + k]
    at_point = slope - bearing
    rate = 2.0 / reach * (to_slope - to_bearing)
    if distance <= reach:
        return RestChord(arclength, bearing, at_point, rate)
    # The lever r sin(angle) of an arc grows by its curvature times r.
    curvature = rate * math.cos(at_point) + math.sin(at_point) / reach
    lever = reach * math.sin(at_point) + 0.5 * curvature * (distance * distance - reach * reach)
    sine = min(max(lever / distance, -1.0), 1.0)
    cos = math.sqrt((1.0 - sine) * (1.0 + sine))
    beyond, angle = (distance - reach) / math.cos(at_point), math.asin(sine)
    rate = (curvature - sine / distance) / cos if cos > _ACROSS else 0.0
    return RestChord(arclength + beyond, slope + curvature * beyond - angle, angle, rate)


@cached
def _write_errors(
    profile: Profile, table: ForwardTable, samples: Floats, work: Floats, sheet: NDArray[np.void], out: Floats
) -> None:
    """Write the errors of the pose at points of all dimensions, given as shares, for contacts before the thrust, or of
    the chord of the rod at rest, if they are larger."""
    box, at = table.box, samples
    for k in range(samples.shape[0]):
        taper = box[0, 0] + at[k, 0] * (box[0, 1] - box[0, 0])
        bend = box[1, 0] + at[k, 1] * (box[1, 1] - box[1, 0])
        delta = box[2, 0] + at[k, 2] * (box[2, 1] - box[2, 0])
        sign, tip = (1.0 if at[k, 3] < 0.5 else -1.0), at[k, 4] < 0.5
        rod = Profile(profile.edges, profile.curvature, profile.rigidity, taper, bend, sign)
        psi1, arclength = (at[k, 5] * (table.psi1[1] + delta) - delta, 1.0) if tip else (-delta, at[k, 5])
        length = _length(table.slenderness, taper, arclength)[0]
        force = _SCALE * math.expm1(table.span * at[k, 6]) / (length * length)
        exact = pose_along(rod, psi1, arclength, force, work)
        prepare(table, rod, delta, sheet)
        _, found, _, _ = pose_in(sheet, table.slenderness, taper, psi1, arclength, force, tip)
        out[k] = max(abs(found.u - exact.u), abs(found.v - exact.v)) / arclength
        out[k] = max(out[k], abs(found.turn - exact.turn))
        if exact.u < 0.0:
            out[k] = 0.0
        reach = rest_along(rod, 0.0, 1.0, work).distance
        # Mostly near the tip, where a curved rod may lie across its chord.
        distance = (1.0 - at[k, 5] * at[k, 5]) * reach
        chord, known = chord_along(rod, 0.0, distance, work), chord_in(sheet, False, reach, distance)
        out[k] = max(out[k], abs(known.arclength - chord.arclength), abs(known.at_base - chord.bearing))


def _errors(profile: Profile, table: ForwardTable) -> Floats:
    out = np.empty(_CHECKS)
    _write_errors(profile, table, np.random.default_rng(0).uniform(size=(_CHECKS, 7)), workspace(), sheet(), out)
    return out
