"""The pose of a loaded uniform rod with constant rest curvature: its pivot as seen from the contact.

A contact force f acts at the contact along (sin β, −cos β), and ψ = φ − β is the rod's slope over the direction across
it. With the rest curvature κ0 the rod obeys

    κ' = f cos ψ,    κ = κ0 and ψ = ψ1 at the contact,        φ' = κ,

a piece of elastica whose curvature need not vanish anywhere. With A = π/4 − ψ/2 and t = (s1 − s)/s1 from the contact to
the pivot it is the pendulum A'' = −y sin A cos A with A' = b at the contact, y = f s1² and b = κ0 s1/2. Its addition
theorems (DLMF 22.8.1 to 22.8.3) begin at the contact, at A1, with Jacobi's functions s, c, d, J (`jacobi`) for the
parameters x = b² + y sin²A1 and y,

    D        = 1 − y sin²A1 s²
    sin A    = (sin A1 c d + b cos A1 s) / D
    u / s1   = 2 [sin A1 cos A1 s c + b ((1 − d)/y − sin²A1 s²)] / D          vector from pivot to contact, along
    v / s1   = 1 − 2 (x J + sin A1 s sin A)                                     (cos β, sin β) and (−sin β, cos β)
    ψ0 − ψ1  = 2 (A1 − A)                                                       turn

which is regular as the load vanishes and where the parameter m = x/y of Legendre's integrals is one. The moment of the
force about the pivot is f u = κ0 − κ(0).
"""

from __future__ import annotations

import math
from typing import NamedTuple

from tactile_bayes.mechanics.compiler import compiled
from tactile_bayes.mechanics.poses.jacobi import Jacobi, jacobi, jacobi_and_slopes

ACROSS = 1e-6  # cosine of the angle of a chord to the rod that counts as zero: the rod goes no farther from the pivot


class Pose(NamedTuple):
    """Pose of the pivot, or its derivatives by a variable."""

    u: float  # component of the vector from pivot to contact across the contact force
    v: float  # its component against the force
    turn: float  # slope of the rod at the pivot less the slope at the contact [rad]


@compiled
def scaled(factor: float, pose: Pose) -> Pose:
    """A derivative by a variable of another scale."""
    return Pose(factor * pose.u, factor * pose.v, factor * pose.turn)


class Chord(NamedTuple):
    """Line from the pivot to a point of the rod at rest."""

    arclength: float  # arc length of the point [L], < 0 on the stem
    at_base: float  # angle from the rod at the pivot to the chord [rad]
    at_point: float  # angle from the chord to the rod at the point [rad]
    rate: float  # derivative of `at_point` by the length of the chord


class _AtContact(NamedTuple):
    """State at the contact."""

    sin: float
    cos: float
    bend: float
    load: float  # y


@compiled
def _start(psi1: float, arclength: float, force: float, curvature: float) -> _AtContact:
    a = 0.25 * math.pi - 0.5 * psi1
    return _AtContact(math.sin(a), math.cos(a), 0.5 * curvature * arclength, force * arclength * arclength)


class _Parts(NamedTuple):
    """Parts of a pose."""

    u: float  # u and v over the arc length
    v: float
    sin_turn: float  # sine and cosine of A − A1
    cos_turn: float
    sin_pivot: float
    mixed: float  # cos²A1 + sin²A1 d
    inverse: float  # 1/D


@compiled
def _parts(start: _AtContact, at: Jacobi) -> _Parts:
    sin, cos, bend, load = start
    s, c, d, r, j = at
    s2, sin2, sc = s * s, sin * sin, sin * cos
    inverse = 1.0 / (1.0 - load * sin2 * s2)
    u = 2.0 * (sc * s * c + bend * (r - sin2 * s2)) * inverse
    sin_pivot = (sin * c * d + bend * cos * s) * inverse
    v = 1.0 - 2.0 * ((bend * bend + load * sin2) * j + sin * s * sin_pivot)
    mixed = cos * cos + sin2 * d
    sin_turn = (bend * s * mixed - sc * c * load * r) * inverse
    cos_turn = (c * mixed + sc * bend * load * s * r) * inverse
    return _Parts(u, v, sin_turn, cos_turn, sin_pivot, mixed, inverse)


