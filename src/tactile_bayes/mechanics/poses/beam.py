"""A rod as the forward model sees it: its pose under a force, and its shape at rest.

Uniform rods of constant rest curvature have closed forms (`pose`); all others are integrated (`taylor`). Functions are
compiled for each of the two kinds (`by_kind`).

A rigid, straight stem may lie between pivot and rod. It continues the rod beyond its base, in the direction ψ0 that the
rod has there, so that with its length h

    u → u + h cos ψ0,    v → v + h sin ψ0,

and the turn is the same. The moment at the pivot is f u as before. Arc lengths begin where the rod does.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, Concatenate, NamedTuple, ParamSpec, TypeVar

from numpy import void
from numpy.typing import NDArray

from tactile_bayes.arrays import Floats
from tactile_bayes.mechanics.compiler import compiled, inlined
from tactile_bayes.mechanics.poses.pose import ACROSS, Chord, Pose, by_arclength, pose, pose_and_slopes
from tactile_bayes.mechanics.poses.profile_pose import (
    at_contact,
    part_along,
    pose_along_and_slopes,
    pose_along_in_phase,
)
from tactile_bayes.mechanics.poses.profile_shape import (
    AtRest,
    beyond_along,
    chord_at_rest,
    largest_bending_along,
    rest_along,
    room_at_rest,
    write_at_rest,
)
from tactile_bayes.mechanics.poses.sheet import is_far, pose_in, sheet
from tactile_bayes.mechanics.poses.taylor import (
    EXACT,
    FORWARD,
    ROUGH,
    March,
    State,
    cell_at,
    most_rest_curvature,
    rest_curvature_at,
    workspace,
)
from tactile_bayes.mechanics.rods.profile import Profile

PARTS = 8  # number of parts of a rod between which a second contact is sought in `loaded_part`


class Varied(NamedTuple):
    """Rest curvature and rigidity along a rod, and a workspace for its series."""

    profile: Profile
    work: Floats
    remainder: float  # of the series of poses: `EXACT` or `CLOSE`
    at_rest: AtRest  # of the rod that is not mirrored, with its stem
    sheet: NDArray[void]  # coefficients of its pose, from a table
    # Slenderness of the table; 0 if there are no coefficients, negative while friction acts in the other sense.
    slenderness: float
    sign: float  # sign of the rod to which these belong, and not to its mirror image


class Beam(NamedTuple):
    """A rod in the sweep frame."""

    curvature: float  # constant rest curvature [1/L]; 0 for rods with a profile
    reach: float  # distance from pivot to tip at rest [L]
    most_curvature: float  # upper bound of the rest curvature [1/L]
    varied: Varied | None  # properties along the rod; None for uniform rods of constant rest curvature
    stem: float  # length of the rigid piece between pivot and rod [L]


Rest = ParamSpec("Rest")
Result = TypeVar("Result")


def by_kind(
    function: Callable[Concatenate[Varied | None, Beam, Rest], Result],
) -> Callable[Concatenate[Beam, Rest], Result]:
    """Compile a function of `beam.varied`, the beam and more as one of the beam and more. numba leaves out what an `is
    None` excludes of an argument, and not of its field."""
    part: Any = inlined(function)

    def of_beam(beam: Beam, *rest: Any) -> Any:
        return part(beam.varied, beam, *rest)

    made: Any = compiled(of_beam)
    return made


def varied_of(profile: Profile | None, remainder: float = EXACT) -> Varied | None:
    """Profile with a workspace, if there is one."""
    return None if profile is None else varied(profile, remainder)


def varied(profile: Profile, remainder: float = EXACT) -> Varied:
    """Profile with a workspace, and without coefficients of a table."""
    return Varied(profile, workspace(), remainder, room_at_rest(profile.edges.size), sheet(), 0.0, 1.0)


@compiled
def mirrored_by(curvature: float, varied: Varied | None, stem: float) -> Beam:
    """Rod of a contact, as in `Rods`."""
    if varied is None:
        return Beam(curvature, 1.0, curvature, varied, stem)
    return Beam(0.0, 1.0, math.inf, with_sign(varied, curvature), stem)


@compiled
def beam_of(curvature: float, varied: Varied | None, stem: float) -> Beam:
    """Uniform rod whose rest shape is an arc of length one, or a rod whose properties vary along it, on a stem."""
    if varied is None:
        along, across = end_of_arc(curvature, 1.0)
        return Beam(curvature, math.hypot(stem + along, across), curvature, varied, stem)
    write_at_rest(with_sign(varied, 1.0).profile, stem, varied.work, varied.at_rest)
    reach = rest_along(varied.profile, stem, 1.0, varied.work).distance
    return Beam(0.0, reach, most_rest_curvature(varied.profile), varied, stem)


@by_kind
def mirrored_beam(varied: Varied | None, beam: Beam) -> Beam:
    """Rod in the frame of the opposite sweep."""
    if varied is None:
        return Beam(-beam.curvature, beam.reach, math.inf, varied, beam.stem)
    turned = with_sign(varied, -varied.profile.sign)
    return Beam(0.0, beam.reach, math.inf, turned, beam.stem)


@compiled
def with_sign(varied: Varied, sign: float) -> Varied:
    """Rod of a sweep: 1 for a forward one, −1 for the mirrored rod of a backward one."""
    profile, work, remainder, at_rest, own, slenderness, own_sign = varied
    edges, curvature, rigidity, taper, bend, _, modes, shape = profile
    turned = Profile(edges, curvature, rigidity, taper, bend, sign, modes, shape)
    return Varied(turned, work, remainder, at_rest, own, slenderness, own_sign)


@by_kind
def rubbed_otherwise(varied: Varied | None, beam: Beam) -> Beam:
    """Rod under friction of the other sense: coefficients hold for one angle of friction."""
    if varied is None:
        return beam
    profile, work, remainder, at_rest, own, slenderness, sign = varied
    rubbed = Varied(profile, work, remainder, at_rest, own, -slenderness, sign)
    return Beam(beam.curvature, beam.reach, beam.most_curvature, rubbed, beam.stem)


@by_kind
def beam_pose(
    varied: Varied | None, beam: Beam, psi1: float, arclength: float, force: float, tip: bool
) -> tuple[Pose, Pose, Pose]:
    """Pose, and its derivatives by ψ1 in tip contact or by the arc length in tangential contact, and by the force."""
    here, by_q, by_force = _pose(varied, beam.curvature, psi1, arclength, force, tip)
    return _on_stem(beam.stem, psi1, tip, here, by_q, by_force)


@by_kind
def tip_pose(varied: Varied | None, beam: Beam, psi1: float, force: float) -> tuple[Pose, Pose, Pose]:
    """Pose in tip contact without a table, and its derivatives by ψ1 and the force."""
    if varied is None:
        here, by_psi1, by_force = pose_and_slopes(psi1, 1.0, force, beam.curvature, bool(1))
    else:
        here, by_psi1, by_force = pose_along_in_phase(
            varied.profile, psi1, 1.0, force, bool(1), varied.work, varied.remainder
        )
    return _on_stem(beam.stem, psi1, bool(1), here, by_psi1, by_force)


@inlined
def _on_stem(stem: float, psi1: float, tip: bool, here: Pose, by_q: Pose, by_force: Pose) -> tuple[Pose, Pose, Pose]:
    """Pose and derivatives as seen from the pivot, from those as seen from where the rod begins."""
    if stem == 0.0:
        return here, by_q, by_force
    psi0 = psi1 + here.turn
    by_psi0 = by_q.turn + 1.0 if tip else by_q.turn
    return (
        _with_stem(stem, psi0, here),
        _moved_by_stem(stem, psi0, by_q, by_psi0),
        _moved_by_stem(stem, psi0, by_force, by_force.turn),
    )


@inlined
def _pose(
    varied: Varied | None, curvature: float, psi1: float, arclength: float, force: float, tip: bool
) -> tuple[Pose, Pose, Pose]:
    if varied is None:
        return pose_and_slopes(psi1, arclength, force, curvature, tip)
    # The coefficients are those of the rod itself and not of its mirror image.
    if varied.slenderness > 0.0 and varied.sign == varied.profile.sign:
        inside, here, by_q, by_force = pose_in(
            varied.sheet, varied.slenderness, varied.profile.taper, psi1, arclength, force, tip
        )
        if inside:
            return here, by_q, by_force
    return pose_along_in_phase(varied.profile, psi1, arclength, force, tip, varied.work, varied.remainder)


class WholePose(NamedTuple):
    """Pose, and its derivatives by all its variables; NaN where there is none."""

    here: Pose
    by_psi1: Pose
    by_arclength: Pose
    by_force: Pose


@by_kind
def whole_pose(varied: Varied | None, beam: Beam, psi1: float, arclength: float, force: float) -> WholePose:
    """Pose and derivatives without a table; see `beam_pose`."""
    if varied is None:
        here, by_psi1, by_force = pose_and_slopes(psi1, arclength, force, beam.curvature, True)
        longer = by_arclength(psi1, force, beam.curvature, here)
    else:
        here, by_psi1, longer, by_force = pose_along_and_slopes(
            varied.profile, psi1, arclength, force, varied.work, varied.remainder
        )
    if beam.stem == 0.0:
        return WholePose(here, by_psi1, longer, by_force)
    psi0, h = psi1 + here.turn, beam.stem
    return WholePose(
        _with_stem(h, psi0, here),
        _moved_by_stem(h, psi0, by_psi1, 1.0 + by_psi1.turn),
        _moved_by_stem(h, psi0, longer, longer.turn),
        _moved_by_stem(h, psi0, by_force, by_force.turn),
    )


@compiled
def _with_stem(stem: float, psi0: float, here: Pose) -> Pose:
    """Pose as seen from the pivot, from that seen from where the rod begins."""
    return Pose(here.u + stem * math.cos(psi0), here.v + stem * math.sin(psi0), here.turn)


@compiled
def _moved_by_stem(stem: float, psi0: float, by: Pose, by_psi0: float) -> Pose:
    """Derivative of such a pose, from that without the stem and that of ψ0."""
    return Pose(by.u - stem * math.sin(psi0) * by_psi0, by.v + stem * math.cos(psi0) * by_psi0, by.turn)


@compiled
def lever_of_stem(stem: float, drive_angle: float, force_x: float, force_y: float) -> float:
    """Moment of the contact force about the pivot less that about the beginning of the rod, from the reaction."""
    return stem * (force_y * math.cos(drive_angle) - force_x * math.sin(drive_angle))


@by_kind
def is_far_from_table(varied: Varied | None, beam: Beam, arclength: float, force: float) -> bool:
    """True if a force is far beyond those of a table: the search for an equilibrium has gone astray."""
    if varied is None:
        return False
    return varied.slenderness > 0.0 and is_far(varied.slenderness, varied.profile.taper, arclength, force)


@by_kind
def chord_to(varied: Varied | None, beam: Beam, distance: float) -> Chord:
    """Chord of the rod at rest to its first point at a distance from the pivot."""
    if varied is not None:
        found = chord_at_rest(varied.profile, beam.stem, distance, varied.at_rest, varied.work)
        return _to_chord(found.arclength, found.bearing, found.slope, found.curvature, distance)
    if beam.stem == 0.0:
        return _chord(beam.curvature, distance)
    return _chord_over_stem(beam, distance)


@inlined
def _chord(curvature: float, distance: float) -> Chord:
    """Chord of an arc."""
    sine = min(max(0.5 * curvature * distance, -1.0), 1.0)
    angle, cos = math.asin(sine), math.sqrt((1.0 - sine) * (1.0 + sine))
    arclength = distance if curvature == 0.0 else 2.0 * angle / curvature
    return Chord(arclength, angle, angle, 0.5 * curvature / cos if cos > ACROSS else 0.0)


@compiled
def _chord_over_stem(beam: Beam, distance: float) -> Chord:
    """Chord of an arc that begins at a distance from the pivot.

    Let c be the chord from where it begins, at an angle w with sin w = κ0 c/2: then r² = h² + 2 h c cos w + c², a
    quadratic equation for c².
    """
    h, curvature = beam.stem, beam.curvature
    square = (distance - h) * (distance + h)
    root = math.sqrt(max(4.0 * distance * distance - curvature * curvature * square * square, 0.0))
    c = square / math.sqrt(square + h * (2.0 * h + root))
    own = _chord(curvature, c)
    bearing = math.atan2(c * math.sin(own.at_base), h + c * math.cos(own.at_base))
    return _to_chord(own.arclength, bearing, own.at_base + own.at_point, curvature, distance)


@compiled
def _to_chord(arclength: float, bearing: float, slope: float, curvature: float, distance: float) -> Chord:
    """Chord to a point of given bearing, slope and curvature."""
    at_point = slope - bearing
    cos = math.cos(at_point)
    rate = (curvature - math.sin(at_point) / distance) / cos if cos > ACROSS else 0.0
    return Chord(arclength, bearing, at_point, rate)


@by_kind
def bending(
    varied: Varied | None,
    beam: Beam,
    drive_angle: float,
    moment: float,
    force_x: float,
    force_y: float,
    arclength: float,
) -> float:
    """Largest change of curvature between pivot and contact in a forward contact, times the diameter over that at the
    base [1/L]."""
    if beam.stem != 0.0:
        moment -= lever_of_stem(beam.stem, drive_angle, force_x, force_y)
    if varied is not None:
        return largest_bending_along(varied.profile, drive_angle, moment, force_x, force_y, arclength, varied.work)
    # It is extreme at the pivot, and where the rod lies across the force, if it does so.
    cos, sin = math.cos(drive_angle), math.sin(drive_angle)
    lever, across = force_x * cos + force_y * sin, force_y * cos - force_x * sin
    if across >= 0.0:
        return abs(moment)
    at_pivot = beam.curvature - moment
    before = at_pivot * at_pivot - 2.0 * (math.hypot(force_x, force_y) + lever)
    if at_pivot > 0.0 and before > 0.0:  # the curvature keeps its sign
        return max(abs(moment), beam.curvature - math.sqrt(before))
    bent = math.sqrt(at_pivot * at_pivot + 2.0 * (math.hypot(force_x, force_y) - lever))
    return max(abs(moment), beam.curvature + bent)


@by_kind
def rest_curvature(varied: Varied | None, beam: Beam, arclength: float) -> float:
    """Rest curvature at an arc length [1/L]."""
    if varied is None:
        return beam.curvature
    return rest_curvature_at(varied.profile, cell_at(varied.profile, arclength, FORWARD), arclength)


@compiled
def is_straight(beam: Beam) -> bool:
    """True if the rod at rest is known to be straight."""
    return beam.varied is None and beam.curvature == 0.0


@by_kind
def free_end(varied: Varied | None, beam: Beam, arclength: float) -> tuple[float, float]:
    """Tip of the free end beyond a contact, along the rod there and to its left [L]."""
    if varied is None:
        return end_of_arc(beam.curvature, 1.0 - arclength)
    return beyond_along(varied.profile, arclength, varied.work)


@compiled
def end_of_arc(curvature: float, length: float) -> tuple[float, float]:
    """End of an arc, along it at its beginning, and to its left [L]."""
    turn = 0.5 * curvature * length
    chord = length if turn == 0.0 else length * math.sin(turn) / turn
    return chord * math.cos(turn), chord * math.sin(turn)


@by_kind
def rest_point(varied: Varied | None, beam: Beam, way: float) -> tuple[float, float]:
    """Point of stem or rod at rest at a way along them from the pivot: along the stem, and to its left [L]."""
    if way <= beam.stem:
        return way, 0.0
    if varied is None:
        along, across = end_of_arc(beam.curvature, way - beam.stem)
        return beam.stem + along, across
    found = rest_along(varied.profile, beam.stem, way - beam.stem, varied.work)
    return found.distance * math.cos(found.bearing), found.distance * math.sin(found.bearing)


@by_kind
def from_tip(varied: Varied | None, beam: Beam, psi1: float) -> March:
    """Start of a walk along a rod in tip contact; see `loaded_part`."""
    if varied is None:
        return March(1.0, 0, State(psi1, 0.0, 0.0, 0.0), 0)
    return at_contact(varied.profile, psi1, 1.0)


@by_kind
def loaded_part(varied: Varied | None, beam: Beam, psi1: float, force: float, part: int, before: March) -> March:
    """End of one of the `PARTS` of a rod in tip contact, counted from the tip, as seen from there as in `pose`.

    The walk goes on from the end of the part before; where there are tables, roughly.
    """
    share = part / PARTS
    if varied is None:
        here = pose(psi1, share, force, beam.curvature)
        return March(1.0 - share, 0, State(psi1 + here.turn, 0.0, here.u, here.v), 0)
    remainder = ROUGH if varied.slenderness > 0.0 else varied.remainder
    return part_along(varied.profile, before, 1.0 - share, force, varied.work, remainder)
