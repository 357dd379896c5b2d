"""One touching rod by its coordinates, with derivatives: the closed form of `touching`, compiled.

Along the direction at the contact the chord is (F − C, S)/√f (`arc`). With the length of the arc √f s1 = F(χ | m) held,
its amplitude gives way: ∂/∂ψ1 at that length is ∂/∂ψ1 − F_ψ1/F_χ ∂/∂χ.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from tactile_bayes.mechanics.arc import arc_and_slopes, arc_to
from tactile_bayes.mechanics.compiler import compiled, inlined, kept

__all__ = ["Move", "Touch", "Touches", "chords", "moved", "room_for_ratios", "touch", "touches", "wrench_slopes"]

Floats = NDArray[np.float64]

_EPSILON = 1e-16
"""Half the difference of two means, over the mean, below which they are one."""


class _Bend(NamedTuple):
    """Chord from the pivot along and across the direction at the contact, and turn; or derivatives of them."""

    along: float
    across: float
    turn: float


class Touch(NamedTuple):
    """What the base of a touching rod feels, where it touches, and β; or derivatives of all that."""

    moment: float
    force_x: float
    force_y: float
    x: float
    y: float
    beta: float


class Touches(NamedTuple):
    """A touching rod, NaN if there is none, and how it changes with its coordinates."""

    rod: Touch
    by_force: Touch
    by_psi1: Touch
    by_arclength: Touch
    by_drive_angle: Touch
    volume_tip: float
    volume_tangential: float
    """As in `Touching`."""
    chi: float
    length_by_psi1: float
    """Of the arc to the amplitude χ at the pivot."""


class Move(NamedTuple):
    """Change of a place, to first order."""

    x: float
    y: float
    slope_angle: float
    arclength: float


@compiled
def _amplitude(load: float, m: float, ratios: Floats) -> float:
    """Jacobi's am(load | m) by arithmetic and geometric means; NaN beyond twice the quarter period."""
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


@inlined
def _column(rod: Touch, by: _Bend, cos: float, sin: float, beta: float, growth: float) -> Touch:
    """Derivatives by a coordinate from those in the direction at the contact, of β, and of the force's logarithm."""
    x, y = by.along * cos - by.across * sin + rod.y * by.turn, by.along * sin + by.across * cos - rod.x * by.turn
    fx, fy = growth * rod.force_x - beta * rod.force_y, growth * rod.force_y + beta * rod.force_x
    moment = x * rod.force_y + rod.x * fy - y * rod.force_x - rod.y * fx
    return Touch(moment, fx, fy, x, y, beta)


@compiled
def touch(force: float, psi1: float, arclength: float, drive_angle: float, ratios: Floats) -> Touches:
    """One rod by its coordinates; `ratios` is `room_for_ratios`."""
    possible = abs(psi1) < 0.5 * math.pi and arclength > 0.0 and 0.0 < force < math.inf
    m = math.sin(0.25 * math.pi - 0.5 * psi1) ** 2
    root = math.sqrt(force)
    chi = _amplitude(root * arclength, m, ratios) if possible else math.nan
    if math.isnan(chi):
        none = Touch(math.nan, math.nan, math.nan, math.nan, math.nan, math.nan)
        return Touches(none, none, none, none, none, math.nan, math.nan, chi, math.nan)
    arc, by_chi, by_psi1 = arc_and_slopes(chi, m)
    short, off, turn = by_chi.shortfall / by_chi.length, by_chi.offset / by_chi.length, by_chi.turn / by_chi.length
    per_force = 0.5 * arclength / root
    at = _Bend(arclength - arc.shortfall / root, arc.offset / root, arc.turn)
    by_f = _Bend(
        (0.5 * arc.shortfall / force - short * per_force) / root,
        (off * per_force - 0.5 * arc.offset / force) / root,
        turn * per_force,
    )
    by_1 = _Bend(
        (by_psi1.length * short - by_psi1.shortfall) / root,
        (by_psi1.offset - by_psi1.length * off) / root,
        by_psi1.turn - by_psi1.length * turn,
    )
    by_s = _Bend(1.0 - short, off, turn * root)

    tip_angle = drive_angle - arc.turn
    beta = tip_angle - psi1
    cos, sin = math.cos(tip_angle), math.sin(tip_angle)
    fx, fy = -force * math.sin(beta), force * math.cos(beta)
    x, y = at.along * cos - at.across * sin, at.along * sin + at.across * cos
    rod = Touch(x * fy - y * fx, fx, fy, x, y, beta)
    return Touches(
        rod,
        _column(rod, by_f, cos, sin, -by_f.turn, 1.0 / force),
        _column(rod, by_1, cos, sin, -by_1.turn - 1.0, 0.0),
        _column(rod, by_s, cos, sin, -by_s.turn, 0.0),
        Touch(0.0, -fy, fx, -y, x, 1.0),  # the whole turns
        # In polar coordinates r, ϑ of the contact the volume is r ∂(r, ϑ − α), as all turn with the drive.
        abs(by_f.along * by_1.across - by_1.along * by_f.across + at.along * by_f.along + at.across * by_f.across),
        abs(by_f.along * by_s.across - by_s.along * by_f.across),
        chi,
        by_psi1.length,
    )


