"""First contact: whether and where a rod in its rest shape touches the contour, and the state there, in which a branch
begins."""

from __future__ import annotations

import math
from enum import IntEnum
from typing import NamedTuple

from tactile_bayes.arrays import Floats
from tactile_bayes.mechanics.branches.equilibrium import SETTLED, Balance, balance, nowhere, settle, unloaded
from tactile_bayes.mechanics.branches.leg import HARDLY
from tactile_bayes.mechanics.branches.line import Line, line_of, pivots, pose_at
from tactile_bayes.mechanics.branches.outline import (
    Outline,
    Place,
    bearing,
    beside,
    ends,
    frame,
    from_base,
    mirrored,
    narrower,
    place,
)
from tactile_bayes.mechanics.branches.phase import contact_at, slip, stuck, tip_touches, touching
from tactile_bayes.mechanics.branches.scene import (
    BY_FORCE,
    NO_FORCE,
    Equilibrium,
    Scene,
    in_phase,
    on_line,
    with_friction,
)
from tactile_bayes.mechanics.compiler import compiled
from tactile_bayes.mechanics.newton import golden, newton_step
from tactile_bayes.mechanics.phases import TANGENTIAL, TIP
from tactile_bayes.mechanics.poses.beam import Beam, chord_to, mirrored_beam
from tactile_bayes.mechanics.poses.pose import Chord
from tactile_bayes.mechanics.reachability import CLEARANCE, Reachability


class _Sought(IntEnum):
    """Function whose root is sought; it decreases away from the side of the pivot."""

    LEVER = 0  # lever arm of a force across the contour
    TURNED = 1  # angle of the contour's direction to the unloaded rod
    WITHIN = 2  # margin to the rod's reach


_TOUCHES, _TOO_FAR, _CUTS_PIVOT = int(Reachability.TOUCHES), int(Reachability.TOO_FAR), int(Reachability.CUTS_PIVOT)
_ENDS, _TOO_CLOSE, _RUNS_OUT = int(Reachability.ENDS), int(Reachability.TOO_CLOSE), int(Reachability.RUNS_OUT)
_BEGINS_INSIDE, _SLIPS_OFF = int(Reachability.BEGINS_INSIDE), int(Reachability.SLIPS_OFF)
_TOUCHES_TWICE, _HEAD_ON = int(Reachability.TOUCHES_TWICE), int(Reachability.HEAD_ON)
_CLEARANCE = CLEARANCE

# Largest number of corrections of a standoff. Each reduces the error to a share of the order of the cone's angle.
_MOST_MOVES = 50
_ROUNDING = 1e-14  # distance from the end of the rod's reach [L] that counts as zero
# Largest number of steps of the search between two looks, and its last step where a rod comes within reach and is past
# the object.
_MOST_HALVINGS, _LAST = 100, 1e-6
# Parts of a drive, and fewest of a line, between which a carried rod is looked at, and last step of searches there.
_LOOKS, _FEWEST_LOOKS, _COARSE = 8, 2, 1e-3
# Angle [rad] to which first contact of a carried rod is found; a search for the equilibrium there follows.
_CLOSE = 1e-3
# Number of steps of the search for the pose in which a rod reaches farthest into an object that it hardly reaches.
_DEEPEST = 20
_JUMP = 0.02  # angle [rad] by which a rod that comes within reach of an object is past it, and has not touched it
# Angle [rad] by which a tip that is found to touch first may lie along the contour all the same, if it is carried: as
# near as its first contact is found.
_NOT_TURNED = 1e-3
_HARDLY_SLIPS = 1e-5  # slip per travel whose sense errors of a table may decide, ten times these
# Travel [rad or L] on which the sense of a slip is decided that vanishes to first order, as that of straight rods does.
_SLIGHT = 1e-3
_RIGID = 1e-9  # travel per force [L³/EI] that rounding makes of none: a contact at 0.02 L from the base gives 3e-6


class Approach(NamedTuple):
    """First contact with an outline, as a parameter of the contour."""

    reach: int  # a `Reachability`
    distance: float  # least distance of contour and base [L]
    begin: float  # first contact
    tip_first: bool  # true if the tip touches first, and not a point before it
    ends: tuple[float, float]  # least and greatest parameter of the contour
    # Angle by which the rod would turn until it touches [rad]; out of reach, one and the distance that is missing.
    gap: float


class Beginning(NamedTuple):
    """First contact and the state there."""

    reach: int  # a `Reachability`
    near: Approach
    scene: Scene  # with the phase, the line of the drive, and the friction that the rod has there
    line: int
    state: Balance


