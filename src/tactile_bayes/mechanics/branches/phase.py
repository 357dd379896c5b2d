"""Contact phases, and what each must offer to a branch.

A contact has four numbers: the contour's parameter p, the angle γ from the contour's normal to the force, the angle ψ1
from the force to the rod, and the rod's arc length s1. A phase leaves two of them free, which with the force are the
coordinates (p, q, f) of an equilibrium:

| phase    | p is        | q is | γ is             | the others                               |
|----------|-------------|------|------------------|------------------------------------------|
| sliding, |             |      |                  |                                          |
| the tip  | p           | ψ1   | ± arctan μ       | s1 = 1                                   |
| the rod  | p           | s1   | ± arctan μ       | ψ1 = ε − γ, along a cone of half angle ε |
| sticking,|             |      |                  |                                          |
| the tip  | τ = ψ1 + γ  | γ    | within the cone  | where it is anchored, s1 = 1             |
| the rod  | p           | γ    | within the cone  | ψ1 = ε − γ, s1 as the rod rolls          |

What is particular to a phase is here, with a case for each:

- `contact_at`: the contact from (p, q); `moves`: its derivatives by them, from which `equilibrium` has its equations;
- `limit`: the p or q at which the phase ends; `turned_over`: the phase that begins there, at its own limit;
- `slip`: how the contact slips, and `stuck` and `sliding_on`, where it begins and ends to stick;
- `is_possible`: the contacts between which equilibria are sought.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from tactile_bayes.mechanics.branches.outline import Outline, beside, place
from tactile_bayes.mechanics.branches.scene import Equilibrium, Scene, StuckContact, anchored, in_phase, with_friction
from tactile_bayes.mechanics.compiler import compiled, inlined
from tactile_bayes.mechanics.phases import TANGENTIAL, TIP

# Codes of the phases in which a tip, or the rod, sticks, beside `TIP` and `TANGENTIAL`, in which they slide.
STUCK, ROLLING = 3, 4
_LONGEST = 1.5  # largest arc length [L] at which a contact is sought: a Newton step may pass the tip by half the rod
# ψ1 between which a contact is sought: a quarter turn more than those of a rod on the outside of the contour.
_LEAST_PSI1, _MOST_PSI1 = -0.5 * math.pi, 1.5 * math.pi
_CLEARLY = 0.03  # slip over the way on a leg, a hundred times the errors of coarse nodes
# Gauss–Legendre quadrature of the way that a rod rolls on a leg, to rounding.
_NODES, _WEIGHTS = (tuple(column.tolist()) for column in np.polynomial.legendre.leggauss(16))
_MOST_STEPS = 8  # Newton steps to where a rod has rolled to its tip


class Touch(NamedTuple):
    """Where rod and object touch, and the direction of the force."""

    p: float  # parameter of the contour
    friction_angle: float  # angle γ from its normal to the force [rad]
    psi1: float  # angle from the force to the rod, as in `pose` [rad]
    arclength: float


class Move(NamedTuple):
    """Derivatives of a contact by a coordinate."""

    p: float
    friction_angle: float
    psi1: float
    arclength: float


class Limit(NamedTuple):
    """Where a phase ends."""

    is_p: bool  # true if p ends there, else q
    value: float
    sense: float  # 1 if it grows toward the end, −1 if it falls


@inlined
def touching(tip: bool) -> int:
    """Phase of a contact that slides."""
    return TIP if tip else TANGENTIAL


@inlined
def slides(phase: int) -> bool:
    return phase <= TANGENTIAL


@inlined
def tip_touches(phase: int) -> bool:
    return phase in (TIP, STUCK)


@compiled
def contact_at(scene: Scene, at: Equilibrium) -> Touch:
    """Contact of an equilibrium."""
    phase, gamma, half_angle, anchor = scene.phase, scene.rig.friction_angle, scene.outline.half_angle, scene.anchor
    if phase == TIP:
        return Touch(at.p, gamma, at.q, 1.0)
    if phase == TANGENTIAL:
        return Touch(at.p, gamma, half_angle - gamma, at.q)
    if phase == STUCK:
        return Touch(anchor.p, at.q, at.p - at.q, 1.0)
    return Touch(at.p, at.q, half_angle - at.q, _rolled(scene.outline, anchor, at.p))


@compiled
def moves(phase: int, speed: float) -> tuple[Move, Move]:
    """Derivatives of the contact by p and by q, where the contour's arc length grows at a speed with its parameter."""
    if phase == TIP:
        return Move(1.0, 0.0, 0.0, 0.0), Move(0.0, 0.0, 1.0, 0.0)
    if phase == TANGENTIAL:
        return Move(1.0, 0.0, 0.0, 0.0), Move(0.0, 0.0, 0.0, 1.0)
    if phase == STUCK:
        return Move(0.0, 0.0, 1.0, 0.0), Move(0.0, 1.0, -1.0, 0.0)
    return Move(1.0, 0.0, 0.0, speed), Move(0.0, 1.0, -1.0, 0.0)


