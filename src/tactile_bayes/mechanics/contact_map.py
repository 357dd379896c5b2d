"""One contact from its coordinates, with derivatives: the closed form of `contact_coordinates`, compiled.

Along the direction at the contact the chord is (F − C, S)/√f (`arc`). At a fixed length of the arc √f s1 = F(χ | m) the
amplitude depends on ψ1: ∂/∂ψ1 at that length is ∂/∂ψ1 − F_ψ1/F_χ ∂/∂χ.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from tactile_bayes.arrays import Floats
from tactile_bayes.mechanics.arc import arc_and_slopes, arc_to
from tactile_bayes.mechanics.compiler import cached, compiled

__all__ = ["chords", "contact_state", "moved", "wrench_slopes", "write_contact_states"]

_EPSILON = 1e-16
"""Half the difference of two means, over the mean, below which they are equal."""


class Bend(NamedTuple):
    """Further quantities of a contact; NaN where there is none."""

    chi: float
    """Amplitude of the arc to the pivot."""
    length_by_psi1: float
    """Derivative by ψ1 of the length of the arc to that amplitude."""
    volume_tip: float
    volume_tangential: float
    """As in `ContactStates`."""


@compiled
def _amplitude(load: float, m: float, ratios: Floats) -> float:
    """Jacobi's am(load | m) by the arithmetic–geometric mean; NaN beyond twice the quarter period."""
    a, b, last = 1.0, math.sqrt(1.0 - m), 0
    ratios[0] = math.sqrt(m)
    while ratios[last] > _EPSILON and last + 1 < ratios.size:
        a, b, c = 0.5 * (a + b), math.sqrt(a * b), 0.5 * (a - b)
        last += 1
        ratios[last] = c / a
    # With twice K = π/(2 a) the line of force passes through the pivot.
    if not load <= math.pi / a:
        return math.nan
    chi = math.ldexp(a * load, last)
    while last > 0:
        chi = 0.5 * (chi + math.asin(ratios[last] * math.sin(chi)))
        last -= 1
    return chi


@compiled
def _column(
    along: float, across: float, turn: float, beta: float, growth: float, cos: float, sin: float, by: Floats, c: int
) -> None:
    """Write derivatives by a coordinate, from those along the direction at the contact, of β, and of log f."""
    fx, fy, x, y = by[0, 1], by[0, 2], by[0, 3], by[0, 4]
    x_by, y_by = along * cos - across * sin + y * turn, along * sin + across * cos - x * turn
    fx_by, fy_by = growth * fx - beta * fy, growth * fy + beta * fx
    by[c, 0] = x_by * fy + x * fy_by - y_by * fx - y * fx_by
    by[c, 1], by[c, 2], by[c, 3], by[c, 4], by[c, 5] = fx_by, fy_by, x_by, y_by, beta


@compiled
def contact_state(z: Floats, i: int, by: Floats, ratios: Floats) -> Bend:
    """Write one contact, NaN if there is none.

    Parameters
    ----------
    z : ndarray, shape (n, 4)
        Coordinates as in `contact_states`; row i is used.
    by : ndarray, shape (5, 6)
        Result: moment and force at the base, contact point, and direction β of the force; then their derivatives by
        each coordinate.
    ratios : ndarray, shape (20,)
        Workspace; for 1 − m = 1e-300 there are 16 means.
    """
    force, psi1, arclength, drive_angle = z[i, 0], z[i, 1], z[i, 2], z[i, 3]
    possible = abs(psi1) < 0.5 * math.pi and arclength > 0.0 and 0.0 < force < math.inf
    m, root, chi = math.sin(0.25 * math.pi - 0.5 * psi1) ** 2, math.sqrt(force), math.nan
    if possible:
        chi = _amplitude(root * arclength, m, ratios)
    if math.isnan(chi):
        for c in range(5):
            for k in range(6):
                by[c, k] = math.nan
        return Bend(math.nan, math.nan, math.nan, math.nan)
    arc, by_chi, by_psi1 = arc_and_slopes(chi, m)
    short, off, turn = by_chi.shortfall / by_chi.length, by_chi.offset / by_chi.length, by_chi.turn / by_chi.length
    per_force = 0.5 * arclength / root
    along, across = arclength - arc.shortfall / root, arc.offset / root
    along_f = (0.5 * arc.shortfall / force - short * per_force) / root
    across_f = (off * per_force - 0.5 * arc.offset / force) / root
    along_1 = (by_psi1.length * short - by_psi1.shortfall) / root
    across_1 = (by_psi1.offset - by_psi1.length * off) / root
    turn_f, turn_1, turn_s = turn * per_force, by_psi1.turn - by_psi1.length * turn, turn * root

    tip_angle = drive_angle - arc.turn
    beta = tip_angle - psi1
    cos, sin = math.cos(tip_angle), math.sin(tip_angle)
    fx, fy = -force * math.sin(beta), force * math.cos(beta)
    x, y = along * cos - across * sin, along * sin + across * cos
    by[0, 0], by[0, 1], by[0, 2], by[0, 3], by[0, 4], by[0, 5] = x * fy - y * fx, fx, fy, x, y, beta
    _column(along_f, across_f, turn_f, -turn_f, 1.0 / force, cos, sin, by, 1)
    _column(along_1, across_1, turn_1, -turn_1 - 1.0, 0.0, cos, sin, by, 2)
    _column(1.0 - short, off, turn_s, -turn_s, 0.0, cos, sin, by, 3)
    by[4, 0], by[4, 1], by[4, 2], by[4, 3], by[4, 4], by[4, 5] = 0.0, -fy, fx, -y, x, 1.0  # a rotation of the whole
    return Bend(
        chi,
        by_psi1.length,
        # In polar coordinates r, ϑ of the contact the volume is r ∂(r, ϑ − α), since all turn with the drive.
        abs(along_f * across_1 - along_1 * across_f + along * along_f + across * across_f),
        abs(along_f * off - (1.0 - short) * across_f),
    )


