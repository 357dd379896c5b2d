"""Step 2 of a rod of any rest curvature and rigidity: the contact that follows from a base wrench.

Slope and moment at the pivot determine the rod. Its contact is the first point at which the bending moment vanishes.
Beyond its tip a rod is continued with the rest curvature and the rigidity of the tip.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from tactile_bayes.arrays import Floats
from tactile_bayes.mechanics.compiler import compiled
from tactile_bayes.mechanics.poses.rises import rise
from tactile_bayes.mechanics.poses.taylor import FARTHEST, FORWARD, State, advance, begin, moved
from tactile_bayes.mechanics.rods.profile import Profile

__all__ = ["ProfileContact", "contact_along"]


class ProfileContact(NamedTuple):
    """Contact of a forward sweep that follows from a base wrench; NaN where there is none."""

    x: float
    y: float
    """Contact point relative to the pivot [L]."""
    slope_angle: float
    """Slope angle α of the contour [rad]."""
    arclength: float
    """Arc length s1 [L]; above 1 the contact lies beyond the tip."""
    tip_angle: float
    """Slope φ(s1) of the rod at the contact [rad]."""


@compiled
def contact_along(
    profile: Profile, phi0: float, moment: float, fx: float, fy: float, delta: float, work: Floats
) -> ProfileContact:
    """Contact for drive angle, holding moment, support reaction and friction angle."""
    force, beta = math.sqrt(fx * fx + fy * fy), math.atan2(-fx, fy)
    start = State(phi0 - beta, -moment, 0.0, 0.0)
    # A force without moment passes through the pivot: the rod must bend away from it before it returns.
    if 0.0 < force < math.inf and (moment > 0.0 or (moment == 0.0 and math.cos(start.psi) < 0.0)):
        march = begin(profile, 0.0, FORWARD, start)
        while march.at < FARTHEST:
            before = march
            step, march = advance(profile, before, FORWARD, FARTHEST, force, work)
            x = rise(before.state, force, step, True, 0.0, work)
            if x >= 0.0:
                end = moved(before.state, force, step, x, work)
                cos, sin = math.cos(beta), math.sin(beta)
                return ProfileContact(
                    end.u * cos - end.v * sin,
                    end.u * sin + end.v * cos,
                    beta - delta,
                    before.at + x * step.length,
                    beta + end.psi,
                )
    return ProfileContact(math.nan, math.nan, math.nan, math.nan, math.nan)
