"""Step 2 of a rod of any rest curvature and rigidity: the contact that follows from a base wrench.

Slope and moment at the pivot determine the rod. Its contact is the first point at which the bending moment vanishes.
Beyond its tip a rod is continued with the rest curvature and the rigidity of the tip.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from tactile_bayes.arrays import Floats
from tactile_bayes.mechanics.compiler import compiled
from tactile_bayes.mechanics.pose import Pose
from tactile_bayes.mechanics.profile import Profile
from tactile_bayes.mechanics.profile_pose import pose_along_and_slopes
from tactile_bayes.mechanics.rises import rise
from tactile_bayes.mechanics.taylor import FARTHEST, FORWARD, State, advance, begin, moved

__all__ = ["ProfileContact", "contact_along", "contact_along_and_slopes"]


class ProfileContact(NamedTuple):
    """Contact of a forward sweep that follows from a base wrench, or its derivative; NaN where there is none."""

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


@compiled
def contact_along_and_slopes(
    profile: Profile, phi0: float, moment: float, fx: float, fy: float, delta: float, work: Floats
) -> tuple[ProfileContact, ProfileContact, ProfileContact, ProfileContact, ProfileContact]:
    """Contact, and its derivatives by drive angle, holding moment, and both components of the reaction."""
    found = contact_along(profile, phi0, moment, fx, fy, delta, work)
    force, beta = math.sqrt(fx * fx + fy * fy), math.atan2(-fx, fy)
    psi1 = found.tip_angle - beta
    poses = pose_along_and_slopes(profile, psi1, found.arclength, force, work)
    lever, square = poses[0].u / force, force * force
    cos, sin = math.cos(beta), math.sin(beta)
    return (
        found,
        _change(found, beta, psi1, poses, 1.0, 0.0, 0.0, 0.0),
        _change(found, beta, psi1, poses, 0.0, 1.0 / force, 0.0, 0.0),
        _change(found, beta, psi1, poses, 0.0, lever * sin, -sin, -fy / square),
        _change(found, beta, psi1, poses, 0.0, -lever * cos, cos, fx / square),
    )


@compiled
def _change(
    found: ProfileContact,
    beta: float,
    psi1: float,
    poses: tuple[Pose, Pose, Pose, Pose],
    by_angle: float,
    by_u: float,
    by_force: float,
    by_beta: float,
) -> ProfileContact:
    """Change of a contact with changes of the drive angle, the lever arm, and size and direction of the force.

    Slope and lever arm at the pivot determine ψ1 and the arc length; their determinant is cos ψ1.
    """
    _, at_psi1, at_arclength, at_force = poses
    cos = math.cos(psi1)
    turn, across = by_angle - by_beta - at_force.turn * by_force, by_u - at_force.u * by_force
    by_psi1 = (at_arclength.u * turn - at_arclength.turn * across) / cos
    by_arclength = ((1.0 + at_psi1.turn) * across - at_psi1.u * turn) / cos
    by_v = at_psi1.v * by_psi1 + at_arclength.v * by_arclength + at_force.v * by_force
    cos_beta, sin_beta = math.cos(beta), math.sin(beta)
    return ProfileContact(
        by_u * cos_beta - by_v * sin_beta - found.y * by_beta,
        by_u * sin_beta + by_v * cos_beta + found.x * by_beta,
        by_beta,
        by_arclength,
        by_beta + by_psi1,
    )
