"""The exact rod: contact → base wrench and base wrench → contact, in closed form.

Everything here is dimensionless (length L, moment EI/L, force EI/L²), relative to the pivot, and broadcasts.

A contact force of magnitude f acts on the rod along (sin β, −cos β), with β = α + δ for slope angle α and friction
angle δ. With ψ = φ − β the rod obeys κ' = f cos ψ and κ(s1) = 0 (equations 19, 20 and 27 of Merker et al. 2018,
doi 10.1155/2018/1613945), whose solution is a piece of Euler's elastica that begins at a point of zero curvature:
the contact. Counted from there, in τ = √f (s1 − s), it is a Jacobi amplitude χ = am(τ | m), m = (1 − sin ψ1)/2, and
with w = sin²(χ/2), Δ² = 1 − m sin²χ, c = cos ψ1 = 2 √(m (1 − m)):

    tan((ψ − ψ1)/2) = c w / (1 − 2 m w)                     how far the rod has turned since the contact
    √f s1           = F(χ | m)
    1 − u'/s1, v'/s1 = C/F, S/F                              chord along and across the rod's direction at the contact
    C = ∫ 2 c² w² Δ⁻³ dχ,   S = ∫ 2 c w (1 − 2 m w) Δ⁻³ dχ   (both in closed form below)

The reason for counting from the contact is rounding: turn, C and S vanish with the load, and in these variables they
do so without cancellation. θ of Legendre's form at the pivot is linked to χ by tan χ = cot θ / √(1 − m).

All contacts are forward ones (holding moment ≥ 0); `side=-1` mirrors a backward one in and out.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.special import ellipk, elliprd, elliprf

from tactile_bayes.errors import ParameterError

__all__ = [
    "MAX_FRICTION_ANGLE",
    "NONE",
    "TANGENTIAL",
    "TIP",
    "Contact",
    "Wrench",
    "contact_from_wrench",
    "wrench_from_contact",
]

Floats = NDArray[np.float64]

NONE, TIP, TANGENTIAL = 0, 1, 2
"""Codes of the contact phase: no contact, Phase A (the tip touches), Phase B (the rod touches tangentially)."""

MAX_FRICTION_ANGLE = 0.7
"""Largest friction angle δ [rad]: 2 E(m) > K(m) must hold for m = (1 + sin δ)/2, else the map of Phase B folds."""

_SHORT = 1.0
"""Below this amplitude C and S come from quadrature (their closed form cancels), above it from Carlson's integrals."""

_SETTLED = 1e-9
"""Relative Newton step after which the next one would be lost in rounding."""

_MAX_STEPS = 40

_CHI_MAX = 3.2
"""A little over π, the amplitude at which the line of force passes through the pivot."""

_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(14)


class Wrench(NamedTuple):
    """What the base feels in a contact; NaN where the rod cannot make it (`phase` is then `NONE`)."""

    drive_angle: Floats
    """Slope φ0 of the rod at the pivot [rad]."""
    holding_moment: Floats
    """Moment m0 that the drive holds."""
    force_x: Floats
    force_y: Floats
    """Support reaction (−f sin β, f cos β)."""
    contact_arclength: Floats
    """Arc length s1 from the pivot to the contact."""
    tip_angle: Floats
    """Slope φ(s1) of the rod at the contact [rad]."""
    phase: NDArray[np.int8]
    """`NONE`, `TIP` or `TANGENTIAL`."""
    by_slope: Floats
    """∂φ0/∂α, the contact point held; by rotation of the whole, ∂φ0/∂(polar angle of the point) = 1 − by_slope."""
    by_distance: Floats
    """∂φ0/∂(r²), r the distance of the contact from the pivot, its direction and α held; zero in tangential contact."""
    tangential_arclength: Floats
    """Arc length that tangential contact at this point would take; the rod's length is what it is compared with."""


class Contact(NamedTuple):
    """Where the rod touches, from what the base feels; NaN where there is no answer."""

    contact_x: Floats
    contact_y: Floats
    """Contact point relative to the pivot."""
    slope_angle: Floats
    """Slope angle α of the contour [rad]."""
    contact_arclength: Floats
    """Arc length s1 from the pivot to the contact; above 1 it lies beyond the tip."""
    tip_angle: Floats
    """Slope φ(s1) of the rod at the contact [rad]."""
    modulus: Floats
    """m; the curvature has a zero if and only if m < 1."""


