"""The exact rod for arrays: contact → base wrench and base wrench → contact (`states`).

Quantities are dimensionless (length L, moment EI/L, force EI/L²), relative to the pivot, and broadcast. The formulas
hold for forward contacts (holding moment ≥ 0); `side=-1` mirrors a backward contact in and out. The unloaded rod is
straight, or a circular arc of any rest curvature, or has a `Profile`. Straight rods have closed forms; wrenches of
others are found by continuation (`continuation`), and contacts of rods with a profile by integration.
"""

from __future__ import annotations

from functools import partial
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tactile_bayes.arrays import Floats
from tactile_bayes.checks import check_arrays, check_kind, check_number, check_optional
from tactile_bayes.errors import ParameterError
from tactile_bayes.mechanics.phases import NONE
from tactile_bayes.mechanics.rods.profile import Profile

__all__ = [
    "MAX_FRICTION_ANGLE",
    "Contact",
    "Wrench",
    "contact_from_wrench",
    "largest_curvature",
    "tangential_arclength",
    "wrench_from_contact",
]

# Largest friction angle δ [rad]: the map of Phase B folds unless 2 E(m) > K(m) for m = (1 + sin δ)/2.
MAX_FRICTION_ANGLE = 0.7


_STEM = "give a length in rod lengths, from 0 for none"
_PROFILE = "give the profile of a rod, Rod(...).profile"

_FARTHEST = 3.0  # angle [rad] by which a rod on a stem may be turned from the bearing of its contact
# Largest number of steps to that angle, the error that is rounding, and the least that is none [rad].
_MOST_HALVINGS, _SETTLED, _MISSED = 100, 1e-15, 1e-9


class Wrench(NamedTuple):
    """Base wrench of a contact and its derivatives; NaN where the rod cannot make it (`phase` is then `NONE`).

    Examples
    --------
    >>> wrench_from_contact(0.2, 0.6, 0.1).holding_moment.round(3).item()
    2.183
    """

    drive_angle: Floats  # slope φ0 of the rod at the pivot [rad]
    holding_moment: Floats  # moment m0 that the drive holds [EI/L]
    force_x: Floats
    force_y: Floats  # support reaction (−f sin β, f cos β) [EI/L²]
    contact_arclength: Floats  # arc length s1 from the pivot to the contact [L]
    tip_angle: Floats  # slope φ(s1) of the rod at the contact [rad]
    phase: NDArray[np.int8]  # `NONE`, `TIP` or `TANGENTIAL`
    # ∂φ0/∂α at a fixed contact point; by rotation of the whole, ∂φ0/∂(polar angle of the point) = 1 − by_slope.
    by_slope: Floats
    # ∂φ0/∂(r²) at a fixed direction of the contact and α, r its distance from the pivot; 0 in tangential contact of a
    # straight rod.
    by_distance: Floats
    # Arc length that tangential contact at this point would take [L]; above 1 the rod is too short for it.
    tangential_arclength: Floats


class Contact(NamedTuple):
    """Contact that follows from a base wrench; NaN where there is none.

    Examples
    --------
    >>> wrench = wrench_from_contact(0.2, 0.6, 0.1)
    >>> found = contact_from_wrench(wrench.drive_angle, wrench.holding_moment, wrench.force_x, wrench.force_y)
    >>> found.contact_x.round(9).item(), found.contact_y.round(9).item()
    (0.2, 0.6)
    """

    contact_x: Floats
    contact_y: Floats  # contact point relative to the pivot [L]
    slope_angle: Floats  # slope angle α of the contour [rad]
    contact_arclength: Floats  # arc length s1 from the pivot to the contact [L]; above 1 it lies beyond the tip
    tip_angle: Floats  # slope φ(s1) of the rod at the contact [rad]
    # Parameter m of the elliptic integrals; the curvature of the whole elastica has a zero if and only if m < 1.
    modulus: Floats


def _refuse_friction(friction_angle: Floats, least: float = 0.0) -> None:
    bad = ~((friction_angle >= least) & (friction_angle <= MAX_FRICTION_ANGLE))
    if np.any(bad):
        found = float(friction_angle[bad].flat[0])
        raise ParameterError(
            f"the friction angle is {found:g} rad: give one between {least:g} and "
            f"{MAX_FRICTION_ANGLE} (coefficient {np.tan(MAX_FRICTION_ANGLE):.2f}); beyond, a rod would loop before it "
            "slides"
        )


