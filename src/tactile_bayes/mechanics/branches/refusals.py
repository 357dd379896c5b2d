"""What rules out a path: a second contact, a tip that folds over, and the end of the contour.

A rod that is curved toward the object may touch it at two points, and one whose tip folds over with its other side.
One that is carried outward may come to the end of what is known of the object.
"""

from __future__ import annotations

import math

from tactile_bayes.mechanics.branches.advance import Here, Setting
from tactile_bayes.mechanics.branches.leg import PLACE, REST, LegSeries, guess
from tactile_bayes.mechanics.branches.line import pivots
from tactile_bayes.mechanics.branches.meeting import Meeting
from tactile_bayes.mechanics.branches.outline import Place, beside, is_inside
from tactile_bayes.mechanics.branches.phase import STUCK, Touch, contact_at, tip_touches
from tactile_bayes.mechanics.branches.scene import Equilibrium, Scene
from tactile_bayes.mechanics.compiler import compiled, inlined
from tactile_bayes.mechanics.poses.beam import PARTS, free_end, from_tip, loaded_part, rest_curvature
from tactile_bayes.mechanics.reachability import CLEARANCE, Reachability

_SHORT_END = 1e-3  # length of a free end [L] up to which its curvature at the contact tells whether it is in the object
_ROUNDING = 1e-9  # how far beyond the end of the contour rounding may put a contact at it
_ACROSS = 0.5 * math.pi
_TOUCHES, _TOO_CLOSE, _ENDS = int(Reachability.TOUCHES), int(Reachability.TOO_CLOSE), int(Reachability.ENDS)
_TOUCHES_TWICE, _FOLDS_OVER = int(Reachability.TOUCHES_TWICE), int(Reachability.FOLDS_OVER)
_CLEARANCE = CLEARANCE


@inlined
def ruled_out(here: Here, setting: Setting, met: Meeting, work: LegSeries) -> tuple[int, float]:
    """Reason why there is no path with the growing part of a leg, a `Reachability`, and the contact where it holds."""
    scene, at, stop = here.scene, contact_at(here.scene, met.at.at), met.stop
    if stop > 0.0 and not tip_touches(scene.phase) and not pivots(setting.lines) and at.arclength < _CLEARANCE:
        return _TOO_CLOSE, at.p
    if _is_past_end(scene, setting.ends[1], stop, work):
        return _ENDS, setting.ends[1]
    # A leg that continues the one before it begins where that was checked.
    twice = _second_contact(scene, setting.ends, math.isfinite(here.before.at.p), stop, work)
    if not math.isnan(twice):
        return _TOUCHES_TWICE, twice
    folded = _folded_over(scene, stop, work)
    return (_TOUCHES, math.nan) if math.isnan(folded) else (_FOLDS_OVER, folded)


@inlined
def _is_past_end(scene: Scene, end: float, stop: float, work: LegSeries) -> bool:
    """True if a contact up to a position on a leg is beyond the end of the contour from which the rod comes."""
    if scene.phase == STUCK:
        return False
    for k in range(work.nodes.size):
        if work.nodes[k] <= stop and work.at_nodes[PLACE, k] > end + _ROUNDING:
            return True
    return stop > 0.0 and guess(work, stop).p > end + _ROUNDING


@inlined
def _second_contact(scene: Scene, ends: tuple[float, float], goes_on: bool, stop: float, work: LegSeries) -> float:
    """Contact up to a position on a leg at which a rod curved toward the object would touch it twice; NaN without one.
    Unless the branch is exact, it is wholly looked for at the beginning and the end only."""
    if scene.beam.most_curvature <= 0.0:
        return math.nan
    for k in range(1 if goes_on else 0, work.nodes.size):
        if k > 0 and work.nodes[k] > stop:
            break
        force = math.hypot(work.at_nodes[1, k], work.at_nodes[2, k])
        at = Equilibrium(work.at_nodes[PLACE, k], work.at_nodes[REST, k], force)
        contact = contact_at(scene, at)
        if _touches_twice(scene, contact, force, work.accuracy.exact or k == 0, ends):
            return contact.p
    at = guess(work, stop)
    contact = contact_at(scene, at)
    return contact.p if _touches_twice(scene, contact, at.force, bool(1), ends) else math.nan


@inlined
def _touches_twice(scene: Scene, at: Touch, force: float, wholly: bool, ends: tuple[float, float]) -> bool:
    """True if a rod touches the object at another point too, between the ends of the contour. In tangential contact the
    free end has its rest shape. It is in the object at once where the contour is less curved than the rod, or further
    on, at its tip, which is looked for if all is. In tip contact it may be the loaded part."""
    outline, beam, tip, arclength, psi1 = scene.outline, scene.beam, tip_touches(scene.phase), at.arclength, at.psi1
    spot = beside(outline, at.p, arclength)
    if not tip and spot.bend <= rest_curvature(beam, arclength) * spot.speed:
        return True
    if not wholly:
        return False
    if tip:
        turned = psi1 + at.friction_angle - outline.half_angle
        if 0.5 * beam.most_curvature <= turned <= _ACROSS:  # the rod is bent toward the object no more than at rest
            return False
        part, (cos, sin) = from_tip(beam, psi1), _along(spot, at.friction_angle)
        for j in range(1, PARTS):
            part = loaded_part(beam, psi1, force, j, part)
            u, v = part.state.u, part.state.v
            x, y = -u * cos + v * sin, -u * sin - v * cos
            if y * spot.cos > x * spot.sin and is_inside(outline, 1.0 - j / PARTS, spot.x + x, spot.y + y, ends):
                return True
    elif arclength < 1.0 - _SHORT_END:
        along, across = free_end(beam, arclength)
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
    if not tip_touches(scene.phase):
        return math.nan
    for k in range(work.nodes.size):
        if work.nodes[k] > stop:
            break
        at = contact_at(scene, Equilibrium(work.at_nodes[PLACE, k], work.at_nodes[REST, k], 0.0))
        if _is_folded(scene, at):
            return at.p
    at = contact_at(scene, guess(work, stop))
    return at.p if _is_folded(scene, at) else math.nan


@compiled
def _is_folded(scene: Scene, at: Touch) -> bool:
    return at.psi1 + at.friction_angle > math.pi - scene.outline.half_angle