@compiled
def pose(psi1: float, arclength: float, force: float, curvature: float) -> Pose:
    """Pose for ψ1 in [−0.7, π/2], arc length s1, force f and rest curvature κ0, in rod lengths and EI/L²."""
    start = _start(psi1, arclength, force, curvature)
    at = jacobi(start.bend * start.bend + start.load * start.sin * start.sin, start.load)
    parts = _parts(start, at)
    return Pose(arclength * parts.u, arclength * parts.v, -2.0 * math.atan2(parts.sin_turn, parts.cos_turn))


@compiled
def pose_and_slopes(
    psi1: float, arclength: float, force: float, curvature: float, tip: bool
) -> tuple[Pose, Pose, Pose]:
    """Pose, and its derivatives by ψ1 in tip contact or by the arc length in tangential contact, and by the force."""
    start = _start(psi1, arclength, force, curvature)
    at, by_x, by_y = jacobi_and_slopes(start.bend * start.bend + start.load * start.sin * start.sin, start.load)
    parts = _parts(start, at)
    turn = -2.0 * math.atan2(parts.sin_turn, parts.cos_turn)
    here = Pose(arclength * parts.u, arclength * parts.v, turn)
    by_force = _by(start, at, by_x, by_y, parts, arclength, 0.0, 0.0, arclength * arclength)
    if tip:  # ψ1 = π/2 − 2 A1
        sin_by, cos_by = -0.5 * start.cos, 0.5 * start.sin
        return here, _by(start, at, by_x, by_y, parts, arclength, sin_by, cos_by, 0.0), by_force
    return here, by_arclength(psi1, force, curvature, here), by_force


@compiled
def by_arclength(psi1: float, force: float, curvature: float, here: Pose) -> Pose:
    """Derivative of a pose by the arc length: a longer rod goes on beyond the pivot, straight ahead."""
    psi0 = psi1 + here.turn
    return Pose(math.cos(psi0), math.sin(psi0), force * here.u - curvature)


@compiled
def _by(
    start: _AtContact,
    at: Jacobi,
    by_x: Jacobi,
    by_y: Jacobi,
    parts: _Parts,
    arclength: float,
    sin_by: float,
    cos_by: float,
    load_by: float,
) -> Pose:
    """Derivative of a pose by a variable, from those of sin A1, cos A1 and the load y."""
    sin, cos, bend, load = start
    s, c, d, r, j = at
    sin2, sc, sin2_by, sc_by = sin * sin, sin * cos, 2.0 * sin * sin_by, sin * cos_by + sin_by * cos
    x, x_by = bend * bend + load * sin2, load * sin2_by + load_by * sin2
    s_by, c_by = by_x.s * x_by + by_y.s * load_by, by_x.c * x_by + by_y.c * load_by
    d_by = by_x.d * x_by + by_y.d * load_by
    r_by, j_by = by_x.r * x_by + by_y.r * load_by, by_x.j * x_by + by_y.j * load_by
    lean, lean_by = sin2 * s * s, sin2_by * s * s + 2.0 * sin2 * s * s_by
    shrink = load * lean_by + load_by * lean  # less the derivative of D
    u_by = 2.0 * (sc_by * s * c + sc * (s_by * c + s * c_by) + bend * (r_by - lean_by)) + parts.u * shrink
    pivot = parts.sin_pivot
    pivot_by = sin_by * c * d + sin * (c_by * d + c * d_by) + bend * (cos_by * s + cos * s_by) + pivot * shrink
    pivot_by *= parts.inverse
    v_by = -2.0 * (x_by * j + x * j_by + (sin_by * s + sin * s_by) * pivot + sin * s * pivot_by)
    mixed_by, loaded, loaded_by = sin2_by * (d - 1.0) + sin2 * d_by, load * r, load_by * r + load * r_by
    turn_sin_by = bend * (s_by * parts.mixed + s * mixed_by) - (sc_by * c + sc * c_by) * loaded - sc * c * loaded_by
    turn_cos_by = c_by * parts.mixed + c * mixed_by
    turn_cos_by += bend * ((sc_by * s + sc * s_by) * loaded + sc * s * loaded_by)
    turn_sin_by += parts.sin_turn * shrink
    turn_cos_by += parts.cos_turn * shrink
    turn_by = -2.0 * (parts.cos_turn * turn_sin_by - parts.sin_turn * turn_cos_by) * parts.inverse
    return Pose(arclength * u_by * parts.inverse, arclength * v_by, turn_by)
