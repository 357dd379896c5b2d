"""Step 2 of a rod of any rest curvature and rigidity: the points that may be the contact, from a base wrench.

Slope and moment at the pivot determine the rod, and its moment vanishes at the contact. It may vanish once before, if
the rod is bent both ways. Beyond its tip a rod is continued with the rest curvature and the rigidity of the tip.
"""

from __future__ import annotations

import math

from tactile_bayes.arrays import Floats
from tactile_bayes.mechanics.compiler import compiled
from tactile_bayes.mechanics.contacts.arc_states import NO_CONTACT, Found
from tactile_bayes.mechanics.poses.rises import rise
from tactile_bayes.mechanics.poses.taylor import FARTHEST, FORWARD, State, advance, begin, moved
from tactile_bayes.mechanics.rods.profile import Profile

__all__ = ["is_exact", "zeros_along"]


_EXACT = 1e-6
"""Arc length [L] and angle [rad] that count as zero in Step 2 without errors."""


@compiled
def zeros_along(
    profile: Profile, phi0: float, moment: float, fx: float, fy: float, delta: float, work: Floats
) -> tuple[Found, Found]:
    """First two points without moment, for drive angle, holding moment, support reaction and friction angle.

    The moment rises through zero at one of them and falls at the other, which are returned in this order. There is no
    second one if the first lies beyond the tip.
    """
    force, beta = math.sqrt(fx * fx + fy * fy), math.atan2(-fx, fy)
    state, rising, falling = State(phi0 - beta, -moment, 0.0, 0.0), NO_CONTACT, NO_CONTACT
    if not (0.0 < force < math.inf and math.isfinite(moment)):
        return rising, falling
    # A force without moment passes through the pivot: the rod must bend away from it before it returns.
    sense = 1.0 if moment > 0.0 or (moment == 0.0 and math.cos(state.psi) < 0.0) else -1.0
    march = begin(profile, 0.0, FORWARD, state)
    while march.at < FARTHEST:
        before = march
        step, march = advance(profile, before, FORWARD, FARTHEST, force, work)
        x = rise(before.state, force, step, sense, 0.0, work)
        if x >= 0.0:
            end, at = moved(before.state, force, step, x, work), before.at + x * step.length
            cos, sin = math.cos(beta), math.sin(beta)
            x, y = end.u * cos - end.v * sin, end.u * sin + end.v * cos
            if sense > 0.0:
                rising = Found(x, y, beta - delta, at, beta + end.psi, math.nan)
            else:
                falling = Found(x, y, beta - delta, at, beta + end.psi, math.nan)
            if at > 1.0 or (rising.arclength > 0.0 and falling.arclength > 0.0):
                break
            march, sense = begin(profile, at, FORWARD, State(end.psi, 0.0, end.u, end.v)), -sense
    return rising, falling


@compiled
def is_exact(arclength: float, turn: float) -> bool:
    """True if a rod ends at a point, or lies along the contour there."""
    turn -= 2.0 * math.pi * math.floor(turn / (2.0 * math.pi) + 0.5)
    return abs(arclength - 1.0) < _EXACT or (arclength < 1.0 and abs(turn) < _EXACT)
