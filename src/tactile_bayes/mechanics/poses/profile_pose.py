"""The pose of a loaded rod of any rest curvature and rigidity: its pivot as seen from the contact.

The rod is marched from the contact to the pivot (`taylor`), in the frame and the units of `pose`. Two derivatives of v
follow from the others. As a function of the force in the frame of the base and of the arc length, the complementary
energy of the rod has the differential −(v df + f u dψ0 + f sin ψ1 ds1), whose mixed derivatives do not depend on their
order.
"""

from __future__ import annotations

import math

from tactile_bayes.arrays import Floats
from tactile_bayes.mechanics.compiler import compiled
from tactile_bayes.mechanics.poses.pose import Pose
from tactile_bayes.mechanics.poses.taylor import (
    BACKWARD,
    EXACT,
    March,
    Slopes,
    State,
    advance,
    begin,
    cell_at,
    rest_curvature_at,
)
from tactile_bayes.mechanics.rods.profile import Profile


@compiled
def pose_along(profile: Profile, psi1: float, arclength: float, force: float, work: Floats) -> Pose:
    """Pose for ψ1, arc length s1 and force f, in rod lengths and EI(0)/L²."""
    march = part_along(profile, at_contact(profile, psi1, arclength), 0.0, force, work, EXACT)
    return Pose(march.state.u, march.state.v, march.state.psi - psi1)


@compiled
def at_contact(profile: Profile, psi1: float, arclength: float) -> March:
    """Start of a march at the contact."""
    return begin(profile, arclength, BACKWARD, State(psi1, 0.0, 0.0, 0.0))


@compiled
def part_along(profile: Profile, march: March, until: float, force: float, work: Floats, remainder: float) -> March:
    """March on toward the pivot, to an arc length."""
    while march.at > until:
        _, march, _ = advance(profile, march, BACKWARD, until, force, work, remainder, None)
    return march


@compiled
def pose_along_in_phase(
    profile: Profile, psi1: float, arclength: float, force: float, tip: bool, work: Floats, remainder: float
) -> tuple[Pose, Pose, Pose]:
    """Pose, and its derivatives by ψ1 in tip contact or by the arc length in tangential contact, and by the force."""
    march, slopes = at_contact(profile, psi1, arclength), Slopes(1.0, 0.0, 0.0, 0.0, 0.0)
    if not tip:  # a longer rod passes the contact unloaded
        curvature = rest_curvature_at(profile, cell_at(profile, arclength, BACKWARD), arclength)
        slopes = Slopes(-curvature, math.cos(psi1), 0.0, 0.0, 0.0)
    while march.at > 0.0:
        _, march, slopes = advance(profile, march, BACKWARD, 0.0, force, work, remainder, slopes)
    psi_q, u_q, psi_f, u_f, v_f = slopes
    here = Pose(march.state.u, march.state.v, march.state.psi - psi1)
    v_q = here.u * psi_q - force * (u_q * psi_f - u_f * psi_q)
    by_q = Pose(u_q, v_q, psi_q - 1.0) if tip else Pose(u_q, math.sin(psi1) + v_q, psi_q)
    return here, by_q, Pose(u_f, v_f, psi_f)


@compiled
def pose_along_and_slopes(
    profile: Profile, psi1: float, arclength: float, force: float, work: Floats, remainder: float
) -> tuple[Pose, Pose, Pose, Pose]:
    """Pose, and its derivatives by ψ1, by the arc length, and by the force."""
    here, by_psi1, by_force = pose_along_in_phase(profile, psi1, arclength, force, bool(1), work, remainder)
    return here, by_psi1, pose_along_in_phase(profile, psi1, arclength, force, bool(0), work, remainder)[1], by_force
