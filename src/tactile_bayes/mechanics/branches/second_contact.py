"""A second contact: a rod that is curved toward the object may touch it at two points, and one whose tip folds over
with its other side."""

from __future__ import annotations

import math

from tactile_bayes.mechanics.branches.curves import REST
from tactile_bayes.mechanics.branches.equilibrium import Equilibrium, Scene, tangential_psi1
from tactile_bayes.mechanics.branches.leg import PLACE, LegCurves, guess
from tactile_bayes.mechanics.branches.outline import Outline, Place, ends, is_inside, narrower, place
from tactile_bayes.mechanics.branches.phase import on_rod
from tactile_bayes.mechanics.compiler import compiled, inlined
from tactile_bayes.mechanics.phases import TIP
from tactile_bayes.mechanics.poses.beam import PARTS, free_end, from_tip, loaded_part, rest_curvature

__all__ = ["folded_over", "second_contact"]

_SHORT_END = 1e-3
"""Length of a free end [L] up to which its curvature at the contact tells whether it is in the object."""

_ACROSS = 0.5 * math.pi


@inlined
def second_contact(scene: Scene, seen: Outline, goes_on: bool, stop: float, work: LegCurves) -> float:
    """Contact up to a position on a leg at which a rod curved toward the object would touch it twice; NaN without one.

    Unless the branch is exact, it is wholly looked for at the beginning and the end only.
    """
    if scene.beam.most_curvature <= 0.0:
        return math.nan
    low, high = ends(seen)
    for k in range(1 if goes_on else 0, work.nodes.size):  # a leg that goes on begins where the last one was checked
        if k > 0 and work.nodes[k] > stop:
            break
        p, q = work.at_nodes[PLACE, k], work.at_nodes[REST, k]
        force = math.hypot(work.at_nodes[1, k], work.at_nodes[2, k])
        if _touches_twice(scene, Equilibrium(p, q, force), scene.exact or k == 0, low, high):
            return p
    at = guess(work, stop)
    return at.p if _touches_twice(scene, at, True, low, high) else math.nan


@inlined
def folded_over(scene: Scene, stop: float, work: LegCurves) -> float:
    """Contact up to a position on a leg at which the tip lies along the contour with the other side of the rod; NaN
    without one. Beyond it, the rod beside its tip would be in the object."""
    if scene.phase != TIP:
        return math.nan
    most = math.pi - scene.rig.friction_angle - scene.outline.half_angle
    for k in range(work.nodes.size):
        if work.nodes[k] > stop:
            break
        if work.at_nodes[REST, k] > most:
            return work.at_nodes[PLACE, k]
    at = guess(work, stop)
    return at.p if at.q > most else math.nan


@inlined
def _touches_twice(scene: Scene, at: Equilibrium, wholly: bool, low: float, high: float) -> bool:
    """True if a rod touches the object at another point too, between the ends of the contour.

    In tangential contact the free end has its rest shape. It is in the object at once where the contour is less
    curved than the rod, or further on, at its tip, which is looked for if all is. In tip contact it may be the loaded
    part.
    """
    outline, beam, q, tip = scene.outline, scene.beam, at.q, scene.phase == TIP
    spot = narrower(outline, place(outline, at.p), on_rod(scene.phase, q, 0.0)[1])
    if not tip and spot.bend <= rest_curvature(beam, q) * spot.speed:
        return True
    if not wholly:
        return False
    if tip:
        turned = q - tangential_psi1(scene)
        if 0.5 * beam.most_curvature <= turned <= _ACROSS:  # the rod is bent toward the object no more than at rest
            return False
        part, (cos, sin) = from_tip(beam, q), _along(spot, scene.rig.friction_angle)
        for j in range(1, PARTS):
            part = loaded_part(beam, q, at.force, j, part)
            u, v = part.state.u, part.state.v
            x, y = -u * cos + v * sin, -u * sin - v * cos
            if y * spot.cos > x * spot.sin and is_inside(outline, 1.0 - j / PARTS, spot.x + x, spot.y + y, low, high):
                return True
    elif q < 1.0 - _SHORT_END:
        along, across = free_end(beam, q)
        cos, sin = _along(spot, outline.half_angle)
        x, y = along * cos - across * sin, along * sin + across * cos
        return is_inside(outline, 1.0, spot.x + x, spot.y + y, low, high)
    return False


@compiled
def _along(spot: Place, turn: float) -> tuple[float, float]:
    """Direction turned from that of the contour."""
    cos, sin = math.cos(turn), math.sin(turn)
    return spot.cos * cos - spot.sin * sin, spot.sin * cos + spot.cos * sin