class _Arc(NamedTuple):
    """A piece of elastica from the contact to amplitude χ."""

    length: Floats
    """F(χ | m) = √f s1."""
    shortfall: Floats
    """C: length minus chord along the direction at the contact."""
    offset: Floats
    """S: chord across the direction at the contact."""
    turn: Floats
    """ψ − ψ1 in [0, π]."""
    moment: Floats
    """cos ψ1 sin χ / Δ: lever arm of the force times √f."""


class _ArcSlopes(NamedTuple):
    """Partial derivatives of an arc."""

    length: Floats
    shortfall: Floats
    offset: Floats
    turn: Floats


def _arc(chi: Floats, m: Floats) -> tuple[_Arc, _ArcSlopes, _ArcSlopes]:
    """Arc to amplitude chi ∈ [0, 3π/2) of parameter m ∈ (0, 1), with its derivatives by chi and by ψ1."""
    p, c = 1.0 - 2.0 * m, 2.0 * np.sqrt(m * (1.0 - m))
    sin, cos = np.sin(chi), np.cos(chi)
    w = np.sin(0.5 * chi) ** 2
    d2 = 1.0 - m * sin * sin
    d = np.sqrt(d2)
    flat = 1.0 - 2.0 * m * w
    turn = 2.0 * np.arctan2(c * w, flat)

    # Legendre's F and D = (F − E)/m by Carlson's forms, which keep all digits for small amplitudes and small m.
    beyond = chi > 0.5 * np.pi
    reach = np.where(beyond, -sin, sin)
    cos2 = cos * cos
    F = reach * elliprf(cos2, d2, 1.0)
    D = reach**3 * elliprd(cos2, d2, 1.0) / 3.0
    if np.any(beyond):
        mb = m[beyond]
        F[beyond] += 2.0 * ellipk(mb)
        D[beyond] += 2.0 * elliprd(0.0, 1.0 - mb, 1.0) / 3.0
    P, Q = F - sin / d, 2.0 * sin * w / d - D
    C, S = 2.0 * m * (P - p * Q), c * (P + 2.0 * m * Q)

    # Derivatives by χ are the integrands; by ψ1 they follow from dm/dψ1 = −c/2, dc/dψ1 = −p.
    F_m = (F - D - sin * cos / d) / (2.0 * (1.0 - m))
    with np.errstate(divide="ignore", invalid="ignore"):
        D_m = (F_m - 0.5 * D) / m
    tiny = m < 1e-6
    if np.any(tiny):
        ct = chi[tiny]
        D_m[tiny] = (12.0 * ct - 8.0 * np.sin(2.0 * ct) + np.sin(4.0 * ct)) / 64.0
    d3 = d2 * d
    P_m = F_m - 0.5 * sin**3 / d3
    Q_m = sin**3 * w / d3 - D_m
    C_m = 2.0 * (P - p * Q) + 2.0 * m * (P_m + 2.0 * Q - p * Q_m)
    S_1 = -p * (P + 2.0 * m * Q) - 0.5 * c * c * (P_m + 2.0 * Q + 2.0 * m * Q_m)
    C_1 = -0.5 * c * C_m

    short = chi < _SHORT
    if np.any(short):
        xs, ms, cs, ps = (a[short][..., None] for a in (chi, m, c, p))
        h = np.sin(0.25 * xs * (1.0 + _NODES)) ** 2
        g = 4.0 * h * (1.0 - h)
        i2 = 1.0 / (1.0 - ms * g)
        kernel = h * i2 * np.sqrt(i2) * (_WEIGHTS * xs)
        thrust = 1.0 - 2.0 * ms * h
        C[short] = (kernel * h * cs * cs).sum(-1)
        S[short] = (kernel * thrust * cs).sum(-1)
        growth = 1.5 * g * i2  # ∂ log Δ⁻³ / ∂m
        C_1[short] = (-0.5 * cs * kernel * h * (4.0 * ps + cs * cs * growth)).sum(-1)
        S_1[short] = (kernel * (-ps * thrust - 0.5 * cs * cs * (growth * thrust - 2.0 * h))).sum(-1)

    arc = _Arc(F, C, S, turn, c * sin / d)
    by_chi = _ArcSlopes(1.0 / d, 2.0 * (c * w) ** 2 / d3, 2.0 * c * w * flat / d3, c * sin / d2)
    # (c w)² + (1 − 2 m w)² = Δ²; the turn by ψ1 is 2 [flat · c_1 − c · flat_1] w / Δ².
    by_psi1 = _ArcSlopes(-0.5 * c * F_m, C_1, S_1, -2.0 * w * (p * flat + c * c * w) / d2)
    return arc, by_chi, by_psi1


