"""Limits of a path: whether a rod reaches the contour, and first contact.

At first contact the rod has its rest shape. Where that is a circular arc of curvature κ0, the rod has the angle
asin(κ0 r/2) to the line from the pivot at the distance r from it.
"""

from __future__ import annotations

import math
from enum import IntEnum
from typing import NamedTuple

from tactile_bayes.mechanics.compiler import compiled
from tactile_bayes.mechanics.newton import newton_step
from tactile_bayes.mechanics.outline import Outline, ends, frame, mirrored, place
from tactile_bayes.mechanics.reachability import CLEARANCE, Reachability

__all__ = ["STRAIGHT", "Approach", "Rest", "approach", "chord_angle", "clear_angle", "rest_of"]


class _Sought(IntEnum):
    """Function whose root is sought; it decreases away from the side of the pivot."""

    LEVER = 0
    """Lever arm of a force across the contour."""
    TURNED = 1
    """Angle of the contour's direction to the unloaded rod."""
    WITHIN = 2
    """Margin to the rod's reach."""


_TOUCHES, _TOO_FAR, _CUTS_PIVOT = int(Reachability.TOUCHES), int(Reachability.TOO_FAR), int(Reachability.CUTS_PIVOT)
_ENDS, _TOO_CLOSE, _RUNS_OUT = int(Reachability.ENDS), int(Reachability.TOO_CLOSE), int(Reachability.RUNS_OUT)
_CLEARANCE = CLEARANCE

_ROUNDING = 1e-14
"""Distance from the end of the rod's reach [L] that counts as zero."""


class Rest(NamedTuple):
    """Rest shape of a rod."""

    curvature: float
    """Rest curvature κ0 [1/L]."""
    reach: float
    """Distance from pivot to tip [L]."""


STRAIGHT = Rest(0.0, 1.0)


@compiled
def rest_of(curvature: float) -> Rest:
    """Rest shape of an arc of length one."""
    half = 0.5 * curvature
    return Rest(curvature, 1.0 if half == 0.0 else math.sin(half) / half)


class Approach(NamedTuple):
    """First contact with an outline, as a parameter of the contour."""

    reach: int
    """A `Reachability`."""
    distance: float
    """Least distance of contour and pivot [L]."""
    begin: float
    """First contact."""
    tip_first: bool
    """True if the tip touches first, and not a point before it."""
    low: float
    """Least parameter of the contour."""


@compiled
def _missing(outline: Outline, rest: Rest, what: _Sought, p: float) -> tuple[float, float]:
    """Function whose root is sought, and its derivative."""
    at = place(outline, p)
    along, facing = frame(at)
    if what == _Sought.LEVER:
        return along, at.speed + facing * at.bend
    if what == _Sought.WITHIN:
        return rest.reach * rest.reach - at.x * at.x - at.y * at.y, -2.0 * along * at.speed
    # The angle between the line from the pivot and the contour's direction grows to the left as long as the contour
    # faces the pivot. It jumps below the pivot, where no contour is.
    bearing = math.atan2(-at.x, at.y) + 0.5 * math.pi
    angle = bearing - math.atan2(at.sin, at.cos)
    rate = facing * at.speed / (at.x * at.x + at.y * at.y) + at.bend
    if rest.curvature != 0.0:
        distance = math.hypot(at.x, at.y)
        angle += chord_angle(rest.curvature, distance)
        sine = 0.5 * rest.curvature * distance
        if abs(sine) < 1.0:
            rate -= 0.5 * rest.curvature * along * at.speed / (distance * math.sqrt((1.0 - sine) * (1.0 + sine)))
    return -angle, rate


@compiled
def _root(outline: Outline, rest: Rest, what: _Sought, positive: float, negative: float, last_step: float) -> float:
    """Root by Newton's method within a bracket, until a step is a given share of it."""
    p, before = 0.5 * (positive + negative), abs(negative - positive)
    settled = last_step * before
    for _ in range(100):
        value, slope = _missing(outline, rest, what, p)
        new, positive, negative, before = newton_step(p, value, slope, positive, negative, before)
        step = abs(new - p)
        p = new
        if not step > settled or value == 0.0:
            break
    return p


@compiled
def _nearest(outline: Outline, low: float, high: float, last_step: float) -> tuple[float, bool, bool]:
    """Parameter of the nearest point, and whether it lies beyond the greatest or the least parameter."""
    beyond_high = _missing(outline, STRAIGHT, _Sought.LEVER, high)[0] <= 0.0
    beyond_low = _missing(outline, STRAIGHT, _Sought.LEVER, low)[0] >= 0.0
    if beyond_high:
        return high, beyond_high, beyond_low
    if beyond_low:
        return low, beyond_high, beyond_low
    return _root(outline, STRAIGHT, _Sought.LEVER, high, low, last_step), beyond_high, beyond_low


@compiled
def _is_out(outline: Outline, rest: Rest, p: float) -> bool:
    at = place(outline, p)
    return math.hypot(at.x, at.y) > rest.reach


@compiled
def _first(outline: Outline, rest: Rest, high: float, nearest: float, last_step: float) -> tuple[float, bool]:
    """Parameter of first contact, and whether the tip touches first."""
    tangent = _root(outline, rest, _Sought.TURNED, high, nearest, last_step)
    if _is_out(outline, rest, tangent):
        return _root(outline, rest, _Sought.WITHIN, nearest, tangent, last_step), True
    return tangent, False


@compiled
def approach(outline: Outline, rest: Rest, last_step: float) -> Approach:
    """First contact of a rod; roots are found to a share of their brackets."""
    low, high = ends(outline)
    nearest, beyond_high, beyond_low = _nearest(outline, low, high, last_step)
    at = place(outline, nearest)
    distance, below = math.hypot(at.x, at.y), frame(at)[1] > 0.0
    begin, tip_first = _first(outline, rest, high, nearest, last_step)
    at_high = place(outline, high)
    open_end = frame(at_high)[1] > 0.0 and math.hypot(at_high.x, at_high.y) <= rest.reach
    reach = _TOUCHES
    if not below:
        reach = _RUNS_OUT if beyond_low and not beyond_high else _CUTS_PIVOT
    elif distance < _CLEARANCE:
        reach = _TOO_CLOSE
    elif distance >= rest.reach - _ROUNDING:
        reach = _TOO_FAR
    elif beyond_high or open_end:
        reach = _ENDS
    return Approach(reach, distance, begin, tip_first, low)


@compiled
def clear_angle(outline: Outline, rest: Rest, last_step: float) -> float:
    """Drive angle beyond which an unloaded rod has passed the contour: first contact of the opposite sweep [rad]."""
    opposite, curvature = mirrored(outline), -rest.curvature
    low, high = ends(opposite)
    nearest = _nearest(opposite, low, high, last_step)[0]
    begin, _ = _first(opposite, Rest(curvature, rest.reach), high, nearest, last_step)
    at = place(opposite, begin)
    return math.pi - (math.atan2(at.y, at.x) - chord_angle(curvature, math.hypot(at.x, at.y)))


@compiled
def chord_angle(curvature: float, distance: float) -> float:
    """Angle of the chord of an arc to its tangents at the ends [rad]; π/2 for a chord longer than the diameter."""
    return math.asin(min(max(0.5 * curvature * distance, -1.0), 1.0))
