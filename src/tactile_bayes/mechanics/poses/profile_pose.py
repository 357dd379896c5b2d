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
    One,
    Other,
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

__all__ = ["at_contact", "part_along", "pose_along", "pose_along_and_slopes", "pose_along_in_phase"]


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
    by_psi1, by_arclength = _begun(psi1), _lengthened(profile, psi1, arclength)
    here, one, other, last = _marched(profile, psi1, arclength, force, by_psi1, by_arclength, work)
    return here, _by_psi1(here, one, last, force), _by_arclength(here, psi1, other, last, force), _by_force(last)


@compiled
def pose_along_in_phase(
    profile: Profile, psi1: float, arclength: float, force: float, tip: bool, work: Floats
) -> tuple[Pose, Pose, Pose]:
    """Pose, and its derivatives by ψ1 in tip contact or by the arc length in tangential contact, and by the force."""
    if tip:
        here, one, _, last = _marched(profile, psi1, arclength, force, _begun(psi1), None, work)
        return here, _by_psi1(here, one, last, force), _by_force(last)
    by_arclength = _lengthened(profile, psi1, arclength)
    here, _, other, last = _marched(profile, psi1, arclength, force, None, by_arclength, work)
    return here, _by_arclength(here, psi1, other, last, force), _by_force(last)


@compiled
def _begun(psi1: float) -> Slope:
    """Derivative of the state at the contact by ψ1."""
    return Slope(1.0, 0.0, 0.0)


@compiled
def _lengthened(profile: Profile, psi1: float, arclength: float) -> Slope:
    """Derivative of the state there by the arc length: a longer rod passes its former contact unloaded."""
    curvature = rest_curvature_at(profile, cell_at(profile, arclength, BACKWARD), arclength)
    return Slope(-curvature, math.cos(psi1), math.sin(psi1))


@compiled
def _by_psi1(here: Pose, by: Slope, last: Slope, force: float) -> Pose:
    return Pose(by.u, here.u * by.psi - force * (by.u * last.psi - last.u * by.psi), by.psi - 1.0)


@compiled
def _by_arclength(here: Pose, psi1: float, by: Slope, last: Slope, force: float) -> Pose:
    return Pose(by.u, math.sin(psi1) + here.u * by.psi - force * (by.u * last.psi - last.u * by.psi), by.psi)


@compiled
def _by_force(last: Slope) -> Pose:
    return Pose(last.u, last.v, last.psi)


@compiled
def _marched(
    profile: Profile,
    psi1: float,
    arclength: float,
    force: float,
    by_psi1: One,
    by_arclength: Other,
    work: Floats,
) -> tuple[Pose, One, Other, Slope]:
    """Pose, and derivatives of the state by ψ1, arc length and force; None is left out."""
    state, at, steps, by_force = State(psi1, 0.0, 0.0, 0.0), arclength, 0, Slope(0.0, 0.0, 0.0)
    cell = cell_at(profile, at, BACKWARD)
    while at > 0.0 and steps < MOST_STEPS:
        length = at - profile.edges[cell]
        step = slope_series(profile, cell, at, length, force, state, by_psi1, by_arclength, by_force, work)
        state = moved(state, force, step, step.share, work)
        by_psi1, by_arclength, by_force = slopes_moved(step, by_psi1, by_arclength, work)
        at -= step.share * length
        if step.share == 1.0:
            at = profile.edges[cell]
            cell -= 1
        else:
            steps += 1
    u, v = (math.nan, math.nan) if at > 0.0 else (state.u, state.v)
    return Pose(u, v, state.psi - psi1), by_psi1, by_arclength, by_force