def _chord_angle(arc: _Arc, slopes: _ArcSlopes) -> tuple[Floats, Floats]:
    """Angle of the chord over the direction at the contact, and its derivative."""
    along = arc.length - arc.shortfall
    angle = np.arctan2(arc.offset, along)
    slope = (along * slopes.offset - arc.offset * (slopes.length - slopes.shortfall)) / (along**2 + arc.offset**2)
    return angle, slope


def _slack(arc: _Arc) -> Floats:
    """√(1 − r²) for a rod of length one, r its chord; without cancellation."""
    F, C, S = arc.length, arc.shortfall, arc.offset
    return np.sqrt(np.maximum(2.0 * F * C - C * C - S * S, 0.0)) / F


def _slack_slope(arc: _Arc, slack: Floats, slopes: _ArcSlopes) -> Floats:
    F, C, S = arc.length, arc.shortfall, arc.offset
    half = (F - C) * slopes.shortfall + C * slopes.length - S * slopes.offset
    return (half / (slack * F) - slack * slopes.length) / F


def _solve_tangential(angle: Floats, m: Floats) -> Floats:
    """Amplitude χ ∈ [0, π] at which the chord stands at `angle` over the rod's direction at the contact.

    Newton on the square root of the angle, which is nearly proportional to χ: a universal function of one variable.
    """
    target = np.sqrt(angle)
    chi = np.minimum(np.sqrt(3.0 / np.sqrt(m * (1.0 - m))) * target, np.pi)
    active = np.flatnonzero(chi > 0.0)
    for _ in range(_MAX_STEPS):
        if not active.size:
            break
        x = chi[active]
        arc, by_chi, _ = _arc(x, m[active])
        value, slope = _chord_angle(arc, by_chi)
        root = np.sqrt(value)
        step = (root - target[active]) * 2.0 * root / slope
        chi[active] = np.clip(x - step, 0.5 * x, np.pi)
        active = active[np.abs(step) > _SETTLED * x]
    chi[active] = np.nan
    return chi


def _near_thrust() -> tuple[Floats, Floats, Floats]:
    """Tip contact pressed nearly along the rod (m → 0): first guesses for `_solve_tip`, as a table over one angle.

    To first order in the tilt ε1 = π/2 − ψ1, slack = ε1 h(χ) and the chord's tilt is ε1 sin χ / χ.
    """
    chi = np.linspace(1e-3, np.pi, 400)
    P = chi - np.sin(chi)
    Q = np.sin(chi) * (1.0 - np.cos(chi)) - 0.5 * chi + 0.25 * np.sin(2.0 * chi)
    h = np.sqrt(chi * (P - Q) - P * P) / chi
    angle = np.arctan2(h, np.sin(chi) / chi)
    return np.append(0.0, angle), np.append(0.0, chi), np.append(np.sqrt(1.25), P / (chi * h))


_THRUST_ANGLE, _THRUST_CHI, _THRUST_RATIO = _near_thrust()


