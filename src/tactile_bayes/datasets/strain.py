"""How much a rod is strained: beyond the end of the model its loads are not to be trusted."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from tactile_bayes.elastica import largest_curvature
from tactile_bayes.path import Paths

__all__ = ["largest_strain"]

Floats = NDArray[np.float64]

_STATES = 9
"""On each stretch of a path, of which the largest strain is taken."""


def largest_strain(paths: Paths, lanes: NDArray[np.bool_]) -> Floats:
    """Largest bending strain of the rod's outer fibre up to snap-off, to 1 % of it; 0 on lanes that are not chosen.

    Parameters
    ----------
    paths : Paths
    lanes : ndarray of bool, shape (lanes,)
        Which are wanted.

    Returns
    -------
    ndarray, shape (lanes,)
    """
    chosen = np.flatnonzero(lanes[paths.segments.lane])
    lane = paths.segments.lane[chosen]
    ways = np.broadcast_to(np.linspace(0.0, 1.0, _STATES), (lane.size, _STATES))
    parameter, _ = paths.segments.take(chosen[:, None]).along(ways)
    wrench = paths.states_at(np.repeat(lane, _STATES), parameter.ravel()).wrench
    curvature = np.zeros(paths.seen.lanes)
    # At first contact rounding may put the point a little out of reach; the rod is straight there.
    np.fmax.at(curvature, np.repeat(lane, _STATES), largest_curvature(wrench))
    return np.asarray(curvature * paths.seen.standoff / paths.seen.length)
