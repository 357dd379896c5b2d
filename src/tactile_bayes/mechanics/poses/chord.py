"""The piece of elastica that joins the ends of a rod in contact, by Newton's method on the exact arc.

In tangential contact the angle of the chord to the contour's tangent gives the amplitude (one variable). In tip contact
the length of the chord and its angle to the force give the amplitude and the direction at the contact (two variables).
"""

from __future__ import annotations

import math

from tactile_bayes.mechanics.compiler import compiled
from tactile_bayes.mechanics.poses.arc import (
    Arc,
    arc_and_slopes,
    arc_to,
    chord_deficit,
    chord_deficit_rate,
    chord_direction,
    chord_direction_rate,
    slopes_by_chi,
)

_SETTLED = 1e-8  # relative Newton step after which only rounding errors are left
_MAX_STEPS = 40

_CHI_MAX = 3.2  # bound on the amplitude, a little over π, at which the line of force passes through the pivot
NO_ARC = Arc(math.nan, math.nan, math.nan, math.nan)


@compiled
def tangential_arc(angle: float, m: float, guess: float) -> tuple[float, Arc, Arc]:
    """Amplitude χ ∈ [0, π], arc, and its derivatives by χ, for a chord at `angle` ≥ 0 to the contour's tangent.
    Newton's method solves for the square root of the angle, which is nearly proportional to χ. NaN where it does not
    converge."""
    target, x = math.sqrt(angle), guess
    for _ in range(_MAX_STEPS):
        arc, by_chi = arc_to(x, m)
        step = 0.0
        if x > 0.0:
            root = math.sqrt(chord_direction(arc))
            step = (root - target) * 2.0 * root / chord_direction_rate(arc, by_chi)
        if abs(step) <= _SETTLED * x:
            # To first order, which leaves rounding errors only, and costs less than another arc.
            length, shortfall, offset, turn = arc
            moved = Arc(
                length - by_chi.length * step,
                shortfall - by_chi.shortfall * step,
                offset - by_chi.offset * step,
                turn - by_chi.turn * step,
            )
            return x - step, moved, slopes_by_chi(x - step, m)
        x = min(max(x - step, 0.5 * x), math.pi)
    return math.nan, NO_ARC, NO_ARC


@compiled
def tip_arc(deficit: float, chord_angle: float, chi: float, epsilon1: float) -> tuple[float, float, Arc, Arc, Arc]:
    """Amplitude χ ∈ [0, π], ε1 = π/2 − ψ1, arc, and its derivatives by χ and ψ1, of a rod of length one. Its chord has
    the length √(1 − deficit²). `chord_angle` ∈ [0, π/2 + δ] is π/2 minus the chord's angle to the direction across the
    force; `chi` and `epsilon1` are a first guess. NaN where Newton's method does not converge."""
    x, t = chi, epsilon1
    for _ in range(_MAX_STEPS):
        arc, by_chi, by_psi1 = arc_and_slopes(x, math.sin(0.5 * t) ** 2)
        dx, dt = 0.0, t - chord_angle  # a straight rod lies along its chord
        if x > 0.0:
            angle_x, angle_t = chord_direction_rate(arc, by_chi), -chord_direction_rate(arc, by_psi1)
            value = chord_deficit(arc)
            value_x, value_t = chord_deficit_rate(arc, value, by_chi), -chord_deficit_rate(arc, value, by_psi1)
            miss, angle_miss = value - deficit, t - chord_direction(arc) - chord_angle
            det = value_x * (1.0 - angle_t) + value_t * angle_x
            dx = (miss * (1.0 - angle_t) - value_t * angle_miss) / det
            dt = (value_x * angle_miss + angle_x * miss) / det
        if abs(dx) <= _SETTLED * x and abs(dt) <= _SETTLED * t:
            arc, by_chi, by_psi1 = arc_and_slopes(x - dx, math.sin(0.5 * (t - dt)) ** 2)
            return x - dx, t - dt, arc, by_chi, by_psi1
        x = min(max(x - dx, 0.5 * x), min(1.5 * x, _CHI_MAX))
        t = min(max(t - dt, 0.5 * t), 0.5 * (t + math.pi))
    return math.nan, math.nan, NO_ARC, NO_ARC, NO_ARC
