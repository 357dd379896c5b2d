"""One touching rod by its coordinates, with derivatives: the closed form of `touching`, compiled.

Along the direction at the contact the chord is (F − C, S)/√f (`arc`). With the length of the arc √f s1 = F(χ | m) held,
its amplitude gives way: ∂/∂ψ1 at that length is ∂/∂ψ1 − F_ψ1/F_χ ∂/∂χ.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from tactile_bayes.mechanics.arc import Arc, arc_and_slopes, arc_to
from tactile_bayes.mechanics.compiler import compiled, kept

__all__ = ["chords", "touches"]

Floats = NDArray[np.float64]


@compiled
def _over(arc: Arc, divisor: float) -> Arc:
    return Arc(arc.length / divisor, arc.shortfall / divisor, arc.offset / divisor, arc.turn / divisor)


@compiled
def _column(
    along: float, across: float, turn: float, beta: float, cos: float, sin: float, x: float, y: float, out: Floats
) -> None:
    """Derivatives of contact point and direction of the force, from those along and across the contact's direction."""
    out[0], out[1], out[2] = along * cos - across * sin + y * turn, along * sin + across * cos - x * turn, beta


@kept
def touches(
    coordinates: Floats,
    chi: Floats,
    delta: Floats,
    loads: Floats,
    place: Floats,
    volumes: Floats,
    loads_by: Floats,
    place_by: Floats,
) -> None:
    """Loads and places of touching rods, NaN where the amplitude is.

    Parameters
    ----------
    coordinates : ndarray, shape (n, 4)
        As `touching` takes them.
    chi, delta : ndarray, shape (n,)
        Amplitude of each rod, and friction angle.
    loads, place, volumes : ndarray, shapes (3, n), (4, n) and (2, n)
        As in `Touching`.
    loads_by, place_by : ndarray, shapes (n, 3, 4) and (n, 4, 4), or none of them
        As in `TouchingSlopes`.
    """
    for i in range(chi.size):
        force, psi1, arclength, drive_angle = coordinates[i]
        loads[:, i], place[:, i], volumes[:, i] = math.nan, math.nan, math.nan
        if loads_by.shape[0]:
            loads_by[i], place_by[i] = math.nan, math.nan
        if not math.isfinite(chi[i]):
            continue
        root = math.sqrt(force)
        arc, by_chi, by_psi1 = arc_and_slopes(chi[i], math.sin(0.25 * math.pi - 0.5 * psi1) ** 2)
        by_load = _over(by_chi, by_chi.length)
        along, across = arclength - arc.shortfall / root, arc.offset / root
        tip_angle = drive_angle - arc.turn
        beta = tip_angle - psi1
        cos, sin = math.cos(tip_angle), math.sin(tip_angle)
        fx, fy = -force * math.sin(beta), force * math.cos(beta)
        x, y = along * cos - across * sin, along * sin + across * cos
        loads[0, i], loads[1, i], loads[2, i] = x * fy - y * fx, fx, fy
        place[0, i], place[1, i], place[2, i], place[3, i] = x, y, beta - delta[i], arclength

        per_force = 0.5 * arclength / root
        along_f = (0.5 * arc.shortfall / force - by_load.shortfall * per_force) / root
        across_f = (by_load.offset * per_force - 0.5 * arc.offset / force) / root
        along_1 = -(by_psi1.shortfall - by_psi1.length * by_load.shortfall) / root
        across_1 = (by_psi1.offset - by_psi1.length * by_load.offset) / root
        along_s, across_s = 1.0 - by_load.shortfall, by_load.offset
        # In polar coordinates r, ϑ of the contact the volume is r ∂(r, ϑ − α), as all turn with the drive.
        volumes[0, i] = abs(along_f * across_1 - along_1 * across_f + along * along_f + across * across_f)
        volumes[1, i] = abs(along_f * across_s - along_s * across_f)
        if not loads_by.shape[0]:
            continue
        by, of = place_by[i], loads_by[i]
        turn_f, turn_s = by_load.turn * per_force, by_load.turn * root
        turn_1 = by_psi1.turn - by_psi1.length * by_load.turn
        _column(along_f, across_f, turn_f, -turn_f, cos, sin, x, y, by[:, 0])
        _column(along_1, across_1, turn_1, -turn_1 - 1.0, cos, sin, x, y, by[:, 1])
        _column(along_s, across_s, turn_s, -turn_s, cos, sin, x, y, by[:, 2])
        by[0, 3], by[1, 3], by[2, 3] = -y, x, 1.0
        by[3, 0], by[3, 1], by[3, 2], by[3, 3] = 0.0, 0.0, 1.0, 0.0
        for c in range(4):
            fx_by, fy_by = -fy * by[2, c], fx * by[2, c]
            if c == 0:
                fx_by, fy_by = fx_by + fx / force, fy_by + fy / force
            of[0, c] = by[0, c] * fy + x * fy_by - by[1, c] * fx - y * fx_by
            of[1, c], of[2, c] = fx_by, fy_by
        of[0, 3] = 0.0  # the whole turns


@kept
def chords(chi: Floats, m: Floats, out: Floats) -> None:
    """C and S of arcs, shape (2, n)."""
    for i in range(chi.size):
        arc, _ = arc_to(chi[i], m[i])
        out[0, i], out[1, i] = arc.shortfall, arc.offset