@compiled
def _rolled(outline: Outline, anchor: StuckContact, p: float) -> float:
    """Arc length at which a rod touches that has rolled on the contour from its anchor. It grows as the contour's
    parallel curve on which the centreline lies, ds1 = dσ − s1 sin ε dα: by the half angle ε of a cone that curve
    changes with the arc length, and exp(α sin ε) is the integrating factor."""
    half, middle, narrowing = 0.5 * (p - anchor.p), 0.5 * (p + anchor.p), outline.narrowing
    if half == 0.0:
        return anchor.arclength
    at = place(outline, p)
    slope, way = math.atan2(at.sin, at.cos), 0.0
    for k in range(len(_NODES)):
        there = place(outline, middle + half * _NODES[k])
        way += _WEIGHTS[k] * there.speed * math.exp(narrowing * (math.atan2(there.sin, there.cos) - slope))
    begin = place(outline, anchor.p)
    return anchor.arclength * math.exp(narrowing * (math.atan2(begin.sin, begin.cos) - slope)) + half * way


@compiled
def limit(scene: Scene, p: float) -> Limit:
    """Where the phase ends; that of a rod that rolls is sought from a parameter of the contour."""
    phase, outline, anchor = scene.phase, scene.outline, scene.anchor
    if phase == TIP:
        return Limit(bool(0), outline.half_angle - scene.rig.friction_angle, -1.0)
    if phase == TANGENTIAL:
        return Limit(bool(0), 1.0, 1.0)
    if phase == STUCK:
        return Limit(bool(1), outline.half_angle, -1.0)
    for _ in range(_MOST_STEPS):
        off = 1.0 - _rolled(outline, anchor, p)
        step = off / beside(outline, p, 1.0).speed
        p += step
        if not abs(off) > 1e-15:
            break
    return Limit(bool(1), p, 1.0)


@compiled
def turned_over(scene: Scene, at: Equilibrium) -> tuple[Scene, Equilibrium, Equilibrium]:
    """The phase that begins where one ends, with tip or rod in place of the other, and the direction away from its own
    limit."""
    contact, to_tip = contact_at(scene, at), not tip_touches(scene.phase)
    if slides(scene.phase):
        there = in_phase(scene, TIP if to_tip else TANGENTIAL)
        end = limit(there, contact.p)
        return there, Equilibrium(contact.p, end.value, at.force), Equilibrium(0.0, -end.sense, 0.0)
    there = anchored(in_phase(scene, STUCK if to_tip else ROLLING), StuckContact(contact.p, 1.0))
    end = limit(there, contact.p)
    return there, Equilibrium(end.value, contact.friction_angle, at.force), Equilibrium(-end.sense, 0.0, 0.0)


@compiled
def slip(scene: Scene, at: Equilibrium, along: Equilibrium) -> float:
    """Slip of a sliding rod along the contour, to greater parameters, as its coordinates change."""
    tip = tip_touches(scene.phase)
    speed = beside(scene.outline, at.p, 1.0 if tip else at.q).speed
    return speed * along.p - (0.0 if tip else along.q)


@compiled
def slips_clearly(scene: Scene, at: Equilibrium, along: Equilibrium) -> bool:
    """Return whether a rod slides, and hardly could stick nearby."""
    return slides(scene.phase) and abs(slip(scene, at, along)) > _CLEARLY


@compiled
def stuck(scene: Scene, at: Equilibrium) -> tuple[Scene, Equilibrium]:
    """A sliding contact as one that sticks."""
    contact = contact_at(scene, at)
    tip, gamma = tip_touches(scene.phase), contact.friction_angle
    there = anchored(in_phase(scene, STUCK if tip else ROLLING), StuckContact(contact.p, contact.arclength))
    return there, Equilibrium(contact.psi1 + gamma if tip else contact.p, gamma, at.force)


@compiled
def sliding_on(scene: Scene, at: Equilibrium) -> tuple[Scene, Equilibrium]:
    """A contact that sticks, with its force at the edge of the cone, as one that slides."""
    contact, delta = contact_at(scene, at), abs(scene.rig.friction_angle)
    tip = tip_touches(scene.phase)
    there = with_friction(in_phase(scene, touching(tip)), math.copysign(delta, contact.friction_angle))
    return there, Equilibrium(contact.p, contact.psi1 if tip else contact.arclength, at.force)


@compiled
def is_possible(contact: Touch) -> bool:
    """False if an equilibrium is sought too far away."""
    return _LEAST_PSI1 <= contact.psi1 <= _MOST_PSI1 and 0.0 <= contact.arclength <= _LONGEST
