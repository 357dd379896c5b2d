"""Equilibria of a rod and a contour: the contact, and how it moves along the branch of solutions.

An equilibrium has three coordinates: the contour's parameter p at the contact, the contact force f, and the coordinate
q of the rod: the angle ψ1 at its tip in tip contact, the arc length s1 in tangential contact. The rod's pose
and the contour must agree on the vector (U, V) from the pivot to the contact in the frame of the force,

    U(p) = u(q, f),    V(p) = v(q, f),

two equations that leave a curve, the branch. A third, linear equation picks a point of it, so that neither p nor f need
be monotone along the branch: a rod curved against the load is first straightened, and its contact moves outward before
it moves inward. The null vector of the two equations is the branch's tangent, and the drive angle φ0 = β(p) + ψ1 + turn
follows without another equation.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from tactile_bayes.mechanics.beam import Beam, beam_pose
from tactile_bayes.mechanics.compiler import compiled
from tactile_bayes.mechanics.outline import Outline, narrower, place

__all__ = [
    "SETTLED",
    "Balance",
    "Equilibrium",
    "Loaded",
    "Rig",
    "Scene",
    "balance",
    "dot",
    "in_phase",
    "less",
    "nowhere",
    "settle",
    "settle_at",
    "tangential_psi1",
    "times",
]

_MOST_STEPS = 25

_MOST_TURN, _MOST_LOADING = 0.4, 1.0
"""Largest changes of q, and of f over 1 + f, in a step."""

_ASTRAY = 1.5
"""Arc length [L] beyond which no tangential contact is sought."""

SETTLED = 1e-8
"""Step, over the largest, after which a first-order correction leaves rounding errors only."""


class Equilibrium(NamedTuple):
    """Coordinates of an equilibrium, or a direction in their space."""

    p: float
    q: float
    force: float


class Loaded(NamedTuple):
    """A rod that slides along a contour in one phase."""

    outline: Outline
    beam: Beam
    friction_angle: float
    compliance: float
    tip: bool
    psi1: float
    """ψ1 in tangential contact [rad]."""


class Rig(NamedTuple):
    """Parameters of the loads other than rod and contour."""

    friction_angle: float
    """Friction angle δ = arctan μ [rad]."""
    compliance: float
    """Turn of the pivot's suspension per holding moment, c in (drive angle) = φ0 + c m0 [rad/(EI/L)]."""
    offset: float
    """Encoder offset in the sweep frame [rad]."""
    sign: float
    """−1 in backward sweeps, else 1."""
    rigidity: float
    """Factor on loads: flexural rigidity over the rigidity in their unit."""


class Scene(NamedTuple):
    """All that an equilibrium depends on: one contour in the sweep frame, the rod, and the rig."""

    outline: Outline
    beam: Beam
    rig: Rig
    exact: bool
    """True if events are computed to rounding."""


class Balance(NamedTuple):
    """An equilibrium with its loads, and its tangent."""

    at: Equilibrium
    drive_angle: float
    """With the turn of the suspension [rad]."""
    holding_moment: float
    force_x: float
    force_y: float
    tangent: Equilibrium
    """Null vector of the equations, in no particular length."""
    angle_rate: float
    """Derivatives of the drive angle and the loads along it."""
    moment_rate: float
    x_rate: float
    y_rate: float


class _Equations(NamedTuple):
    """The two equations at a point, and the derivatives of the loads."""

    miss_u: float
    miss_v: float
    by_u: Equilibrium
    by_v: Equilibrium
    angle_by: Equilibrium
    lever_by_q: float
    bend: float


@compiled
def in_phase(scene: Scene, tip: bool) -> Loaded:
    """Rod in one phase of contact."""
    rig = scene.rig
    return Loaded(scene.outline, scene.beam, rig.friction_angle, rig.compliance, tip, tangential_psi1(scene))


@compiled
def tangential_psi1(scene: Scene) -> float:
    """ψ1 of a rod that lies along the contour with its surface [rad]."""
    return scene.outline.half_angle - scene.rig.friction_angle


@compiled
def balance(loaded: Loaded, at: Equilibrium) -> tuple[Balance, _Equations]:
    """Loads and tangent at a point near the branch."""
    delta, p, q, force = loaded.friction_angle, at.p, at.q, max(at.force, 0.0)
    psi1, length = (q, 1.0) if loaded.tip else (loaded.psi1, q)
    spot = narrower(loaded.outline, place(loaded.outline, p), length)
    sin_delta, cos_delta = math.sin(delta), math.cos(delta)
    sin, cos = spot.sin * cos_delta + spot.cos * sin_delta, spot.cos * cos_delta - spot.sin * sin_delta
    along, across = spot.x * cos + spot.y * sin, spot.y * cos - spot.x * sin
    here, by_q, by_force = beam_pose(loaded.beam, psi1, length, force, loaded.tip)
    closer = 0.0 if loaded.tip else loaded.outline.narrowing
    lever_by_q = closer * sin_delta
    by_u = Equilibrium(spot.speed * cos_delta + spot.bend * across, lever_by_q - by_q.u, -by_force.u)
    by_v = Equilibrium(-spot.speed * sin_delta - spot.bend * along, closer * cos_delta - by_q.v, -by_force.v)
    moment, compliance = force * along, loaded.compliance
    angle_by = Equilibrium(
        spot.bend + compliance * force * by_u.p,
        by_q.turn + (1.0 if loaded.tip else 0.0) + compliance * force * lever_by_q,
        by_force.turn + compliance * along,
    )
    angle = math.atan2(sin, cos) + psi1 + here.turn + compliance * moment
    tangent = _cross(by_u, by_v)
    turning = force * spot.bend * tangent.p
    found = Balance(
        at,
        angle,
        moment,
        -force * sin,
        force * cos,
        tangent,
        dot(angle_by, tangent),
        force * (by_u.p * tangent.p + lever_by_q * tangent.q) + along * tangent.force,
        -sin * tangent.force - cos * turning,
        cos * tangent.force - sin * turning,
    )
    return found, _Equations(along - here.u, across - here.v, by_u, by_v, angle_by, lever_by_q, spot.bend)


