"""The outcome of a sweep: whether the rod reaches the contour, and how contact ends."""

from __future__ import annotations

from enum import IntEnum
from typing import Self

# Least distance of pivot and contour at which a path is followed [L]. Nearer, almost the whole path lies within a
# degree of snap-off, and the nodes would miss it.
CLEARANCE = 0.02


class Reachability(IntEnum):
    """Reachability of a contour by a rod in a sweep: its code, and why there is no path, in a few words."""

    message: str

    def __new__(cls, code: int, message: str = "") -> Self:
        made = int.__new__(cls, code)
        made._value_, made.message = code, message
        return made

    TOUCHES = 0, "ok"
    TOO_FAR = 1, "out of reach"  # no point is within the rod's length
    CUTS_PIVOT = 2, "cuts the pivot"  # it is not below the contour
    ENDS = 3, "touched beyond its end"  # that from which the rod comes
    TOO_CLOSE = 4, "too close to the pivot"  # nearer than `CLEARANCE`
    RUNS_OUT = 5, "still touched at its other end"
    GRAZES = 6, "hardly touched"  # contact is so weak that rounding hides how it ends
    TOUCHES_TWICE = 7, "touched twice"  # by a rod that is curved toward it
    # At first contact the tip is turned beyond the normal of the contour, so that any force pushes it off.
    SLIPS_OFF = 8, "slips off at once"
    # A rod that is carried is in the object at the beginning of its drive, or comes into it without a contact.
    BEGINS_INSIDE = 9, "touched at the beginning"
    # Friction lets the contact neither slide nor stick at first, or both: a straight rod is pushed along itself.
    HEAD_ON = 10, "met head-on"
    FOLDS_OVER = 11, "folded over at its tip"  # until the other side of the rod lies along the contour


class SnapOff(IntEnum):
    """Kind of the end of a path."""

    NEVER = 0
    FOLD = 1  # a smooth maximum of the drive angle
    CORNER = 2  # a maximum where the phase changes or the contour's curvature jumps
    THRUST = 3  # the line of force passes through the pivot, so that the holding moment vanishes
    RELEASE = 4  # the force vanishes: a rod that is curved or carried leaves the contour without a jump
    JUMP = 5  # friction lets the contact neither slide nor stick: it jumps
