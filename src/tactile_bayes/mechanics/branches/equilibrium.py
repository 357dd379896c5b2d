"""Equilibria of a rod and a contour: the contact, and how it moves along the branch of solutions.

An equilibrium has three coordinates: the contour's parameter p at the contact, the contact force f, and the coordinate
q of the rod: the angle ψ1 at its tip in tip contact, the arc length s1 in tangential contact. The rod's pose
and the contour must agree on the vector (U, V) from the pivot to the contact in the frame of the force,

    U(p) = u(q, f),    V(p) = v(q, f),

two equations that leave a curve, the branch. A third, linear equation picks a point of it, so that neither p nor f need
be monotone along the branch: a rod curved against the load is first straightened, and its contact moves outward before
it moves inward. The null vector of the two equations is the branch's tangent, and the drive angle φ0 = β(p) + ψ1 + turn
follows without another equation.

If a drive carries the base, position and angle of the base that follow from contact and pose must lie on a `Line`:
again two equations. In place of the drive angle the travel along the line follows.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from tactile_bayes.arrays import Floats
from tactile_bayes.mechanics.branches.line import Line, components, line_of, off_line
from tactile_bayes.mechanics.branches.outline import Outline, Place, narrower, place
from tactile_bayes.mechanics.branches.phase import is_possible, limit, on_rod, sliding, turning
from tactile_bayes.mechanics.compiler import compiled
from tactile_bayes.mechanics.phases import TIP
from tactile_bayes.mechanics.poses.beam import Beam, beam_pose, is_far_from_table, rubbed_otherwise
from tactile_bayes.mechanics.poses.pose import Pose

__all__ = [
    "BY_FORCE",
    "NO_FORCE",
    "SETTLED",
    "Balance",
    "Equilibrium",
    "Rates",
    "Rig",
    "Scene",
    "balance",
    "dot",
    "in_phase",
    "less",
    "nowhere",
    "on_line",
    "settle",
    "settle_at",
    "settle_at_limit",
    "tangential_psi1",
    "times",
    "with_friction",
]

_MOST_STEPS = 25
"""Newton steps of a search; those that converge take two to six."""

_MOST_TURN, _MOST_LOADING = 0.4, 1.0
"""Largest changes of q, and of f over 1 + f, in a step."""

SETTLED = 1e-8
"""Step, over the largest, after which a first-order correction leaves rounding errors only: its square."""


class Equilibrium(NamedTuple):
    """Coordinates of an equilibrium, or a direction in their space."""

    p: float
    q: float
    force: float


_BY_P, _BY_Q, BY_FORCE = Equilibrium(1.0, 0.0, 0.0), Equilibrium(0.0, 1.0, 0.0), Equilibrium(0.0, 0.0, 1.0)
NO_FORCE = Equilibrium(0.0, 0.0, 0.0)


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
    moment_unit: float
    force_unit: float
    """EI/L and EI/L² of the rod, in the units of loads."""


class Scene(NamedTuple):
    """All that an equilibrium depends on: one contour in the sweep frame, the rod, the rig, and the phase."""

    outline: Outline
    beam: Beam
    rig: Rig
    line: Line | None
    """Drive that carries the base, which is at the origin at its beginning; None for a rotation about a pivot."""
    phase: int


class Rates(NamedTuple):
    """Derivatives of travel and loads along the tangent."""

    travel: float
    moment: float
    x: float
    y: float


class Balance(NamedTuple):
    """An equilibrium with its loads, and its tangent."""

    at: Equilibrium
    travel: float
    """Travel of the drive: its angle, with the turn of the suspension [rad], or the way along its line."""
    holding_moment: float
    force_x: float
    force_y: float
    tangent: Equilibrium
    """Null vector of the equations, in no particular length."""
    rates: Rates


class _Equations(NamedTuple):
    """The two equations at a point, their derivatives, and those of travel and holding moment."""

    miss_one: float
    miss_two: float
    by_one: Equilibrium
    by_two: Equilibrium
    travel: float
    travel_by: Equilibrium
    moment: float
    moment_by: Equilibrium
    bend: float


@compiled
def in_phase(scene: Scene, phase: int) -> Scene:
    """Scene in a phase of contact."""
    return Scene(scene.outline, scene.beam, scene.rig, scene.line, phase)


@compiled
def tangential_psi1(scene: Scene) -> float:
    """ψ1 of a rod that lies along the contour with its surface [rad]."""
    return scene.outline.half_angle - scene.rig.friction_angle


@compiled
def on_line(scene: Scene, lines: Floats | None, k: int) -> Scene:
    """Scene with another line of the drive."""
    if lines is None:
        return scene
    return Scene(scene.outline, scene.beam, scene.rig, line_of(lines, k), scene.phase)


@compiled
def with_friction(scene: Scene, angle: float) -> Scene:
    """Scene with friction that acts in the other sense."""
    _, compliance, offset, sign, moment_unit, force_unit = scene.rig
    rig = Rig(angle, compliance, offset, sign, moment_unit, force_unit)
    return Scene(scene.outline, rubbed_otherwise(scene.beam), rig, scene.line, scene.phase)


@compiled
def balance(scene: Scene, at: Equilibrium) -> tuple[Balance, _Equations]:
    """Loads and tangent at a point near the branch."""
    delta, force = scene.rig.friction_angle, max(at.force, 0.0)
    psi1, length = on_rod(scene.phase, at.q, tangential_psi1(scene))
    spot = narrower(scene.outline, place(scene.outline, at.p), length)
    sin_delta, cos_delta = math.sin(delta), math.cos(delta)
    sin, cos = spot.sin * cos_delta + spot.cos * sin_delta, spot.cos * cos_delta - spot.sin * sin_delta
    rod = beam_pose(scene.beam, psi1, length, force, scene.phase == TIP)
    angle = math.atan2(sin, cos) + psi1 + rod[0].turn
    equations = _equations(scene, scene.line, spot, force, sin, cos, rod, angle)
    tangent, moment = _cross(equations.by_one, equations.by_two), equations.moment
    turned = force * spot.bend * tangent.p
    rates = Rates(
        dot(equations.travel_by, tangent),
        dot(equations.moment_by, tangent),
        -sin * tangent.force - cos * turned,
        cos * tangent.force - sin * turned,
    )
    return Balance(at, equations.travel, moment, -force * sin, force * cos, tangent, rates), equations


@compiled
def _equations(
    scene: Scene,
    line: Line | None,
    spot: Place,
    force: float,
    sin: float,
    cos: float,
    rod: tuple[Pose, Pose, Pose],
    angle: float,
) -> _Equations:
    """Equations for a contact force in the direction (sin, −cos), and a base at an angle before the turn of the
    suspension."""
    here, by_q, by_force = rod
    compliance, by_psi1 = scene.rig.compliance, turning(scene.phase)
    closer = sliding(scene.phase) * scene.outline.narrowing
    sin_delta, cos_delta = spot.cos * sin - spot.sin * cos, spot.cos * cos + spot.sin * sin
    if line is None:
        along, across = spot.x * cos + spot.y * sin, spot.y * cos - spot.x * sin
        lever_by_q = closer * sin_delta
        by_u = Equilibrium(spot.speed * cos_delta + spot.bend * across, lever_by_q - by_q.u, -by_force.u)
        by_v = Equilibrium(-spot.speed * sin_delta - spot.bend * along, closer * cos_delta - by_q.v, -by_force.v)
        moment_by = Equilibrium(force * by_u.p, force * lever_by_q, along)
        travel_by = Equilibrium(
            spot.bend + compliance * moment_by.p,
            by_q.turn + by_psi1 + compliance * moment_by.q,
            by_force.turn + compliance * along,
        )
        moment = force * along
        travel = angle + compliance * moment
        return _Equations(along - here.u, across - here.v, by_u, by_v, travel, travel_by, moment, moment_by, spot.bend)
    # The vector from the base to the contact, and its derivatives.
    x, y = here.u * cos - here.v * sin, here.u * sin + here.v * cos
    moment_by = Equilibrium(0.0, force * by_q.u, here.u + force * by_force.u)
    moment = force * here.u
    off = off_line(line, spot.x - x, spot.y - y, angle + compliance * moment)
    by_p = components(line, spot.speed * spot.cos + spot.bend * y, spot.speed * spot.sin - spot.bend * x, spot.bend)
    by_rod = components(
        line,
        -closer * spot.sin - by_q.u * cos + by_q.v * sin,
        closer * spot.cos - by_q.u * sin - by_q.v * cos,
        by_q.turn + by_psi1 + compliance * moment_by.q,
    )
    by_load = components(
        line,
        by_force.v * sin - by_force.u * cos,
        -by_force.u * sin - by_force.v * cos,
        by_force.turn + compliance * moment_by.force,
    )
    return _Equations(
        off.x,
        off.y,
        Equilibrium(by_p.x, by_rod.x, by_load.x),
        Equilibrium(by_p.y, by_rod.y, by_load.y),
        off.angle,
        Equilibrium(by_p.angle, by_rod.angle, by_load.angle),
        moment,
        moment_by,
        spot.bend,
    )


@compiled
def settle(
    scene: Scene, start: Equilibrium, origin: Equilibrium, normal: Equilibrium, level: float, settled: float
) -> Balance:
    """Equilibrium where normal · (z − origin) = level for z = (p, q, f), by Newton's method from a guess.

    The search ends with a step of `settled`, over the largest. The loads are corrected for it to first order; tangent
    and rates have an error of its size. NaN where the method does not converge.
    """
    at = start
    if _is_astray(scene, at):
        return nowhere()
    for _ in range(_MOST_STEPS):
        found, equations = balance(scene, at)
        one, two, bend = equations.miss_one, equations.miss_two, equations.bend
        off = dot(normal, less(at, origin)) - level
        det = dot(normal, found.tangent)
        first, second, third = _cross(equations.by_two, normal), _cross(normal, equations.by_one), found.tangent
        dp = (one * first.p + two * second.p + off * third.p) / det
        dq = (one * first.q + two * second.q + off * third.q) / det
        df = (one * first.force + two * second.force + off * third.force) / det
        largest = max(abs(dq) / _MOST_TURN, abs(df) / (_MOST_LOADING * (1.0 + at.force)))
        if not largest < math.inf:
            break
        share = min(1.0, 1.0 / largest) if largest > 0.0 else 1.0
        at = Equilibrium(at.p - share * dp, at.q - share * dq, at.force - share * df)
        if _is_astray(scene, at):
            break
        if largest <= settled and abs(dp) * bend <= settled:
            change, before = Equilibrium(dp, dq, df), found.at.force
            travel = found.travel - dot(equations.travel_by, change)
            moment = found.holding_moment - dot(equations.moment_by, change)
            share, turn = (-df / before if before > 0.0 else 0.0), -bend * dp
            force_x = found.force_x + share * found.force_x - turn * found.force_y
            force_y = found.force_y + share * found.force_y + turn * found.force_x
            return Balance(at, travel, moment, force_x, force_y, found.tangent, found.rates)
    return nowhere()


@compiled
def _is_astray(scene: Scene, at: Equilibrium) -> bool:
    """Return whether a rod without a closed form is sought too far away: it takes long and leads nowhere."""
    if scene.beam.varied is None:
        return False
    arclength = on_rod(scene.phase, at.q, 0.0)[1]
    return not is_possible(scene.phase, at.q) or is_far_from_table(scene.beam, arclength, at.force)


@compiled
def settle_at_limit(scene: Scene, start: Equilibrium) -> Balance:
    """Equilibrium where the phase ends."""
    end = Equilibrium(0.0, limit(scene.phase, tangential_psi1(scene))[0], 0.0)
    return settle(scene, start, end, _BY_Q, 0.0, SETTLED)


@compiled
def settle_at(scene: Scene, p: float, start: Equilibrium) -> Balance:
    """Equilibrium at a parameter of the contour."""
    at = Equilibrium(p, start.q, start.force)
    return settle(scene, at, at, _BY_P, 0.0, SETTLED)


@compiled
def nowhere() -> Balance:
    """Balance of NaN."""
    nothing = Equilibrium(math.nan, math.nan, math.nan)
    rates = Rates(math.nan, math.nan, math.nan, math.nan)
    return Balance(nothing, math.nan, math.nan, math.nan, math.nan, nothing, rates)


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