@compiled
def _touch(outline: Outline, beam: Beam, p: float, tip: bool) -> tuple[Place, Chord]:
    """Point beside which the unloaded rod lies at a contact, and the chord to it."""
    at = place(outline, p)
    narrow = narrower(outline, at, 1.0)
    chord = chord_to(beam, math.hypot(narrow.x, narrow.y))
    if tip or outline.narrowing == 0.0:
        return narrow, chord
    for _ in range(_MOST_MOVES):
        before = chord.arclength
        narrow = narrower(outline, at, before)
        chord = chord_to(beam, math.hypot(narrow.x, narrow.y))
        if not abs(chord.arclength - before) > _ROUNDING:
            break
    return narrow, chord


@compiled
def _missing(outline: Outline, beam: Beam, what: _Sought, p: float) -> tuple[float, float]:
    """Function whose root is sought, and its derivative."""
    at = place(outline, p)
    if what == _Sought.LEVER:
        along, facing = frame(at)
        # What faces away from the base lies beyond the point upright over it.
        return (along, at.speed + facing * at.bend) if facing > 0.0 else (at.x, at.speed * at.cos)
    if what == _Sought.WITHIN:
        at = narrower(outline, at, 1.0)
        along = frame(at)[0]
        return beam.reach * beam.reach - at.x * at.x - at.y * at.y, -2.0 * along * at.speed
    # The angle between the line from the pivot and the contour's direction grows to the left as long as the contour
    # faces the pivot. It jumps below the pivot, where no contour is.
    at, chord = _touch(outline, beam, p, bool(0))
    along, facing = frame(at)
    distance = math.hypot(at.x, at.y)
    angle = bearing(at) - math.atan2(at.sin, at.cos) + chord.at_point - outline.half_angle
    return -angle, facing * at.speed / (distance * distance) + at.bend - chord.rate * along * at.speed / distance


@compiled
def _root(outline: Outline, beam: Beam, what: _Sought, positive: float, negative: float, last_step: float) -> float:
    """Root by Newton's method within a bracket, until a step is a given share of it."""
    p, before = 0.5 * (positive + negative), abs(negative - positive)
    settled = last_step * before
    for _ in range(100):
        value, slope = _missing(outline, beam, what, p)
        new, positive, negative, before = newton_step(p, value, slope, positive, negative, before)
        step = abs(new - p)
        p = new
        if not step > settled or value == 0.0:
            break
    return p


class _Nearest(NamedTuple):
    """The point of an outline that is nearest to the base of a rod, and the ends of the outline."""

    ends: tuple[float, float]
    p: float
    distance: float  # distance from the base [L]
    missing: float  # distance of the point beside which the tip lies, less the rod's reach [L]
    is_above: bool  # whether the base is outside of the object
    beyond_low: bool
    beyond_high: bool  # whether it would be beyond the least or the greatest parameter


@compiled
def _nearest(outline: Outline, beam: Beam, last_step: float) -> _Nearest:
    low, high = ends(outline)
    beyond_high = _missing(outline, beam, _Sought.LEVER, high)[0] <= 0.0
    beyond_low = _missing(outline, beam, _Sought.LEVER, low)[0] >= 0.0
    p = high if beyond_high else low
    if not (beyond_high or beyond_low):
        p = _root(outline, beam, _Sought.LEVER, high, low, last_step)
    at, tip = place(outline, p), beside(outline, p, 1.0)
    missing = math.hypot(tip.x, tip.y) - (beam.reach - _ROUNDING)
    return _Nearest((low, high), p, math.hypot(at.x, at.y), missing, frame(at)[1] > 0.0, beyond_low, beyond_high)


@compiled
def _is_out(outline: Outline, beam: Beam, p: float) -> bool:
    at = beside(outline, p, 1.0)
    return math.hypot(at.x, at.y) > beam.reach


@compiled
def _first(outline: Outline, beam: Beam, high: float, nearest: float, last_step: float) -> tuple[float, bool]:
    """Parameter of first contact, and whether the tip touches first."""
    tangent = _root(outline, beam, _Sought.TURNED, high, nearest, last_step)
    if _is_out(outline, beam, tangent):
        return _root(outline, beam, _Sought.WITHIN, nearest, tangent, last_step), True
    return tangent, False


