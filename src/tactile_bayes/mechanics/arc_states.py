"""One state of a rod whose rest shape is a circular arc: contact → base wrench, and back.

Quantities are dimensionless and relative to the pivot; contacts are forward ones, and the rest curvature κ0 is mirrored
with them. A base wrench determines its contact in closed form. With A = π/4 − ψ/2 and t = s1 − s, as in `pose`, but not
scaled by the arc length,

    sin²A1 = sin²A0 + m0 (m0 − 2 κ0)/(4 f),         κ = κ0 − m0 at the pivot,

and Jacobi's functions of s1 (`jacobi`), for the parameters x = κ0²/4 + f sin²A1 and y = f, follow from both ends by the
subtraction theorem (DLMF 22.8.1 to 22.8.3); with E = κ0²/4 + f sin²A1 cos²A0

    s = (κ0 sin(A0 − A1) + m0 sin A1 cos A0) / (2 E)
    c = (x cos A0 cos A1 + κ κ0 sin A0 sin A1 / 4) / E,       d = (κ κ0 / 4 + f sin A0 sin A1 cos A0 cos A1) / E.

Then s1 is an elliptic integral in Carlson's form. Nothing of this is singular where the force vanishes, or where the
parameter m = x/y is one. The contact is the first point at which the bending moment vanishes with κ' = f cos ψ > 0. If
m0 > 0 the moment vanishes nowhere before. If the line of force has passed the pivot, m0 < 0 and cos ψ0 < 0, as happens
to rods that are curved at rest as a load curves them, it vanishes once before.

A contact determines its wrench by continuation in the rest curvature, along which the force is positive.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from tactile_bayes.mechanics.compiler import compiled
from tactile_bayes.mechanics.pose import Pose, pose, pose_and_slopes

__all__ = ["MOST_LOAD", "NOWHERE", "Found", "Start", "State", "arc_contact", "arc_state", "unloaded_arc"]

MOST_LOAD = 1e6
"""Largest load f s1² and square of the bend κ0 s1: a rod would make a hundred turns."""

_CLOSE = 0.012
"""Spread of the arguments of Carlson's R_F for which eight terms of its series (DLMF 19.36.1) are exact."""

_MOST_STEPS = 200

_LEAST_STEP = 1e-9
"""Share of a continuation below which it ends."""

_NEAR, _SHRINKS = 0.05, 0.25
"""Largest first step of a Newton search in a continuation, and largest ratio of its steps."""

_SETTLED = 1e-8
"""Newton step after which rounding errors are left only."""

_NUDGE = 1e-6
"""Change of the rest curvature for a derivative by it, which serves for a first guess [1/L]."""


class State(NamedTuple):
    """Base wrench of a contact and its derivatives; NaN where the rod cannot make the contact."""

    drive_angle: float
    holding_moment: float
    force_x: float
    force_y: float
    arclength: float
    tip_angle: float
    by_slope: float
    by_distance: float
    """As in `Wrench`."""


NOWHERE = State(math.nan, math.nan, math.nan, math.nan, math.nan, math.nan, math.nan, math.nan)


class Found(NamedTuple):
    """Contact that follows from a base wrench, mirrored to a forward one; NaN where there is none. See `Contact`."""

    x: float
    y: float
    slope_angle: float
    arclength: float
    tip_angle: float
    modulus: float


@compiled
def _halved(s: float, c: float, d: float, x: float, y: float, gap: float) -> tuple[float, float, float]:
    """Jacobi's functions of half the argument, for gap = y − x; s < 0 in the second half of a swing.

    In this form nothing cancels where c = −d, at half a period.
    """
    if d < 0.0:
        ratio, fall = gap / (c - d), (1.0 - d) / y
        return math.sqrt(fall / (1.0 + c)), math.sqrt(ratio * fall), s * math.sqrt(ratio / (1.0 + c))
    if c < 0.0:
        ratio, fall = -gap / (d - c), (1.0 - c) / x
        return math.sqrt(fall / (1.0 + d)), s * math.sqrt(ratio / (1.0 + d)), math.sqrt(ratio * fall)
    rest_c, rest_d = 1.0 + c, 1.0 + d
    half = math.sqrt((c + d) / rest_c)
    return abs(s) / math.sqrt(rest_c * rest_d), math.sqrt((c + d) / rest_d), half if s > 0.0 else -half