def _solve_tip(slack: Floats, tilt: Floats) -> tuple[Floats, Floats]:
    """Amplitude χ ∈ [0, π] and ε1 = π/2 − ψ1 of a rod of length one whose chord is √(1 − slack²).

    `tilt` ∈ [0, π/2 + δ] is π/2 minus the chord's angle over the direction across the force. Newton in two variables.
    """
    angle = np.arctan2(slack, np.sin(np.minimum(tilt, 0.5 * np.pi)))
    chi = np.sqrt(np.interp(angle, _THRUST_ANGLE, _THRUST_CHI**2))
    tilt1 = np.minimum(tilt + slack * np.interp(chi, _THRUST_CHI, _THRUST_RATIO), 0.9 * np.pi)
    active = np.flatnonzero(slack > 0.0)
    for _ in range(_MAX_STEPS):
        if not active.size:
            break
        x, t = chi[active], tilt1[active]
        arc, by_chi, by_psi1 = _arc(x, np.sin(0.5 * t) ** 2)
        angle, angle_x = _chord_angle(arc, by_chi)
        angle_t = -_chord_angle(arc, by_psi1)[1]
        value = _slack(arc)
        value_x, value_t = _slack_slope(arc, value, by_chi), -_slack_slope(arc, value, by_psi1)
        miss, miss_tilt = value - slack[active], t - angle - tilt[active]
        det = value_x * (1.0 - angle_t) + value_t * angle_x
        dx = (miss * (1.0 - angle_t) - value_t * miss_tilt) / det
        dt = (value_x * miss_tilt + angle_x * miss) / det
        chi[active] = np.clip(x - dx, 0.5 * x, np.minimum(1.5 * x, _CHI_MAX))
        tilt1[active] = np.clip(t - dt, 0.5 * t, 0.5 * (t + np.pi))
        active = active[(np.abs(dx) > _SETTLED * x) | (np.abs(dt) > _SETTLED * t)]
    chi[active] = np.nan
    return chi, tilt1


def _refuse_friction(friction_angle: Floats) -> None:
    if np.any(~((friction_angle >= 0.0) & (friction_angle <= MAX_FRICTION_ANGLE))):
        bad = friction_angle[~((friction_angle >= 0.0) & (friction_angle <= MAX_FRICTION_ANGLE))].flat[0]
        raise ParameterError(
            f"friction angle {bad!r} rad: give arctan of the friction coefficient, between 0 and {MAX_FRICTION_ANGLE} "
            f"(coefficient {np.tan(MAX_FRICTION_ANGLE):.2f}; beyond, a rod would loop before it slides)"
        )


