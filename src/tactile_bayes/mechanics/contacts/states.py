"""Step 2 for single states: base wrench → contact, of any rod.

Slope and moment at the pivot determine the rod, and its moment vanishes at the contact. It may vanish once before, if
the rod is bent both ways. Straight rods have a closed form (`contact`), and so have arcs (`arc_states`); others are
integrated, and continued beyond their tip with its rest curvature and rigidity. Quantities are dimensionless and
relative to the pivot; contacts are forward ones.
"""

from __future__ import annotations

import math

from tactile_bayes.arrays import Floats
from tactile_bayes.mechanics.compiler import cached, compiled
from tactile_bayes.mechanics.contacts.arc_states import NO_CONTACT, FoundContact, arc_zeros
from tactile_bayes.mechanics.poses.arc import SHORT_COSINE, arc_at
from tactile_bayes.mechanics.poses.beam import Beam, Varied, by_kind, end_of_arc, lever_of_stem, mirrored_by
from tactile_bayes.mechanics.poses.pose import pose
from tactile_bayes.mechanics.poses.profile_shape import shape_along
from tactile_bayes.mechanics.poses.taylor import (
    EXACT,
    FARTHEST,
    FORWARD,
    State,
    advance,
    arclength_to,
    begin,
    moved,
    rise,
)
from tactile_bayes.mechanics.rods.profile import Profile

_EXACT = 1e-6  # arc length [L] and angle [rad] that count as zero in Step 2 without errors


@compiled
def contact(phi0: float, moment: float, fx: float, fy: float, delta: float) -> FoundContact:
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
        return FoundContact(math.nan, math.nan, math.nan, math.nan, math.nan, modulus)
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
    return FoundContact(x, y, beta - delta, arc.length / root, tip_angle, modulus)


@compiled
def _zeros_along(
    profile: Profile, phi0: float, moment: float, fx: float, fy: float, delta: float, work: Floats
) -> tuple[FoundContact, FoundContact]:
    """First two points without moment, for drive angle, holding moment, support reaction and friction angle. The moment
    rises through zero at one of them and falls at the other, which are returned in this order. There is no second one
    if the first lies beyond the tip."""
    force, beta = math.sqrt(fx * fx + fy * fy), math.atan2(-fx, fy)
    state, rising, falling = State(phi0 - beta, -moment, 0.0, 0.0), NO_CONTACT, NO_CONTACT
    if not (0.0 < force < math.inf and math.isfinite(moment)):
        return rising, falling
    # A force without moment passes through the pivot: the rod must bend away from it before it returns.
    sense = 1.0 if moment > 0.0 or (moment == 0.0 and math.cos(state.psi) < 0.0) else -1.0
    march = begin(profile, 0.0, FORWARD, state)
    while march.at < FARTHEST:
        before = march
        step, march, _ = advance(profile, before, FORWARD, FARTHEST, force, work, EXACT, None)
        x = rise(before.state, force, step, sense, 0.0, work)
        if x >= 0.0:
            end, at = moved(before.state, force, step, x, work), before.at + arclength_to(step, x)
            cos, sin = math.cos(beta), math.sin(beta)
            x, y = end.u * cos - end.v * sin, end.u * sin + end.v * cos
            if sense > 0.0:
                rising = FoundContact(x, y, beta - delta, at, beta + end.psi, math.nan)
            else:
                falling = FoundContact(x, y, beta - delta, at, beta + end.psi, math.nan)
            if at > 1.0 or (rising.arclength > 0.0 and falling.arclength > 0.0):
                break
            march, sense = begin(profile, at, FORWARD, State(end.psi, 0.0, end.u, end.v)), -sense
    return rising, falling


@by_kind
def contact_pair(
    varied: Varied | None, beam: Beam, phi0: float, moment: float, fx: float, fy: float, delta: float
) -> tuple[FoundContact, FoundContact]:
    """Points of any rod that may be its contact: the moment rises through zero at the first, and falls at the second. A
    contact along the rod is of the first kind, and so is that of a tip, unless it is turned beyond the normal of the
    contour. Straight, uniform rods are past snap-off when they are bent both ways: they have the first kind only."""
    h = beam.stem
    if h != 0.0:
        moment -= lever_of_stem(h, phi0, fx, fy)
    if varied is not None:
        rising, falling = _zeros_along(varied.profile, phi0, moment, fx, fy, delta, varied.work)
    elif beam.curvature == 0.0:
        rising, falling = contact(phi0, moment, fx, fy, delta), NO_CONTACT
    else:
        rising, falling = arc_zeros(phi0, moment, fx, fy, delta, beam.curvature)
    return (rising, falling) if h == 0.0 else (_on_stem(h, phi0, rising), _on_stem(h, phi0, falling))


@compiled
def _on_stem(stem: float, phi0: float, found: FoundContact) -> FoundContact:
    x, y, slope_angle, arclength, tip_angle, modulus = found
    return FoundContact(
        x + stem * math.cos(phi0), y + stem * math.sin(phi0), slope_angle, arclength, tip_angle, modulus
    )


