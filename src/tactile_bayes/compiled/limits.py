"""How far the path of a lane can run, as `tactile_bayes.reach` says it without friction."""

from __future__ import annotations

import math

from tactile_bayes.compiled.compiler import compiled
from tactile_bayes.compiled.lane import Lane, end_of, place
from tactile_bayes.reach import CLEARANCE, Reach

__all__ = ["first_contact", "limits"]

_LAST_STEP = 1e-6
"""Newton step, as a share of the bracket, whose square is small enough."""

_LEVER, _TANGENT, _WITHIN = 0, 1, 2
_TOUCHES, _TOO_FAR, _CUTS_PIVOT = int(Reach.TOUCHES), int(Reach.TOO_FAR), int(Reach.CUTS_PIVOT)
_ENDS, _TOO_CLOSE, _RUNS_OUT = int(Reach.ENDS), int(Reach.TOO_CLOSE), int(Reach.RUNS_OUT)
_CLEARANCE = CLEARANCE


@compiled
def _missing(lane: Lane, what: int, p: float) -> tuple[float, float]:
    """What is sought vanishes at its root, and falls away from the pivot's side; with its derivative."""
    x, y, sin, cos, speed, bend = place(lane, p)
    along, facing = x * cos + y * sin, y * cos - x * sin
    if what == _LEVER:
        return along, speed + facing * bend
    if what == _WITHIN:
        return 1.0 - x * x - y * y, -2.0 * along * speed
    return -math.atan2(facing, along), facing * speed / (x * x + y * y) + bend


@compiled
def _root(lane: Lane, what: int, positive: float, negative: float) -> float:
    """Newton kept in its bracket, as `falling_root`."""
    p, before = 0.5 * (positive + negative), abs(negative - positive)
    settled = _LAST_STEP * before
    for _ in range(100):
        value, slope = _missing(lane, what, p)
        if value > 0.0:
            positive = p
        else:
            negative = p
        new = p - value / slope
        if (new - positive) * (new - negative) <= 0.0 and abs(new - p) <= 0.5 * before:
            before = abs(new - p)
        else:
            new = 0.5 * (positive + negative)
            before = abs(negative - positive)
        step = abs(new - p)
        p = new
        if not step > settled or value == 0.0:
            break
    return p


@compiled
def _nearest(lane: Lane, lo: float, hi: float) -> tuple[float, bool, bool]:
    """Parameter of the nearest point, and whether it lies beyond the greatest or the least one."""
    right_of_hi, left_of_lo = _missing(lane, _LEVER, hi)[0] <= 0.0, _missing(lane, _LEVER, lo)[0] >= 0.0
    if right_of_hi:
        return hi, right_of_hi, left_of_lo
    if left_of_lo:
        return lo, right_of_hi, left_of_lo
    return _root(lane, _LEVER, hi, lo), right_of_hi, left_of_lo


@compiled
def _first(lane: Lane, hi: float, nearest: float) -> tuple[float, bool]:
    """Parameter of first contact, and whether the tip touches first."""
    tangent = _root(lane, _TANGENT, hi, nearest)
    x, y, _, _, _, _ = place(lane, tangent)
    if x * x + y * y > 1.0:
        return _root(lane, _WITHIN, nearest, tangent), True
    return tangent, False


@compiled
def first_contact(lane: Lane) -> float:
    """Parameter of first contact, of a lane within reach."""
    lo, hi = end_of(lane, -1.0), end_of(lane, 1.0)
    return _first(lane, hi, _nearest(lane, lo, hi)[0])[0]


@compiled
def limits(lane: Lane) -> tuple[int, float, float, bool, bool]:
    """`Reach`, parameters of first contact and of the end, whether the tip touches first, whether the contour ends."""
    lo, hi = end_of(lane, -1.0), end_of(lane, 1.0)
    nearest, right_of_hi, left_of_lo = _nearest(lane, lo, hi)
    x, y, sin, cos, _, _ = place(lane, nearest)
    distance = math.sqrt(x * x + y * y)
    below = y * cos - x * sin > 0.0
    begin, tip_first = _first(lane, hi, nearest)
    x, y, sin, cos, _, _ = place(lane, hi)
    open_end = y * cos - x * sin > 0.0 and x * x + y * y <= 1.0
    reach = _TOUCHES
    if not below:
        reach = _RUNS_OUT if left_of_lo and not right_of_hi else _CUTS_PIVOT
    elif distance < _CLEARANCE:
        reach = _TOO_CLOSE
    elif distance >= 1.0:
        reach = _TOO_FAR
    elif right_of_hi or open_end:
        reach = _ENDS
    return reach, begin, nearest, tip_first, nearest == lo