def tangential_arclength(
    contact_x: ArrayLike,
    contact_y: ArrayLike,
    slope_angle: ArrayLike,
    friction_angle: ArrayLike = 0.0,
    *,
    rest_curvature: ArrayLike = 0.0,
) -> Floats:
    """Arc length [L] that tangential contact of a forward sweep takes; above 1 only the tip can touch there.

    Parameters
    ----------
    contact_x, contact_y, slope_angle, friction_angle, rest_curvature : array_like
        As in `wrench_from_contact`.

    Returns
    -------
    array
        Of the broadcast shape; NaN where the contour faces away from the pivot, and where the rod is curved away from
        the contour so much that it lies along it at this point without any force, or never.

    Raises
    ------
    ParameterError
        If a friction angle is not between 0 and 0.7, or an argument is not numbers of a shape that broadcasts.

    Examples
    --------
    >>> tangential_arclength(0.2, 0.6, [0.1, 0.2]).round(6)
    array([1.053211, 0.976104])
    """
    x, y, alpha, delta, bent = check_arrays(
        contact_x=contact_x,
        contact_y=contact_y,
        slope_angle=slope_angle,
        friction_angle=friction_angle,
        rest_curvature=rest_curvature,
    )
    with np.errstate(over="ignore", invalid="ignore"):
        return _states((x, y, alpha, delta, bent, NONE))[1][8]


def wrench_from_contact(
    contact_x: ArrayLike,
    contact_y: ArrayLike,
    slope_angle: ArrayLike,
    friction_angle: ArrayLike = 0.0,
    *,
    side: ArrayLike = 1,
    phase: ArrayLike | None = None,
    rest_curvature: ArrayLike = 0.0,
    profile: Profile | None = None,
    stem: float = 0.0,
) -> Wrench:
    """Base wrench of a rod that touches a contour at a given point: Step 1 for one state.

    Equations 19 and 20 of Merker et al. 2018, doi 10.1155/2018/1613945, solved in closed form for a straight rod.

    A rod with rest curvature may have two equilibria with the same contact: one in which the load bends it as it bends
    a straight rod, and one in which a small load has only straightened it. The first is returned: it is continued from
    that of the straight uniform rod, or in tangential contact from the arc that lies along the contour without force.

    Parameters
    ----------
    contact_x, contact_y : array_like
        Contact point relative to the pivot, in rod lengths.
    slope_angle : array_like
        Slope angle α of the contour there [rad].
    friction_angle : array_like
        Friction angle δ = arctan μ of a rod that slides with Coulomb's coefficient μ, at most 0.7 [rad].
    side : array_like of +1 or −1
        +1 for a contact of a forward sweep, −1 for a contact of a backward sweep, its mirror image.
    phase : array_like of `TIP` or `TANGENTIAL`, optional
        The phase, if it is known; then only this one is computed, without a check.
    rest_curvature : array_like
        Curvature of the unloaded rod in the laboratory frame, a circular arc; > 0 counter-clockwise [1/L].
    profile : Profile, optional
        Rod whose rest curvature or rigidity varies along it, in place of an arc.
    stem : float
        Rigid piece between pivot and rod, in the direction of its base [L]: the drive angle is found by Newton's method
        within a bracket, from states of the rod on the stem's end.

    Returns
    -------
    Wrench
        Arrays of the broadcast shape. The phase is `TANGENTIAL` where an arc length s1 ≤ 1 suffices, else `TIP` where
        the point is within reach. It is `NONE`, and the rest is NaN, beyond reach, where the contour faces away, and
        where the continuation ends because there is no equilibrium or the force is not positive.

    Raises
    ------
    ParameterError
        If a friction angle is not between 0 and 0.7, or an argument is not numbers of a shape that broadcasts.

    Examples
    --------
    >>> w = wrench_from_contact(0.2, 0.6, [0.1, 0.2])
    >>> w.phase, w.drive_angle.round(6)
    (array([1, 2], dtype=int8), array([2.901776, 2.923367]))
    """
    x, y, alpha, delta, sides, curvature, known = check_arrays(
        contact_x=contact_x,
        contact_y=contact_y,
        slope_angle=slope_angle,
        friction_angle=friction_angle,
        side=side,
        rest_curvature=rest_curvature,
        phase=NONE if phase is None else phase,
    )
    check_optional("profile", profile, Profile, _PROFILE)
    stem = check_number("stem", stem, _STEM, least=0.0)
    sign = np.where(sides < 0.0, -1.0, 1.0)
    mirrored = sign < 0.0
    bent = sign * (curvature if profile is None else profile.sign)
    contacts = sign * x, y, sign * alpha, delta, bent, known
    with np.errstate(over="ignore", invalid="ignore"):  # of contacts out of reach
        found, columns = _states(contacts, profile) if stem == 0.0 else _states_on_stem(stem, contacts, profile)
    drive_angle, moment, force_x, force_y, arclength, tip_angle, by_slope, by_distance, tangential = columns
    return Wrench(
        drive_angle=np.where(mirrored, np.pi - drive_angle, drive_angle),
        holding_moment=sign * moment,
        force_x=sign * force_x,
        force_y=force_y,
        contact_arclength=arclength,
        tip_angle=np.where(mirrored, np.pi - tip_angle, tip_angle),
        phase=found,
        by_slope=by_slope,
        by_distance=sign * by_distance,
        tangential_arclength=tangential,
    )


