"""The pose of rods whose properties vary along them, as polynomials, for likelihoods.

All rods of a likelihood have one profile. Its table holds their pose, as seen from where they begin, as polynomials in

    tip contact:         ψ1 and f Λ(1)²,
    tangential contact:  s1 and f Λ(s1)², up to the tip, and beyond it: the last series of a phase may go on there,

with the length Λ(s) = ∫ EI^(−1/2) ds of a uniform rod that bends as much; and in those of taper, addition to the rest
curvature, friction angle, and amplitudes of the modes of the rest curvature that vary between the rods. These are the
same throughout a sweep, and contracted once.

Polynomials interpolate at Chebyshev nodes and at f = 0: there the deficit of the chord, from which the force follows,
is of second order, and an error in it would be one of its square root in the force. They are not extrapolated.
"""

from __future__ import annotations

import math
from itertools import combinations, product
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tactile_bayes.arrays import Floats, Index
from tactile_bayes.mechanics.compiler import cached, compiled
from tactile_bayes.mechanics.poses.profile_pose import pose_along
from tactile_bayes.mechanics.poses.sheet import (
    BEYOND,
    COLUMNS,
    GROUP,
    MOST_FORCE,
    MOST_NODES,
    MOST_ROWS,
    SCALE,
    TERMS,
    length_of,
    pose_in,
    sheet,
)
from tactile_bayes.mechanics.poses.taylor import workspace, write_shape
from tactile_bayes.mechanics.rods.profile import MOST_MODES, Profile
from tactile_bayes.numerics import chebyshev
from tactile_bayes.tasks import in_parts

_WORST = 1e-5  # largest error of the pose with which a table is of use
_OUTER = 5, 5, 7  # nodes in a taper, bend and friction angle that vary
# Powers of the amplitudes of modes, along `ForwardTable.axes` and over the largest: up to four of the first, and two of
# the others.
_POWERS = np.array(
    [(i, *others) for others in product(range(3), repeat=4) if sum(others) <= 2 for i in range(5 - 2 * sum(others))],
    dtype=np.intp,
)
# Amplitudes, over the largest, at which poses are calculated for least squares.
_OTHERS = 0.7 * np.eye(MOST_MODES)[1:]
_SHAPES = np.array(
    [x * np.eye(MOST_MODES)[0] for x in (-1.0, -0.6, 0.0, 0.6, 1.0)]
    + [x * np.eye(MOST_MODES)[0] + sign * other for x in (-0.7, 0.0, 0.7) for other in _OTHERS for sign in (1.0, -1.0)]
    + [sign * one + other for one, other in combinations(_OTHERS, 2) for sign in (1.0, -1.0)]
)
_NEGLIGIBLE, _AT_ONSET = 2e-7, 100.0  # size of terms that are left out, and how much smaller it is without a force
_THRUST = 20.0  # f Λ² before which sweeps end with a thrust through the pivot; their last series may go on
_ROUNDING = 1e-12  # distance from the end of a range that counts as zero
_ALONG = np.linspace(0.0, 1.0, 201)  # points along a rod at which means over it are taken
_CHECKS = 400  # points at which the error is measured


class _Grade(NamedTuple):
    """Size and ranges of a table."""

    rows: int  # most terms in ψ1 or s1
    below: float  # largest amount of ψ1 below that of tangential contact [rad]
    psi1: float  # largest ψ1 [rad]
    force: float  # largest f Λ²


_GRADES = (_Grade(16, 0.4, 1.4, MOST_FORCE), _Grade(MOST_ROWS, 0.1, 2.4, _THRUST), _Grade(MOST_ROWS, 0.1, 2.4, 7.0))

GRADES = len(_GRADES)  # number of grades of tables


class Box(NamedTuple):
    """Ranges of what differs between the rods of a table; a range without width is a value."""

    taper: tuple[float, float]
    bend: tuple[float, float]
    friction_angle: tuple[float, float]
    shape: float = 0.0  # largest root of the sum of the squares of the amplitudes of modes


class Terms(NamedTuple):
    """Coefficients in taper, bend, friction angle and shape that are not negligible."""

    orders: Index  # orders of the Chebyshev polynomials, and of the row of `_POWERS`, shape (terms, 4)
    coefficients: Floats  # coefficients of a rod and of its mirror image, shape (2, terms, rows, columns)


class ForwardTable(NamedTuple):
    """Coefficients of all rods of a box."""

    tip: Terms  # tip contact
    tangential: Terms  # tangential contact up to the tip
    beyond: Terms  # tangential contact beyond it
    box: Floats  # least and largest taper, bend and friction angle, shape (3, 2)
    shape: float  # largest amplitudes of modes, as in `Box`
    # Axes of the amplitudes, along which a rod seen from its tip turns most, second most, …: shape (modes, modes).
    axes: Floats
    slenderness: float  # Λ(1) without the taper
    psi1: tuple[float, float]  # range of ψ1 in tip contact
    span: float  # logarithm of 1 + f Λ²/10 at the largest force


