"""Slip of a rod along the contour, which friction opposes."""

from __future__ import annotations

import math

from tactile_bayes.mechanics.branches.curves import REST
from tactile_bayes.mechanics.branches.equilibrium import Balance, Loaded
from tactile_bayes.mechanics.branches.leg import PLACE, LegCurves
from tactile_bayes.mechanics.branches.outline import narrower, place
from tactile_bayes.mechanics.compiler import compiled

__all__ = ["held", "slip"]

_HELD = 1e-9
"""Slip per length of a leg, in the sense of the friction, that rounding may cause."""


@compiled
def slip(loaded: Loaded, found: Balance) -> float:
    """Slip of the rod along the contour, to greater parameters, per travel."""
    spot = narrower(loaded.outline, place(loaded.outline, found.at.p), 1.0 if loaded.tip else found.at.q)
    slip = spot.speed * found.tangent.p - (0.0 if loaded.tip else found.tangent.q)
    return slip / found.travel_rate


@compiled
def held(loaded: Loaded, stop: float, work: LegCurves) -> float:
    """Contact up to a position on a leg where the rod does not slip against its friction; NaN if there is none."""
    half = work.nodes.size
    for k in range(half):
        if loaded.friction_angle == 0.0 or (k > 0 and work.nodes[k] > stop):
            break
        p = work.at_nodes[PLACE, k]
        spot = narrower(loaded.outline, place(loaded.outline, p), 1.0 if loaded.tip else work.at_nodes[REST, k])
        along_rod = 0.0 if loaded.tip else work.at_nodes[REST, half + k]
        slip = spot.speed * work.at_nodes[PLACE, half + k] - along_rod
        if math.copysign(slip, slip * loaded.friction_angle) > _HELD:
            return p
    return math.nan
