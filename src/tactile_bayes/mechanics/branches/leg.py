"""Legs: parts of a branch of equilibria that are short enough for series.

A leg begins at an equilibrium and goes along the tangent there. Planes across the tangent cut the branch at the nodes
of Chebyshev series of loads, contact and drive angle (numerical continuation by pseudo-arc length, Keller 1977).
"""

from __future__ import annotations

import math
from functools import cache
from typing import NamedTuple

import numpy as np

from tactile_bayes.arrays import Floats
from tactile_bayes.mechanics.branches.curves import ANGLE, REST, Curves, curves_of
from tactile_bayes.mechanics.branches.equilibrium import Balance, Equilibrium, Rates, Scene, dot, less, settle, times
from tactile_bayes.mechanics.branches.limits import Approach, touch
from tactile_bayes.mechanics.branches.outline import Outline, place
from tactile_bayes.mechanics.branches.series import value_and_slope, weighted
from tactile_bayes.mechanics.compiler import compiled
from tactile_bayes.numerics import chebyshev

__all__ = [
    "NUDGE",
    "PLACE",
    "Leg",
    "LegCurves",
    "first_equilibrium",
    "guess",
    "leg_curves",
    "leg_from",
    "sample_leg",
    "settle_on",
    "shortened",
]

_BY_ROD, _BY_FORCE, _BY_FORCE_ON_LINE = 0.2, 0.03, 0.3
"""Weights of q and f in the length of a leg, the last if the base is carried. Away from first contact all is smooth in
p, where it is monotone: the greater its weight, the fewer legs a branch has."""

NUDGE = 1e-9
"""Distance beyond a knot of the contour, in its parameter, at which it is smooth."""

PLACE = 5
"""Row of the contour's parameter at the nodes."""


class Leg(NamedTuple):
    """A part of a branch, and the planes that cut it: normal · (z − begin) = way, from 0 to 1, for z = (p, q, f)."""

    begin: Equilibrium
    along: Equilibrium
    """Change of the coordinates along the tangent at the beginning; its product with the normal is 1."""
    normal: Equilibrium


class LegCurves(NamedTuple):
    """Workspace for the series of a leg, from values and derivatives at half as many nodes."""

    curves: Curves
    """The rest of a state is the coordinate q of the rod."""
    nodes: Floats
    """Positions from 0 to 1: legs have their ends in common."""
    onward: Floats
    """Weights of values and derivatives at the beginning and the last nodes in an extrapolation to the next node, shape
    (nodes, 6)."""
    fit: Floats
    """Coefficients of the series of which one value or derivative is 1 and all others are 0, a row each."""
    at_nodes: Floats
    """Values of loads, q, drive angle and p at the nodes, and then their derivatives, shape (6, order)."""
    place: Floats
    """Coefficients of the contour's parameter p."""
    rest_slope: Floats
    """Coefficients of the derivative of q."""


def leg_curves(order: int) -> LegCurves:
    """Workspace for series of an even number of terms."""
    nodes, onward, fit = _weights(order)
    empty = np.zeros(order)
    return LegCurves(curves_of(order), nodes, onward, fit, np.zeros((6, order)), empty, empty.copy())


