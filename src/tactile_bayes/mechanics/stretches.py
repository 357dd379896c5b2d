"""Smooth stretches of an equilibrium path: cut where the phase changes and where the contour's curvature jumps."""

from __future__ import annotations

from typing import NamedTuple

from tactile_bayes.arrays import Floats
from tactile_bayes.mechanics.compiler import compiled
from tactile_bayes.mechanics.limits import Limits
from tactile_bayes.mechanics.series import Nodes, change_of, crossing, tail, value, weighted
from tactile_bayes.mechanics.states import Scene, excess

__all__ = ["BRIEF", "Accuracy", "Stretch", "along", "along_rate", "cut"]

BRIEF = 1e-6
"""Share of a path so short that changes on it may be lost in rounding."""

_NOTHING = 1e-13
"""Share of a path that is too short for a stretch."""

_SHORT = 1e-3
"""Distance along a contour within which the error of tables in a change of the phase matters."""

_HALVINGS = 8
"""Largest number of halvings of a piece in the search for changes of the phase; a kink exhausts them."""


class Accuracy(NamedTuple):
    """Accuracy of a path."""

    resolved: float
    """Tolerated error of an interpolant, as a share of the change of the drive angle on a stretch."""
    sharp: float
    """Tolerated error of the drive angle of an event [rad]."""
    halvings: int
    """Largest number of halvings of a stretch; a singularity at its end exhausts them."""
    first_step: float
    """Newton step, as a share of the bracket, at which the search for first contact ends."""
    last_step: float
    """Newton step, as a share of the bracket, at which searches on a stretch end."""
    polished: bool
    """True if states at drive angles are solved for, and not taken from the series."""


class Stretch(NamedTuple):
    """A smooth part of a path."""

    begin: float
    """Contour parameter at its beginning, the greater one."""
    end: float
    tip: bool
    """True in tip contact."""
    rooted: bool
    """True if contact begins here with the tip: loads then grow like the square root of the arc."""
    halvings: int
    brief: bool
    """True if fewer nodes may suffice."""


@compiled
def along(stretch: Stretch, way: float) -> float:
    """Contour parameter at a position from 0 to 1 in which loads are smooth."""
    return stretch.begin + (stretch.end - stretch.begin) * (way * way if stretch.rooted else way)


@compiled
def along_rate(stretch: Stretch, way: float) -> float:
    """Derivative of `along` by the position."""
    return (stretch.end - stretch.begin) * (2.0 * way if stretch.rooted else 1.0)


@compiled
def cut(
    scene: Scene, limit: Limits, knots: Floats, accuracy: Accuracy, miss: float, on: Nodes, series: Floats, out: Floats
) -> int:
    """Cut a path at knots, and at points where tangential contact takes exactly the rod's length.

    Parameters
    ----------
    knots : ndarray, shape (k,)
        Parameters at which the contour may not be smooth, decreasing.
    miss : float
        Tolerated error of the arc length of tangential contact [L].
    series : ndarray, shape (3, order)
        Workspace.
    out : ndarray, shape (most, 3)
        Begin and end of every stretch, in the order of the path, and 1 for tip contact.

    Returns
    -------
    int
        Number of stretches, at most `most`.
    """
    whole, count = limit.begin - limit.end, 0
    begin = limit.begin
    for k in range(knots.size + 1):
        end = limit.end if k == knots.size else min(max(knots[k], limit.end), limit.begin)
        if not begin - end > _NOTHING * whole:
            continue
        count += _cut_piece(scene, begin, end, whole, accuracy, miss, on, series, out[count:])
        begin = end
    return count


@compiled
def _cut_piece(
    scene: Scene,
    first: float,
    last: float,
    whole: float,
    accuracy: Accuracy,
    miss: float,
    on: Nodes,
    series: Floats,
    out: Floats,
) -> int:
    """Cut a smooth piece of a contour, in the largest parts on which a polynomial fits the arc length."""
    values, lengths, slope = series[0], series[1], series[2]
    order, least = on.nodes.size, (first - last) * 0.5**_HALVINGS
    begin, end, count = first, last, 0
    while begin > last and count < out.shape[0] - order - 2:
        for k in range(order):
            values[k] = excess(scene, begin + (end - begin) * on.nodes[k])
        weighted(on.fit, values, lengths)
        span = begin - end
        rough = tail(lengths) > min(accuracy.resolved * change_of(lengths), miss)
        if rough and span > least and span > BRIEF * whole:
            end = begin - 0.5 * span
            continue
        weighted(on.slopes, lengths, slope)
        count += _cut_smooth(scene, begin, end, _NOTHING * whole, accuracy, on, series, out[count:])
        begin, end = end, last
    return count


@compiled
def _cut_smooth(
    scene: Scene, begin: float, end: float, nothing: float, accuracy: Accuracy, on: Nodes, series: Floats, out: Floats
) -> int:
    """Cut at the sign changes of a polynomial."""
    values, lengths, slope = series[0], series[1], series[2]
    span, order, started, old, count = end - begin, on.nodes.size, 0.0, 0.0, 0
    beyond = value(lengths, 0.0) > 0.0
    for k in range(order + 1):
        new = 1.0 if k == order else on.nodes[k]
        changes = ((value(lengths, 1.0) if k == order else values[k]) > 0.0) != beyond
        if not changes and 0 < k < order - 1:
            between = _nearest_zero(on.nodes, values, k)
            if (value(lengths, between) > 0.0) != beyond:  # a phase so brief that it lies between two nodes
                new, changes = between, True
        if changes:
            left, right = (old, new) if beyond else (new, old)
            change = crossing(lengths, slope, 0.0, left, right, 0.5 * (old + new), accuracy.last_step)
            most = min(change - started, 1.0 - change)
            change = _polished(scene, begin, span, change, most, accuracy.first_step)
            if abs(span) * (change - started) > nothing:  # otherwise it is rounding at the beginning of a piece
                out[count, 0], out[count, 1], out[count, 2] = begin + span * started, begin + span * change, beyond
                count += 1
            started, beyond = change, not beyond
        old = new
    out[count, 0], out[count, 1], out[count, 2] = begin + span * started, end, beyond
    return count + 1


@compiled
def _nearest_zero(nodes: Floats, values: Floats, k: int) -> float:
    """Point at which a parabola through a node and its neighbours is nearest to zero, or the node itself."""
    before, after = nodes[k - 1] - nodes[k], nodes[k + 1] - nodes[k]
    rise, rise_on = values[k - 1] - values[k], values[k + 1] - values[k]
    if not (rise * values[k] > 0.0 and rise_on * values[k] > 0.0):
        return nodes[k]
    bend = (rise_on / after - rise / before) / (after - before)
    return nodes[k] - 0.5 * (rise / before - bend * before) / bend


@compiled
def _polished(scene: Scene, begin: float, span: float, change: float, most: float, last_step: float) -> float:
    """Change of the phase, refined from the interpolant's by secants until a step is small enough.

    Where tip contact is so short that the error of a table is a large share of it, states are exact.
    """
    scene = Scene(scene.outline, scene.rig, scene.exact or abs(span) * most < _SHORT, scene.known, scene.workspace)
    old, now = change + 1e-4 * most, change
    at_old = excess(scene, begin + span * old)
    at_now = excess(scene, begin + span * now)
    for _ in range(4):
        step = at_now * (now - old) / (at_now - at_old)
        if not abs(step) < 0.5 * most:
            break
        old, at_old, now = now, at_now, now - step
        if abs(step) <= last_step:
            break
        at_now = excess(scene, begin + span * now)
    return now
