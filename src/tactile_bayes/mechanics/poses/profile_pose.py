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
    MOST_STEPS,
    March,
    Slope,
    State,
    advance,
    begin,
    cell_at,
    moved,
    rest_curvature_at,
    slope_series,
    slopes_moved,
)
from tactile_bayes.mechanics.rods.profile import Profile

__all__ = ["at_contact", "part_along", "pose_along", "pose_along_and_slopes"]


@compiled
def pose_along(profile: Profile, psi1: float, arclength: float, force: float, work: Floats) -> Pose:
    """Pose for ψ1, arc length s1 and force f, in rod lengths and EI(0)/L²."""
    march = part_along(profile, at_contact(profile, psi1, arclength), 0.0, force, work)
    return Pose(march.state.u, march.state.v, march.state.psi - psi1)


@compiled
def at_contact(profile: Profile, psi1: float, arclength: float) -> March:
    """Start of a march at the contact."""
    return begin(profile, arclength, BACKWARD, State(psi1, 0.0, 0.0, 0.0))


@compiled
def part_along(profile: Profile, march: March, until: float, force: float, work: Floats) -> March:
    """March on toward the pivot, to an arc length."""
    while march.at > until:
        _, march = advance(profile, march, BACKWARD, until, force, work)
    return march


@compiled
def pose_along_and_slopes(
    profile: Profile, psi1: float, arclength: float, force: float, work: Floats
) -> tuple[Pose, Pose, Pose, Pose]:
    """Pose, and its derivatives by ψ1, by the arc length, and by the force."""
    state, at = State(psi1, 0.0, 0.0, 0.0), arclength
    cell = cell_at(profile, at, BACKWARD)
    by_psi1, by_force = Slope(1.0, 0.0, 0.0), Slope(0.0, 0.0, 0.0)
    # A longer rod passes its former contact unloaded.
    by_arclength = Slope(-rest_curvature_at(profile, cell, at), math.cos(psi1), math.sin(psi1))
    steps = 0
    while at > 0.0 and steps < MOST_STEPS:
        length = at - profile.edges[cell]
        step = slope_series(profile, cell, at, length, force, state, by_psi1, by_arclength, by_force, work)
        state = moved(state, force, step, step.share, work)
        by_psi1, by_arclength, by_force = slopes_moved(step, step.share, work)
        at -= step.share * length
        if step.share == 1.0:
            at = profile.edges[cell]
            cell -= 1
        else:
            steps += 1
    u, v = (math.nan, math.nan) if at > 0.0 else (state.u, state.v)
    v_1 = u * by_psi1.psi - force * (by_psi1.u * by_force.psi - by_force.u * by_psi1.psi)
    v_s = math.sin(psi1) + u * by_arclength.psi
    v_s -= force * (by_arclength.u * by_force.psi - by_force.u * by_arclength.psi)
    return (
        Pose(u, v, state.psi - psi1),
        Pose(by_psi1.u, v_1, by_psi1.psi - 1.0),
        Pose(by_arclength.u, v_s, by_arclength.psi),
        Pose(by_force.u, by_force.v, by_force.psi),
    )
