"""The exact rod: contact → base wrench and base wrench → contact, in closed form.

Everything here is dimensionless (length L, moment EI/L, force EI/L²), relative to the pivot, and broadcasts.

A contact force of magnitude f acts on the rod along (sin β, −cos β), with β = α + δ for slope angle α and friction
angle δ. With ψ = φ − β the rod obeys κ' = f cos ψ and κ(s1) = 0 (equations 19, 20 and 27 of Merker et al. 2018,
doi 10.1155/2018/1613945): a piece of Euler's elastica that begins at a point of zero curvature, the contact (`arc`).

All contacts are forward ones (holding moment ≥ 0); `side=-1` mirrors a backward one in and out.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tactile_bayes.arc import SHORT_COSINE, Arc, ArcSlopes, arc_and_slopes, arc_at, chord_angle, slack, slack_slope
from tactile_bayes.errors import ParameterError
from tactile_bayes.universal import tangential_arcs, tangential_numbers, tip_arcs, tip_numbers

__all__ = [
    "MAX_FRICTION_ANGLE",
    "NONE",
    "PHASE_NAMES",
    "TANGENTIAL",
    "TIP",
    "Contact",
    "QuickWrench",
    "Wrench",
    "contact_from_wrench",
    "largest_curvature",
    "quick_tangential_arclength",
    "quick_wrench",
    "tangential_arclength",
    "wrench_from_contact",
]

Floats = NDArray[np.float64]
Result = TypeVar("Result", bound=tuple[NDArray[Any], ...])

NONE, TIP, TANGENTIAL = 0, 1, 2
"""Codes of the contact phase: no contact, Phase A (the tip touches), Phase B (the rod touches tangentially)."""

PHASE_NAMES = ("none", "tip", "tangential")
"""Words for the contact phases, by code."""

MAX_FRICTION_ANGLE = 0.7
"""Largest friction angle δ [rad]: 2 E(m) > K(m) must hold for m = (1 + sin δ)/2, else the map of Phase B folds."""

_BLOCK = 16384
"""States worked on at a time, so that intermediate results stay in the processor's cache."""


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


def _refuse_friction(friction_angle: Floats) -> None:
    bad = ~((friction_angle >= 0.0) & (friction_angle <= MAX_FRICTION_ANGLE))
    if np.any(bad):
        found = float(friction_angle[bad].flat[0])
        raise ParameterError(
            f"the friction angle is {found:g} rad: give one between 0 and "
            f"{MAX_FRICTION_ANGLE} (coefficient {np.tan(MAX_FRICTION_ANGLE):.2f}); beyond, a rod would loop before it "
            "slides"
        )


def _in_blocks(work: Callable[..., Result], make: type[Result], *given: NDArray[Any]) -> Result:
    """What `work` makes of arguments that broadcast, given to it flat and a block at a time."""
    columns = np.broadcast_arrays(*given)
    shape, flat = columns[0].shape, [column.reshape(-1) for column in columns]
    begins = range(0, max(flat[0].size, 1), _BLOCK)
    blocks = [work(*(column[begin : begin + _BLOCK] for column in flat)) for begin in begins]
    return make(*(np.concatenate(parts).reshape(shape) for parts in zip(*blocks, strict=True)))


class _Touch(NamedTuple):
    """Tangential contact at points of a contour, however long the rod."""

    where: NDArray[np.intp]
    """Which of the points the rod can touch from the pivot's side."""
    arc: Arc
    by_chi: ArcSlopes
    length: Floats
    """Arc length that it takes."""


def _touch(x: Floats, y: Floats, alpha: Floats, delta: Floats, wanted: NDArray[np.bool_] | bool = True) -> _Touch:
    """Tangential contact in forward sweeps: the chord's angle over the contour's tangent alone gives the amplitude."""
    sin, cos = np.sin(alpha), np.cos(alpha)
    along, across = x * cos + y * sin, y * cos - x * sin
    angle, limit = np.arctan2(across, along), 0.5 * np.pi + delta
    with np.errstate(invalid="ignore"):
        index = np.flatnonzero(wanted & (across >= 0.0) & (angle <= limit + 1e-12) & (np.abs(alpha) <= 0.5 * np.pi))
    angle, limit = angle[index], limit[index]
    m = 0.5 * (1.0 + np.sin(delta[index]))
    chi, arc, by_chi = tangential_arcs(np.minimum(angle, limit), m)
    chord = np.hypot(x[index], y[index])
    with np.errstate(divide="ignore", invalid="ignore"):
        stretch = arc.length / np.hypot(arc.length - arc.shortfall, arc.offset)
    return _Touch(index, arc, by_chi, chord * np.where(chi > 0.0, stretch, 1.0))


