"""Slip of a rod along the contour, which friction opposes."""

from __future__ import annotations

import math

from tactile_bayes.mechanics.branches.curves import REST
from tactile_bayes.mechanics.branches.equilibrium import Balance, Equilibrium, Scene, dot
from tactile_bayes.mechanics.branches.leg import PLACE, Leg, LegCurves
from tactile_bayes.mechanics.branches.outline import narrower, place
from tactile_bayes.mechanics.branches.phase import on_rod, sliding
from tactile_bayes.mechanics.compiler import compiled

__all__ = ["NOT_SLIPPING", "held", "slip"]

NOT_SLIPPING = 1e-9
"""Slip per length of a leg, or per travel, whose sense rounding may decide."""


@compiled
def slip(scene: Scene, found: Balance) -> float:
    """Slip of the rod along the contour, to greater parameters, per travel."""
    return _slip(scene, found.at, found.tangent) / found.rates.travel


@compiled
def held(scene: Scene, leg: Leg, stop: float, at_stop: Balance, work: LegCurves) -> float:
    """Contact up to a position on a leg where the rod does not slip against its friction; NaN if there is none."""
    half, delta = work.nodes.size, scene.rig.friction_angle
    if delta == 0.0:
        return math.nan
    for k in range(half):
        if k > 0 and work.nodes[k] > stop:
            break
        at = Equilibrium(work.at_nodes[PLACE, k], work.at_nodes[REST, k], 0.0)
        along = Equilibrium(work.at_nodes[PLACE, half + k], work.at_nodes[REST, half + k], 0.0)
        if math.copysign(1.0, delta) * _slip(scene, at, along) > NOT_SLIPPING:
            return at.p
    sense = math.copysign(1.0, delta) / dot(leg.normal, at_stop.tangent)
    return at_stop.at.p if sense * _slip(scene, at_stop.at, at_stop.tangent) > NOT_SLIPPING else math.nan


@compiled
def _slip(scene: Scene, at: Equilibrium, along: Equilibrium) -> float:
    """Slip of the rod along the contour, to greater parameters, as its coordinates change."""
    spot = narrower(scene.outline, place(scene.outline, at.p), on_rod(scene.phase, at.q, 0.0)[1])
    return spot.speed * along.p - sliding(scene.phase) * along.q