def lever_of_stem(stem: float, drive_angle: Floats, force_x: Floats, force_y: Floats) -> Floats:
    """Moment of a contact force about the pivot less that where the rod begins, from the support reaction."""
    return np.asarray(stem * (force_y * np.cos(drive_angle) - force_x * np.sin(drive_angle)))


def _states_on_stem(
    stem: float, contacts: tuple[ArrayLike, ...], profile: Profile | None
) -> tuple[NDArray[np.int8], Floats]:
    """`_states` of rods that begin at the end of a stem. A drive angle a puts the beginning of the rod somewhere, from
    where the contact takes the drive angle φ0(a). Sought is the a with φ0(a) = a: the farther the stem is turned, the
    less the rod."""
    given = np.broadcast_arrays(*contacts)
    shape = given[0].shape
    x, y, *others = (np.asarray(column.ravel()) for column in given)
    bearing = np.arctan2(y, x)
    low, high, angle = bearing - _FARTHEST, bearing + _FARTHEST, bearing
    for _ in range(_MOST_HALVINGS):
        from_x, from_y = x - stem * np.cos(angle), y - stem * np.sin(angle)
        found, columns = _states((from_x, from_y, *others), profile)
        # Out of reach the stem is turned too far, to either side.
        off = np.where(np.isfinite(columns[0]), columns[0] - angle, np.where(angle < bearing, 1.0, -1.0))
        if not np.any((np.abs(off) > _SETTLED) & (high - low > _SETTLED)):
            break
        low, high = np.where(off >= 0.0, angle, low), np.where(off >= 0.0, high, angle)
        with np.errstate(invalid="ignore", divide="ignore"):
            new = angle + off / (1.0 - _turned_by_stem(stem, angle, from_x, from_y, columns))
        angle = np.where((new > low) & (new < high), new, 0.5 * (low + high))
    missed = ~(np.abs(columns[0] - angle) <= _MISSED)
    columns[:8, missed], found[missed] = np.nan, NONE
    fx, fy, by_slope, by_distance = columns[2], columns[3], columns[6], columns[7]
    square, own = x * x + y * y, from_x * from_x + from_y * from_y
    left = 1.0 - _turned_by_stem(stem, angle, from_x, from_y, columns)
    turned = (from_x * y - from_y * x) / (2.0 * square * own)
    columns[7] = (by_distance * (from_x * x + from_y * y) / square + (1.0 - by_slope) * turned) / left
    columns[6] = by_slope / left
    columns[1] += lever_of_stem(stem, columns[0], fx, fy)
    return found.reshape(shape), columns.reshape(9, *shape)