@compiled
def contact_of(beam: Beam, phi0: float, moment: float, fx: float, fy: float, delta: float) -> FoundContact:
    """Contact of any rod that follows from a base wrench without errors."""
    return _exact_one(beam, contact_pair(beam, phi0, moment, fx, fy, delta))


@compiled
def _exact_one(beam: Beam, pair: tuple[FoundContact, FoundContact]) -> FoundContact:
    """Point of a pair at which the moment rises through zero, unless the rod ends at the other one."""
    rising, falling = pair
    is_contact = _is_exact(rising.arclength, rising.tip_angle - rising.slope_angle)
    if not is_contact and _is_exact(falling.arclength, math.pi):
        return falling
    is_first = beam.varied is None or not falling.arclength < rising.arclength
    return rising if is_contact or is_first else NO_CONTACT


@compiled
def _is_exact(arclength: float, turn: float) -> bool:
    """True if a rod ends at a point, or lies along the contour there."""
    turn -= 2.0 * math.pi * math.floor(turn / (2.0 * math.pi) + 0.5)
    return abs(arclength - 1.0) < _EXACT or (arclength < 1.0 and abs(turn) < _EXACT)


@cached
def write_contacts(
    columns: Floats, curvature: Floats, varied: Varied | None, stem: float, out: Floats, pairs: Floats
) -> None:
    """Write the contacts that follow from base wrenches, mirrored to forward ones, or the points that may be. Columns
    are drive angle, holding moment, support reaction and friction angle, shape (n, 5). `out` takes the fields of
    `Contact`, shape (n, 6), and `pairs` arc length and ψ1 of both points of `contact_pair`, shape (n, 2, 2); either may
    have no rows."""
    for i in range(columns.shape[0]):
        beam = mirrored_by(curvature[i], varied, stem)
        pair = contact_pair(beam, columns[i, 0], columns[i, 1], columns[i, 2], columns[i, 3], columns[i, 4])
        if out.shape[0]:
            found = _exact_one(beam, pair)
            for k in range(6):
                out[i, k] = found[k]
        if pairs.shape[0]:
            for k in range(2):
                pairs[i, k, 0] = pair[k].arclength
                pairs[i, k, 1] = pair[k].tip_angle - pair[k].slope_angle - columns[i, 4]


@cached
def write_shapes(
    wrenches: Floats, curvature: Floats, varied: Varied | None, arclengths: Floats, x: Floats, y: Floats
) -> None:
    """Write centrelines from base wrenches (drive angle, holding moment, support reaction), shape (n, points). Without
    a force they have their rest shape; they are NaN where no contact makes a wrench."""
    for i in range(wrenches.shape[0]):
        beam = mirrored_by(curvature[i], varied, 0.0)
        phi0, moment, fx, fy = wrenches[i, 0], wrenches[i, 1], wrenches[i, 2], wrenches[i, 3]
        end, psi1, modulus = 0.0, 0.0, math.nan
        if fx * fx + fy * fy > 0.0 and math.isfinite(moment):
            found = contact_of(beam, phi0, moment, fx, fy, 0.0)
            end, psi1, modulus = found.arclength, found.tip_angle - found.slope_angle, found.modulus
        else:
            moment, fx, fy = 0.0, 0.0, 0.0
        # A force at the pivot itself, without moment, leaves a rod in its rest shape: it has a modulus, but no arc.
        if math.isnan(end) and modulus < 1.0:
            end, moment, fx, fy = 0.0, 0.0, 0.0, 0.0
        if end == 0.0:
            psi1 = phi0
        if math.isnan(end):
            x[i], y[i] = math.nan, math.nan
        else:
            _write_shape(beam, phi0, moment, fx, fy, psi1, end, arclengths, x[i], y[i])


@by_kind
def _write_shape(
    varied: Varied | None,
    beam: Beam,
    phi0: float,
    moment: float,
    fx: float,
    fy: float,
    psi1: float,
    contact: float,
    arclengths: Floats,
    x: Floats,
    y: Floats,
) -> None:
    """Write a centreline that is loaded up to a contact: a point of an arc is the pivot of a shorter rod."""
    if varied is not None:
        shape_along(varied.profile, phi0, moment, fx, fy, contact, arclengths, x, y, varied.work)
        return
    force, beta = math.hypot(fx, fy), math.atan2(-fx, fy)
    cos, sin = math.cos(beta), math.sin(beta)
    whole = pose(psi1, contact, force, beam.curvature)
    for k in range(arclengths.size):
        u, v, beyond = whole.u, whole.v, arclengths[k] - contact
        if beyond <= 0.0:
            rest = pose(psi1, -beyond, force, beam.curvature)
            u, v = u - rest.u, v - rest.v
        else:
            along, across = end_of_arc(beam.curvature, beyond)
            u += along * math.cos(psi1) - across * math.sin(psi1)
            v += along * math.sin(psi1) + across * math.cos(psi1)
        x[k], y[k] = u * cos - v * sin, u * sin + v * cos
