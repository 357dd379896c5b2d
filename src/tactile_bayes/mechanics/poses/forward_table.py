"""The pose of rods whose properties vary along them, as polynomials, for likelihoods.

All rods of a likelihood have one profile. Its table holds their pose, as seen from where they begin, as polynomials in

    tip contact:         ψ1 and f Λ(1)²,
    tangential contact:  s1 and f Λ(s1)², up to the tip, and beyond it: the last series of a phase may go on there,

with the length Λ(s) = ∫ EI^(−1/2) ds of a uniform rod that bends as much; and in those of taper, addition to the rest
curvature and friction angle that vary between the rods. These are the same throughout a sweep, and contracted once.
Rods whose rest curvature has modes that vary are integrated.

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
from tactile_bayes.mechanics.poses.profile_pose import pose_along
from tactile_bayes.mechanics.poses.sheet import (
    BEYOND,
    COLUMNS,
    GROUP,
    MOST_NODES,
    MOST_PSI1,
    MOST_ROWS,
    SCALE,
    SPAN,
    TERMS,
    length_of,
    pose_in,
    sheet,
)
from tactile_bayes.mechanics.poses.taylor import workspace
from tactile_bayes.mechanics.rods.profile import Profile
from tactile_bayes.numerics import chebyshev
from tactile_bayes.tasks import in_parts

_WORST = 1e-5  # largest error of the pose with which a table is of use
_OUTER = 5, 5, 7  # nodes in a taper, bend and friction angle that vary
_NEGLIGIBLE, _AT_ONSET = 2e-7, 100.0  # size of terms that are left out, and how much smaller it is without a force
_THRUST = 20.0  # f Λ² before which sweeps end with a thrust through the pivot; their last series may go on
_ROUNDING = 1e-12  # distance from the end of a range that counts as zero
_ALONG = np.linspace(0.0, 1.0, 201)  # points along a rod at which means over it are taken
_CHECKS = 400  # points at which the error is measured
_BELOW = 0.4  # largest amount of ψ1 below that of tangential contact [rad]


class Box(NamedTuple):
    """Ranges of what differs between the rods of a table; a range without width is a value."""

    taper: tuple[float, float]
    bend: tuple[float, float]
    friction_angle: tuple[float, float]


class Terms(NamedTuple):
    """Coefficients in taper, bend and friction angle that are not negligible."""

    orders: Index  # orders of the Chebyshev polynomials, shape (terms, 3)
    coefficients: Floats  # coefficients of a rod and of its mirror image, shape (2, terms, rows, columns)


class ForwardTable(NamedTuple):
    """Coefficients of all rods of a box."""

    tip: Terms  # tip contact
    tangential: Terms  # tangential contact up to the tip
    beyond: Terms  # tangential contact beyond it
    box: Floats  # least and largest taper, bend and friction angle, shape (3, 2)
    slenderness: float  # Λ(1) without the taper
    least_psi1: float  # in tip contact


_NONE = Terms(np.zeros((0, 3), dtype=np.intp), np.zeros((2, 0, 0, 0)))

# Table without any rod.
NO_TABLE = ForwardTable(_NONE, _NONE, _NONE, np.array([[1.0, 0.0]] * 3), 1.0, 0.0)
Tables = tuple[ForwardTable, ForwardTable]  # tables of which the first that holds a rod serves it
NO_TABLES: Tables = (NO_TABLE, NO_TABLE)  # no tables


def forward_table(profile: Profile, box: Box) -> ForwardTable:
    """Return the table of a profile, or `NO_TABLE` if it would need too many terms."""
    table = NO_TABLE
    # One rod tells soon where terms are too few for all.
    for each in dict.fromkeys((Box(*((0.5 * (low + high),) * 2 for low, high in box)), box)):
        table = _tabulated(profile, each)
        if _errors(profile, table).max() > _WORST:
            return NO_TABLE
    return table


def _tabulated(profile: Profile, box: Box) -> ForwardTable:
    rows, low = MOST_ROWS, -box.friction_angle[1] - _BELOW
    shares = [chebyshev.nodes(n if end > begin else 1) for n, (begin, end) in zip(_OUTER, box, strict=True)]
    tapers, bends, deltas = (begin + (end - begin) * z for z, (begin, end) in zip(shares, box, strict=True))
    slenderness = _slenderness(profile)
    ways, loading = chebyshev.nodes(rows), np.concatenate([[0.0], chebyshev.nodes(TERMS - 1)])
    forces = SCALE * np.expm1(SPAN * loading)
    outer = 2, tapers.size, bends.size
    tip, tangential = np.empty((*outer, rows, TERMS, 3)), np.empty((*outer, deltas.size, 2, rows, TERMS, 3))
    psi1 = low + (MOST_PSI1 - low) * ways
    rods = list(product(enumerate((1.0, -1.0)), enumerate(bends), enumerate(tapers)))

    def write(part: slice) -> None:
        work = workspace()
        for (i, sign), (b, bend), (a, taper) in rods[part]:
            rod = profile._replace(taper=taper, bend=bend, sign=sign)
            _write_rod(rod, psi1, ways, deltas, forces, slenderness, work, tip[i, a, b], tangential[i, a, b])

    in_parts(write, len(rods), 1)
    felt = np.where(forces > 0.0, forces < _THRUST, _AT_ONSET)[:, None]
    return ForwardTable(
        _phase(tip[:, :, :, None], felt, loading),
        _phase(tangential[..., 0, :, :, :], felt, loading),
        _phase(tangential[..., 1, :, :, :], felt, loading),
        np.array(box, dtype=float),
        slenderness,
        low,
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
    coefficients = values.reshape(*values.shape[:4], -1, COLUMNS)
    return Terms(orders, np.ascontiguousarray(coefficients[:, *orders.T]))


def _phase(values: Floats, relevance: Floats, loading: Floats) -> Terms:
    """Terms of a phase, from as few nodes in ψ1 or s1, along the axis −3, as leave out negligible terms only."""
    coefficients = chebyshev.coefficients(np.moveaxis(values, -3, -1))
    needed = (np.maximum(relevance, 1.0) * np.abs(coefficients)).max(axis=tuple(range(1, 7))) > _NEGLIGIBLE
    count = min(-(-(1 + np.flatnonzero(needed)[-1]) // GROUP) * GROUP, needed.size)
    nodes = chebyshev.nodes(count)
    few = np.moveaxis(np.tensordot(chebyshev.polynomials(count, nodes), coefficients[:count], 1), 0, -3)
    return _terms(few, relevance, (-3, nodes), (-2, loading))


def _slenderness(profile: Profile) -> float:
    """Λ(1) without the taper, to a few digits: it scales the force, no more."""
    return float(np.mean(_along(profile, profile.rigidity) ** -0.5))


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
    if not (own.least_psi1 == table.least_psi1 and own.sign == profile.sign):
        return False
    return own.taper == profile.taper and own.bend == profile.bend and own.friction_angle == friction_angle


@compiled
def _write_outer(box: Floats, values: tuple[float, float, float], outer: Floats) -> None:
    """Write polynomials in taper, bend and friction angle."""
    for c in range(3):
        x = (2.0 * values[c] - box[c, 0] - box[c, 1]) / (box[c, 1] - box[c, 0]) if box[c, 1] > box[c, 0] else 0.0
        outer[c, 0], outer[c, 1] = 1.0, x
        for k in range(2, MOST_NODES):
            outer[c, k] = 2.0 * x * outer[c, k - 1] - outer[c, k - 2]


@compiled
def prepare(table: ForwardTable, profile: Profile, friction_angle: float, sheet: NDArray[np.void]) -> bool:
    """Write the coefficients of one rod, unless they are there, and return False if the table does not hold it."""
    own, values = sheet[0], (profile.taper, profile.bend, friction_angle)
    if _is_prepared(table, profile, friction_angle, own):
        return True
    for c in range(3):
        if not table.box[c, 0] - _ROUNDING <= values[c] <= table.box[c, 1] + _ROUNDING:
            return False
    _write_outer(table.box, values, own.outer)
    own.least_psi1, own.sign, own.friction_angle = table.least_psi1, profile.sign, friction_angle
    own.taper, own.bend = profile.taper, profile.bend
    mirrored = 0 if profile.sign > 0.0 else 1
    for k, phase in enumerate((table.tip, table.tangential, table.beyond)):
        own.rows[k] = phase.coefficients.shape[2]
        _contract(phase, mirrored, own.outer, own.phases[k])
    return True


@compiled
def _contract(terms: Terms, mirrored: int, outer: Floats, out: Floats) -> None:
    """Write the sum over taper, bend and friction angle, from their polynomials."""
    orders, coefficients = terms.orders, terms.coefficients
    rows = coefficients.shape[2]
    out[:rows] = 0.0
    for k in range(orders.shape[0]):
        weight = outer[0, orders[k, 0]] * outer[1, orders[k, 1]] * outer[2, orders[k, 2]]
        for i in range(rows):
            for j in range(COLUMNS):
                out[i, j] += weight * coefficients[mirrored, k, i, j]


@cached
def _write_errors(
    profile: Profile, table: ForwardTable, samples: Floats, work: Floats, sheet: NDArray[np.void], out: Floats
) -> None:
    """Write the errors of the pose at points of all dimensions, given as shares, for contacts before the thrust."""
    box, at = table.box, samples
    for k in range(samples.shape[0]):
        taper = box[0, 0] + at[k, 0] * (box[0, 1] - box[0, 0])
        bend = box[1, 0] + at[k, 1] * (box[1, 1] - box[1, 0])
        delta = box[2, 0] + at[k, 2] * (box[2, 1] - box[2, 0])
        sign, tip = (1.0 if at[k, 3] < 0.5 else -1.0), at[k, 4] < 0.5
        edges, curvature, rigidity, _, _, _, modes, shape = profile
        rod = Profile(edges, curvature, rigidity, taper, bend, sign, modes, shape)
        psi1, arclength = (at[k, 5] * (MOST_PSI1 + delta) - delta, 1.0) if tip else (-delta, at[k, 5])
        length = length_of(table.slenderness, taper, arclength)[0]
        force = SCALE * math.expm1(SPAN * at[k, 6]) / (length * length)
        exact = pose_along(rod, psi1, arclength, force, work)
        prepare(table, rod, delta, sheet)
        _, found, _, _ = pose_in(sheet, table.slenderness, taper, psi1, arclength, force, tip)
        out[k] = max(abs(found.u - exact.u), abs(found.v - exact.v)) / arclength
        out[k] = max(out[k], abs(found.turn - exact.turn))
        if exact.u < 0.0:
            out[k] = 0.0


def _errors(profile: Profile, table: ForwardTable) -> Floats:
    out, shares = np.empty(_CHECKS), np.random.default_rng(0).uniform(size=(_CHECKS, 7))
    _write_errors(profile, table, shares, workspace(), sheet(), out)
    return out