@compiled
def _is_moderate(arclength: float, force: float, curvature: float) -> bool:
    """True if a pose can be computed."""
    bend = curvature * arclength
    return force * arclength * arclength < MOST_LOAD and bend * bend < MOST_LOAD and arclength * arclength < MOST_LOAD


@compiled
def _argument(s: float, c: float, d: float, x: float, y: float, gap: float) -> float:
    """Argument of Jacobi's functions, within one swing or half a rotation, from their values."""
    double = 1.0
    while (s < 0.0 or c < 0.0 or d < 0.0) and double < 16.0:
        s, c, d = _halved(s, c, d, x, y, gap)
        double *= 2.0
    p, q, r = c * c, d * d, 1.0
    for _ in range(30):
        c, d, z = math.sqrt(p), math.sqrt(q), math.sqrt(r)
        common = c * d + (c + d) * z
        p, q, r = 0.25 * (p + common), 0.25 * (q + common), 0.25 * (r + common)
        mean = (p + q + r) / 3.0
        a, b = 1.0 - p / mean, 1.0 - q / mean
        if max(abs(a), abs(b), abs(a + b)) < _CLOSE:
            break
    e2, e3 = a * b - (a + b) * (a + b), -a * b * (a + b)
    series = 1.0 + e2 * (e2 * (1.0 / 24.0 - 5.0 / 208.0 * e2 + e3 / 16.0) - 3.0 / 44.0 * e3 - 0.1)
    series += e3 * (1.0 / 14.0 + 3.0 / 104.0 * e3)
    return double * s / math.sqrt(mean) * series


@compiled
def arc_contact(phi0: float, moment: float, fx: float, fy: float, delta: float, curvature: float) -> Found:
    """Contact that follows from a base wrench, without integration or root search; see `contact_from_wrench`."""
    force, modulus = math.sqrt(fx * fx + fy * fy), math.nan
    beta = math.atan2(-fx, fy)
    psi0 = phi0 - beta
    quarter = 0.25 * math.pi - 0.5 * (psi0 - 2.0 * math.pi * math.floor((psi0 + 0.5 * math.pi) / (2.0 * math.pi)))
    sin0, cos0, at_pivot = math.sin(quarter), math.cos(quarter), curvature - moment
    excess = 0.25 * moment * (moment - 2.0 * curvature) / force
    root = math.sqrt(abs(excess))
    if excess > 0.0:
        square, complement = sin0 * sin0 + excess, (cos0 - root) * (cos0 + root)
    else:
        square, complement = (abs(sin0) - root) * (abs(sin0) + root), cos0 * cos0 - excess
    at_rest = 0.25 * curvature * curvature
    if force > 0.0:
        modulus = square + at_rest / force
    gap = force * complement - at_rest
    # A pendulum that turns over does so in one sense.
    possible = gap > 0.0 or at_pivot * curvature > 0.0
    possible = possible and square > 0.0 and complement > 0.0 and 0.0 < force < math.inf and at_rest < math.inf
    if not (possible and (moment > 0.0 or sin0 < 0.0)):
        return Found(math.nan, math.nan, math.nan, math.nan, math.nan, modulus)
    if gap <= 0.0 and curvature > 0.0 and sin0 < 0.0:
        sin0, cos0 = -sin0, -cos0
    sin1, cos1, x = math.sqrt(square), math.sqrt(complement), at_rest + force * square
    one, other = sin0 * cos1, sin1 * cos0
    apart = -excess / (one + other) if one * other > 0.0 else one - other
    scale = at_rest + force * other * other
    arclength = _argument(
        0.5 * (curvature * apart + moment * other) / scale,
        (x * cos0 * cos1 + 0.25 * at_pivot * curvature * sin0 * sin1) / scale,
        (0.25 * at_pivot * curvature + force * one * other) / scale,
        x,
        force,
        gap,
    )
    if not _is_moderate(arclength, force, curvature):
        return Found(math.nan, math.nan, math.nan, math.nan, math.nan, modulus)
    here = pose(0.5 * math.pi - 2.0 * math.atan2(sin1, cos1), arclength, force, curvature)
    u, v = moment / force, here.v
    x, y = (u * fy + v * fx) / force, (v * fy - u * fx) / force
    return Found(x, y, beta - delta, arclength, phi0 - here.turn, modulus)