@cache
def _weights(order: int) -> tuple[Floats, Floats, Floats]:
    """Nodes, and the weights `onward` and `fit`, which compiled code only reads."""
    nodes, unit = 0.5 - 0.5 * np.cos(np.linspace(0.0, np.pi, order // 2)), np.eye(order)
    slopes = np.vstack([chebyshev.derivative(unit), np.zeros(order)])
    at_nodes = chebyshev.polynomials(order, nodes)
    fit = np.ascontiguousarray(np.linalg.inv(np.vstack([at_nodes, at_nodes @ slopes])).T)
    return nodes, _onward(nodes), fit


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
def first_equilibrium(scene: Scene, outline: Outline, found: Approach) -> Equilibrium:
    """Equilibrium without force at first contact with an outline relative to the base."""
    at, chord = touch(outline, scene.beam, found.begin, found.tip_first)
    if found.tip_first:
        bearing = math.atan2(at.y, at.x) if scene.line is None else math.atan2(-at.x, at.y) + 0.5 * math.pi
        psi1 = bearing + chord.at_point - math.atan2(at.sin, at.cos) - scene.rig.friction_angle
        return Equilibrium(found.begin, psi1, 0.0)
    return Equilibrium(found.begin, chord.arclength, 0.0)


@compiled
def leg_from(scene: Scene, begin: Balance, before: Equilibrium, length: float) -> Leg:
    """Leg from an equilibrium in the sense of the direction before.

    Its length is measured in the way and turn of the contact on the contour, in q, and in f over 1 + f.
    """
    spot, tangent = place(scene.outline, begin.at.p + math.copysign(NUDGE, before.p)), begin.tangent
    by_p, loading = spot.speed * spot.speed + spot.bend * spot.bend, 1.0 + begin.at.force
    by_force = _BY_FORCE if scene.line is None else _BY_FORCE_ON_LINE
    across = Equilibrium(by_p * tangent.p, _BY_ROD * tangent.q, by_force * tangent.force / (loading * loading))
    size = length / math.sqrt(dot(across, tangent))
    if dot(across, before) < 0.0:
        size = -size
    along = times(size, tangent)
    scale = 1.0 / (size * dot(across, tangent))
    return Leg(begin.at, along, times(scale, across))


@compiled
def shortened(leg: Leg, share: float) -> Leg:
    """First part of a leg."""
    normal = leg.normal
    across = Equilibrium(normal.p / share, normal.q / share, normal.force / share)
    return Leg(leg.begin, times(share, leg.along), across)


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
def _combined(weights: Floats, found: Balance, old: Balance, older: Balance) -> Equilibrium:
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
    z, rate, old, tangent = found.at, found.tangent, before.at, before.tangent
    h = dot(leg.normal, less(z, old))
    scale = 1.0 / dot(leg.normal, tangent)
    return Equilibrium(
        _cubic_at(z.p, rate.p, old.p, scale * tangent.p, h, way),
        _cubic_at(z.q, rate.q, old.q, scale * tangent.q, h, way),
        _cubic_at(z.force, rate.force, old.force, scale * tangent.force, h, way),
    )


@compiled
def _cubic_at(new: float, rate: float, old: float, old_rate: float, h: float, t: float) -> float:
    mean = (new - old) / h
    bend, twist = (2.0 * rate + old_rate - 3.0 * mean) / h, (rate + old_rate - 2.0 * mean) / (h * h)
    return new + t * (rate + t * (bend + t * twist))


@compiled
def guess(work: LegCurves, way: float) -> Equilibrium:
    """Equilibrium at a position, from the series."""
    series = work.curves.series
    p, q = value_and_slope(work.place, series[REST], way)
    force_x, force_y = value_and_slope(series[1], series[2], way)
    return Equilibrium(p, q, math.hypot(force_x, force_y))


@compiled
def sample_leg(
    scene: Scene, leg: Leg, begin: Balance, before: Balance, known: float, settled: float, work: LegCurves
) -> tuple[bool, Balance, Balance]:
    """Fit the series of a leg, unless the branch does not cut all planes, and return the equilibria at its last nodes.

    The search at a node starts from a polynomial through the nodes before it. If the series of a longer leg in the same
    direction are at hand, of which this is the share `known` > 0, it starts from these.
    """
    series, at_nodes, half = work.curves.series, work.at_nodes, work.nodes.size
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
            found = settle_on(scene, leg, work.nodes[k], start, settled)
            if not math.isfinite(found.travel):
                return False, begin, before
        at_nodes[0, k], at_nodes[0, half + k] = found.holding_moment, found.rates.moment
        at_nodes[1, k], at_nodes[1, half + k] = found.force_x, found.rates.x
        at_nodes[2, k], at_nodes[2, half + k] = found.force_y, found.rates.y
        at_nodes[REST, k], at_nodes[REST, half + k] = found.at.q, found.tangent.q
        at_nodes[ANGLE, k], at_nodes[ANGLE, half + k] = found.travel, found.rates.travel
        at_nodes[PLACE, k], at_nodes[PLACE, half + k] = found.at.p, found.tangent.p
    for c in range(PLACE):
        weighted(work.fit, at_nodes[c], series[c])
    weighted(work.fit, at_nodes[PLACE], work.place)
    return True, found, old