@compiled
def moved(at: Touches, psi1: float, arclength: float, angle: float, moment: float, fx: float, fy: float) -> Move:
    """By how much the place moves, to first order, when drive angle and loads are so much more: the slopes of Step 2.

    By equation 26 sin ψ1 = sin ψ0 − m0²/(2 f), where ψ0 = φ0 − β. As ψ1 goes with ψ0, m0 and f held, so does the arc to
    χ: √f cos ψ1 ∂s1/∂ψ0 = ∂F/∂ψ1 cos ψ0 + (sin ψ1 flat + cos ψ1 steep) flat sin χ/Δ³, which is 0/0 in terms of turns.
    """
    rod, m = at.rod, math.sin(0.25 * math.pi - 0.5 * psi1) ** 2
    force2 = rod.force_x * rod.force_x + rod.force_y * rod.force_y
    force, cos1 = math.sqrt(force2), 2.0 * math.sqrt(m * (1.0 - m))
    w = math.sin(0.5 * at.chi) ** 2
    flat, steep = 1.0 - 2.0 * m * w, cos1 * w
    d2 = flat * flat + steep * steep
    cos0 = (cos1 * (flat - steep) * (flat + steep) - 2.0 * (1.0 - 2.0 * m) * flat * steep) / d2
    along = ((1.0 - 2.0 * m) * flat + cos1 * steep) * flat * math.sin(at.chi) / (d2 * math.sqrt(d2))

    by_force = (rod.force_x * fx + rod.force_y * fy) / force
    beta = (rod.force_x * fy - rod.force_y * fx) / force2
    psi0 = angle - beta
    lost = moment / force - 0.5 * rod.moment * by_force / force2
    by_psi1 = (cos0 * psi0 - rod.moment * lost) / cos1
    by_arclength = (along + at.length_by_psi1 * cos0) / (cos1 * math.sqrt(force)) * psi0
    by_arclength -= at.by_psi1.beta * lost / cos1 + 0.5 * arclength * by_force / force
    return Move(
        at.by_force.x * by_force + at.by_psi1.x * by_psi1 + at.by_arclength.x * by_arclength - rod.y * angle,
        at.by_force.y * by_force + at.by_psi1.y * by_psi1 + at.by_arclength.y * by_arclength + rod.x * angle,
        beta,
        by_arclength,
    )


@compiled
def room_for_ratios() -> Floats:
    """For what `touch` notes on the way: 1 − m of 1e-300 takes 16 means."""
    return np.empty(20)


@kept
def touches(
    coordinates: Floats,
    delta: Floats,
    loads: Floats,
    place: Floats,
    volumes: Floats,
    loads_by: Floats,
    place_by: Floats,
) -> None:
    """Loads and places of touching rods, NaN where there is none.

    Parameters
    ----------
    coordinates : ndarray, shape (n, 4)
        As `touching` takes them.
    delta : ndarray, shape (n,)
        Friction angle.
    loads, place, volumes : ndarray, shapes (3, n), (4, n) and (2, n)
        As in `Touching`.
    loads_by, place_by : ndarray, shapes (n, 3, 4) and (n, 4, 4), or none of them
        As in `TouchingSlopes`.
    """
    ratios = room_for_ratios()
    for i in range(delta.size):
        arclength = coordinates[i, 2]
        at = touch(coordinates[i, 0], coordinates[i, 1], arclength, coordinates[i, 3], ratios)
        rod = at.rod
        loads[0, i], loads[1, i], loads[2, i] = rod.moment, rod.force_x, rod.force_y
        place[0, i], place[1, i], place[2, i], place[3, i] = rod.x, rod.y, rod.beta - delta[i], arclength
        volumes[0, i], volumes[1, i] = at.volume_tip, at.volume_tangential
        if loads_by.shape[0]:
            for c, by in enumerate((at.by_force, at.by_psi1, at.by_arclength, at.by_drive_angle)):
                loads_by[i, 0, c], loads_by[i, 1, c], loads_by[i, 2, c] = by.moment, by.force_x, by.force_y
                place_by[i, 0, c], place_by[i, 1, c], place_by[i, 2, c] = by.x, by.y, by.beta
                place_by[i, 3, c] = 1.0 if c == 2 else 0.0


@kept
def wrench_slopes(coordinates: Floats, out: Floats) -> None:
    """Derivatives of places by drive angle and loads, shape (n, 4, 4)."""
    ratios = room_for_ratios()
    for i in range(coordinates.shape[0]):
        force, psi1, arclength, drive_angle = coordinates[i]
        at = touch(force, psi1, arclength, drive_angle, ratios)
        for c in range(4):
            by = moved(at, psi1, arclength, 1.0 * (c == 0), 1.0 * (c == 1), 1.0 * (c == 2), 1.0 * (c == 3))
            out[i, 0, c], out[i, 1, c], out[i, 2, c], out[i, 3, c] = by.x, by.y, by.slope_angle, by.arclength


@kept
def chords(chi: Floats, m: Floats, out: Floats) -> None:
    """C and S of arcs, shape (2, n)."""
    for i in range(chi.size):
        arc, _ = arc_to(chi[i], m[i])
        out[0, i], out[1, i] = arc.shortfall, arc.offset