class Start(NamedTuple):
    """A state to continue from: rest curvature, ψ1 or arc length, and force."""

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


class _Slopes(NamedTuple):
    """Pose at a point, its derivatives by (q, f), and their determinant."""

    here: Pose
    by_q: Pose
    by_force: Pose
    det: float


@compiled
def _slopes(q: float, force: float, curvature: float, delta: float, tip: bool) -> _Slopes:
    psi1, arclength = (q, 1.0) if tip else (-delta, q)
    here, by_q, by_force = pose_and_slopes(psi1, arclength, force, curvature, tip)
    return _Slopes(here, by_q, by_force, by_q.u * by_force.v - by_force.u * by_q.v)


@compiled
def _step(at: _Slopes, du: float, dv: float) -> tuple[float, float]:
    """Change of (q, f) for a change of (u, v)."""
    _, by_q, by_force, det = at
    return (du * by_force.v - dv * by_force.u) / det, (by_q.u * dv - by_q.v * du) / det


@compiled
def _settled(u: float, v: float, delta: float, curvature: float, tip: bool, q: float, force: float) -> Start:
    """State near a guess by Newton's method; NaN if its steps are large or do not shrink fast."""
    before = _NEAR / _SHRINKS
    while force > 0.0 and _is_moderate(1.0 if tip else q, force, curvature):
        at = _slopes(q, force, curvature, delta, tip)
        dq, df = _step(at, u - at.here.u, v - at.here.v)
        size = max(abs(dq), abs(df) / (1.0 + force))
        if not size <= _SHRINKS * before:
            break
        q, force, before = q + dq, force + df, size
        if size <= _SETTLED:
            return Start(curvature, q, force)
    return Start(math.nan, math.nan, math.nan)


@compiled
def _continued(u: float, v: float, delta: float, curvature: float, tip: bool, start: Start) -> Start:
    """State with a rest curvature, continued from another one; NaN where the continuation ends before.

    The start may be somewhat off the contact: it is left behind at the same time.
    """
    at, way, step = start, 0.0, 1.0
    if not _is_moderate(1.0 if tip else at.q, at.force, at.curvature):
        return Start(math.nan, math.nan, math.nan)
    here = _slopes(start.q, start.force, start.curvature, delta, tip)
    from_u, from_v, change = here.here.u, here.here.v, curvature - start.curvature
    for _ in range(_MOST_STEPS):
        psi1, arclength = (at.q, 1.0) if tip else (-delta, at.q)
        aside = pose(psi1, arclength, at.force, at.curvature + _NUDGE)
        by_u, by_v = (aside.u - here.here.u) / _NUDGE, (aside.v - here.here.v) / _NUDGE
        dq, df = _step(here, u - from_u - change * by_u, v - from_v - change * by_v)
        for _ in range(_MOST_STEPS):
            end = min(way + step, 1.0)
            left, gone = 1.0 - end, end - way
            on_u, on_v, bent = u - left * (u - from_u), v - left * (v - from_v), curvature - left * change
            new = _settled(on_u, on_v, delta, bent, tip, at.q + gone * dq, at.force + gone * df)
            if new.force > 0.0 or not step > _LEAST_STEP:
                break
            step *= 0.5
        if end == 1.0 or not new.force > 0.0:
            return new
        at, way, step = new, end, 2.0 * step
        here = _slopes(at.q, at.force, at.curvature, delta, tip)
    return Start(math.nan, math.nan, math.nan)


@compiled
def arc_state(x: float, y: float, alpha: float, delta: float, curvature: float, tip: bool, start: Start) -> State:
    """State of a contact, continued from one with another rest curvature; NaN where this ends.

    The derivatives follow from those of the pose: with the slope of the contour the frame of the force turns.
    """
    beta = alpha + delta
    sin, cos = math.sin(beta), math.cos(beta)
    u, v = x * cos + y * sin, y * cos - x * sin
    _, q, force = _continued(u, v, delta, curvature, tip, start)
    if not force > 0.0:
        return NOWHERE
    at = _slopes(q, force, curvature, delta, tip)
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
    return State(drive_angle, force * u, -force * sin, force * cos, arclength, tip_angle, by_slope, by_distance)
