"""The outcome of a sweep: whether the rod reaches the contour, and how contact ends."""

from __future__ import annotations

from enum import IntEnum

# Least distance of pivot and contour at which a path is followed [L]. Nearer, almost the whole path lies within a
# degree of snap-off, and the nodes would miss it.
CLEARANCE = 0.02


class Reachability(IntEnum):
    """Reachability of a contour by a rod in a sweep."""

    TOUCHES = 0
    TOO_FAR = 1  # no point is within the rod's length
    CUTS_PIVOT = 2  # the pivot is not below the contour
    ENDS = 3  # the rod would touch beyond the end of the contour from which it comes
    TOO_CLOSE = 4  # the pivot is nearer to the contour than `CLEARANCE`
    RUNS_OUT = 5  # the rod would still touch at the other end of the contour
    GRAZES = 6  # contact is so weak that rounding hides how it ends
    TOUCHES_TWICE = 7  # a rod that is curved toward the object would touch it at two points
    # At first contact the tip is turned beyond the normal of the contour, so that any force pushes it off.
    SLIPS_OFF = 8
    # A rod that is carried is in the object at the beginning of its drive, or comes into it without a contact.
    BEGINS_INSIDE = 9
    # Friction lets the contact neither slide nor stick at first, or both: a straight rod is pushed along itself.
    HEAD_ON = 10
    FOLDS_OVER = 11  # the tip would turn over until the other side of the rod lies along the contour

    @property
    def message(self) -> str:
        """Reason why there is no path, in a few words; "ok" if there is one."""
        return _MESSAGES[self]


_MESSAGES = {
    Reachability.TOUCHES: "ok",
    Reachability.TOO_FAR: "out of reach",
    Reachability.CUTS_PIVOT: "cuts the pivot",
    Reachability.ENDS: "touched beyond its end",
    Reachability.TOO_CLOSE: "too close to the pivot",
    Reachability.RUNS_OUT: "still touched at its other end",
    Reachability.GRAZES: "hardly touched",
    Reachability.TOUCHES_TWICE: "touched twice",
    Reachability.SLIPS_OFF: "slips off at once",
    Reachability.BEGINS_INSIDE: "touched at the beginning",
    Reachability.HEAD_ON: "met head-on",
    Reachability.FOLDS_OVER: "folded over at its tip",
}


class SnapOff(IntEnum):
    """Kind of the end of a path."""

    NEVER = 0
    FOLD = 1  # a smooth maximum of the drive angle
    CORNER = 2  # a maximum where the phase changes or the contour's curvature jumps
    THRUST = 3  # the line of force passes through the pivot, so that the holding moment vanishes
    RELEASE = 4  # the force vanishes: a rod that is curved or carried leaves the contour without a jump
    JUMP = 5  # friction lets the contact neither slide nor stick: it jumps
