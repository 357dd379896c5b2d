"""The beginning of a branch: first contact, and the state there."""

from __future__ import annotations

import math
from typing import NamedTuple

from tactile_bayes.arrays import Floats
from tactile_bayes.mechanics.branches.equilibrium import (
    BY_FORCE,
    NO_FORCE,
    SETTLED,
    Balance,
    Equilibrium,
    Scene,
    balance,
    in_phase,
    nowhere,
    on_line,
    settle,
    tangential_psi1,
    with_friction,
)
from tactile_bayes.mechanics.branches.limits import Approach, approach, arrival, touch
from tactile_bayes.mechanics.branches.line import line_of, only_turns, pose_at
from tactile_bayes.mechanics.branches.outline import Outline, bearing, from_base
from tactile_bayes.mechanics.branches.phase import touching
from tactile_bayes.mechanics.branches.refusals import NOT_SLIPPING, slip
from tactile_bayes.mechanics.compiler import compiled
from tactile_bayes.mechanics.phases import TANGENTIAL, TIP
from tactile_bayes.mechanics.reachability import Reachability

__all__ = ["Beginning", "beginning"]

_TOUCHES, _TOUCHES_TWICE = int(Reachability.TOUCHES), int(Reachability.TOUCHES_TWICE)
_SLIPS_OFF, _STICKS = int(Reachability.SLIPS_OFF), int(Reachability.STICKS)

_NOT_TURNED = 1e-3
"""Angle [rad] by which a tip that is found to touch first may lie along the contour all the same, if it is carried: as
near as its first contact is found."""


class Beginning(NamedTuple):
    """First contact and the state there."""

    reach: int
    """A `Reachability`."""
    near: Approach
    scene: Scene
    """With the phase, the line of the drive, and the friction that the rod has there."""
    line: int
    state: Balance


@compiled
def beginning(scene: Scene, lines: Floats | None, slides: bool, first_step: float) -> Beginning:
    """Beginning of a branch, on the first line that leads to contact if the drive carries the base.

    Friction opposes the slip there if `slides`; otherwise it acts as in a forward sweep of a straight rod.
    """
    near, scene, line, seen = _arrive(scene, lines, first_step)
    if near.reach != _TOUCHES:
        return Beginning(near.reach, near, scene, line, nowhere())
    reach, scene, state = _first_state(scene, lines, seen, near, slides)
    least_psi1 = tangential_psi1(scene) - (0.0 if lines is None else _NOT_TURNED)
    if reach == _TOUCHES and scene.phase == TIP and state.at.q < least_psi1:
        reach = _TOUCHES_TWICE
    return Beginning(reach, near, scene, line, state)


@compiled
def _arrive(scene: Scene, lines: Floats | None, first_step: float) -> tuple[Approach, Scene, int, Outline]:
    """First contact, the scene with the line of the drive on which it lies, and the outline relative to the base."""
    if lines is None:
        return approach(scene.outline, scene.beam, first_step), scene, 0, scene.outline
    near, k, travel = arrival(scene.outline, scene.beam, lines)
    pose = pose_at(line_of(lines, k), travel)
    return near, on_line(scene, lines, k), k, from_base(scene.outline, pose.x, pose.y)


@compiled
def _first_state(
    scene: Scene, lines: Floats | None, seen: Outline, near: Approach, slides: bool
) -> tuple[int, Scene, Balance]:
    """State at first contact, with the friction that it has: it opposes the slip of the rod along the contour.

    A tip that is carried head-on does not slip to first order: rounding would decide the sense.
    """
    scene = in_phase(scene, touching(near.tip_first))
    begin = _unloaded(scene, lines, seen, near)
    if scene.phase == TANGENTIAL and lines is not None and begin.at.q > 1.0:  # the approach is not exact
        near = Approach(near.reach, near.distance, near.begin, True, near.ends, near.gap)
        scene = in_phase(scene, TIP)
        begin = _unloaded(scene, lines, seen, near)
    delta = scene.rig.friction_angle
    if slides and delta > 0.0:
        slipping = slip(scene, begin)
        if scene.phase == TIP and not only_turns(scene.line) and not abs(slipping) > NOT_SLIPPING:
            return _STICKS, scene, begin
        if slipping > NOT_SLIPPING:
            scene = with_friction(scene, -delta)
            begin = _unloaded(scene, lines, seen, near)
            if not slip(scene, begin) > 0.0:
                return _STICKS, scene, begin
    pushed = lines is None or begin.rates.travel * begin.tangent.force > 0.0
    return _TOUCHES if pushed else _SLIPS_OFF, scene, begin


@compiled
def _unloaded(scene: Scene, lines: Floats | None, seen: Outline, near: Approach) -> Balance:
    """Equilibrium without force at first contact with an outline relative to the base."""
    at, chord = touch(seen, scene.beam, near.begin, near.tip_first)
    q = chord.arclength
    if near.tip_first:
        q = bearing(at) + chord.at_point - math.atan2(at.sin, at.cos) - scene.rig.friction_angle
    start = Equilibrium(near.begin, q, 0.0)
    if lines is None:
        return balance(scene, start)[0]
    return settle(scene, start, NO_FORCE, BY_FORCE, 0.0, SETTLED)