@compiled
def _approach(outline: Outline, beam: Beam, last_step: float) -> Approach:
    """First contact of a rod; roots are found to a share of their brackets."""
    nearest = _nearest(outline, beam, last_step)
    begin, tip_first = _first(outline, beam, nearest.ends[1], nearest.p, last_step)
    open_end = frame(beside(outline, nearest.ends[1], 1.0))[1] > 0.0 and not _is_out(outline, beam, nearest.ends[1])
    reach = _TOUCHES
    if not nearest.is_above:
        reach = _RUNS_OUT if nearest.beyond_low and not nearest.beyond_high else _CUTS_PIVOT
    elif nearest.distance < beam.stem + _CLEARANCE:
        reach = _TOO_CLOSE
    elif nearest.missing >= 0.0:
        reach = _TOO_FAR
    elif nearest.beyond_high or open_end:
        reach = _ENDS
    return Approach(reach, nearest.distance, begin, tip_first, nearest.ends, math.nan)


@compiled
def clear_angle(outline: Outline, beam: Beam, last_step: float) -> float:
    """Drive angle beyond which an unloaded rod has passed the contour: first contact of the opposite sweep [rad]."""
    opposite, of_opposite = mirrored(outline), mirrored_beam(beam)
    near = _approach(opposite, of_opposite, last_step)
    at, chord = _touch(opposite, of_opposite, near.begin, near.tip_first)
    return math.pi - (math.atan2(at.y, at.x) - chord.at_base)


@compiled
def _look(outline: Outline, beam: Beam, line: Line, travel: float) -> Approach:
    """First contact of a rod if it turned from the pose of its base at a travel; `_ENDS` if that is the end of what is
    known."""
    pose = pose_at(line, travel)
    seen = from_base(outline, pose.x, pose.y)
    nearest = _nearest(seen, beam, _COARSE)
    high, begin, tip_first, reach, gap = nearest.ends[1], nearest.p, True, _TOUCHES, 1.0 + max(nearest.missing, 0.0)
    if not nearest.is_above:
        reach = _TOO_FAR if nearest.beyond_high or nearest.beyond_low else _CUTS_PIVOT
    elif nearest.distance < beam.stem + _CLEARANCE:
        reach, gap = _TOO_CLOSE, 0.0
    elif nearest.missing >= 0.0:
        reach = _TOO_FAR
    else:
        if not nearest.beyond_high and _missing(seen, beam, _Sought.TURNED, high)[0] > 0.0:
            begin, tip_first = _first(seen, beam, high, nearest.p, _COARSE)
        elif _is_out(seen, beam, high):
            begin = _root(seen, beam, _Sought.WITHIN, nearest.p, high, _COARSE)
        else:
            begin, tip_first, reach = high, False, _ENDS
        there, chord = _touch(seen, beam, begin, tip_first)
        gap = bearing(there) - chord.at_base - pose.angle
    return Approach(reach, nearest.distance, begin, tip_first, nearest.ends, gap)


@compiled
def _arrival_on(outline: Outline, beam: Beam, line: Line, way: float, is_first: bool) -> tuple[Approach, float]:
    """First contact on a line of a drive of some way, and its travel; NaN if there is none. The least gap between two
    looks is looked for where it may be less than none: if the least found is no larger than its changes from look to
    look."""
    looks = max(math.ceil(_LOOKS * (line.end - line.travel) / way), _FEWEST_LOOKS)
    size = (line.end - line.travel) / looks
    before, looked = line.travel, _look(outline, beam, line, line.travel)
    nearest, least, gap, change = before, math.inf, looked.gap, 0.0
    if gap <= 0.0 and (is_first or _is_blocked(looked)):
        return looked, before
    for k in range(1, looks + 1):
        travel = line.travel + k * size
        looked = _look(outline, beam, line, travel)
        if gap > 0.0 and looked.gap <= 0.0:
            found, at = _between(outline, beam, line, before, gap, travel, looked)
            if found.gap > -_JUMP or _is_blocked(found):
                return found, at
        elif gap > 0.0 and looked.gap < least:
            nearest, least = travel, looked.gap
        change = max(change, abs(looked.gap - gap))
        before, gap = travel, looked.gap
    if least > change:
        return looked, math.nan
    return _grazing(outline, beam, line, max(nearest - size, line.travel), min(nearest + size, line.end))


@compiled
def _is_blocked(found: Approach) -> bool:
    """True if the object is where the base is, or too close to it."""
    return found.reach == _CUTS_PIVOT or found.reach == _TOO_CLOSE


