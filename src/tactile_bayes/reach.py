"""Where a path may run: whether a rod reaches its contour, where it first touches, and where no lever arm is left."""

from __future__ import annotations

from collections.abc import Callable
from enum import IntEnum
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from tactile_bayes.contours.base import Locus
from tactile_bayes.contours.seen import SeenContour
from tactile_bayes.roots import falling_root

__all__ = ["CLEARANCE", "Limits", "Reach", "limits", "seen_frame"]

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
    """The rod would first touch beyond an end of the contour."""
    TOO_CLOSE = 4
    """The pivot is nearer to the contour than `CLEARANCE`."""


class Limits(NamedTuple):
    """How far the path of every lane can run; parameters are the contour's own."""

    reach: NDArray[np.int8]
    distance: Floats
    """Least distance of contour and pivot, in rod lengths."""
    begin: Floats
    """First contact."""
    end: Floats
    """Where the line of force passes through the pivot."""
    tip_first: NDArray[np.bool_]
    """Whether the tip touches first, or a tangent line from the pivot."""


def seen_frame(locus: Locus) -> tuple[Floats, Floats]:
    """The vector from the pivot to the contour along the contour and into the object."""
    cos, sin = np.cos(locus.slope_angle), np.sin(locus.slope_angle)
    return locus.x * cos + locus.y * sin, locus.y * cos - locus.x * sin


def limits(seen: SeenContour, friction_angle: float) -> Limits:
    """Where the path of every lane can run, with friction angle δ [rad]."""
    lanes = np.arange(seen.lanes)
    lo, hi = seen.domain()

    def thrust(tilt: float) -> Callable[[Index, Floats], tuple[Floats, Floats]]:
        """Lever arm of a force that is turned by `tilt` from the normal."""
        cos, sin = np.cos(tilt), np.sin(tilt)

        def lever(lane: Index, parameter: Floats) -> tuple[Floats, Floats]:
            locus = seen.locate(lane, parameter)
            along, facing = seen_frame(locus)
            along_rate = locus.arclength_rate + facing * locus.slope_rate
            return cos * along + sin * facing, cos * along_rate - sin * along * locus.slope_rate

        return lever

    def facing_root(lane: Index, parameter: Floats) -> tuple[Floats, Floats]:
        locus = seen.locate(lane, parameter)
        along, facing = seen_frame(locus)
        return facing, -along * locus.slope_rate

    def within_root(lane: Index, parameter: Floats) -> tuple[Floats, Floats]:
        locus = seen.locate(lane, parameter)
        along, _ = seen_frame(locus)
        return 1.0 - locus.x**2 - locus.y**2, -2.0 * along * locus.arclength_rate

    lever = thrust(0.0)
    straddles = (lever(lanes, hi)[0] > 0.0) & (lever(lanes, lo)[0] < 0.0)
    ends = np.where(lever(lanes, hi)[0] > 0.0, lo, hi)
    nearest = np.where(straddles, falling_root(lever, np.where(straddles, hi, lo), lo), ends)
    locus = seen.locate(lanes, nearest)
    distance, below = np.hypot(locus.x, locus.y), seen_frame(locus)[1] > 0.0

    end = falling_root(thrust(friction_angle), hi, nearest) if friction_angle else nearest
    tangent = falling_root(facing_root, end, hi)
    at_hi, at_tangent, at_end = (seen.locate(lanes, p) for p in (hi, tangent, end))
    tip_first = np.hypot(at_tangent.x, at_tangent.y) > 1.0
    begin = np.where(tip_first, falling_root(within_root, end, tangent), tangent)
    open_end = (seen_frame(at_hi)[1] > 0.0) & (np.hypot(at_hi.x, at_hi.y) <= 1.0)

    reach = np.full(seen.lanes, Reach.TOUCHES, dtype=np.int8)
    reach[~straddles | open_end] = Reach.ENDS
    reach[(distance >= 1.0) | (np.hypot(at_end.x, at_end.y) >= 1.0)] = Reach.TOO_FAR
    reach[distance < CLEARANCE] = Reach.TOO_CLOSE
    reach[~below] = Reach.CUTS_PIVOT
    return Limits(reach, distance, begin, end, tip_first)
