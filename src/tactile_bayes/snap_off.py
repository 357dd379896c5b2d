"""The snap-off: the first maximum of the drive angle along each path."""

from __future__ import annotations

from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from tactile_bayes import chebyshev
from tactile_bayes.accuracy import Accuracy
from tactile_bayes.contours.seen import SeenContour
from tactile_bayes.roots import falling_root
from tactile_bayes.segments import BRIEF, Segments, first_of_lane, last_of_lane, whole
from tactile_bayes.states import angle_rate, exact_states

__all__ = ["SnapOff", "first_maximum", "polish_fold"]

Floats = NDArray[np.float64]
Index = NDArray[np.intp]


class SnapOff(IntEnum):
    """How a path ends."""

    NEVER = 0
    FOLD = 1
    """A smooth maximum of the drive angle."""
    CORNER = 2
    """The maximum lies where the phase changes or the contour's curvature jumps."""
    THRUST = 3
    """The line of force has come to pass through the pivot: no holding moment is left."""


def first_maximum(segments: Segments, angle: Floats, accuracy: Accuracy) -> tuple[Index, Floats, NDArray[np.int8]]:
    """Segments up to the first maximum of the drive angle, how far each is followed, and how the last one ends."""
    slope = chebyshev.derivative(angle)
    grid = np.linspace(0.0, 1.0, 2 * angle.shape[0] + 1)
    falls = chebyshev.tabulate(slope, grid) <= 0.0
    falls[first_of_lane(segments.lane), 0] = False  # it always rises from first contact
    begin, end = whole(segments)
    falls[(begin - segments.end < BRIEF * (begin - end)) & ~last_of_lane(segments.lane)] = False  # lost in rounding
    any_fall, cell = falls.any(axis=1), falls.argmax(axis=1)
    fold = any_fall & (cell > 0)
    before: Index = np.cumsum(any_fall) - any_fall
    first = np.maximum.accumulate(np.where(first_of_lane(segments.lane), np.arange(before.size), 0))
    keep = np.flatnonzero((before == before[first]) & (fold | ~any_fall))

    kept_fold = fold[keep]
    at = keep[kept_fold]
    both = chebyshev.with_slope(slope[:, at])
    stop = np.ones(keep.size)
    stop[kept_fold] = falling_root(
        lambda i, z: chebyshev.value_and_slope(both[..., i], z),
        grid[cell[at] - 1],
        grid[cell[at]],
        last_step=accuracy.last_step,
    )
    kind = np.full(keep.size, SnapOff.NEVER, dtype=np.int8)
    ends = last_of_lane(segments.lane[keep])
    kind[ends] = np.where(last_of_lane(segments.lane)[keep], SnapOff.THRUST, SnapOff.CORNER)[ends]
    kind[kept_fold] = SnapOff.FOLD
    return keep, stop, kind


def polish_fold(seen: SeenContour, segments: Segments, angle: Floats, stop: Floats, friction_angle: Floats) -> Floats:
    """Ways at which the exact derivative of the drive angle vanishes: secants, the first by the interpolant."""

    def rate(way: Floats) -> Floats:
        parameter, parameter_rate = segments.along(way)
        return (
            angle_rate(seen, segments.lane, exact_states(seen, segments.lane, parameter, friction_angle))
            * parameter_rate
        )

    bend = chebyshev.evaluate(chebyshev.derivative(chebyshev.derivative(angle)), stop)
    at_stop, last_step = rate(stop), np.full(stop.shape, 2e-2)
    for _ in range(7):
        with np.errstate(divide="ignore", invalid="ignore"):
            step = at_stop / bend
            chosen = np.abs(step) < 0.5 * last_step
            new = np.where(chosen, np.clip(stop - step, 0.0, 1.0), stop)
            at_new = rate(new)
            bend = np.where(chosen, (at_new - at_stop) / (new - stop), bend)
        stop, at_stop, last_step = new, at_new, np.where(chosen, np.abs(step), last_step)
        if not np.any(chosen):
            break
    return stop