@compiled
def _grazing(outline: Outline, beam: Beam, line: Line, low: float, high: float) -> tuple[Approach, float]:
    """First contact about the least gap between two travels, and its travel; NaN if there is none."""
    looked = _look(outline, beam, line, high)
    for _ in range(_DEEPEST):
        left, right = golden(low, high)
        at_left, at_right = _look(outline, beam, line, left), _look(outline, beam, line, right)
        if min(at_left.gap, at_right.gap) <= 0.0:
            inside, looked = (left, at_left) if at_left.gap <= 0.0 else (right, at_right)
            found, at = _between(outline, beam, line, low, _look(outline, beam, line, low).gap, inside, looked)
            return found, at if found.gap > -_JUMP else math.nan
        if at_left.gap < at_right.gap:
            high = right
        else:
            low = left
    return looked, math.nan


@compiled
def _between(
    outline: Outline, beam: Beam, line: Line, clear: float, gap: float, inside: float, found: Approach
) -> tuple[Approach, float]:
    """First contact between two travels, at the second of which the unloaded rod would cut the object."""
    settled, at_inside = _LAST * (inside - clear), found.gap
    if _is_blocked(found):
        return found, inside
    for k in range(_MOST_HALVINGS):
        share = gap / (gap - at_inside)
        travel = clear + (inside - clear) * (share if k % 3 < 2 else 0.5)
        looked = _look(outline, beam, line, travel)
        if looked.gap <= 0.0:
            inside, at_inside, found = travel, looked.gap, looked
            gap *= 0.5 if k % 3 == 1 else 1.0
        else:
            clear, gap = travel, looked.gap
        if not inside - clear > settled or found.gap > -_CLOSE:
            break
    return found, inside


@compiled
def _arrival(outline: Outline, beam: Beam, lines: Floats) -> tuple[Approach, int, float]:
    """First contact of a rod that is carried along lines, the number of the line, and the travel. A first line that
    ends at no travel turns the rod into the pose in which the others begin, if it touches there."""
    least, way, first = math.inf, 0.0, int(lines[0, 7] == 0.0)
    for k in range(lines.shape[0]):
        if not math.isnan(lines[k, 7]):
            way = lines[k, 7]
    for k in range(first, lines.shape[0]):
        if math.isnan(lines[k, 0]):
            break
        line = line_of(lines, k)
        found, travel = _arrival_on(outline, beam, line, way, k == first)
        if math.isfinite(travel) or _is_blocked(found):
            reach, distance, begin, tip_first, limits, gap = found
            if k == first and travel == line.travel and not _is_blocked(found):
                if first == 1 and gap > lines[0, 6]:
                    return Approach(reach, distance, begin, tip_first, limits, 0.0), 0, gap
                reach = _BEGINS_INSIDE
            return Approach(reach, distance, begin, tip_first, limits, gap), k, travel
        least = min(least, found.distance)
    return Approach(_TOO_FAR, least, math.nan, True, (math.nan, math.nan), math.nan), 0, math.nan


@compiled
def beginning(scene: Scene, lines: Floats, first_step: float) -> Beginning:
    """Beginning of a branch, on the first line that leads to contact if the drive carries the base."""
    near, scene, line, seen = _arrive(scene, lines, first_step)
    if near.reach != _TOUCHES:
        return Beginning(near.reach, near, scene, line, nowhere())
    reach, scene, state = _first_state(scene, lines, seen, near)
    contact = contact_at(scene, state.at)
    least = scene.outline.half_angle - (0.0 if pivots(lines) else _NOT_TURNED)
    if reach == _TOUCHES and tip_touches(scene.phase) and contact.psi1 + contact.friction_angle < least:
        reach = _TOUCHES_TWICE
    return Beginning(reach, near, scene, line, state)


@compiled
def _arrive(scene: Scene, lines: Floats, first_step: float) -> tuple[Approach, Scene, int, Outline]:
    """First contact, the scene with the line of the drive on which it lies, and the outline relative to the base."""
    if pivots(lines):
        return _approach(scene.outline, scene.beam, first_step), scene, 0, scene.outline
    (reach, distance, begin, tip_first, _, gap), k, travel = _arrival(scene.outline, scene.beam, lines)
    near = Approach(reach, distance, begin, tip_first, _ends_along(scene.outline, lines), gap)
    pose = pose_at(line_of(lines, k), travel)
    return near, on_line(scene, lines, k), k, from_base(scene.outline, pose.x, pose.y)


