"""Equilibria of a rod and a contour: the contact, and how it moves along the branch of solutions.

An equilibrium has three coordinates, two of the contact, p and q (`phase`), and the contact force f. The rod's pose and
the contour must agree on the vector (U, V) from the pivot to the contact in the frame of the force,

    U(p, q) = u(p, q, f),    V(p, q) = v(p, q, f),

two equations that leave a curve, the branch. A third, linear equation picks a point of it, so that none of the three
need be monotone along the branch: a rod curved against the load is first straightened, and its contact moves outward
before it moves inward. The null vector of the two equations is the branch's tangent, and the drive angle
φ0 = β + ψ1 + turn follows without another equation, from the direction of the force β = α + γ.

If a drive carries the base, position and angle of the base that follow from contact and pose must lie on a `Line`:
again two equations. In place of the drive angle the travel along the line follows.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from tactile_bayes.mechanics.branches.line import Line, components, is_rotation, off_line
from tactile_bayes.mechanics.branches.outline import Place, further, narrower, place
from tactile_bayes.mechanics.branches.phase import (
    STUCK,
    Move,
    Touch,
    contact_at,
    is_possible,
    limit,
    moves,
    slides,
    tip_touches,
)
from tactile_bayes.mechanics.branches.scene import (
    BY_FORCE,
    BY_P,
    BY_Q,
    NO_FORCE,
    Equilibrium,
    Scene,
    cross,
    dot,
    less,
    times,
)
from tactile_bayes.mechanics.compiler import compiled
from tactile_bayes.mechanics.poses.beam import beam_pose, is_far_from_table, tip_pose, whole_pose
from tactile_bayes.mechanics.poses.pose import Pose, scaled

_MOST_STEPS = 25  # Newton steps of a search; those that converge take two to six
_MOST_TURN, _MOST_LOADING = 0.4, 1.0  # largest changes of q, and of f over 1 + f, in a step
SETTLED = 1e-8  # step, over the largest, after which a first-order correction leaves rounding errors only: its square
# Error of the equations that is rounding, and the largest step that it may cause, over the largest, where a contact
# sticks: the rod hardly yields to a turn of a small force.
_ROUNDING, _UNRESOLVED = 2e-15, 1e-4
_NONE = Pose(0.0, 0.0, 0.0)


class Rates(NamedTuple):
    """Derivatives of travel and loads along the tangent."""

    travel: float
    moment: float
    x: float
    y: float


class Balance(NamedTuple):
    """An equilibrium with its loads, and its tangent."""

    at: Equilibrium
    travel: float  # travel of the drive: its angle, with the turn of the suspension [rad], or the way along its line
    holding_moment: float
    force_x: float
    force_y: float
    tangent: Equilibrium  # null vector of the equations, in no particular length
    rates: Rates


class _Equations(NamedTuple):
    """The two equations at a point, their derivatives, and those of travel, holding moment and direction of the
    force."""

    miss_one: float
    miss_two: float
    by_one: Equilibrium
    by_two: Equilibrium
    travel: float
    travel_by: Equilibrium
    moment: float
    moment_by: Equilibrium
    turn_by: Equilibrium


class _Force(NamedTuple):
    """The contact force, and its direction (sin β, −cos β)."""

    size: float
    sin: float
    cos: float
    sin_gamma: float
    cos_gamma: float


class _Motion(NamedTuple):
    """Derivatives of contact and rod by a coordinate."""

    along: float  # way of the contact along the contour
    closer: float  # way of the rod toward the object
    turn: float  # turn of the force
    psi1: float
    pose: Pose


class _Response(NamedTuple):
    """Derivatives of the equations, of travel and holding moment by a coordinate."""

    one: float
    two: float
    travel: float
    moment: float


@compiled
def balance(scene: Scene, at: Equilibrium) -> tuple[Balance, _Equations]:
    """Loads and tangent at a point near the branch."""
    contact, size = contact_at(scene, at), max(at.force, 0.0)
    sin_gamma, cos_gamma = math.sin(contact.friction_angle), math.cos(contact.friction_angle)
    yielding = scene.rig.yielding
    at_rest = narrower(scene.outline, place(scene.outline, contact.p), contact.arclength)
    spot = further(at_rest, yielding * size * cos_gamma)
    sin, cos = spot.sin * cos_gamma + spot.cos * sin_gamma, spot.cos * cos_gamma - spot.sin * sin_gamma
    force = _Force(size, sin, cos, sin_gamma, cos_gamma)
    by_p, by_q = moves(scene.phase, at_rest.speed)
    here, pose_by_p, pose_by_q, by_force = _posed(scene, contact, size, by_p)
    first, second = _motion(scene, spot, force, by_p, pose_by_p), _motion(scene, spot, force, by_q, pose_by_q)
    loaded = _Motion(0.0, yielding * cos_gamma, 0.0, 0.0, by_force)
    angle = math.atan2(sin, cos) + contact.psi1 + here.turn
    equations = _equations(scene.line, scene.rig.compliance, spot, force, here, first, second, loaded, angle)
    tangent, moment = cross(equations.by_one, equations.by_two), equations.moment
    turned = size * dot(equations.turn_by, tangent)
    rates = Rates(
        dot(equations.travel_by, tangent),
        dot(equations.moment_by, tangent),
        -sin * tangent.force - cos * turned,
        cos * tangent.force - sin * turned,
    )
    return Balance(at, equations.travel, moment, -size * sin, size * cos, tangent, rates), equations


@compiled
def _posed(scene: Scene, contact: Touch, force: float, by_p: Move) -> tuple[Pose, Pose, Pose, Pose]:
    """Pose of the rod, and its derivatives by p, q and the force."""
    psi1, arclength = contact.psi1, contact.arclength
    if slides(scene.phase):
        here, by_q, by_force = beam_pose(scene.beam, psi1, arclength, force, tip_touches(scene.phase))
        return here, _NONE, by_q, by_force
    if tip_touches(scene.phase):
        here, turned, by_force = tip_pose(scene.beam, psi1, force)
        return here, turned, scaled(-1.0, turned), by_force
    here, turned, longer, by_force = whole_pose(scene.beam, psi1, arclength, force)
    return here, scaled(by_p.arclength, longer), scaled(-1.0, turned), by_force


@compiled
def _motion(scene: Scene, spot: Place, force: _Force, by: Move, pose: Pose) -> _Motion:
    pressed = -scene.rig.yielding * force.size * force.sin_gamma * by.friction_angle
    closer, turn = scene.outline.narrowing * by.arclength + pressed, spot.bend * by.p + by.friction_angle
    return _Motion(spot.speed * by.p, closer, turn, by.psi1, pose)


@compiled
def _equations(
    line: Line,
    compliance: float,
    spot: Place,
    force: _Force,
    here: Pose,
    by_p: _Motion,
    by_q: _Motion,
    loaded: _Motion,
    angle: float,
) -> _Equations:
    """Equations of a base at an angle before the turn of the suspension."""
    if is_rotation(line):
        along, across = spot.x * force.cos + spot.y * force.sin, spot.y * force.cos - spot.x * force.sin
        p = _about_pivot(compliance, along, across, force, 0.0, by_p)
        q = _about_pivot(compliance, along, across, force, 0.0, by_q)
        f = _about_pivot(compliance, along, across, force, 1.0, loaded)
        one, two, moment = along - here.u, across - here.v, force.size * along
        travel = angle + compliance * moment
    else:
        p = _on_line(line, compliance, spot, force, here, 0.0, by_p)
        q = _on_line(line, compliance, spot, force, here, 0.0, by_q)
        f = _on_line(line, compliance, spot, force, here, 1.0, loaded)
        moment = force.size * here.u
        x, y = _from_base(here, force)
        one, two, travel = off_line(line, spot.x - x, spot.y - y, angle + compliance * moment)
    return _Equations(
        one,
        two,
        Equilibrium(p.one, q.one, f.one),
        Equilibrium(p.two, q.two, f.two),
        travel,
        Equilibrium(p.travel, q.travel, f.travel),
        moment,
        Equilibrium(p.moment, q.moment, f.moment),
        Equilibrium(by_p.turn, by_q.turn, 0.0),
    )


@compiled
def _about_pivot(
    compliance: float, along: float, across: float, force: _Force, loading: float, by: _Motion
) -> _Response:
    """Response of a rod that turns about a pivot, from where the contact is along and across the lever of the force."""
    sin, cos, pose = force.sin_gamma, force.cos_gamma, by.pose
    lever = by.along * cos + by.closer * sin + by.turn * across
    moment = force.size * lever + loading * along
    return _Response(
        lever - pose.u,
        by.closer * cos - by.along * sin - by.turn * along - pose.v,
        by.turn + by.psi1 + pose.turn + compliance * moment,
        moment,
    )


@compiled
def _from_base(pose: Pose, force: _Force) -> tuple[float, float]:
    """Vector from the base to the contact."""
    return pose.u * force.cos - pose.v * force.sin, pose.u * force.sin + pose.v * force.cos


@compiled
def _on_line(
    line: Line, compliance: float, spot: Place, force: _Force, here: Pose, loading: float, by: _Motion
) -> _Response:
    """Response of a rod that is carried along a line."""
    (x, y), (x_by, y_by) = _from_base(here, force), _from_base(by.pose, force)
    moment = force.size * by.pose.u + loading * here.u
    moved = components(
        line,
        by.along * spot.cos - by.closer * spot.sin - x_by + by.turn * y,
        by.along * spot.sin + by.closer * spot.cos - y_by - by.turn * x,
        by.turn + by.psi1 + by.pose.turn + compliance * moment,
    )
    return _Response(moved.x, moved.y, moved.angle, moment)


@compiled
def settle(
    scene: Scene, start: Equilibrium, origin: Equilibrium, normal: Equilibrium, level: float, settled: float
) -> Balance:
    """Equilibrium where normal · (z − origin) = level for z = (p, q, f), by Newton's method from a guess. The search
    ends with a step of `settled`, over the largest. The loads are corrected for it to first order; tangent and rates
    have an error of its size. NaN where the method does not converge."""
    at = start
    if _is_astray(scene, at):
        return nowhere()
    for _ in range(_MOST_STEPS):
        found, equations = balance(scene, at)
        one, two = equations.miss_one, equations.miss_two
        off = dot(normal, less(at, origin)) - level
        det = dot(normal, found.tangent)
        first, second, third = cross(equations.by_two, normal), cross(normal, equations.by_one), found.tangent
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
        change, before = Equilibrium(dp, dq, df), found.at.force
        turn = -dot(equations.turn_by, change)
        rests = largest <= settled and abs(dp) * (1.0 if scene.phase == STUCK else equations.turn_by.p) <= settled
        hardly_yields = largest <= _UNRESOLVED and abs(one) + abs(two) <= _ROUNDING and not slides(scene.phase)
        if rests or hardly_yields:
            travel = found.travel - dot(equations.travel_by, change)
            moment = found.holding_moment - dot(equations.moment_by, change)
            share = -df / before if before > 0.0 else 0.0
            force_x = found.force_x + share * found.force_x - turn * found.force_y
            force_y = found.force_y + share * found.force_y + turn * found.force_x
            return Balance(at, travel, moment, force_x, force_y, found.tangent, found.rates)
    return nowhere()


@compiled
def _is_astray(scene: Scene, at: Equilibrium) -> bool:
    """Return whether a rod without a closed form is sought too far away: it takes long and leads nowhere."""
    if scene.beam.varied is None:
        return False
    contact = contact_at(scene, at)
    return not is_possible(contact) or is_far_from_table(scene.beam, contact.arclength, at.force)


@compiled
def settle_at_limit(scene: Scene, start: Equilibrium) -> Balance:
    """Equilibrium where the phase ends."""
    end = limit(scene, start.p)
    there = Equilibrium(end.value if end.is_p else 0.0, 0.0 if end.is_p else end.value, 0.0)
    return settle(scene, start, there, BY_P if end.is_p else BY_Q, 0.0, SETTLED)


@compiled
def settle_at(scene: Scene, p: float, start: Equilibrium) -> Balance:
    """Equilibrium at a parameter of the contour."""
    at = Equilibrium(p, start.q, start.force)
    return settle(scene, at, at, BY_P, 0.0, SETTLED)


@compiled
def unloaded(scene: Scene, start: Equilibrium, small: float) -> Balance:
    """Equilibrium without force, by Newton's method from a guess. If the contact sticks, its force has no direction
    there. Direction and tangent are extrapolated from a small force and its double, with errors of the cube and the
    square of these, and of their rounding."""
    if slides(scene.phase):
        return settle(scene, start, NO_FORCE, BY_FORCE, 0.0, SETTLED)
    one = settle(scene, Equilibrium(start.p, start.q, small), NO_FORCE, BY_FORCE, small, SETTLED)
    two = settle(scene, Equilibrium(one.at.p, one.at.q, 2.0 * small), NO_FORCE, BY_FORCE, 2.0 * small, SETTLED)
    by_one, by_two = times(1.0 / one.tangent.force, one.tangent), times(1.0 / two.tangent.force, two.tangent)
    rates, others, back = _by_force(one), _by_force(two), times(0.5 * small, less(times(3.0, by_one), by_two))
    return Balance(
        Equilibrium(one.at.p - back.p, one.at.q - back.q, 0.0),
        one.travel - 0.5 * small * (3.0 * rates.travel - others.travel),
        0.0,
        0.0,
        0.0,
        less(times(2.0, by_one), by_two),
        Rates(
            2.0 * rates.travel - others.travel,
            2.0 * rates.moment - others.moment,
            2.0 * rates.x - others.x,
            2.0 * rates.y - others.y,
        ),
    )


@compiled
def _by_force(found: Balance) -> Rates:
    """Derivatives by the force."""
    by, rates = 1.0 / found.tangent.force, found.rates
    return Rates(by * rates.travel, by * rates.moment, by * rates.x, by * rates.y)


@compiled
def nowhere() -> Balance:
    """Balance of NaN."""
    nothing = Equilibrium(math.nan, math.nan, math.nan)
    rates = Rates(math.nan, math.nan, math.nan, math.nan)
    return Balance(nothing, math.nan, math.nan, math.nan, math.nan, nothing, rates)