_NONE = Terms(np.zeros((0, 4), dtype=np.intp), np.zeros((2, 0, 0, 0)))

# Table without any rod.
NO_TABLE = ForwardTable(_NONE, _NONE, _NONE, np.array([[1.0, 0.0]] * 3), 0.0, np.eye(MOST_MODES), 1.0, (0.0, 1.0), 1.0)
Tables = tuple[ForwardTable, ForwardTable]  # tables of which the first that holds a rod serves it
NO_TABLES: Tables = (NO_TABLE, NO_TABLE)  # no tables


def forward_table(profile: Profile, box: Box, grade: int = 0) -> ForwardTable:
    """Return the table of a profile, or `NO_TABLE` if it would need too many terms. A grade of 1 or 2 is a fine table.
    It has more terms, and smaller ranges of ψ1 and of the force, the smallest for 2, except that rods curved backward
    touch at larger ψ1: it holds rods of strong and uneven curvature, and costs more."""
    taper, bend, friction_angle = ((0.5 * (low + high),) * 2 for low, high in box[:3])
    middle = Box(taper, bend, friction_angle)
    table = NO_TABLE
    # One rod, or one angle of friction, tell soon where terms are too few for all.
    for each in dict.fromkeys((middle, middle._replace(shape=box.shape), box)):
        table = _tabulated(profile, each, grade)
        if _errors(profile, table).max() > _WORST:
            return NO_TABLE
    return table


def _tabulated(profile: Profile, box: Box, grade: int) -> ForwardTable:
    rows, below, high, most = _GRADES[grade]
    low, span = -box.friction_angle[1] - below, math.log1p(most / SCALE)
    shares = [chebyshev.nodes(n if end > begin else 1) for n, (begin, end) in zip(_OUTER, box[:3], strict=True)]
    tapers, bends, deltas = (begin + (end - begin) * z for z, (begin, end) in zip(shares, box[:3], strict=True))
    axes = _axes(profile)
    shapes = box.shape * (_SHAPES if box.shape else _SHAPES[:1]) @ axes
    outer = tapers.size, bends.size, len(shapes), deltas.size
    slenderness = _slenderness(profile)
    ways, loading = chebyshev.nodes(rows), np.concatenate([[0.0], chebyshev.nodes(TERMS - 1)])
    forces = SCALE * np.expm1(span * loading)
    tip, tangential = np.empty((2, *outer[:3], rows, TERMS, 3)), np.empty((2, *outer, 2, rows, TERMS, 3))
    psi1 = low + (high - low) * ways
    rods = list(product(enumerate((1.0, -1.0)), enumerate(bends), enumerate(shapes), enumerate(tapers)))

    def write(part: slice) -> None:
        work = workspace()
        for (i, sign), (b, bend), (c, shape), (a, taper) in rods[part]:
            rod = profile.shaped(shape)._replace(taper=taper, bend=bend, sign=sign)
            known = psi1, ways, deltas, forces, slenderness
            _write_rod(rod, *known, work, tip[i, a, b, c], tangential[i, a, b, c])

    in_parts(write, len(rods), 1)
    felt = np.where(forces > 0.0, forces < _THRUST, _AT_ONSET)[:, None]
    return ForwardTable(
        _phase(tip[:, :, :, :, None], felt, loading),
        _phase(tangential[..., 0, :, :, :], felt, loading),
        _phase(tangential[..., 1, :, :, :], felt, loading),
        np.array(box[:3], dtype=float),
        box.shape,
        axes,
        slenderness,
        (low, high),
        span,
    )


def _terms(values: Floats, relevance: Floats | float, *inner: tuple[int, Floats]) -> Terms:
    """Terms from values at nodes, those in taper, bend, shape and friction angle along the axes after the first."""
    for axis in (1, 2, 4):
        values = np.moveaxis(chebyshev.coefficients(np.moveaxis(values, axis, -1)), 0, axis)
    if values.shape[3] > 1:
        powers = np.linalg.pinv(np.prod(_SHAPES[:, None] ** _POWERS, axis=-1))
        values = np.moveaxis(np.tensordot(powers, values, (1, 3)), 0, 3)
    values = np.moveaxis(values, 3, 4)
    size = (relevance * np.abs(values)).max(axis=(0, 5, 6, 7))
    orders = np.ascontiguousarray(np.argwhere(size > _NEGLIGIBLE))
    for axis, points in inner:
        fit = np.linalg.inv(np.vander(2.0 * points - 1.0, increasing=True))
        values = np.moveaxis(np.tensordot(fit, values, (1, axis)), 0, axis)
    coefficients = values.reshape(*values.shape[:5], -1, COLUMNS)
    return Terms(orders, np.ascontiguousarray(coefficients[:, *orders.T]))