def _turned_by_stem(stem: float, angle: Floats, x: Floats, y: Floats, columns: Floats) -> Floats:
    """Derivative of the rod's drive angle by that of the stem, for a contact at (x, y) from the rod's beginning."""
    cos, sin = np.cos(angle), np.sin(angle)
    nearer, turned = 2.0 * stem * (x * sin - y * cos), -stem * (x * cos + y * sin) / (x * x + y * y)
    return np.asarray(columns[7] * nearer + (1.0 - columns[6]) * turned)


def _states(contacts: tuple[ArrayLike, ...], profile: Profile | None = None) -> tuple[NDArray[np.int8], Floats]:
    """Phases, and columns of states, shape (9, ...), of contacts mirrored to forward ones. `bent` is the rest curvature
    [1/L] of arcs, mirrored with them; of rods with a profile, the sign that mirrors it."""
    from tactile_bayes.mechanics.contacts.tables import tables, workspace
    from tactile_bayes.mechanics.contacts.wrenches import continued_wrenches, wrenches
    from tactile_bayes.mechanics.poses.beam import varied_of  # numba takes a second to load

    _refuse_friction(np.asarray(contacts[3], dtype=float), 0.0 if profile is None else -MAX_FRICTION_ANGLE)
    given = np.broadcast_arrays(*contacts)
    shape = given[0].shape
    columns = np.stack([column.ravel() for column in given[:5]], axis=-1).astype(float)
    found, out = given[5].astype(np.int8).ravel(), np.empty((columns.shape[0], 9))
    known = tables(), workspace()
    if profile is None:
        curved = columns[:, -1] != 0.0
        for rows, write in ((~curved, wrenches), (curved, partial(continued_wrenches, None, None))):
            if rows.any():  # what is never called is never compiled
                which = slice(None) if rows.all() else rows
                phases, states = found[which], out[which]
                write(columns[which], *known, phases, states)
                found[which], out[which] = phases, states
    else:
        room = profile._replace(curvature=np.empty_like(profile.curvature), rigidity=np.empty_like(profile.rigidity))
        continued_wrenches(varied_of(profile), room, columns, *known, found, out)
    return found.reshape(shape), np.ascontiguousarray(out.T).reshape(9, *shape)


