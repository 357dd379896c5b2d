"""Slip of a rod along the contour, which friction opposes."""

from __future__ import annotations

import math

from tactile_bayes.mechanics.branches.curves import REST
from tactile_bayes.mechanics.branches.equilibrium import Balance, Equilibrium, Loaded, dot
from tactile_bayes.mechanics.branches.leg import PLACE, Leg, LegCurves
from tactile_bayes.mechanics.branches.outline import narrower, place
from tactile_bayes.mechanics.compiler import compiled

__all__ = ["NOT_SLIPPING", "held", "slip"]

NOT_SLIPPING = 1e-9
"""Slip per length of a leg, or per travel, whose sense rounding may decide."""


@compiled
def slip(loaded: Loaded, found: Balance) -> float:
    """Slip of the rod along the contour, to greater parameters, per travel."""
    return _slip(loaded, found.at, found.tangent) / found.travel_rate


@compiled
def held(loaded: Loaded, leg: Leg, stop: float, at_stop: Balance, work: LegCurves) -> float:
    """Contact up to a position on a leg where the rod does not slip against its friction; NaN if there is none."""
    half = work.nodes.size
    for k in range(half):
        if loaded.friction_angle == 0.0 or (k > 0 and work.nodes[k] > stop):
            break
        at = Equilibrium(work.at_nodes[PLACE, k], work.at_nodes[REST, k], 0.0)
        along = Equilibrium(work.at_nodes[PLACE, half + k], work.at_nodes[REST, half + k], 0.0)
        if math.copysign(1.0, loaded.friction_angle) * _slip(loaded, at, along) > NOT_SLIPPING:
            return at.p
    sense = math.copysign(1.0, loaded.friction_angle) / dot(leg.normal, at_stop.tangent)
    held_there = loaded.friction_angle != 0.0 and sense * _slip(loaded, at_stop.at, at_stop.tangent) > NOT_SLIPPING
    return at_stop.at.p if held_there else math.nan


@compiled
def _slip(loaded: Loaded, at: Equilibrium, along: Equilibrium) -> float:
    """Slip of the rod along the contour, to greater parameters, as its coordinates change."""
    spot = narrower(loaded.outline, place(loaded.outline, at.p), 1.0 if loaded.tip else at.q)
    return spot.speed * along.p - (0.0 if loaded.tip else along.q)
