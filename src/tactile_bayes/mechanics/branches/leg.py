"""Legs: parts of a branch of equilibria that are short enough for series.

A leg begins at an equilibrium and goes along the tangent there. Planes across the tangent cut the branch at the nodes
of Chebyshev series of loads, contact and travel (numerical continuation by pseudo-arc length, Keller 1977). A position
on a leg ("way") is a number from 0 to 1; one above 1 is beyond the leg.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import cache
from typing import NamedTuple

import numpy as np

from tactile_bayes.arrays import Floats
from tactile_bayes.mechanics.branches.equilibrium import SETTLED, Balance, Rates, balance, settle, unloaded
from tactile_bayes.mechanics.branches.line import is_rotation
from tactile_bayes.mechanics.branches.outline import place
from tactile_bayes.mechanics.branches.phase import slides, slips_clearly
from tactile_bayes.mechanics.branches.scene import (
    Equilibrium,
    Scene,
    dot,
    less,
    times,
)
from tactile_bayes.mechanics.branches.series import two_values, weighted
from tactile_bayes.mechanics.compiler import compiled
from tactile_bayes.numerics import chebyshev

# Weights of q and f in the length of a leg, the last if the base is carried. Away from first contact all is smooth in
# p, where it is monotone: five times these weights, or a fifth, change the Newton steps of likelihoods by 12 %.
_BY_ROD, _BY_FORCE, _BY_FORCE_ON_LINE = 0.2, 0.03, 0.3
# First distance at which a tangent is compared, in p, how often it is divided by ten, and turn of the force there that
# is small enough [rad].
_BESIDE, _MOST_BESIDE, _LITTLE = 1e-3, 7, 0.1
# Change of p over that of f below which a contact that sticks is followed by f, which may pass a maximum.
_HARDLY_TURNS = 0.05
NUDGE = 1e-9  # distance beyond a knot of the contour, in its parameter, at which it is smooth
# Force from which a contact that sticks is extrapolated to none, over that of a leg: rounding leaves 1e-11 rad of its
# direction.
HARDLY = 1e-5
_COARSE = 1e-5  # last step to a node where noise hides what is finer, and the rod clearly slides
# Rows of series after the three loads: the coordinate q of the rod, the contour's parameter, the travel (in a rotation
# the drive angle), and its derivative.
REST, PLACE, ANGLE, RATE = 3, 4, 5, 6


class Accuracy(NamedTuple):
    """Accuracy of a path."""

    tolerance: Floats  # tolerated errors of moment and forces [EI/L and EI/L²], shape (3,)
    resolved: float  # tolerated error of an interpolant, as a share of the change of the travel on a leg
    sharp: float  # tolerated error of the travel of an event [rad]
    halvings: int  # largest number of halvings of a leg; a singularity at its end exhausts them
    first_step: float  # Newton step, as a share of the bracket, at which the search for first contact ends
    last_step: float  # Newton step, as a share of the bracket, at which searches on a leg end
    polished: bool  # true if states at drive angles are solved for, and not taken from the series
    exact: bool  # true if events are computed to rounding


class Leg(NamedTuple):
    """A part of a branch, and the planes that cut it: normal · (z − begin) = way, from 0 to 1, for z = (p, q, f)."""

    begin: Equilibrium
    along: Equilibrium  # change of the coordinates along the tangent at the beginning; its product with the normal is 1
    normal: Equilibrium


class LegSeries(NamedTuple):
    """Workspace for the series of a leg, from values and derivatives at half as many nodes."""

    accuracy: Accuracy
    nodes: Floats  # positions from 0 to 1: legs have their ends in common
    # Weights of values and derivatives at the beginning and the last nodes in an extrapolation to the next node, shape
    # (nodes, 6).
    onward: Floats
    fit: Floats  # coefficients of the series of which one value or derivative is 1 and all others are 0, a row each
    slopes: Floats  # coefficients of the derivative of each polynomial, a row each
    grid: Floats  # positions at which signs are checked
    on_grid: Floats  # values of each polynomial there
    at_nodes: Floats  # values of the series at the nodes, and then their derivatives, shape (6, order)
    series: Floats  # shape (7, order)
    slope: Floats  # derivative of one of them, where it is wanted
    sampled: Floats  # values on the grid


def leg_series(accuracy: Accuracy, order: int) -> LegSeries:
    """Workspace for series of an even number of terms."""
    grid = np.linspace(0.0, 1.0, 2 * order + 1)
    series = np.zeros((6, order)), np.zeros((7, order)), np.zeros(order)
    return LegSeries(accuracy, *_weights(order), grid, chebyshev.basis(order, grid), *series, np.zeros(grid.size))


@cache
def _weights(order: int) -> tuple[Floats, Floats, Floats, Floats]:
    """Nodes, and the weights `onward`, `fit` and `slopes`, which compiled code only reads."""
    nodes, unit = 0.5 - 0.5 * np.cos(np.linspace(0.0, np.pi, order // 2)), np.eye(order)
    slopes = np.vstack([chebyshev.derivative(unit), np.zeros(order)])
    at_nodes = chebyshev.polynomials(order, nodes)
    fit = np.ascontiguousarray(np.linalg.inv(np.vstack([at_nodes, at_nodes @ slopes])).T)
    return nodes, _onward(nodes), fit, np.ascontiguousarray(slopes.T)


def _onward(nodes: Floats) -> Floats:
    """Weights of the three points before each node, the nearest first: all values, then all derivatives."""
    weights = np.zeros((nodes.size, 6))
    for k in range(1, nodes.size):
        last = nodes[max(k - 3, 0) : k][::-1] - nodes[k]
        powers = np.arange(2 * last.size)
        values = last[:, None] ** powers
        slopes = powers * last[:, None] ** np.maximum(powers - 1, 0)
        found = np.linalg.solve(np.vstack([values, slopes]).T, np.eye(powers.size)[:, 0])
        weights[k, : last.size], weights[k, 3 : 3 + last.size] = found[: last.size], found[last.size :]
    return weights


@compiled
def leg_from(scene: Scene, begin: Balance, onward: Equilibrium, length: float) -> Leg:
    """Leg from an equilibrium in the sense of a direction. Its length is measured in the way and turn of the contact on
    the contour, in q, and in f over 1 + f; where the contact sticks, in about the turn of the force."""
    tangent, loading = begin.tangent, 1.0 + begin.at.force
    if slides(scene.phase):
        spot = place(scene.outline, begin.at.p + math.copysign(NUDGE, onward.p))
        by_p = spot.speed * spot.speed + spot.bend * spot.bend
        by_force = _BY_FORCE if is_rotation(scene.line) else _BY_FORCE_ON_LINE
        across = Equilibrium(by_p * tangent.p, _BY_ROD * tangent.q, by_force * tangent.force / (loading * loading))
    else:
        across = _fastest(scene, begin)
    size = length / math.sqrt(dot(across, tangent))
    if dot(across if slides(scene.phase) else tangent, onward) < 0.0:
        size = -size
    along = times(size, tangent)
    scale = 1.0 / (size * dot(across, tangent))
    return Leg(begin.at, along, times(scale, across))


@compiled
def _fastest(scene: Scene, begin: Balance) -> Equilibrium:
    """Direction across which a contact that sticks is followed: of that coordinate which changes most. A rod that
    hardly yields along itself turns the force through the cone at once, and at the edge, where the slip has vanished,
    that begins with the square of p."""
    tangent, force = begin.tangent, begin.tangent.force / (1.0 + begin.at.force)
    if abs(tangent.q) > max(abs(tangent.p), abs(force)):
        return Equilibrium(0.0, tangent.q, 0.0)
    by_p = abs(tangent.p) > _HARDLY_TURNS * abs(force)
    change = tangent.p if by_p else force
    weight = max(0.5 * _bend(scene, begin, change, by_p), 1.0)
    if by_p:
        return Equilibrium(weight * change, 0.0, 0.0)
    return Equilibrium(0.0, 0.0, weight * change / (1.0 + begin.at.force))


@compiled
def _bend(scene: Scene, begin: Balance, change: float, by_p: bool) -> float:
    """Second derivative of the force's direction by p, or by f over 1 + f, at the beginning of a leg, from the tangent
    beside it."""
    at, tangent, step, bend = begin.at, begin.tangent, _BESIDE, 0.0
    for _ in range(_MOST_BESIDE):
        share = step / change
        there = Equilibrium(at.p + share * tangent.p, at.q + share * tangent.q, at.force + share * tangent.force)
        beside = balance(scene, there)[0].tangent
        slope = beside.q / (beside.p if by_p else beside.force / (1.0 + at.force))
        bend = abs(slope - tangent.q / change) / step
        if not bend * step * step > _LITTLE:
            break
        step *= 0.1
    return bend


@compiled
def shortened(leg: Leg, share: float) -> Leg:
    """First part of a leg."""
    normal = leg.normal
    across = Equilibrium(normal.p / share, normal.q / share, normal.force / share)
    return Leg(leg.begin, times(share, leg.along), across)


@compiled
def share_of(leg: Leg, found: Balance) -> float:
    """Position on a leg."""
    return dot(leg.normal, less(found.at, leg.begin))


@compiled
def settle_on(scene: Scene, leg: Leg, way: float, start: Equilibrium, settled: float) -> Balance:
    """Equilibrium at a position on a leg; tangent and rates are derivatives by the position."""
    return _by_way(leg, settle(scene, start, leg.begin, leg.normal, way, settled))


@compiled
def _by_way(leg: Leg, found: Balance) -> Balance:
    """Equilibrium with tangent and rates by the position on a leg."""
    at, travel, moment, force_x, force_y, tangent, rates = found
    scale = 1.0 / dot(leg.normal, tangent)
    by_way = Rates(scale * rates.travel, scale * rates.moment, scale * rates.x, scale * rates.y)
    return Balance(at, travel, moment, force_x, force_y, times(scale, tangent), by_way)


@compiled
def _combined(weights: Sequence[float] | Floats, found: Balance, old: Balance, older: Balance) -> Equilibrium:
    """Extrapolation from three equilibria, the last one first, with weights of values and tangents."""
    a, b, c, d, e, f = weights[0], weights[1], weights[2], weights[3], weights[4], weights[5]
    one, two, three = found.at, old.at, older.at
    u, v, w = found.tangent, old.tangent, older.tangent
    return Equilibrium(
        a * one.p + b * two.p + c * three.p + d * u.p + e * v.p + f * w.p,
        a * one.q + b * two.q + c * three.q + d * u.q + e * v.q + f * w.q,
        a * one.force + b * two.force + c * three.force + d * u.force + e * v.force + f * w.force,
    )


@compiled
def _cubic(leg: Leg, found: Balance, before: Balance, way: float) -> Equilibrium:
    """Cubic through the beginning of a leg and an equilibrium before it, with their tangents, at a position."""
    h = dot(leg.normal, less(found.at, before.at))
    t, scale = way / h, h / dot(leg.normal, before.tangent)
    old = t * t * (3.0 + 2.0 * t)
    weights = (1.0 - old, old, 0.0, way * (1.0 + t) * (1.0 + t), scale * t * t * (1.0 + t), 0.0)
    return _combined(weights, found, before, before)


@compiled
def guess(work: LegSeries, way: float) -> Equilibrium:
    """Equilibrium at a position, from the series."""
    p, q = two_values(work.series[PLACE], work.series[REST], way)
    force_x, force_y = two_values(work.series[1], work.series[2], way)
    return Equilibrium(p, q, math.hypot(force_x, force_y))


@compiled
def sample_leg(
    scene: Scene, leg: Leg, begin: Balance, before: Balance, known: float, is_released: bool, work: LegSeries
) -> tuple[bool, Balance, Balance]:
    """Fit the series of a leg, unless the branch does not cut all planes, and return the equilibria at its last nodes.
    The search at a node starts from a polynomial through the nodes before it. If the series of a longer leg in the same
    direction are at hand, of which this is the share `known` > 0, it starts from these. At the end of one that is
    released there is no force."""
    at_nodes, half = work.at_nodes, work.nodes.size
    usual = max(SETTLED, 0.1 * work.accuracy.last_step)
    found = _by_way(leg, begin)
    old, older = found, found
    for k in range(half):
        if k > 0:
            if known > 0.0:
                start = guess(work, known * work.nodes[k])
            elif k > 1 or not math.isfinite(before.at.p):
                start = _combined(work.onward[k], found, old, older)
            else:
                start = _cubic(leg, found, before, work.nodes[k])
            older, old = old, found
            if is_released and k == half - 1 and not slides(scene.phase):
                found = _by_way(leg, unloaded(scene, start, HARDLY * leg.begin.force))
            else:
                is_clear = not work.accuracy.exact and slips_clearly(scene, found.at, found.tangent)
                found = settle_on(scene, leg, work.nodes[k], start, _COARSE if is_clear else usual)
            if not math.isfinite(found.travel):
                return False, begin, before
        at_nodes[0, k], at_nodes[0, half + k] = found.holding_moment, found.rates.moment
        at_nodes[1, k], at_nodes[1, half + k] = found.force_x, found.rates.x
        at_nodes[2, k], at_nodes[2, half + k] = found.force_y, found.rates.y
        at_nodes[REST, k], at_nodes[REST, half + k] = found.at.q, found.tangent.q
        at_nodes[PLACE, k], at_nodes[PLACE, half + k] = found.at.p, found.tangent.p
        at_nodes[ANGLE, k], at_nodes[ANGLE, half + k] = found.travel, found.rates.travel
    for c in range(RATE):
        weighted(work.fit, at_nodes[c], work.series[c])
    return True, found, old
