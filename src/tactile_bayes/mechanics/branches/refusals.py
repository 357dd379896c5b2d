"""What rules out a path: a second contact, friction that would hold the contact, and a tip that folds over.

A rod that is curved toward the object may touch it at two points, and one whose tip folds over with its other side.
"""

from __future__ import annotations

import math

from tactile_bayes.mechanics.branches.advance import Here, Setting, Step
from tactile_bayes.mechanics.branches.equilibrium import Balance, Equilibrium, Scene, dot, tangential_psi1
from tactile_bayes.mechanics.branches.leg import PLACE, REST, Leg, LegSeries, guess
from tactile_bayes.mechanics.branches.meeting import KNOT, Meeting
from tactile_bayes.mechanics.branches.outline import Place, beside, is_inside
from tactile_bayes.mechanics.branches.phase import on_rod, sliding
from tactile_bayes.mechanics.compiler import compiled, inlined
from tactile_bayes.mechanics.phases import TANGENTIAL, TIP
from tactile_bayes.mechanics.poses.beam import PARTS, free_end, from_tip, loaded_part, rest_curvature
from tactile_bayes.mechanics.reachability import CLEARANCE, Reachability

__all__ = ["NOT_SLIPPING", "ruled_out", "slip"]

NOT_SLIPPING = 1e-9
"""Slip per length of a leg, or per travel, whose sense rounding may decide."""

_SHORT_END = 1e-3
"""Length of a free end [L] up to which its curvature at the contact tells whether it is in the object."""

_ACROSS = 0.5 * math.pi
_TOUCHES, _TOO_CLOSE, _STICKS = int(Reachability.TOUCHES), int(Reachability.TOO_CLOSE), int(Reachability.STICKS)
_TOUCHES_TWICE, _FOLDS_OVER = int(Reachability.TOUCHES_TWICE), int(Reachability.FOLDS_OVER)
_CLEARANCE = CLEARANCE


@inlined
def ruled_out(here: Here, setting: Setting, step: Step, met: Meeting, work: LegSeries) -> tuple[int, float]:
    """Reason why there is no path with the growing part of a leg, a `Reachability`, and the contact where it holds."""
    scene, at, stop = here.scene, met.at, met.stop
    if stop > 0.0 and scene.phase == TANGENTIAL and setting.lines is not None and at.at.q < _CLEARANCE:
        return _TOO_CLOSE, at.at.p
    # A leg that continues the one before it begins where that was checked.
    twice = _second_contact(scene, setting.ends, math.isfinite(here.before.at.p), stop, work)
    if not math.isnan(twice):
        return _TOUCHES_TWICE, twice
    if stop > 0.0 and setting.slides:
        before_knot = step.end if met.kind == KNOT and not met.is_maximum else at
        stuck = _held(scene, step.leg, stop, before_knot, work)
        if not math.isnan(stuck):
            return _STICKS, stuck
    folded = _folded_over(scene, stop, work)
    return (_TOUCHES, math.nan) if math.isnan(folded) else (_FOLDS_OVER, folded)


@compiled
def slip(scene: Scene, found: Balance) -> float:
    """Slip of the rod along the contour, to greater parameters, per travel."""
    return _slip(scene, found.at, found.tangent) / found.rates.travel


@compiled
def _slip(scene: Scene, at: Equilibrium, along: Equilibrium) -> float:
    """Slip of the rod along the contour, to greater parameters, as its coordinates change."""
    spot = beside(scene.outline, at.p, on_rod(scene.phase, at.q, 0.0)[1])
    return spot.speed * along.p - sliding(scene.phase) * along.q


@compiled
def _held(scene: Scene, leg: Leg, stop: float, at_stop: Balance, work: LegSeries) -> float:
    """Contact up to a position on a leg where the rod does not slip against its friction; NaN if there is none."""
    at_nodes, half, delta = work.at_nodes, work.nodes.size, scene.rig.friction_angle
    if delta == 0.0:
        return math.nan
    sense = math.copysign(1.0, delta)
    for k in range(half):
        if k > 0 and work.nodes[k] > stop:
            break
        at = Equilibrium(at_nodes[PLACE, k], at_nodes[REST, k], 0.0)
        along = Equilibrium(at_nodes[PLACE, half + k], at_nodes[REST, half + k], 0.0)
        if sense * _slip(scene, at, along) > NOT_SLIPPING:
            return at.p
    sense /= dot(leg.normal, at_stop.tangent)
    return at_stop.at.p if sense * _slip(scene, at_stop.at, at_stop.tangent) > NOT_SLIPPING else math.nan


@inlined
def _second_contact(scene: Scene, ends: tuple[float, float], goes_on: bool, stop: float, work: LegSeries) -> float:
    """Contact up to a position on a leg at which a rod curved toward the object would touch it twice; NaN without one.

    Unless the branch is exact, it is wholly looked for at the beginning and the end only.
    """
    if scene.beam.most_curvature <= 0.0:
        return math.nan
    for k in range(1 if goes_on else 0, work.nodes.size):
        if k > 0 and work.nodes[k] > stop:
            break
        force = math.hypot(work.at_nodes[1, k], work.at_nodes[2, k])
        at = Equilibrium(work.at_nodes[PLACE, k], work.at_nodes[REST, k], force)
        if _touches_twice(scene, at, work.accuracy.exact or k == 0, ends):
            return at.p
    at = guess(work, stop)
    return at.p if _touches_twice(scene, at, bool(1), ends) else math.nan


@inlined
def _touches_twice(scene: Scene, at: Equilibrium, wholly: bool, ends: tuple[float, float]) -> bool:
    """True if a rod touches the object at another point too, between the ends of the contour.

    In tangential contact the free end has its rest shape. It is in the object at once where the contour is less
    curved than the rod, or further on, at its tip, which is looked for if all is. In tip contact it may be the loaded
    part.
    """
    outline, beam, q, tip = scene.outline, scene.beam, at.q, scene.phase == TIP
    spot = beside(outline, at.p, on_rod(scene.phase, q, 0.0)[1])
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
            if y * spot.cos > x * spot.sin and is_inside(outline, 1.0 - j / PARTS, spot.x + x, spot.y + y, ends):
                return True
    elif q < 1.0 - _SHORT_END:
        along, across = free_end(beam, q)
        cos, sin = _along(spot, outline.half_angle)
        x, y = along * cos - across * sin, along * sin + across * cos
        return is_inside(outline, 1.0, spot.x + x, spot.y + y, ends)
    return False


@compiled
def _along(spot: Place, turn: float) -> tuple[float, float]:
    """Direction turned from that of the contour."""
    cos, sin = math.cos(turn), math.sin(turn)
    return spot.cos * cos - spot.sin * sin, spot.sin * cos + spot.cos * sin


@inlined
def _folded_over(scene: Scene, stop: float, work: LegSeries) -> float:
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
