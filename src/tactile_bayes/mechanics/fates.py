"""What becomes of a sweep: whether the rod finds its contour, and how contact ends."""

from __future__ import annotations

from enum import IntEnum

__all__ = ["CLEARANCE", "Reach", "SnapOff"]

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
    GRAZES = 6
    """Contact is so slight that rounding hides how it ends."""

    @property
    def words(self) -> str:
        """Why there is no path, in a few words."""
        return _WORDS[self]


_WORDS = {
    Reach.TOUCHES: "ok",
    Reach.TOO_FAR: "out of reach",
    Reach.CUTS_PIVOT: "cuts the pivot",
    Reach.ENDS: "first touched beyond its end",
    Reach.TOO_CLOSE: "too close to the pivot",
    Reach.RUNS_OUT: "still touched at its other end",
    Reach.GRAZES: "hardly touched",
}


class SnapOff(IntEnum):
    """How a path ends."""

    NEVER = 0
    FOLD = 1
    """A smooth maximum of the drive angle."""
    CORNER = 2
    """The maximum lies where the phase changes or the contour's curvature jumps."""
    THRUST = 3
    """The line of force has come to pass through the pivot: no holding moment is left."""
