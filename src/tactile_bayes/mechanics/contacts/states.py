"""One state of a rod in contact, exactly or from tables: contact → base wrench, and back.

Quantities are dimensionless (length L, moment EI/L, force EI/L²) and relative to the pivot; contacts are forward ones.
A contact force of magnitude f acts on the rod along (sin β, −cos β), with β = α + δ for slope angle α and friction
angle δ. With ψ = φ − β the rod obeys κ' = f cos ψ and κ(s1) = 0 (equations 19, 20 and 27 of Merker et al. 2018, doi
10.1155/2018/1613945): a piece of Euler's elastica that begins at a point of zero curvature, the contact (`arc`).
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from tactile_bayes.arrays import Floats
from tactile_bayes.mechanics.compiler import cached, compiled
from tactile_bayes.mechanics.contacts.arc_states import NO_CONTACT, Found, arc_zeros
from tactile_bayes.mechanics.contacts.continuation import NOWHERE, Start, State, continued_state, unloaded_arc
from tactile_bayes.mechanics.contacts.profile_contact import is_exact, zeros_along
from tactile_bayes.mechanics.contacts.tables import (
    MOST_FRICTION,
    Tables,
    Workspace,
    in_polar,
    prepare,
    series,
)
from tactile_bayes.mechanics.phases import NONE, TANGENTIAL, TIP
from tactile_bayes.mechanics.poses.arc import (
    SHORT_COSINE,
    Arc,
    arc_and_slopes,
    arc_at,
    chord_deficit,
    chord_deficit_rate,
    chord_direction_rate,
)
from tactile_bayes.mechanics.poses.beam import Beam, Varied, lever_of_stem, mirrored_by, with_sign
from tactile_bayes.mechanics.poses.chord import tangential_arc, tip_arc
from tactile_bayes.mechanics.poses.profile_shape import shape_along
from tactile_bayes.mechanics.rods.profile import Profile

__all__ = [
    "contact",
    "contact_of",
    "contact_pair",
    "continued_wrenches",
    "profile_shapes",
    "wrenches",
    "write_contact_pairs",
    "write_contacts",
]

_BEYOND = 1e-12
"""Angle by which rounding may turn a chord beyond the line of force through the pivot [rad]."""

_NO_ARC = Arc(math.nan, math.nan, math.nan, math.nan)


@compiled
def _tangential(x: float, y: float, alpha: float, delta: float, workspace: Workspace) -> tuple[float, Arc, Arc]:
    """Arc length of tangential contact, its arc, and the derivatives of the arc by the amplitude."""
    sin, cos = math.sin(alpha), math.cos(alpha)
    along, across = x * cos + y * sin, y * cos - x * sin
    angle, largest = math.atan2(across, along), 0.5 * math.pi + delta
    if not (across >= 0.0 and angle <= largest + _BEYOND and abs(alpha) <= 0.5 * math.pi):
        return math.nan, _NO_ARC, _NO_ARC
    angle = min(angle, largest)
    m = 0.5 * (1.0 + math.sin(delta))
    if delta <= MOST_FRICTION:
        guess = math.sqrt(max(angle * series(workspace, angle / largest), 0.0))
    else:
        guess = min(math.sqrt(3.0 * angle / math.sqrt(m * (1.0 - m))), math.pi)
    chi, arc, by_chi = tangential_arc(angle, m, guess)
    length = math.sqrt(x * x + y * y)
    if chi > 0.0:
        length *= arc.length / math.hypot(arc.length - arc.shortfall, arc.offset)
    return length, arc, by_chi


@compiled
def _tangential_state(x: float, y: float, alpha: float, delta: float, length: float, arc: Arc, by_chi: Arc) -> State:
    """State in tangential contact (Phase B)."""
    force = (arc.length / length) ** 2
    turning = by_chi.turn / chord_direction_rate(arc, by_chi) if arc.turn > 0.0 else 3.0
    beta = alpha + delta
    sin, cos = math.sin(beta), math.cos(beta)
    moment = force * (x * cos + y * sin)
    return State(alpha + arc.turn, moment, -force * sin, force * cos, length, alpha, 1.0 - turning, 0.0)


@compiled
def _tip_state(x: float, y: float, alpha: float, delta: float, known: Tables, workspace: Workspace) -> State:
    """State in tip contact (Phase A): distance and direction of the tip give amplitude and direction at the contact."""
    larger, smaller = max(abs(x), abs(y)), min(abs(x), abs(y))
    deficit2 = (1.0 - larger) * (1.0 + larger) - smaller * smaller
    if not deficit2 >= 0.0:
        return NOWHERE
    beta = alpha + delta
    sin, cos = math.sin(beta), math.cos(beta)
    u, v = x * cos + y * sin, y * cos - x * sin
    deficit, chord_angle = math.sqrt(deficit2), max(math.atan2(u, v), 0.0)
    angle, share, by_angle, by_share = in_polar(known, deficit, chord_angle, workspace)
    chi, epsilon1, arc, by_chi, by_psi1 = tip_arc(
        deficit, chord_angle, math.sqrt(max(angle * by_angle, 0.0)), share * by_share
    )
    by_slope, by_distance = math.nan, -math.inf
    if chi > 0.0:
        _, by_chi, by_psi1 = arc_and_slopes(chi, math.sin(0.5 * epsilon1) ** 2)
        angle_x, angle_1, value = (
            chord_direction_rate(arc, by_chi),
            1.0 + chord_direction_rate(arc, by_psi1),
            chord_deficit(arc),
        )
        value_x, value_1 = chord_deficit_rate(arc, value, by_chi), chord_deficit_rate(arc, value, by_psi1)
        det = value_x * angle_1 - value_1 * angle_x
        by_slope = 1.0 - (value_x * (1.0 + by_psi1.turn) - value_1 * by_chi.turn) / det
        by_distance = -0.5 * (angle_1 * by_chi.turn - angle_x * (1.0 + by_psi1.turn)) / det / value
    force, tip_angle = arc.length * arc.length, beta + 0.5 * math.pi - epsilon1
    return State(tip_angle + arc.turn, force * u, -force * sin, force * cos, 1.0, tip_angle, by_slope, by_distance)


@cached
def wrenches(columns: Floats, known: Tables, workspace: Workspace, phase: NDArray[np.int8], out: Floats) -> None:
    """Write states, and arc lengths of tangential contact, of contacts mirrored to forward ones.

    Parameters
    ----------
    columns : ndarray, shape (n, 4)
        Contact point, slope angle, friction angle.
    phase : ndarray, shape (n,)
        Known phases; a phase that is `NONE` is determined and stored.
    out : ndarray, shape (n, 9)
        Fields of `State`, and the arc length of tangential contact.
    """
    prepared = math.nan
    for i in range(columns.shape[0]):
        x, y, alpha, delta = columns[i, 0], columns[i, 1], columns[i, 2], columns[i, 3]
        if delta != prepared:
            prepare(known, delta, workspace)
            prepared = delta
        out[i] = math.nan
        if phase[i] != TIP:
            length, arc, by_chi = _tangential(x, y, alpha, delta, workspace)
            out[i, 8] = length
            if phase[i] == TANGENTIAL or length <= 1.0:
                _store(_tangential_state(x, y, alpha, delta, length, arc, by_chi), out[i])
                phase[i] = TANGENTIAL
        if phase[i] == TIP or (phase[i] == NONE and out[i, 8] > 1.0):
            ending = _tip_state(x, y, alpha, delta, known, workspace)
            _store(ending, out[i])
            phase[i] = NONE if math.isnan(ending.arclength) else TIP


@cached
def continued_wrenches(
    varied: Varied | None,
    room: Profile | None,
    columns: Floats,
    known: Tables,
    workspace: Workspace,
    phase: NDArray[np.int8],
    out: Floats,
) -> None:
    """Write states of arcs, or of a rod with a profile, as `wrenches` does.

    Parameters
    ----------
    varied, room : Varied and Profile, optional
        The rod, and a profile of the same shape to be written to, unless the rods are arcs.
    columns : ndarray, shape (n, 5)
        The last column is the rest curvature of an arc; with a profile −1 for the mirrored rod, else 1.
    """
    for i in range(columns.shape[0]):
        x, y, alpha, delta = columns[i, 0], columns[i, 1], columns[i, 2], columns[i, 3]
        beam = mirrored_by(columns[i, 4], varied, 0.0)
        sin, cos = math.sin(alpha + delta), math.cos(alpha + delta)
        u, v = x * cos + y * sin, y * cos - x * sin
        out[i] = math.nan
        if phase[i] != TIP:
            lying = continued_state(x, y, alpha, delta, beam, False, unloaded_arc(u, v, delta), room)
            out[i, 8] = lying.arclength
            if phase[i] == TANGENTIAL or lying.arclength <= 1.0:
                _store(lying, out[i])
                phase[i] = TANGENTIAL
                continue
        straight = _tip_state(x, y, alpha, delta, known, workspace)
        psi1 = straight.tip_angle - alpha - delta
        start = Start(0.0, psi1, math.hypot(straight.force_x, straight.force_y))
        ending = continued_state(x, y, alpha, delta, beam, True, start, room)
        if phase[i] == TIP or ending.tip_angle >= alpha:
            _store(ending, out[i])
        phase[i] = NONE if math.isnan(out[i, 4]) else TIP


@compiled
def _store(state: State, out: Floats) -> None:
    for k in range(8):
        out[k] = state[k]


@compiled
def contact(phi0: float, moment: float, fx: float, fy: float, delta: float) -> Found:
    """Contact that follows from a base wrench, without integration or root search; see `contact_from_wrench`."""
    force, modulus = math.sqrt(fx * fx + fy * fy), math.nan
    root = math.sqrt(force)
    beta = math.atan2(-fx, fy)
    psi0 = phi0 - beta
    quarter = 0.25 * math.pi - 0.5 * (psi0 - 2.0 * math.pi * math.floor((psi0 + 0.5 * math.pi) / (2.0 * math.pi)))
    a, a_cos, b = math.sin(quarter), math.cos(quarter), 0.5 * moment / root
    complement = (a_cos - b) * (a_cos + b)
    if force > 0.0:
        modulus = a * a + b * b
    # A force without moment passes through the pivot of a straight rod: the contact may be anywhere.
    if not (complement > 0.0 and modulus > 0.0 and (b > 0.0 or (b == 0.0 and a < 0.0)) and force < math.inf):
        return Found(math.nan, math.nan, math.nan, math.nan, math.nan, modulus)
    # θ0 = atan2(a, b) and χ are related by tan χ = cot θ0 / √(1 − m).
    width = a_cos * math.sqrt(modulus)
    cos_chi = a * math.sqrt(complement) / width
    arc = arc_at(b / width, cos_chi, modulus)
    tip_angle = phi0 - arc.turn
    along, across = (arc.length - arc.shortfall) / root, arc.offset / root
    if cos_chi < SHORT_COSINE:
        # In a strongly bent rod m0 = f u keeps more digits; the other component lies along the force.
        u, v = moment / force, along * (1.0 - 2.0 * modulus) + across * 2.0 * math.sqrt(modulus * complement)
        x, y = (u * fy + v * fx) / force, (v * fy - u * fx) / force
    else:
        cos, sin = math.cos(tip_angle), math.sin(tip_angle)
        x, y = along * cos - across * sin, along * sin + across * cos
    return Found(x, y, beta - delta, arc.length / root, tip_angle, modulus)


@compiled
def contact_pair(beam: Beam, phi0: float, moment: float, fx: float, fy: float, delta: float) -> tuple[Found, Found]:
    """Points of any rod that may be its contact: the moment rises through zero at the first, and falls at the second.

    A contact along the rod is of the first kind, and so is that of a tip, unless it is turned beyond the normal of the
    contour. Straight, uniform rods are past snap-off when they are bent both ways: they have the first kind only.
    """
    h = beam.stem
    if h == 0.0:
        return _contact_pair(beam.varied, beam.curvature, phi0, moment, fx, fy, delta)
    moment -= lever_of_stem(h, phi0, fx, fy)
    rising, falling = _contact_pair(beam.varied, beam.curvature, phi0, moment, fx, fy, delta)
    return _on_stem(h, phi0, rising), _on_stem(h, phi0, falling)


@compiled
def _on_stem(stem: float, phi0: float, found: Found) -> Found:
    x, y, slope_angle, arclength, tip_angle, modulus = found
    return Found(x + stem * math.cos(phi0), y + stem * math.sin(phi0), slope_angle, arclength, tip_angle, modulus)


@compiled
def _contact_pair(
    varied: Varied | None, curvature: float, phi0: float, moment: float, fx: float, fy: float, delta: float
) -> tuple[Found, Found]:
    if varied is None:
        if curvature == 0.0:
            return contact(phi0, moment, fx, fy, delta), NO_CONTACT
        return arc_zeros(phi0, moment, fx, fy, delta, curvature)
    return zeros_along(varied.profile, phi0, moment, fx, fy, delta, varied.work)


@compiled
def contact_of(beam: Beam, phi0: float, moment: float, fx: float, fy: float, delta: float) -> Found:
    """Contact of any rod that follows from a base wrench without errors.

    It is the point at which the moment rises through zero, unless the rod ends at the other one.
    """
    rising, falling = contact_pair(beam, phi0, moment, fx, fy, delta)
    is_contact = is_exact(rising.arclength, rising.tip_angle - rising.slope_angle)
    if not is_contact and is_exact(falling.arclength, math.pi):
        return falling
    is_first = beam.varied is None or not falling.arclength < rising.arclength
    return rising if is_contact or is_first else NO_CONTACT


@cached
def write_contacts(columns: Floats, curvature: Floats, varied: Varied | None, stem: float, out: Floats) -> None:
    """Write the contacts that follow from base wrenches, mirrored to forward ones.

    Parameters
    ----------
    columns : ndarray, shape (n, 5)
        Drive angle, holding moment and support reaction, friction angle.
    curvature, varied, stem
        As in `Rods`.
    out : ndarray, shape (n, 6)
        As `Contact`.
    """
    for i in range(columns.shape[0]):
        beam = mirrored_by(curvature[i], varied, stem)
        found = contact_of(beam, columns[i, 0], columns[i, 1], columns[i, 2], columns[i, 3], columns[i, 4])
        for k in range(6):
            out[i, k] = found[k]


@cached
def write_contact_pairs(columns: Floats, curvature: Floats, varied: Varied | None, stem: float, out: Floats) -> None:
    """Write arc length and ψ1 of both points of `contact_pair`, shape (n, 2, 2); see `write_contacts`."""
    for i in range(columns.shape[0]):
        beam = mirrored_by(curvature[i], varied, stem)
        pair = contact_pair(beam, columns[i, 0], columns[i, 1], columns[i, 2], columns[i, 3], columns[i, 4])
        for k in range(2):
            out[i, k, 0], out[i, k, 1] = pair[k].arclength, pair[k].tip_angle - pair[k].slope_angle - columns[i, 4]


@cached
def profile_shapes(wrenches: Floats, varied: Varied, arclengths: Floats, x: Floats, y: Floats) -> None:
    """Write the centrelines of a rod with a profile, NaN where no contact makes a wrench, shape (n, points).

    Parameters
    ----------
    wrenches : ndarray, shape (n, 5)
        Drive angle, holding moment, support reaction, and −1 for the mirrored rod, else 1.
    """
    for i in range(wrenches.shape[0]):
        phi0, moment, fx, fy = wrenches[i, 0], wrenches[i, 1], wrenches[i, 2], wrenches[i, 3]
        profile, end = with_sign(varied, wrenches[i, 4]).profile, 0.0
        if fx * fx + fy * fy > 0.0 and math.isfinite(moment):
            end = contact_of(mirrored_by(wrenches[i, 4], varied, 0.0), phi0, moment, fx, fy, 0.0).arclength
        else:
            moment, fx, fy = 0.0, 0.0, 0.0
        shape_along(profile, phi0, moment, fx, fy, end, arclengths, x[i], y[i], varied.work)
        if math.isnan(end):
            for k in range(arclengths.size):
                x[i, k], y[i, k] = math.nan, math.nan