@compiled
def moved(
    z: Floats, i: int, bend: Bend, by: Floats, angle: float, moment: float, fx: float, fy: float
) -> tuple[float, float, float, float]:
    """Shift of the place, to first order, for changes of drive angle and loads: the derivatives of Step 2.

    With ψ0 = φ0 − β (equation 26 of Merker et al. 2018, doi 10.1155/2018/1613945), sin ψ1 = sin ψ0 − m0²/(2 f). At
    fixed m0 and f, √f cos ψ1 ∂s1/∂ψ0 = ∂F/∂ψ1 cos ψ0 + (sin ψ1 flat + cos ψ1 steep) flat sin χ/Δ³, which would be 0/0
    in terms of turns.
    """
    force, m = z[i, 0], math.sin(0.25 * math.pi - 0.5 * z[i, 1]) ** 2
    cos1, w = 2.0 * math.sqrt(m * (1.0 - m)), math.sin(0.5 * bend.chi) ** 2
    flat, steep = 1.0 - 2.0 * m * w, cos1 * w
    d2 = flat * flat + steep * steep
    cos0 = (cos1 * (flat - steep) * (flat + steep) - 2.0 * (1.0 - 2.0 * m) * flat * steep) / d2
    along = ((1.0 - 2.0 * m) * flat + cos1 * steep) * flat * math.sin(bend.chi) / (d2 * math.sqrt(d2))

    by_force = (by[0, 1] * fx + by[0, 2] * fy) / force
    beta = (by[0, 1] * fy - by[0, 2] * fx) / (force * force)
    psi0, lost = angle - beta, (moment - 0.5 * by[0, 0] * by_force / force) / force
    by_psi1 = (cos0 * psi0 - by[0, 0] * lost) / cos1
    by_arclength = (along + bend.length_by_psi1 * cos0) / (cos1 * math.sqrt(force)) * psi0
    by_arclength -= by[2, 5] * lost / cos1 + 0.5 * z[i, 2] * by_force / force
    return (
        by[1, 3] * by_force + by[2, 3] * by_psi1 + by[3, 3] * by_arclength + by[4, 3] * angle,
        by[1, 4] * by_force + by[2, 4] * by_psi1 + by[3, 4] * by_arclength + by[4, 4] * angle,
        beta,
        by_arclength,
    )


@cached
def write_contact_states(
    coordinates: Floats,
    delta: Floats,
    loads: Floats,
    place: Floats,
    volumes: Floats,
    loads_by: Floats,
    place_by: Floats,
    by: Floats,
    ratios: Floats,
) -> None:
    """Write loads and places of contacts, NaN where there is none.

    Parameters
    ----------
    coordinates : ndarray, shape (n, 4)
        As in `contact_states`.
    delta : ndarray, shape (n,)
        Friction angle [rad].
    loads, place, volumes : ndarray, shapes (3, n), (4, n) and (2, n)
        As in `ContactStates`.
    loads_by, place_by : ndarray, shapes (n, 3, 4) and (n, 4, 4), or without rows
        As in `ContactStateSlopes`.
    by, ratios : ndarray
        As in `contact_state`.
    """
    for i in range(delta.size):
        bend = contact_state(coordinates, i, by, ratios)
        for k in range(3):
            loads[k, i] = by[0, k]
        place[0, i], place[1, i], place[2, i], place[3, i] = by[0, 3], by[0, 4], by[0, 5] - delta[i], coordinates[i, 2]
        volumes[0, i], volumes[1, i] = bend.volume_tip, bend.volume_tangential
        if loads_by.shape[0]:
            for c in range(4):
                for k in range(3):
                    loads_by[i, k, c], place_by[i, k, c] = by[c + 1, k], by[c + 1, k + 3]
                place_by[i, 3, c] = 1.0 if c == 2 else 0.0


@cached
def wrench_slopes(coordinates: Floats, by: Floats, ratios: Floats, out: Floats) -> None:
    """Write the derivatives of places by drive angle and loads, shape (n, 4, 4)."""
    for i in range(coordinates.shape[0]):
        bend = contact_state(coordinates, i, by, ratios)
        for c in range(4):
            change = moved(coordinates, i, bend, by, 1.0 * (c == 0), 1.0 * (c == 1), 1.0 * (c == 2), 1.0 * (c == 3))
            for k in range(4):
                out[i, k, c] = change[k]


@cached
def chords(chi: Floats, m: Floats, out: Floats) -> None:
    """Write C and S of arcs, shape (2, n)."""
    for i in range(chi.size):
        arc, _ = arc_to(chi[i], m[i])
        out[0, i], out[1, i] = arc.shortfall, arc.offset
