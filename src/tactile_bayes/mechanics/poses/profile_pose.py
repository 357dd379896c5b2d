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
    Other,
    Slope,
    State,
    advance,
    begin,
    cell_at,
    rest_curvature_at,
    slopes_moved,
)
from tactile_bayes.mechanics.rods.profile import Profile

__all__ = ["at_contact", "part_along", "pose_along", "pose_along_and_slopes", "pose_along_in_phase"]


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
        _, march = advance(profile, march, BACKWARD, until, force, work, remainder)
    return march


@compiled
def pose_along_and_slopes(
    profile: Profile, psi1: float, arclength: float, force: float, work: Floats
) -> tuple[Pose, Pose, Pose, Pose]:
    """Pose, and its derivatives by ψ1, by the arc length, and by the force."""
    by_psi1 = _at_contact_by(profile, psi1, arclength, True)
    by_arclength = _at_contact_by(profile, psi1, arclength, False)
    here, one, other, last = _marched(profile, psi1, arclength, force, by_psi1, by_arclength, work)
    by_q, by_other = _by(here, one, last, force, psi1, True), _by(here, other, last, force, psi1, False)
    return here, by_q, by_other, Pose(last.u, last.v, last.psi)


@compiled
def pose_along_in_phase(
    profile: Profile, psi1: float, arclength: float, force: float, tip: bool, work: Floats
) -> tuple[Pose, Pose, Pose]:
    """Pose, and its derivatives by ψ1 in tip contact or by the arc length in tangential contact, and by the force."""
    by_q = _at_contact_by(profile, psi1, arclength, tip)
    here, one, _, last = _marched(profile, psi1, arclength, force, by_q, None, work)
    return here, _by(here, one, last, force, psi1, tip), Pose(last.u, last.v, last.psi)


@compiled
def _at_contact_by(profile: Profile, psi1: float, arclength: float, tip: bool) -> Slope:
    """Derivative of the state at the contact by ψ1, or by the arc length: a longer rod passes it unloaded."""
    if tip:
        return Slope(1.0, 0.0, 0.0)
    curvature = rest_curvature_at(profile, cell_at(profile, arclength, BACKWARD), arclength)
    return Slope(-curvature, math.cos(psi1), math.sin(psi1))


@compiled
def _by(here: Pose, by: Slope, last: Slope, force: float, psi1: float, tip: bool) -> Pose:
    """Derivative of a pose by ψ1 or the arc length, from those of the state and of the state by the force."""
    v = here.u * by.psi - force * (by.u * last.psi - last.u * by.psi)
    return Pose(by.u, v, by.psi - 1.0) if tip else Pose(by.u, math.sin(psi1) + v, by.psi)


@compiled
def _marched(
    profile: Profile, psi1: float, arclength: float, force: float, by_q: Slope, other: Other, work: Floats
) -> tuple[Pose, Slope, Other, Slope]:
    """Pose, and derivatives of the state by ψ1 or the arc length, by the other unless it is None, and by the force."""
    march, by_force = at_contact(profile, psi1, arclength), Slope(0.0, 0.0, 0.0)
    while march.at > 0.0:
        step, march = advance(profile, march, BACKWARD, 0.0, force, work, EXACT, by_q, other, by_force)
        by_q, other, by_force = slopes_moved(step, other, work)
    return Pose(march.state.u, march.state.v, march.state.psi - psi1), by_q, other, by_force
