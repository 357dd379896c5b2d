"""A rod as the forward model sees it: its pose under a force, and its shape at rest.

Uniform rods of constant rest curvature have closed forms (`pose`); all others are integrated (`taylor`). Functions are
compiled for each of the two: where an argument is None, numba leaves out what an `is None` excludes.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from tactile_bayes.arrays import Floats
from tactile_bayes.mechanics.compiler import compiled
from tactile_bayes.mechanics.forward_table import chord_in, pose_in, sheet
from tactile_bayes.mechanics.pose import Pose, by_arclength, pose, pose_and_slopes
from tactile_bayes.mechanics.profile import Profile
from tactile_bayes.mechanics.profile_pose import at_contact, part_along, pose_along_and_slopes
from tactile_bayes.mechanics.profile_shape import beyond_along, chord_along, largest_bending_along, rest_along
from tactile_bayes.mechanics.taylor import (
    FORWARD,
    March,
    State,
    cell_at,
    most_rest_curvature,
    rest_curvature_at,
    workspace,
)

__all__ = [
    "Beam",
    "Chord",
    "Varied",
    "beam_of",
    "beam_pose",
    "bending",
    "chord_to",
    "free_end",
    "from_tip",
    "integrated",
    "loaded_part",
    "mirrored_beam",
    "mirrored_by",
    "rest_curvature",
    "varied",
    "varied_of",
    "whole_pose",
    "with_sign",
]


_ACROSS = 1e-6
"""Cosine of the angle of a chord to the rod that counts as zero: the rod goes no farther from the pivot."""


class Varied(NamedTuple):
    """Rest curvature and rigidity along a rod, and a workspace for its series."""

    profile: Profile
    work: Floats
    sheet: Floats
    """Coefficients of its pose, from a table."""
    slenderness: float
    """That of the table; 0 if there are no coefficients."""
    sign: float
    """Sign of the rod to which these belong; the mirrored one has its shape at rest in them, and not its pose."""


class Beam(NamedTuple):
    """A rod in the sweep frame."""

    curvature: float
    """Constant rest curvature [1/L]; 0 for rods with a profile."""
    reach: float
    """Distance from pivot to tip at rest [L]."""
    most_curvature: float
    """Upper bound of the rest curvature [1/L]."""
    varied: Varied | None
    """Properties along the rod; None for uniform rods of constant rest curvature."""


class Chord(NamedTuple):
    """Line from the pivot to a point of the rod at rest."""

    arclength: float
    """Arc length of the point [L]."""
    at_base: float
    """Angle from the rod at the pivot to the chord [rad]."""
    at_point: float
    """Angle from the chord to the rod at the point [rad]."""
    rate: float
    """Derivative of `at_point` by the length of the chord."""


def varied_of(profile: Profile | None) -> Varied | None:
    """Profile with a workspace, if there is one."""
    return None if profile is None else varied(profile)


def varied(profile: Profile) -> Varied:
    """Profile with a workspace, and without coefficients of a table."""
    return Varied(profile, workspace(), sheet(), 0.0, 1.0)


@compiled
def mirrored_by(curvature: float, varied: Varied | None) -> Beam:
    """Rod of a contact, as in `Rods`."""
    if varied is None:
        return Beam(curvature, 1.0, curvature, varied)
    return Beam(0.0, 1.0, math.inf, with_sign(varied, curvature))


@compiled
def beam_of(curvature: float, varied: Varied | None) -> Beam:
    """Uniform rod whose rest shape is an arc of length one, or a rod whose properties vary along it."""
    if varied is None:
        half = 0.5 * curvature
        return Beam(curvature, 1.0 if half == 0.0 else math.sin(half) / half, curvature, varied)
    reach = rest_along(varied.profile, 1.0, varied.work).distance
    return Beam(0.0, reach, most_rest_curvature(varied.profile), varied)


@compiled
def mirrored_beam(beam: Beam) -> Beam:
    """Rod in the frame of the opposite sweep."""
    return Beam(-beam.curvature, beam.reach, math.inf, _mirrored(beam.varied))


@compiled
def _mirrored(varied: Varied | None) -> Varied | None:
    if varied is None:
        return varied
    return with_sign(varied, -varied.profile.sign)


@compiled
def with_sign(varied: Varied, sign: float) -> Varied:
    """Rod of a sweep: 1 for a forward one, −1 for the mirrored rod of a backward one."""
    edges, curvature, rigidity, taper, bend, _ = varied.profile
    profile = Profile(edges, curvature, rigidity, taper, bend, sign)
    return Varied(profile, varied.work, varied.sheet, varied.slenderness, varied.sign)


@compiled
def integrated(beam: Beam) -> Beam:
    """Rod without coefficients of a table, which hold for one angle of friction."""
    return Beam(beam.curvature, beam.reach, beam.most_curvature, _integrated(beam.varied))


@compiled
def _integrated(varied: Varied | None) -> Varied | None:
    if varied is None:
        return varied
    return Varied(varied.profile, varied.work, varied.sheet, 0.0, varied.sign)


@compiled
def beam_pose(beam: Beam, psi1: float, arclength: float, force: float, tip: bool) -> tuple[Pose, Pose, Pose]:
    """Pose, and its derivatives by ψ1 in tip contact or by the arc length in tangential contact, and by the force."""
    return _pose(beam.varied, beam.curvature, psi1, arclength, force, tip)


@compiled
def _pose(
    varied: Varied | None,
    curvature: float,
    psi1: float,
    arclength: float,
    force: float,
    tip: bool,
) -> tuple[Pose, Pose, Pose]:
    if varied is None:
        return pose_and_slopes(psi1, arclength, force, curvature, tip)
    if varied.slenderness > 0.0 and varied.sign == varied.profile.sign:
        inside, here, by_q, by_force = pose_in(
            varied.sheet, varied.slenderness, varied.profile.taper, psi1, arclength, force, tip
        )
        if inside:
            return here, by_q, by_force
    here, by_psi1, by_arclength, by_force = pose_along_and_slopes(varied.profile, psi1, arclength, force, varied.work)
    return here, by_psi1 if tip else by_arclength, by_force


@compiled
def whole_pose(beam: Beam, psi1: float, arclength: float, force: float) -> tuple[Pose, Pose, Pose, Pose]:
    """Pose, and its derivatives by ψ1, by the arc length and by the force."""
    return _whole_pose(beam.varied, beam.curvature, psi1, arclength, force)


@compiled
def _whole_pose(
    varied: Varied | None, curvature: float, psi1: float, arclength: float, force: float
) -> tuple[Pose, Pose, Pose, Pose]:
    if varied is None:
        here, by_psi1, by_force = pose_and_slopes(psi1, arclength, force, curvature, True)
        return here, by_psi1, by_arclength(psi1, force, curvature, here), by_force
    return pose_along_and_slopes(varied.profile, psi1, arclength, force, varied.work)


@compiled
def chord_to(beam: Beam, distance: float) -> Chord:
    """Chord of the rod at rest to its first point at a distance from the pivot."""
    return _chord(beam.varied, beam.curvature, beam.reach, distance)


@compiled
def _chord(varied: Varied | None, curvature: float, reach: float, distance: float) -> Chord:
    if varied is None:
        sine = min(max(0.5 * curvature * distance, -1.0), 1.0)
        angle, cos = math.asin(sine), math.sqrt((1.0 - sine) * (1.0 + sine))
        arclength = distance if curvature == 0.0 else 2.0 * angle / curvature
        return Chord(arclength, angle, angle, 0.5 * curvature / cos if cos > _ACROSS else 0.0)
    if varied.slenderness > 0.0:
        in_table = chord_in(varied.sheet, varied.sign != varied.profile.sign, reach, distance)
        return Chord(in_table.arclength, in_table.at_base, in_table.at_point, in_table.rate)
    found = chord_along(varied.profile, distance, varied.work)
    at_point = found.slope - found.bearing
    cos = math.cos(at_point)
    rate = (found.curvature - math.sin(at_point) / distance) / cos if cos > _ACROSS else 0.0
    return Chord(found.arclength, found.bearing, at_point, rate)


@compiled
def bending(beam: Beam, drive_angle: float, moment: float, force_x: float, force_y: float, arclength: float) -> float:
    """Largest change of curvature between pivot and contact in a forward contact, times the diameter over that at the
    base [1/L]."""
    return _bending(beam.varied, beam.curvature, drive_angle, moment, force_x, force_y, arclength)


@compiled
def _bending(
    varied: Varied | None,
    curvature: float,
    drive_angle: float,
    moment: float,
    force_x: float,
    force_y: float,
    arclength: float,
) -> float:
    if varied is None:
        # It is extreme at the pivot, and where the rod lies across the force, if it does so.
        cos, sin = math.cos(drive_angle), math.sin(drive_angle)
        lever, across = force_x * cos + force_y * sin, force_y * cos - force_x * sin
        if across >= 0.0:
            return abs(moment)
        at_pivot = curvature - moment
        before = at_pivot * at_pivot - 2.0 * (math.hypot(force_x, force_y) + lever)
        if at_pivot > 0.0 and before > 0.0:  # the curvature keeps its sign
            return max(abs(moment), curvature - math.sqrt(before))
        bent = math.sqrt(at_pivot * at_pivot + 2.0 * (math.hypot(force_x, force_y) - lever))
        return max(abs(moment), curvature + bent)
    return largest_bending_along(varied.profile, drive_angle, moment, force_x, force_y, arclength, varied.work)


@compiled
def rest_curvature(beam: Beam, arclength: float) -> float:
    """Rest curvature at an arc length [1/L]."""
    return _rest_curvature(beam.varied, beam.curvature, arclength)


@compiled
def _rest_curvature(varied: Varied | None, curvature: float, arclength: float) -> float:
    if varied is None:
        return curvature
    return rest_curvature_at(varied.profile, cell_at(varied.profile, arclength, FORWARD), arclength)


@compiled
def free_end(beam: Beam, arclength: float) -> tuple[float, float]:
    """Tip of the free end beyond a contact, along the rod there and to its left [L]."""
    return _free_end(beam.varied, beam.curvature, arclength)


@compiled
def _free_end(varied: Varied | None, curvature: float, arclength: float) -> tuple[float, float]:
    if varied is None:
        length = 1.0 - arclength
        turn = 0.5 * curvature * length
        chord = length if turn == 0.0 else length * math.sin(turn) / turn
        return chord * math.cos(turn), chord * math.sin(turn)
    return beyond_along(varied.profile, arclength, varied.work)


@compiled
def from_tip(beam: Beam, psi1: float) -> March:
    """Start of a walk along a rod in tip contact; see `loaded_part`."""
    return _from_tip(beam.varied, psi1)


@compiled
def _from_tip(varied: Varied | None, psi1: float) -> March:
    if varied is None:
        return March(1.0, 0, State(psi1, 0.0, 0.0, 0.0), 0)
    return at_contact(varied.profile, psi1, 1.0)


@compiled
def loaded_part(beam: Beam, psi1: float, force: float, share: float, before: March) -> March:
    """Point of a rod in tip contact, at a share of the arc length from the tip, as seen from there as in `pose`.

    The walk goes on from a point nearer the tip.
    """
    return _loaded_part(beam.varied, beam.curvature, psi1, force, share, before)


@compiled
def _loaded_part(
    varied: Varied | None, curvature: float, psi1: float, force: float, share: float, before: March
) -> March:
    if varied is None:
        here = pose(psi1, share, force, curvature)
        return March(1.0 - share, 0, State(psi1 + here.turn, 0.0, here.u, here.v), 0)
    return part_along(varied.profile, before, 1.0 - share, force, varied.work)
