"""State of any rod in contact: contact → base wrench, by continuation.

Straight uniform rods have a closed form (`states`). For any other one a rod with constant rest curvature κ that makes
the same contact is changed into it, with a share λ from 0 to 1 of the rest curvature (1 − λ) κ + λ κ0(s). The force is
positive all along. In tangential contact it begins with the arc that lies along the contour without any force, of
whatever rigidity. In tip contact it begins with the straight rod, which is first changed from a uniform one, by a share
of the rigidity 1 + λ (B(s) − 1) and the taper λ t: a straight rod reaches whatever the curved one does.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from tactile_bayes.mechanics.compiler import compiled
from tactile_bayes.mechanics.contacts.arc_states import is_moderate
from tactile_bayes.mechanics.poses.beam import Beam, Varied, beam_pose, by_kind
from tactile_bayes.mechanics.poses.pose import Pose
from tactile_bayes.mechanics.poses.taylor import FARTHEST
from tactile_bayes.mechanics.rods.profile import Profile

_MOST_STEPS = 200

_LEAST_STEP = 1e-9  # share of a continuation below which it ends
_NEAR, _SHRINKS = 0.05, 0.25  # largest first step of a Newton search in a continuation, and largest ratio of its steps
_SETTLED = 1e-8  # Newton step after which rounding errors are left only
# Positions in a continuation: its beginning, that of the rod's rigidity, and that of its rest curvature as well.
_UNIFORM, _STIFFENED, _WHOLE = 0.0, 1.0, 2.0
_NUDGE = 1e-6  # change of the share for a derivative by it, which serves for a first guess


class ContactState(NamedTuple):
    """Base wrench of a contact and its derivatives; NaN where the rod cannot make the contact."""

    drive_angle: float
    holding_moment: float
    force_x: float
    force_y: float
    arclength: float
    tip_angle: float
    by_slope: float
    by_distance: float  # as in `Wrench`


NOWHERE = ContactState(math.nan, math.nan, math.nan, math.nan, math.nan, math.nan, math.nan, math.nan)


class Start(NamedTuple):
    """A state to continue from: constant rest curvature, ψ1 or arc length, and force."""

    curvature: float
    q: float
    force: float


@compiled
def unloaded_arc(u: float, v: float, delta: float) -> Start:
    """The arc that lies along the contour at a contact without any force."""
    angle = math.atan2(v, u) + delta
    distance = math.hypot(u, v)
    sine = math.sin(angle)
    return Start(-2.0 * sine / distance, distance * (angle / sine if sine != 0.0 else 1.0), 0.0)


@by_kind
def _between(varied: Varied | None, beam: Beam, begin: float, way: float, room: Profile | None) -> Beam:
    """Rod on the way of a continuation that begins with a rest curvature; its profile is written to the room."""
    left = min(_WHOLE - way, 1.0)
    if varied is None or room is None:
        return Beam(beam.curvature - left * (beam.curvature - begin), 1.0, math.inf, varied, 0.0)
    edges, bent, rigidity, taper, bend, sign, modes, shape = varied.profile
    bent_share, rigid_share = 1.0 - left, min(way, 1.0)
    for i in range(edges.size):
        for k in range(bent.shape[1]):
            room.curvature[i, k] = bent_share * bent[i, k]
        for k in range(rigidity.shape[1]):
            room.rigidity[i, k] = rigid_share * rigidity[i, k]
        room.rigidity[i, 0] += 1.0 - rigid_share
    bend = bent_share * bend + left * sign * begin
    profile = Profile(edges, room.curvature, room.rigidity, rigid_share * taper, bend, sign, modes, shape)
    _, work, remainder, at_rest, sheet, _, _ = varied
    rod = Varied(profile, work, remainder, at_rest, sheet, 0.0, 1.0)
    return Beam(0.0, 1.0, math.inf, rod, 0.0)


class _Slopes(NamedTuple):
    """Pose at a point, its derivatives by (q, f), and their determinant."""

    here: Pose
    by_q: Pose
    by_force: Pose
    det: float


@compiled
def _slopes(q: float, force: float, beam: Beam, delta: float, tip: bool) -> _Slopes:
    psi1, arclength = (q, 1.0) if tip else (-delta, q)
    here, by_q, by_force = beam_pose(beam, psi1, arclength, force, tip)
    return _Slopes(here, by_q, by_force, by_q.u * by_force.v - by_force.u * by_q.v)


@compiled
def _step(at: _Slopes, du: float, dv: float) -> tuple[float, float]:
    """Change of (q, f) for a change of (u, v)."""
    _, by_q, by_force, det = at
    return (du * by_force.v - dv * by_force.u) / det, (by_q.u * dv - by_q.v * du) / det


@by_kind
def _has_pose(varied: Varied | None, beam: Beam, q: float, force: float, tip: bool) -> bool:
    arclength = 1.0 if tip else q
    if varied is None:
        return is_moderate(arclength, force, beam.curvature)
    return 0.0 < arclength < FARTHEST and is_moderate(arclength, force, 0.0)


@compiled
def _settled(u: float, v: float, delta: float, beam: Beam, tip: bool, q: float, force: float) -> tuple[float, float]:
    """(q, f) near a guess by Newton's method; NaN if its steps are large or do not shrink fast."""
    before = _NEAR / _SHRINKS
    while force > 0.0 and _has_pose(beam, q, force, tip):
        at = _slopes(q, force, beam, delta, tip)
        dq, df = _step(at, u - at.here.u, v - at.here.v)
        size = max(abs(dq), abs(df) / (1.0 + force))
        if not size <= _SHRINKS * before:
            break
        q, force, before = q + dq, force + df, size
        if size <= _SETTLED:
            return q, force
    return math.nan, math.nan