def tangential_arclength(
    contact_x: ArrayLike, contact_y: ArrayLike, slope_angle: ArrayLike, friction_angle: ArrayLike = 0.0
) -> Floats:
    """Arc length that tangential contact of a forward sweep takes; above 1 only the tip can touch there.

    Parameters are those of `wrench_from_contact`. NaN where the contour turns its back.

    Examples
    --------
    >>> tangential_arclength(0.2, 0.6, [0.1, 0.2]).round(6)
    array([1.053211, 0.976104])
    """
    x, y, alpha, delta = np.broadcast_arrays(
        *(np.asarray(a, dtype=float) for a in (contact_x, contact_y, slope_angle, friction_angle))
    )
    _refuse_friction(delta)
    touch = _touch(x.ravel(), y.ravel(), alpha.ravel(), delta.ravel())
    length = np.full(x.size, np.nan)
    length[touch.where] = touch.length
    return length.reshape(x.shape)


def wrench_from_contact(
    contact_x: ArrayLike,
    contact_y: ArrayLike,
    slope_angle: ArrayLike,
    friction_angle: ArrayLike = 0.0,
    *,
    side: ArrayLike = 1,
    phase: ArrayLike | None = None,
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
    phase : array_like of `TIP` or `TANGENTIAL`, optional
        The phase, where it is known already; then only that one is computed, and not questioned.

    Returns
    -------
    Wrench
        Arrays of the broadcast shape. Where s1 ≤ 1 suffices for tangential contact the phase is `TANGENTIAL`; else it
        is `TIP` if the point is within reach; else, or where the contour turns its back, it is `NONE` and the rest NaN.

    Examples
    --------
    >>> w = wrench_from_contact(0.2, 0.6, [0.1, 0.2])
    >>> w.phase, w.drive_angle.round(6)
    (array([1, 2], dtype=int8), array([2.901776, 2.923367]))
    """
    given = [np.asarray(a, dtype=float) for a in (contact_x, contact_y, slope_angle, friction_angle, side)]
    _refuse_friction(given[3])
    return _in_blocks(_wrench, Wrench, *given, *(() if phase is None else (np.asarray(phase),)))


def _wrench(
    x: Floats, y: Floats, alpha: Floats, delta: Floats, sign: Floats, known: NDArray[Any] | None = None
) -> Wrench:
    x, alpha = sign * x, sign * alpha
    beta = alpha + delta
    sin_beta, cos_beta = np.sin(beta), np.cos(beta)

    touch = _touch(x, y, alpha, delta, True if known is None else known == TANGENTIAL)
    lies = touch.length <= 1.0 if known is None else np.ones(touch.where.size, dtype=bool)
    larger, smaller = np.maximum(np.abs(x), np.abs(y)), np.minimum(np.abs(x), np.abs(y))
    slack2 = (1.0 - larger) * (1.0 + larger) - smaller * smaller
    tangential_arclength = np.full(x.size, np.nan)
    tangential_arclength[touch.where] = touch.length
    with np.errstate(invalid="ignore"):
        ends = np.flatnonzero((tangential_arclength > 1.0 if known is None else known == TIP) & (slack2 >= 0.0))

    found = np.zeros(x.size, dtype=np.int8)
    found[touch.where[lies]], found[ends] = TANGENTIAL, TIP
    columns = np.full((6, x.size), np.nan)
    columns[:, touch.where[lies]] = _lying(touch, alpha[touch.where])[:, lies]
    columns[:, ends] = _ending(x[ends], y[ends], beta[ends], np.sqrt(slack2[ends]))
    force, arclength, tip_angle, turn, by_slope, by_distance = columns

    drive_angle = tip_angle + turn
    mirrored = sign < 0
    return Wrench(
        drive_angle=np.where(mirrored, np.pi - drive_angle, drive_angle),
        holding_moment=sign * force * (x * cos_beta + y * sin_beta),
        force_x=-sign * force * sin_beta,
        force_y=force * cos_beta,
        contact_arclength=arclength,
        tip_angle=np.where(mirrored, np.pi - tip_angle, tip_angle),
        phase=found,
        by_slope=by_slope,
        by_distance=sign * by_distance,
        tangential_arclength=tangential_arclength,
    )


def _lying(touch: _Touch, alpha: Floats) -> Floats:
    """Phase B: force, arc length, direction at the contact, turn, and derivatives of the drive angle."""
    arc, by_chi, length = touch.arc, touch.by_chi, touch.length
    with np.errstate(divide="ignore", invalid="ignore"):
        turning = np.where(arc.turn > 0.0, by_chi.turn / chord_angle(arc, by_chi)[1], 3.0)
    return np.stack([(arc.length / length) ** 2, length, alpha, arc.turn, 1.0 - turning, np.zeros_like(length)])


def _ending(x: Floats, y: Floats, beta: Floats, lack: Floats) -> Floats:
    """Phase A, the same: distance and direction of the tip give amplitude and direction at the contact."""
    u, v = x * np.cos(beta) + y * np.sin(beta), y * np.cos(beta) - x * np.sin(beta)
    chi, tilt, arc = tip_arcs(lack, np.maximum(np.arctan2(u, v), 0.0))
    out = np.full((6, lack.size), np.nan)
    out[:4] = arc.length**2, np.ones_like(lack), beta + 0.5 * np.pi - tilt, arc.turn
    arc, by_chi, by_psi1 = arc_and_slopes(chi, np.sin(0.5 * tilt) ** 2)
    _, angle_x = chord_angle(arc, by_chi)
    angle_1 = 1.0 + chord_angle(arc, by_psi1)[1]
    value = slack(arc)
    with np.errstate(divide="ignore", invalid="ignore"):
        value_x, value_1 = slack_slope(arc, value, by_chi), slack_slope(arc, value, by_psi1)
        det = value_x * angle_1 - value_1 * angle_x
        by_chord = (value_x * (1.0 + by_psi1.turn) - value_1 * by_chi.turn) / det
        by_value = (angle_1 * by_chi.turn - angle_x * (1.0 + by_psi1.turn)) / det
        out[4] = np.where(chi > 0.0, 1.0 - by_chord, np.nan)
        out[5] = np.where(chi > 0.0, -0.5 * by_value / value, -np.inf)
    return out


class QuickWrench(NamedTuple):
    """The part of `Wrench` that a likelihood needs."""

    drive_angle: Floats
    holding_moment: Floats
    force_x: Floats
    force_y: Floats


def quick_wrench(
    contact_x: Floats, contact_y: Floats, slope_angle: Floats, tip: NDArray[np.bool_], *, roughly: bool = False
) -> QuickWrench:
    """`wrench_from_contact` for frictionless forward contacts of known phase, from tables.

    To about 1e-9, or `roughly`, to 3e-6. NaN where the rod cannot make the contact.

    Examples
    --------
    >>> quick_wrench(np.array([0.2]), np.array([0.6]), np.array([0.1]), np.array([True])).drive_angle.round(6)
    array([2.901776])
    """
    shape = contact_x.shape
    x, y, alpha = contact_x.ravel(), contact_y.ravel(), slope_angle.ravel()
    tip = np.broadcast_to(tip, shape).ravel()
    sin, cos = np.sin(alpha), np.cos(alpha)
    along, across = x * cos + y * sin, y * cos - x * sin
    force, drive_angle = np.full(x.size, np.nan), np.full(x.size, np.nan)
    distance2 = x * x + y * y
    within = (across >= 0.0) & (along >= -1e-12)
    lies, ends = np.flatnonzero(within & ~tip), np.flatnonzero(within & tip & (distance2 <= 1.0))
    lying = tangential_numbers(np.arctan2(across[lies], along[lies]), roughly=roughly)
    force[lies] = lying.force / distance2[lies]
    drive_angle[lies] = alpha[lies] + lying.turn
    tilt = np.maximum(np.arctan2(along[ends], across[ends]), 0.0)
    ending = tip_numbers(np.sqrt(1.0 - distance2[ends]), tilt, roughly=roughly)
    force[ends] = ending.force
    drive_angle[ends] = alpha[ends] + 0.5 * np.pi - ending.tilt + ending.turn
    columns = drive_angle, force * along, -force * sin, force * cos
    return QuickWrench(*(column.reshape(shape) for column in columns))


def quick_tangential_arclength(
    contact_x: Floats, contact_y: Floats, slope_angle: Floats, *, roughly: bool = False
) -> Floats:
    """`tangential_arclength` without friction, from a table, to about 1e-9; `roughly`, to 1e-7.

    Examples
    --------
    >>> quick_tangential_arclength(np.array(0.2), np.array(0.6), np.array(0.1)).round(6)
    np.float64(1.053211)
    """
    sin, cos = np.sin(slope_angle), np.cos(slope_angle)
    along, across = contact_x * cos + contact_y * sin, contact_y * cos - contact_x * sin
    numbers = tangential_numbers(np.arctan2(np.maximum(across, 0.0), along), roughly=roughly)
    return np.hypot(contact_x, contact_y) * numbers.stretch


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
    delta = np.asarray(friction_angle, dtype=float)
    _refuse_friction(delta)
    given = (drive_angle, moment, force_x, force_y, delta, side)
    return _in_blocks(_contact, Contact, *(np.asarray(a, dtype=float) for a in given))


def _contact(phi0: Floats, moment: Floats, fx: Floats, fy: Floats, delta: Floats, sign: Floats) -> Contact:
    mirrored = sign < 0.0
    phi0 = np.where(mirrored, np.pi - phi0, phi0)
    moment, fx = sign * moment, sign * fx
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        force = np.sqrt(fx * fx + fy * fy)
        root = np.sqrt(force)
        beta = np.arctan2(-fx, fy)
        psi0 = phi0 - beta
        quarter = 0.25 * np.pi - 0.5 * (psi0 - 2.0 * np.pi * np.floor((psi0 + 0.5 * np.pi) / (2.0 * np.pi)))
        a, a_cos, b = np.sin(quarter), np.cos(quarter), 0.5 * moment / root
        modulus = np.where(force > 0.0, a * a + b * b, np.nan)
        complement = (a_cos - b) * (a_cos + b)
        # A force without moment passes through the pivot of a straight rod: it may be anywhere.
        usable = (complement > 0.0) & (modulus > 0.0) & ((b > 0.0) | ((b == 0.0) & (a < 0.0))) & (force < np.inf)

        # θ0 = atan2(a, b) is linked to χ by tan χ = cot θ0 / √(1 − m).
        width = a_cos * np.sqrt(np.where(usable, modulus, np.nan))
        sin_chi, cos_chi = b / width, a * np.sqrt(complement) / width
        arc = arc_at(sin_chi, cos_chi, modulus)
        arclength, along, across = arc.length / root, (arc.length - arc.shortfall) / root, arc.offset / root
        tip_angle = phi0 - arc.turn
        cos, sin = np.cos(tip_angle), np.sin(tip_angle)
        # In a rod bent far round, m0 = f u keeps more digits; the rest of the contact lies along the force.
        bent = cos_chi < SHORT_COSINE
        sin_psi1, cos_psi1 = 1.0 - 2.0 * modulus, 2.0 * np.sqrt(modulus) * np.sqrt(complement)
        u, v = moment / force, along * sin_psi1 + across * cos_psi1
        x = np.where(bent, (u * fy + v * fx) / force, along * cos - across * sin)
        y = np.where(bent, (v * fy - u * fx) / force, along * sin + across * cos)
    return Contact(
        sign * x,
        y,
        sign * np.where(usable, beta - delta, np.nan),
        arclength,
        np.where(mirrored, np.pi - tip_angle, tip_angle),
        modulus,
    )


def largest_curvature(wrench: Wrench) -> Floats:
    """Largest curvature of the rod between pivot and contact, in 1/L: its bending moment in EI/L.

    Along the rod κ²/2 = f (sin ψ − sin ψ1), which is greatest where ψ = π/2 if the rod comes past there, else at the
    pivot, where it is the holding moment.

    Examples
    --------
    >>> bent = wrench_from_contact(0.2, 0.6, [0.1, 0.8])
    >>> bent.holding_moment.round(6), largest_curvature(bent).round(6)
    (array([2.18262 , 3.400363]), array([4.000574, 3.400363]))
    """
    cos, sin = np.cos(wrench.drive_angle), np.sin(wrench.drive_angle)
    along, across = wrench.force_x * cos + wrench.force_y * sin, wrench.force_y * cos - wrench.force_x * sin
    inflated = 2.0 * (np.hypot(wrench.force_x, wrench.force_y) - along)
    bent_round = np.where(wrench.holding_moment < 0.0, -across, across) < 0.0
    return np.sqrt(wrench.holding_moment**2 + np.where(bent_round, inflated, 0.0))