def contact_from_wrench(
    drive_angle: ArrayLike,
    holding_moment: ArrayLike,
    force_x: ArrayLike,
    force_y: ArrayLike,
    friction_angle: ArrayLike = 0.0,
    *,
    side: ArrayLike | None = None,
    rest_curvature: ArrayLike = 0.0,
    profile: Profile | None = None,
    stem: float = 0.0,
) -> Contact:
    """Contact that follows from a base wrench: Step 2 for one state, without integration or root search.

    Equation 26 of Merker et al. 2018, doi 10.1155/2018/1613945, gives the direction of the force. Slope and curvature
    at the pivot then determine the elastica, and the contact is its first point of zero curvature (equation 27), or of
    the rest curvature. A rod that is not straight or not uniform may have the rest curvature at two points: the contact
    is the second one if the rod ends there, or lies along the contour, and does neither at the first.

    Parameters
    ----------
    drive_angle, holding_moment, force_x, force_y : array_like
        Slope of the rod at the pivot [rad] and the wrench there (moment EI/L, force EI/L²).
    friction_angle : array_like
        Friction angle δ = arctan μ, at most 0.7 [rad].
    side : array_like of +1 or −1, optional
        +1 for contacts of a forward sweep, −1 for those of a backward one; by default the sign of the holding moment,
        which the force can only have reversed on a rod with a large rest curvature.
    rest_curvature : array_like
        Curvature of the unloaded rod in the laboratory frame, a circular arc; > 0 counter-clockwise [1/L].
    profile : Profile, optional
        Rod whose rest curvature or rigidity varies along it, in place of an arc; it is integrated up to its contact.
    stem : float
        Rigid piece between pivot and rod, in the direction of its base [L].

    Returns
    -------
    Contact
        Arrays of the broadcast shape; NaN where there is no force or no point without bending moment (in a straight
        rod, `modulus` ≥ 1).

    Raises
    ------
    ParameterError
        If a friction angle is not between 0 and 0.7, or an argument is not numbers of a shape that broadcasts.

    Examples
    --------
    >>> w = wrench_from_contact(0.2, 0.6, 0.1)
    >>> c = contact_from_wrench(w.drive_angle, w.holding_moment, w.force_x, w.force_y)
    >>> c.contact_x.round(12), c.contact_y.round(12), c.slope_angle.round(12)
    (np.float64(0.2), np.float64(0.6), np.float64(0.1))
    """
    from tactile_bayes.mechanics.contacts.states import write_contacts
    from tactile_bayes.mechanics.poses.beam import varied_of  # numba takes a second to load

    angle, moment, fx, fy, delta, curvature, sides = check_arrays(
        drive_angle=drive_angle,
        holding_moment=holding_moment,
        force_x=force_x,
        force_y=force_y,
        friction_angle=friction_angle,
        rest_curvature=rest_curvature,
        side=holding_moment if side is None else side,
    )
    check_optional("profile", profile, Profile, _PROFILE)
    stem = check_number("stem", stem, _STEM, least=0.0)
    _refuse_friction(delta, 0.0 if profile is None else -MAX_FRICTION_ANGLE)
    sign = np.where(sides < 0.0, -1.0, 1.0)
    mirrored = sign < 0.0
    phi0 = np.where(mirrored, np.pi - angle, angle)
    of_rods = sign * curvature if profile is None else sign
    given = np.broadcast_arrays(phi0, sign * moment, sign * fx, fy, delta, of_rods)
    *wrench, of_rods = (column.ravel() for column in given)
    found = np.empty((wrench[0].size, 6))
    with np.errstate(over="ignore", invalid="ignore"):
        columns = np.ascontiguousarray(np.stack(wrench, axis=-1).astype(float))
        write_contacts(columns, of_rods.astype(float), varied_of(profile), stem, found, np.empty((0, 2, 2)))
    x, y, slope_angle, arclength, tip_angle, modulus = np.ascontiguousarray(found.T).reshape(6, *given[0].shape)
    tip_angle = np.where(mirrored, np.pi - tip_angle, tip_angle)
    return Contact(sign * x, y, sign * slope_angle, arclength, tip_angle, modulus)


def largest_curvature(wrench: Wrench, rest_curvature: ArrayLike = 0.0) -> Floats:
    """Largest change of the rod's curvature from its rest curvature, between pivot and contact [1/L].

    It is the largest bending moment in EI/L. Along the rod κ²/2 − f sin ψ is constant, so that κ is least where the rod
    lies across the force, if it does so, else at the pivot, where the moment is the holding moment.

    Parameters
    ----------
    wrench : Wrench
        Base wrenches, of any shape.
    rest_curvature : array_like
        As in `wrench_from_contact`.

    Returns
    -------
    array
        Of the shape of the wrenches.

    Examples
    --------
    >>> bent = wrench_from_contact(0.2, 0.6, [0.1, 0.8])
    >>> bent.holding_moment.round(6), largest_curvature(bent).round(6)
    (array([2.18262 , 3.400363]), array([4.000574, 3.400363]))
    """
    check_kind("wrench", wrench, Wrench, "give what wrench_from_contact returned")
    *_, curvature = check_arrays(wrench=wrench.drive_angle, rest_curvature=rest_curvature)
    cos, sin = np.cos(wrench.drive_angle), np.sin(wrench.drive_angle)
    along, across = wrench.force_x * cos + wrench.force_y * sin, wrench.force_y * cos - wrench.force_x * sin
    sign, force = np.where(wrench.holding_moment < 0.0, -1.0, 1.0), np.hypot(wrench.force_x, wrench.force_y)
    moment, rest = sign * wrench.holding_moment, sign * curvature
    at_pivot = rest - moment
    # The rod lies across the force in its sense or, if its curvature keeps the other sign, in the opposite one.
    with np.errstate(invalid="ignore", over="ignore"):
        squared = at_pivot**2 - 2.0 * (force + along)
        inflated = rest + np.sqrt(at_pivot**2 + 2.0 * (force - along))
        inflated = np.where((at_pivot > 0.0) & (squared > 0.0), rest - np.sqrt(squared), inflated)
    return np.where(sign * across < 0.0, np.maximum(moment, inflated), moment)