@compiled
def settle(
    loaded: Loaded, start: Equilibrium, origin: Equilibrium, normal: Equilibrium, level: float, settled: float
) -> Balance:
    """Equilibrium where normal · (z − origin) = level for z = (p, q, f), by Newton's method from a guess.

    The search ends with a step of `settled`, over the largest. The loads are corrected for it to first order; tangent
    and rates have an error of its size. NaN where the method does not converge.
    """
    at = start
    if _is_astray(loaded, at):
        return nowhere()
    for _ in range(_MOST_STEPS):
        found, equations = balance(loaded, at)
        miss_u, miss_v, by_u, by_v, angle_by, lever_by_q, bend = equations
        off = dot(normal, less(at, origin)) - level
        det = dot(normal, found.tangent)
        first, second, third = _cross(by_v, normal), _cross(normal, by_u), found.tangent
        dp = (miss_u * first.p + miss_v * second.p + off * third.p) / det
        dq = (miss_u * first.q + miss_v * second.q + off * third.q) / det
        df = (miss_u * first.force + miss_v * second.force + off * third.force) / det
        largest = max(abs(dq) / _MOST_TURN, abs(df) / (_MOST_LOADING * (1.0 + at.force)))
        if not largest < math.inf:
            break
        share = min(1.0, 1.0 / largest) if largest > 0.0 else 1.0
        at = Equilibrium(at.p - share * dp, at.q - share * dq, at.force - share * df)
        if _is_astray(loaded, at):
            break
        if largest <= settled and abs(dp) * bend <= settled:
            angle = found.drive_angle - dot(angle_by, Equilibrium(dp, dq, df))
            before = found.at.force
            lever = found.holding_moment / before if before > 0.0 else 0.0
            moment = found.holding_moment - df * lever - before * (by_u.p * dp + lever_by_q * dq)
            share, turn = (-df / before if before > 0.0 else 0.0), -bend * dp
            force_x = found.force_x + share * found.force_x - turn * found.force_y
            force_y = found.force_y + share * found.force_y + turn * found.force_x
            return Balance(
                at,
                angle,
                moment,
                force_x,
                force_y,
                found.tangent,
                found.angle_rate,
                found.moment_rate,
                found.x_rate,
                found.y_rate,
            )
    return nowhere()


@compiled
def _is_astray(loaded: Loaded, at: Equilibrium) -> bool:
    """Return whether a rod without a closed form is sought too far beyond its tip: it takes long and leads nowhere."""
    return loaded.beam.varied is not None and not loaded.tip and at.q > _ASTRAY


@compiled
def settle_at(loaded: Loaded, p: float, start: Equilibrium) -> Balance:
    """Equilibrium at a parameter of the contour, where its curvature may be infinite; NaN if none is found.

    Tangent and rates need not be finite.
    """
    at = Equilibrium(p, start.q, start.force)
    for _ in range(_MOST_STEPS):
        equations = balance(loaded, at)[1]
        miss_u, miss_v, by_u, by_v = equations.miss_u, equations.miss_v, equations.by_u, equations.by_v
        det = by_u.q * by_v.force - by_u.force * by_v.q
        dq, df = (miss_u * by_v.force - miss_v * by_u.force) / det, (by_u.q * miss_v - by_v.q * miss_u) / det
        largest = max(abs(dq) / _MOST_TURN, abs(df) / (_MOST_LOADING * (1.0 + at.force)))
        if not largest < math.inf:
            break
        share = min(1.0, 1.0 / largest) if largest > 0.0 else 1.0
        at = Equilibrium(p, at.q - share * dq, at.force - share * df)
        if largest <= SETTLED:
            return balance(loaded, at)[0]
    return nowhere()


@compiled
def nowhere() -> Balance:
    """Balance of NaN."""
    nothing = Equilibrium(math.nan, math.nan, math.nan)
    return Balance(nothing, math.nan, math.nan, math.nan, math.nan, nothing, math.nan, math.nan, math.nan, math.nan)


@compiled
def _cross(a: Equilibrium, b: Equilibrium) -> Equilibrium:
    return Equilibrium(a.q * b.force - a.force * b.q, a.force * b.p - a.p * b.force, a.p * b.q - a.q * b.p)


@compiled
def dot(a: Equilibrium, b: Equilibrium) -> float:
    return a.p * b.p + a.q * b.q + a.force * b.force


@compiled
def less(a: Equilibrium, b: Equilibrium) -> Equilibrium:
    """Difference a − b."""
    return Equilibrium(a.p - b.p, a.q - b.q, a.force - b.force)


@compiled
def times(factor: float, a: Equilibrium) -> Equilibrium:
    return Equilibrium(factor * a.p, factor * a.q, factor * a.force)