@compiled
def _continued(
    u: float, v: float, delta: float, beam: Beam, tip: bool, start: Start, room: Profile | None
) -> tuple[float, float]:
    """(q, f) of a rod, continued from one of constant rest curvature; NaN where the continuation ends before. The start
    may be somewhat off the contact: it is left behind at the same time."""
    begin, q, force = start
    way = _UNIFORM if tip and beam.varied is not None else _STIFFENED
    rod = _between(beam, begin, way, room)
    if not _has_pose(rod, q, force, tip):
        return math.nan, math.nan
    here = _slopes(q, force, rod, delta, tip)
    step, whole = 1.0, _WHOLE - way
    off_u, off_v = (u - here.here.u) / whole, (v - here.here.v) / whole
    for _ in range(_MOST_STEPS):
        aside = _slopes(q, force, _between(beam, begin, way + _NUDGE, room), delta, tip).here
        by_u, by_v = (aside.u - here.here.u) / _NUDGE, (aside.v - here.here.v) / _NUDGE
        dq, df = _step(here, off_u - by_u, off_v - by_v)
        for _ in range(_MOST_STEPS):
            end = min(way + step, _STIFFENED if way < _STIFFENED else _WHOLE)
            left, gone, rod = _WHOLE - end, end - way, _between(beam, begin, end, room)
            on_u, on_v = u - left * off_u, v - left * off_v
            new_q, new_force = _settled(on_u, on_v, delta, rod, tip, q + gone * dq, force + gone * df)
            if new_force > 0.0 or not step > _LEAST_STEP:
                break
            step *= 0.5
        if end == _WHOLE or not new_force > 0.0:
            return new_q, new_force
        q, force, way, step = new_q, new_force, end, min(2.0 * step, 1.0)
        here = _slopes(q, force, rod, delta, tip)
    return math.nan, math.nan


@compiled
def continued_state(
    x: float, y: float, alpha: float, delta: float, beam: Beam, tip: bool, start: Start, room: Profile | None
) -> ContactState:
    """State of a contact, continued from that of another rod with the same contact; NaN where this ends. The
    derivatives follow from those of the pose: with the slope of the contour the frame of the force turns."""
    beta = alpha + delta
    sin, cos = math.sin(beta), math.cos(beta)
    u, v = x * cos + y * sin, y * cos - x * sin
    q, force = _continued(u, v, delta, beam, tip, start, room)
    if not force > 0.0:
        return NOWHERE
    at = _slopes(q, force, beam, delta, tip)
    psi1, arclength = (q, 1.0) if tip else (-delta, q)
    if u < 0.0 and not math.cos(psi1 + at.here.turn) < 0.0:
        return NOWHERE
    by_q = at.by_q.turn + (1.0 if tip else 0.0)
    dq, df = _step(at, v, -u)
    by_slope = 1.0 + by_q * dq + at.by_force.turn * df
    dq, df = _step(at, u, v)
    by_distance = 0.5 * (by_q * dq + at.by_force.turn * df) / (u * u + v * v)
    tip_angle = beta + psi1
    drive_angle = tip_angle + at.here.turn
    return ContactState(drive_angle, force * u, -force * sin, force * cos, arclength, tip_angle, by_slope, by_distance)