def wrench_from_contact(
    contact_x: ArrayLike,
    contact_y: ArrayLike,
    slope_angle: ArrayLike,
    friction_angle: ArrayLike = 0.0,
    *,
    side: ArrayLike = 1,
) -> Wrench:
    """What the base feels when the rod touches a contour at a given point: Step 1 for one state.

    Parameters
    ----------
    contact_x, contact_y : array_like
        Contact point relative to the pivot, in rod lengths.
    slope_angle : array_like
        Slope angle α of the contour there [rad].
    friction_angle : array_like
        δ = arctan μ for a rod that slides with Coulomb's coefficient μ [rad].
    side : array_like of +1 or −1
        +1 for a contact of a forward sweep, −1 for one of a backward sweep, its mirror image.

    Returns
    -------
    Wrench
        Arrays of the broadcast shape. Where s1 ≤ 1 suffices for tangential contact the phase is `TANGENTIAL`; else it
        is `TIP` if the point is within reach; else, or where the contour turns its back, it is `NONE` and the rest NaN.

    Examples
    --------
    >>> w = wrench_from_contact(0.2, 0.6, [0.1, 0.2])
    >>> w.phase, w.drive_angle.round(6)
    (array([2, 2], dtype=int8), array([2.608797, 2.318453]))
    """
    x, y, alpha, delta, sign = np.broadcast_arrays(
        *(np.asarray(a, dtype=float) for a in (contact_x, contact_y, slope_angle, friction_angle, side))
    )
    _refuse_friction(delta)
    shape = x.shape
    x, alpha = (sign * x).ravel(), (sign * alpha).ravel()
    y, delta, sign = y.ravel(), delta.ravel(), sign.ravel()

    sin_a, cos_a = np.sin(alpha), np.cos(alpha)
    along, across = x * cos_a + y * sin_a, y * cos_a - x * sin_a
    beta = alpha + delta
    chord_angle = np.arctan2(across, along)
    limit = 0.5 * np.pi + delta
    with np.errstate(invalid="ignore"):
        faces = (across >= 0.0) & (chord_angle <= limit + 1e-12) & (np.abs(alpha) <= 0.5 * np.pi)
    fields = {name: np.full(x.size, np.nan) for name in Wrench._fields}
    phase = np.zeros(x.size, dtype=np.int8)

    # Phase B: the direction at the contact is the contour's; amplitude from the chord's angle alone.
    i = np.flatnonzero(faces)
    m = 0.5 * (1.0 + np.sin(delta[i]))
    chi = _solve_tangential(np.minimum(chord_angle[i], limit[i]), m)
    arc, by_chi, _ = _arc(chi, m)
    root_f = np.hypot(arc.length - arc.shortfall, arc.offset) / np.hypot(x[i], y[i])
    with np.errstate(divide="ignore", invalid="ignore"):
        length = np.where(chi > 0.0, arc.length / root_f, np.hypot(x[i], y[i]))
        turning = np.where(chi > 0.0, by_chi.turn / _chord_angle(arc, by_chi)[1], 3.0)
    fields["tangential_arclength"][i] = length
    b = length <= 1.0
    j = i[b]
    phase[j] = TANGENTIAL
    fields["by_slope"][j] = 1.0 - turning[b]
    fields["by_distance"][j] = 0.0
    fields["contact_arclength"][j] = length[b]
    fields["tip_angle"][j] = alpha[j]
    fields["drive_angle"][j] = alpha[j] + arc.turn[b]
    force, lever = np.zeros(x.size), np.zeros(x.size)
    force[j], lever[j] = root_f[b] ** 2, arc.moment[b] * root_f[b]

    # Phase A: the tip's distance and direction give amplitude and direction at the contact.
    larger, smaller = np.maximum(np.abs(x), np.abs(y)), np.minimum(np.abs(x), np.abs(y))
    slack2 = (1.0 - larger) * (1.0 + larger) - smaller * smaller
    with np.errstate(invalid="ignore"):
        j = np.flatnonzero(faces & (fields["tangential_arclength"] > 1.0) & (slack2 >= 0.0))
    slack = np.sqrt(slack2[j])
    u = x[j] * np.cos(beta[j]) + y[j] * np.sin(beta[j])
    v = y[j] * np.cos(beta[j]) - x[j] * np.sin(beta[j])
    tilt = np.maximum(np.arctan2(u, v), 0.0)
    chi, tilt1 = _solve_tip(slack, tilt)
    arc, by_chi, by_psi1 = _arc(chi, np.sin(0.5 * tilt1) ** 2)
    _, angle_x = _chord_angle(arc, by_chi)
    angle_1 = 1.0 + _chord_angle(arc, by_psi1)[1]
    value = _slack(arc)
    with np.errstate(divide="ignore", invalid="ignore"):
        value_x, value_1 = _slack_slope(arc, value, by_chi), _slack_slope(arc, value, by_psi1)
        det = value_x * angle_1 - value_1 * angle_x
        by_chord = (value_x * (1.0 + by_psi1.turn) - value_1 * by_chi.turn) / det
        by_value = (angle_1 * by_chi.turn - angle_x * (1.0 + by_psi1.turn)) / det
        at_rest = chi == 0.0
        fields["by_slope"][j] = np.where(at_rest, np.nan, 1.0 - by_chord)
        fields["by_distance"][j] = np.where(at_rest, -np.inf, -0.5 * by_value / value)
    phase[j] = TIP
    fields["contact_arclength"][j] = 1.0
    fields["tip_angle"][j] = beta[j] + 0.5 * np.pi - tilt1
    fields["drive_angle"][j] = fields["tip_angle"][j] + arc.turn
    force[j], lever[j] = arc.length**2, arc.moment * arc.length

    touching = phase != NONE
    out = dict.fromkeys(("holding_moment", "force_x", "force_y"), np.full(x.size, np.nan))
    out["holding_moment"] = np.where(touching, sign * lever, np.nan)
    out["force_x"] = np.where(touching, -sign * force * np.sin(beta), np.nan)
    out["force_y"] = np.where(touching, force * np.cos(beta), np.nan)
    mirrored = sign < 0
    for name in ("drive_angle", "tip_angle"):
        out[name] = np.where(mirrored, np.pi - fields[name], fields[name])
    out["by_distance"] = sign * fields["by_distance"]
    merged = fields | out | {"phase": phase}
    return Wrench(**{name: a.reshape(shape) for name, a in merged.items()})


