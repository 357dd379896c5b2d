"""Where a path may run: whether a rod reaches its contour, where it first touches, and where no lever arm is left."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from enum import IntEnum
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from tactile_bayes.accuracy import Accuracy
from tactile_bayes.contours.base import Locus
from tactile_bayes.contours.seen import SeenContour
from tactile_bayes.roots import falling_root

__all__ = ["CLEARANCE", "Limits", "Reach", "clear_angle", "limits", "seen_frame"]

Floats = NDArray[np.float64]
Index = NDArray[np.intp]

CLEARANCE = 0.02
"""Least distance of pivot and contour, in rod lengths, at which a path is followed: nearer, almost all of it happens
within a degree of snap-off, and the nodes would miss it."""


class Reach(IntEnum):
    """Whether a rod finds its contour."""

    TOUCHES = 0
    TOO_FAR = 1
    """No point is within the rod's length."""
    CUTS_PIVOT = 2
    """The pivot is not below the contour."""
    ENDS = 3
    """The rod would first touch beyond the end of the contour that it comes from."""
    TOO_CLOSE = 4
    """The pivot is nearer to the contour than `CLEARANCE`."""
    RUNS_OUT = 5
    """The rod would still touch at the other end of the contour."""


class Limits(NamedTuple):
    """How far the path of every lane can run; parameters are the contour's own."""

    reach: NDArray[np.int8]
    distance: Floats
    """Least distance of contour and pivot, in rod lengths."""
    begin: Floats
    """First contact."""
    end: Floats
    """Where the line of force passes through the pivot, or the rod's length is used up again, or the contour ends."""
    tip_first: NDArray[np.bool_]
    """Whether the tip touches first, or a tangent line from the pivot."""
    runs_out: NDArray[np.bool_]
    """Whether it is the contour that ends."""


def seen_frame(locus: Locus) -> tuple[Floats, Floats]:
    """The vector from the pivot to the contour along the contour and into the object."""
    cos, sin = np.cos(locus.slope_angle), np.sin(locus.slope_angle)
    return locus.x * cos + locus.y * sin, locus.y * cos - locus.x * sin


def limits(seen: SeenContour, friction_angle: Floats, accuracy: Accuracy) -> Limits:
    """Where the path of every lane can run, with friction angles δ [rad], shape (lanes,)."""
    lanes = np.arange(seen.lanes)
    lo, hi = seen.domain()

    def lever(lane: Index, parameter: Floats) -> tuple[Floats, Floats]:
        locus = seen.locate(lane, parameter)
        along, facing = seen_frame(locus)
        return along, locus.arclength_rate + facing * locus.slope_rate

    def turned_less_than(limit: Floats) -> Callable[[Index, Floats], tuple[Floats, Floats]]:
        """How much less than `limit` the line from the pivot is turned from the contour's direction.

        The farther to the left the more it is turned, as long as the contour faces the pivot.
        """

        def remaining(lane: Index, parameter: Floats) -> tuple[Floats, Floats]:
            locus = seen.locate(lane, parameter)
            _, facing = seen_frame(locus)
            bearing = np.arctan2(-locus.x, locus.y) + 0.5 * np.pi  # it jumps below the pivot, where no contour is
            rate = facing * locus.arclength_rate / (locus.x**2 + locus.y**2) + locus.slope_rate
            return limit[lane] - (bearing - locus.slope_angle), rate

        return remaining

    def within(lane: Index, parameter: Floats) -> tuple[Floats, Floats]:
        locus = seen.locate(lane, parameter)
        along, _ = seen_frame(locus)
        return 1.0 - locus.x**2 - locus.y**2, -2.0 * along * locus.arclength_rate

    right_of_hi, left_of_lo = lever(lanes, hi)[0] <= 0.0, lever(lanes, lo)[0] >= 0.0

    def root(function: Callable[[Index, Floats], tuple[Floats, Floats]], positive: Floats, negative: Floats) -> Floats:
        return falling_root(function, positive, negative, last_step=accuracy.last_step)

    nearest = root(lever, hi, lo)
    nearest = np.where(right_of_hi, hi, np.where(left_of_lo, lo, nearest))
    locus = seen.locate(lanes, nearest)
    distance, below = np.hypot(locus.x, locus.y), seen_frame(locus)[1] > 0.0

    tangent = root(turned_less_than(np.zeros(seen.lanes)), hi, nearest)
    at_hi, at_tangent = seen.locate(lanes, hi), seen.locate(lanes, tangent)
    tip_first = np.hypot(at_tangent.x, at_tangent.y) > 1.0
    begin = np.where(tip_first, root(within, nearest, tangent), tangent)

    # A force that friction turns passes through the pivot only beyond the nearest point, if not out of reach.
    end = nearest
    if np.any(friction_angle):
        thrust = turned_less_than(0.5 * np.pi + friction_angle)
        end = np.where(thrust(lanes, lo)[0] >= 0.0, lo, root(thrust, nearest, lo))
        at_end = seen.locate(lanes, end)
        out = np.hypot(at_end.x, at_end.y) > 1.0
        end = np.where(out, root(within, nearest, end), end)

    reach = np.full(seen.lanes, Reach.TOUCHES, dtype=np.int8)
    open_end = (seen_frame(at_hi)[1] > 0.0) & (np.hypot(at_hi.x, at_hi.y) <= 1.0)
    reach[right_of_hi | open_end] = Reach.ENDS
    reach[distance >= 1.0] = Reach.TOO_FAR
    reach[distance < CLEARANCE] = Reach.TOO_CLOSE
    reach[~below] = Reach.CUTS_PIVOT
    reach[~below & left_of_lo & ~right_of_hi] = Reach.RUNS_OUT
    return Limits(reach, distance, begin, end, tip_first, end == lo)


def clear_angle(seen: SeenContour, accuracy: Accuracy) -> Floats:
    """Drive angle of every lane from which on a straight rod is past the contour, as far as that is known.

    There the opposite sweep would first touch.
    """
    opposite = replace(seen, mirrored=~seen.mirrored)
    locus = opposite.locate(np.arange(seen.lanes), limits(opposite, np.zeros(seen.lanes), accuracy).begin)
    return np.pi - np.arctan2(locus.y, locus.x)