def _phase(values: Floats, relevance: Floats, loading: Floats) -> Terms:
    """Terms of a phase, from as few nodes in ψ1 or s1, along the axis −3, as leave out negligible terms only."""
    coefficients = chebyshev.coefficients(np.moveaxis(values, -3, -1))
    needed = (np.maximum(relevance, 1.0) * np.abs(coefficients)).max(axis=tuple(range(1, 8))) > _NEGLIGIBLE
    count = min(-(-(1 + np.flatnonzero(needed)[-1]) // GROUP) * GROUP, needed.size)
    nodes = chebyshev.nodes(count)
    few = np.moveaxis(np.tensordot(chebyshev.polynomials(count, nodes), coefficients[:count], 1), 0, -3)
    return _terms(few, relevance, (-3, nodes), (-2, loading))


def _slenderness(profile: Profile) -> float:
    """Λ(1) without the taper, to a few digits: it scales the force, no more."""
    return float(np.mean(_along(profile, profile.rigidity) ** -0.5))


def _axes(profile: Profile) -> Floats:
    """The principal axes of the turns between points along the rod and its tip."""
    turns = np.zeros((_ALONG.size, MOST_MODES))
    for k, mode in enumerate(profile.modes[1:]):
        turns[:, k] = np.cumsum(_along(profile, mode)[::-1])
    return np.asarray(np.linalg.svd(turns)[2])


def _along(profile: Profile, coefficients: Floats) -> Floats:
    """Values of piecewise polynomials along a rod."""
    cells = np.searchsorted(profile.edges[1:-1], _ALONG, side="right")
    return np.array(
        [np.polyval(coefficients[c, ::-1], s - profile.edges[c]) for c, s in zip(cells, _ALONG, strict=True)]
    )


@cached
def _write_rod(
    rod: Profile,
    psi1: Floats,
    ways: Floats,
    deltas: Floats,
    forces: Floats,
    slenderness: float,
    work: Floats,
    tip: Floats,
    tangential: Floats,
) -> None:
    """Write the poses of a rod in tip contact, and in tangential contact up to the tip and beyond it."""
    for i in range(ways.size):
        _write_row(rod, psi1[i], 1.0, forces, slenderness, work, tip[i])
        for d in range(deltas.size):
            for k in range(2):
                arclength = 1.0 + BEYOND * (1.0 - rod.taper) * ways[i] if k else ways[i]
                _write_row(rod, -deltas[d], arclength, forces, slenderness, work, tangential[d, k, i])


@compiled
def _write_row(
    rod: Profile, psi1: float, arclength: float, forces: Floats, slenderness: float, work: Floats, out: Floats
) -> None:
    """Write poses under forces, u and v over the arc length."""
    length = length_of(slenderness, rod.taper, arclength)[0]
    for k in range(forces.size):
        here = pose_along(rod, psi1, arclength, forces[k] / (length * length), work)
        out[k, 0], out[k, 1], out[k, 2] = here.u / arclength, here.v / arclength, here.turn


@compiled
def _is_prepared(table: ForwardTable, profile: Profile, friction_angle: float, own: Any) -> bool:
    """True if the coefficients of a rod are there."""
    low, high = table.psi1
    if not (own.least_psi1 == low and own.most_psi1 == high and own.span == table.span and own.sign == profile.sign):
        return False
    for k in range(MOST_MODES):
        if own.shape[k] != profile.shape[k]:
            return False
    return own.taper == profile.taper and own.bend == profile.bend and own.friction_angle == friction_angle


@compiled
def _holds(table: ForwardTable, values: tuple[float, float, float], shape: Floats) -> bool:
    """True if a table holds a rod of this taper, bend, friction angle and shape."""
    square = 0.0
    for k in range(MOST_MODES):
        square += shape[k] * shape[k]
    for c in range(3):
        if not table.box[c, 0] - _ROUNDING <= values[c] <= table.box[c, 1] + _ROUNDING:
            return False
    return square <= table.shape * table.shape


@compiled
def _write_outer(table: ForwardTable, values: tuple[float, float, float], shape: Floats, outer: Floats) -> None:
    """Write polynomials in taper, bend and friction angle, and in the amplitudes of modes."""
    box = table.box
    for c in range(3):
        x = (2.0 * values[c] - box[c, 0] - box[c, 1]) / (box[c, 1] - box[c, 0]) if box[c, 1] > box[c, 0] else 0.0
        outer[c, 0], outer[c, 1] = 1.0, x
        for k in range(2, MOST_NODES):
            outer[c, k] = 2.0 * x * outer[c, k - 1] - outer[c, k - 2]
    outer[3] = 1.0
    for k in range(MOST_MODES if table.shape > 0.0 else 0):
        amplitude = 0.0
        for j in range(MOST_MODES):
            amplitude += table.axes[k, j] * shape[j] / table.shape
        for r in range(_POWERS.shape[0]):
            for _ in range(_POWERS[r, k]):
                outer[3, r] *= amplitude


@compiled
def prepare(table: ForwardTable, profile: Profile, friction_angle: float, sheet: NDArray[np.void]) -> bool:
    """Write the coefficients of one rod, unless they are there, and return False if the table does not hold it."""
    own, values = sheet[0], (profile.taper, profile.bend, friction_angle)
    if _is_prepared(table, profile, friction_angle, own):
        return True
    if not _holds(table, values, profile.shape):
        return False
    _write_outer(table, values, profile.shape, own.outer)
    for k in range(MOST_MODES):
        own.shape[k] = profile.shape[k]
    own.least_psi1, own.most_psi1 = table.psi1
    own.span, own.sign, own.friction_angle = table.span, profile.sign, friction_angle
    own.taper, own.bend = profile.taper, profile.bend
    mirrored = 0 if profile.sign > 0.0 else 1
    for k, phase in enumerate((table.tip, table.tangential, table.beyond)):
        own.rows[k] = phase.coefficients.shape[2]
        _contract(phase, mirrored, own.outer, own.phases[k])
    return True


@compiled
def _contract(terms: Terms, mirrored: int, outer: Floats, out: Floats) -> None:
    """Write the sum over taper, bend, friction angle and shape, from their polynomials."""
    orders, coefficients = terms.orders, terms.coefficients
    rows = coefficients.shape[2]
    out[:rows] = 0.0
    for k in range(orders.shape[0]):
        weight = outer[0, orders[k, 0]] * outer[1, orders[k, 1]] * outer[2, orders[k, 2]] * outer[3, orders[k, 3]]
        for i in range(rows):
            for j in range(COLUMNS):
                out[i, j] += weight * coefficients[mirrored, k, i, j]


@cached
def _write_errors(
    profile: Profile, table: ForwardTable, samples: Floats, work: Floats, sheet: NDArray[np.void], out: Floats
) -> None:
    """Write the errors of the pose at points of all dimensions, given as shares, and amplitudes of modes, for contacts
    before the thrust."""
    box, at = table.box, samples
    for k in range(samples.shape[0]):
        taper = box[0, 0] + at[k, 0] * (box[0, 1] - box[0, 0])
        bend = box[1, 0] + at[k, 1] * (box[1, 1] - box[1, 0])
        delta = box[2, 0] + at[k, 2] * (box[2, 1] - box[2, 0])
        sign, tip = (1.0 if at[k, 3] < 0.5 else -1.0), at[k, 4] < 0.5
        write_shape(profile.modes, at[k, 7:], profile.shape, profile.curvature)
        edges, curvature, rigidity, _, _, _, modes, shape = profile
        rod = Profile(edges, curvature, rigidity, taper, bend, sign, modes, shape)
        psi1, arclength = (at[k, 5] * (table.psi1[1] + delta) - delta, 1.0) if tip else (-delta, at[k, 5])
        length = length_of(table.slenderness, taper, arclength)[0]
        force = SCALE * math.expm1(table.span * at[k, 6]) / (length * length)
        exact = pose_along(rod, psi1, arclength, force, work)
        prepare(table, rod, delta, sheet)
        _, found, _, _ = pose_in(sheet, table.slenderness, taper, psi1, arclength, force, tip)
        out[k] = max(abs(found.u - exact.u), abs(found.v - exact.v)) / arclength
        out[k] = max(out[k], abs(found.turn - exact.turn))
        if exact.u < 0.0:
            out[k] = 0.0


def _errors(profile: Profile, table: ForwardTable) -> Floats:
    out, rng = np.empty(_CHECKS), np.random.default_rng(0)
    shares, ways = rng.uniform(size=(_CHECKS, 7)), rng.normal(size=(_CHECKS, MOST_MODES))
    ways *= table.shape * rng.uniform(size=(_CHECKS, 1)) / np.linalg.norm(ways, axis=1, keepdims=True)
    rod = profile.shaped(np.zeros(MOST_MODES))  # with arrays of its own
    _write_errors(rod, table, np.concatenate([shares, ways], axis=1), workspace(), sheet(), out)
    return out
