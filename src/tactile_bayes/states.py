"""Exact states on equilibrium paths, and how fast the drive angle grows there."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tactile_bayes.contours.seen import SeenContour
from tactile_bayes.elastica import Wrench, wrench_from_contact
from tactile_bayes.reach import seen_frame

__all__ = ["States", "angle_rate", "exact_states"]

Floats = NDArray[np.float64]
Index = NDArray[np.intp]


class States(NamedTuple):
    """Exact states on the paths."""

    parameter: Floats
    """The contour's parameter, seen."""
    x: Floats
    y: Floats
    """Point at which rod's centreline and the contour (seen) touch."""
    slope_angle: Floats
    wrench: Wrench


def exact_states(
    seen: SeenContour,
    lane: Index,
    parameter: Floats,
    friction_angle: Floats,
    *,
    phase: NDArray[Any] | None = None,
) -> States:
    """States at the contour's parameters; friction angles are those of all lanes."""
    locus = seen.locate(lane, parameter)
    wrench = wrench_from_contact(locus.x, locus.y, locus.slope_angle, friction_angle[lane], phase=phase)
    return States(parameter, locus.x, locus.y, locus.slope_angle, wrench)


def angle_rate(seen: SeenContour, lane: Index, state: States) -> Floats:
    """Derivative of the drive angle by the contour's parameter."""
    locus = seen.locate(lane, state.parameter)
    along, facing = seen_frame(locus)
    distance2 = locus.x**2 + locus.y**2
    bearing_rate = -facing * locus.arclength_rate / distance2
    with np.errstate(invalid="ignore"):
        by_distance = state.wrench.by_distance * 2.0 * along * locus.arclength_rate
        return bearing_rate + state.wrench.by_slope * (locus.slope_rate - bearing_rate) + by_distance