@compiled
def _ends_along(outline: Outline, lines: Floats) -> tuple[float, float]:
    """Least and greatest parameter of the contour that a rod may reach along lines of a drive."""
    low, high = math.inf, -math.inf
    for k in range(lines.shape[0]):
        if math.isnan(lines[k, 0]):
            break
        line = line_of(lines, k)
        for travel in (line.travel, line.end):
            pose = pose_at(line, travel)
            of_pose = ends(from_base(outline, pose.x, pose.y))
            low, high = min(low, of_pose[0]), max(high, of_pose[1])
    return low, high


@compiled
def _first_state(scene: Scene, lines: Floats, seen: Outline, near: Approach) -> tuple[int, Scene, Balance]:
    """State at first contact, with the friction that it has."""
    scene = in_phase(scene, touching(near.tip_first))
    begin = _unloaded(scene, lines, seen, near)
    if scene.phase == TANGENTIAL and not pivots(lines) and begin.at.q > 1.0:  # the approach is not exact
        near = Approach(near.reach, near.distance, near.begin, True, near.ends, near.gap)
        scene = in_phase(scene, TIP)
        begin = _unloaded(scene, lines, seen, near)
    # A rod that turns about a pivot slides inward unless it is curved toward the object.
    if scene.rig.friction_angle == 0.0 or (pivots(lines) and scene.beam.most_curvature <= 0.0):
        return _TOUCHES if pivots(lines) or _is_pushed(begin) else _SLIPS_OFF, scene, begin
    other = with_friction(scene, -scene.rig.friction_angle)
    at_other = _unloaded(other, lines, seen, near)
    held, at_held = _held(scene, begin)
    slides, slides_back, sticks = _opposes(scene, begin), _opposes(other, at_other), held.anchor.arclength > 0.0
    if slides + slides_back + sticks != 1:
        slips_off = not _is_pushed(begin) and not _is_pushed(at_other) and not _is_head_on(begin)
        return _SLIPS_OFF if slips_off else _HEAD_ON, scene, begin
    if sticks:
        return _TOUCHES, held, at_held
    return (_TOUCHES, scene, begin) if slides else (_TOUCHES, other, at_other)


@compiled
def _is_pushed(begin: Balance) -> bool:
    """True if the force grows from none with the travel."""
    return begin.rates.travel * begin.tangent.force > 0.0 and not _is_head_on(begin)


@compiled
def _is_head_on(begin: Balance) -> bool:
    """True if a straight rod is pushed along itself, so that it does not yield."""
    return abs(begin.rates.travel) < _RIGID * abs(begin.tangent.force)


@compiled
def _opposes(scene: Scene, begin: Balance) -> bool:
    """True if friction opposes the slip as the force grows from none."""
    slipping = slip(scene, begin.at, begin.tangent) / begin.rates.travel
    if abs(slipping) <= _HARDLY_SLIPS:
        at, tangent, size = begin.at, begin.tangent, _SLIGHT / begin.rates.travel
        force = size * tangent.force
        start = Equilibrium(at.p + size * tangent.p, at.q + size * tangent.q, force)
        later = settle(scene, start, NO_FORCE, BY_FORCE, force, SETTLED)
        slipping = slip(scene, later.at, later.tangent) / later.rates.travel
    return _is_pushed(begin) and math.copysign(1.0, scene.rig.friction_angle) * slipping <= 0.0


@compiled
def _held(scene: Scene, begin: Balance) -> tuple[Scene, Balance]:
    """First contact that sticks, anchored nowhere if it would not."""
    there, at = stuck(scene, begin.at)
    held = unloaded(there, Equilibrium(at.p, 0.0, 0.0), abs(HARDLY * begin.tangent.force / begin.rates.travel))
    if _is_pushed(held) and abs(held.at.q) < abs(scene.rig.friction_angle):
        _, _, moment, force_x, force_y, tangent, rates = held
        return there, Balance(held.at, begin.travel, moment, force_x, force_y, tangent, rates)
    return scene, begin


@compiled
def _unloaded(scene: Scene, lines: Floats, seen: Outline, near: Approach) -> Balance:
    """Equilibrium without force at first contact with an outline relative to the base."""
    at, chord = _touch(seen, scene.beam, near.begin, near.tip_first)
    q = chord.arclength
    if near.tip_first:
        q = bearing(at) + chord.at_point - math.atan2(at.sin, at.cos) - scene.rig.friction_angle
    start = Equilibrium(near.begin, q, 0.0)
    if pivots(lines):
        return balance(scene, start)[0]
    return settle(scene, start, NO_FORCE, BY_FORCE, 0.0, SETTLED)