def contact_from_wrench(
    drive_angle: ArrayLike,
    holding_moment: ArrayLike,
    force_x: ArrayLike,
    force_y: ArrayLike,
    friction_angle: ArrayLike = 0.0,
    *,
    side: ArrayLike | None = None,
) -> Contact:
    """Where the rod touches, from what the base feels: Step 2 for one state, without integration or root search.

    Equation 26 gives the direction of the force, and the pivot's slope and curvature then fix the elastica; the contact
    is its first point of zero curvature (equation 27).

    Parameters
    ----------
    drive_angle, holding_moment, force_x, force_y : array_like
        Slope of the rod at the pivot [rad] and the wrench there (moment EI/L, force EI/L²).
    friction_angle : array_like
        δ = arctan μ [rad].
    side : array_like of +1 or −1, optional
        +1 for contacts of a forward sweep, −1 backward; by default the sign of the holding moment.

    Returns
    -------
    Contact
        NaN where there is no force, or the curvature has no zero (`modulus` ≥ 1).

    Examples
    --------
    >>> w = wrench_from_contact(0.2, 0.6, 0.1)
    >>> c = contact_from_wrench(w.drive_angle, w.holding_moment, w.force_x, w.force_y)
    >>> c.contact_x.round(12), c.contact_y.round(12), c.slope_angle.round(12)
    (np.float64(0.2), np.float64(0.6), np.float64(0.1))
    """
    moment = np.asarray(holding_moment, dtype=float)
    if side is None:
        side = np.where(moment < 0.0, -1.0, 1.0)
    phi0, moment, fx, fy, delta, sign = np.broadcast_arrays(
        *(np.asarray(a, dtype=float) for a in (drive_angle, moment, force_x, force_y, friction_angle, side))
    )
    _refuse_friction(delta)
    shape = phi0.shape
    mirrored = sign < 0
    phi0 = np.where(mirrored, np.pi - phi0, phi0)
    moment, fx = sign * moment, sign * fx

    force = np.hypot(fx, fy)
    beta = np.arctan2(-fx, fy)
    psi0 = phi0 - beta
    psi0 = psi0 - 2.0 * np.pi * np.floor((psi0 + 0.5 * np.pi) / (2.0 * np.pi))
    a, a_cos = np.sin(0.25 * np.pi - 0.5 * psi0), np.sin(0.25 * np.pi + 0.5 * psi0)
    with np.errstate(divide="ignore", invalid="ignore"):
        b = 0.5 * moment / np.sqrt(force)
        modulus = a * a + b * b
        complement = (a_cos - b) * (a_cos + b)
        usable = (force > 0.0) & (complement > 0.0) & (moment >= 0.0)
    chi = np.where(usable, np.arctan2(b, a * np.sqrt(np.where(usable, complement, 1.0))), np.nan)
    arc, _, _ = _arc(chi.ravel(), np.where(usable, modulus, 0.5).ravel())
    F, C, S, turn = (a.reshape(shape) for a in (arc.length, arc.shortfall, arc.offset, arc.turn))
    with np.errstate(divide="ignore", invalid="ignore"):
        arclength = np.where(
            moment > 0.0, F / np.sqrt(force), np.where(usable & (chi > 1.0), F / np.sqrt(force), np.nan)
        )
        shortfall, offset = arclength * (C / F), arclength * (S / F)
    tip_angle = phi0 - turn
    sin_t, cos_t = np.sin(tip_angle), np.cos(tip_angle)
    x = (arclength - shortfall) * cos_t - offset * sin_t
    y = (arclength - shortfall) * sin_t + offset * cos_t
    slope = np.where(force > 0.0, beta - delta, np.nan)
    return Contact(
        sign * x,
        y,
        sign * slope,
        arclength,
        np.where(mirrored, np.pi - tip_angle, tip_angle),
        np.where(force > 0.0, modulus, np.nan),
    )
