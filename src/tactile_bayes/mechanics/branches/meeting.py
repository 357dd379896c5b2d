"""Meeting an event on a leg: how the leg is left, up to where the travel of the drive grows, how the path ends, and
where the branch goes on: in another phase, on another line, past a knot, or where it has left a dip."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from tactile_bayes.arrays import Floats
from tactile_bayes.mechanics.branches.advance import LONGEST, Here, LegStep, Setting
from tactile_bayes.mechanics.branches.crossings import (
    LOST,
    NOT_SLIPPING,
    change_of_mode,
    change_of_phase,
    end_of_line,
    first_fall,
    polished_fold,
    regained,
)
from tactile_bayes.mechanics.branches.equilibrium import (
    SETTLED,
    Balance,
    balance,
    nowhere,
    settle,
    settle_at_limit,
)
from tactile_bayes.mechanics.branches.leg import (
    NUDGE,
    LegSeries,
    guess,
    leg_from,
    sample_leg,
    settle_on,
    share_of,
    shortened,
)
from tactile_bayes.mechanics.branches.line import Line, is_before_record
from tactile_bayes.mechanics.branches.phase import (
    ROLLING,
    contact_at,
    slides,
    sliding_on,
    slip,
    stuck,
    tip_touches,
    touching,
    turned_over,
)
from tactile_bayes.mechanics.branches.scene import (
    BY_FORCE,
    NO_FORCE,
    Equilibrium,
    Scene,
    StuckContact,
    anchored,
    dot,
    in_phase,
    on_line,
    times,
    with_friction,
)
from tactile_bayes.mechanics.compiler import compiled, inlined
from tactile_bayes.mechanics.reachability import Reachability, SnapOff

# How a leg is left: the branch goes on smoothly, or there is a knot of the contour, a change of the phase between tip
# and rod, the end of a line of the drive, or sliding or sticking ends.
_SMOOTHLY, KNOT, _PHASE, _LINE, _MODE = range(5)
OPEN = -1  # in place of a `SnapOff` as long as the end of a path is not known
_NO_MOMENT = 1e-7  # holding moment [EI/L] that counts as zero: a hundred times the error of the loads of exact legs
# Force [EI/L²] at the end of a leg on which a release was found that is zero. There may be another state without force
# on the plane across its end.
_NO_LOAD = 1e-8
_NEVER, _FOLD, _CORNER, _THRUST, _RELEASE, _JUMP = (int(kind) for kind in SnapOff)
_RUNS_OUT = int(Reachability.RUNS_OUT)


# Slip per travel in the wrong sense of a contact that has stuck for less than that; and per length of a leg that begins
# where a contact has stuck for hardly more.
_HIDDEN, _UNCLEAR = 1e-4, 1e-6
_FAINT = 4e-3  # force [EI/L²] that rounding turns by 3e-6 rad where a rod that is as good as straight sticks
# Largest travel of a leg on a line of the drive, over the travel up to its end: a path of 40 lines takes half the
# Newton steps that it takes without.
_ROOM_PAST_LINE = 1.1


class Meeting(NamedTuple):
    """How a leg is left, and its part on which the travel of the drive grows before that."""

    kind: int
    share: float  # position on the leg at which it is left
    left: Balance
    # Position at which it ends growing: 0 if it falls from the beginning, −1 if the leg lies beyond a maximum.
    stop: float
    at: Balance
    is_maximum: bool  # whether the travel falls beyond it


@inlined
def meet(here: Here, step: LegStep, in_dip: bool, is_first: bool, work: LegSeries) -> Meeting:
    """How a leg is left, and its part before that on which the travel grows: none if the branch is in a dip."""
    scene = here.scene
    kind, share, left = _SMOOTHLY, 1.0, step.end
    change = change_of_phase(scene, work)
    if change <= 1.0:
        kind, left = _PHASE, settle_at_limit(scene, guess(work, change))
        share = min(max(share_of(step.leg, left), 0.0), 1.0)
    elif math.isfinite(step.knot):
        kind, left = KNOT, step.at_knot
    if in_dip:
        return Meeting(kind, share, left, -1.0, here.begin, False)
    way, at_mode = change_of_mode(scene, step.leg, share, work)
    if way <= share:
        kind, share, left = _MODE, way, at_mode
    stop = first_fall(is_first, work)
    over = end_of_line(scene.line, min(stop, share), work)
    if over <= 1.0:
        left = _ending(scene.line, settle_on(scene, step.leg, over, guess(work, over), SETTLED))
        kind, share, stop = _LINE, over, 2.0
    if stop <= 0.0:
        return Meeting(kind, share, left, stop, here.begin, True)
    if stop > share:
        return Meeting(kind, share, left, share, left, False)
    if work.accuracy.exact:
        stop = polished_fold(scene, step.leg, stop, work)
    at = settle_on(scene, step.leg, stop, guess(work, stop), SETTLED)
    return Meeting(kind, share, left, stop, at, True)


@compiled
def _ending(line: Line, found: Balance) -> Balance:
    """Equilibrium at the end of a line, to which it was found with rounding errors."""
    at, _, moment, force_x, force_y, tangent, rates = found
    return Balance(at, line.end, moment, force_x, force_y, tangent, rates)


@inlined
def fate_of(step: LegStep, met: Meeting) -> int:
    """How the path ends on a leg, a `SnapOff`, or `OPEN`."""
    if met.is_maximum:
        if abs(met.at.holding_moment) <= _NO_MOMENT:
            return _THRUST
        return _FOLD if met.stop > 0.0 else _CORNER
    is_free = step.is_released and step.end.at.force < _NO_LOAD
    return _RELEASE if is_free and met.kind == _SMOOTHLY else OPEN


@inlined
def go_on(here: Here, setting: Setting, step: LegStep, met: Meeting, event: Any, work: LegSeries) -> Here:
    """Where the branch goes on; NaN where it, the drive or the contour ends, or friction would not let it go on, which
    is written."""
    if event.snap_off > _NEVER:
        position, begin = _regained_at(here, step, met, event.snap_angle, work)
        if position == LOST:
            return _stopped(here)
        if position <= 1.0:
            event.snap_off = OPEN
            return Here(here.scene, here.line, begin, nowhere(), begin.tangent, here.longest)
    elif met.kind == KNOT and step.knot == setting.ends[0]:
        event.reach, event.snap_parameter = _RUNS_OUT, math.nan
    elif met.kind == _LINE and not _goes_on(setting.lines, here.line):
        event.snap_off = _NEVER
    if met.kind == _SMOOTHLY:
        scene = _rolled_on(here.scene, step.end.at)
        return Here(scene, here.line, step.end, step.before_end, step.end.tangent, here.longest)
    there = _behind(here, setting, step, met)
    if event.snap_off > _NEVER:
        return there
    if met.kind == _MODE and slides(here.scene.phase):
        # Before the record begins, loads are not asked for, and those of a contact that slides have no history.
        now, passes = there.begin, not work.accuracy.exact
        if now.at.force < _FAINT or (passes and is_before_record(there.scene.line, now.travel)):
            back = slid_back(there)
            passes = passes and is_before_record(there.scene.line, 2.0 * back.begin.travel - now.travel)
            is_hidden = now.at.force < _FAINT and is_brief(now, back.begin)
            if is_hidden or (passes and math.isfinite(back.begin.at.p)):
                return back
    is_held, there = in_mode(there, met.kind == _MODE)
    if not is_held and not slides(here.scene.phase):
        there = slid_back(here)
        is_held = is_brief(here.begin, there.begin)
    if not is_held:
        event.snap_off = _JUMP
        return _stopped(here)
    return there


@inlined
def _behind(here: Here, setting: Setting, step: LegStep, met: Meeting) -> Here:
    """Beginning of what follows a change of the phase, a knot, or the end of a line, in the same mode of friction."""
    if met.kind == _LINE:
        return _on_next_line(here, setting.lines, step, met)
    scene, begin, onward = here.scene, met.left, step.end.tangent
    if met.kind == _PHASE:
        scene, at, onward = turned_over(scene, begin.at)
        begin = balance(scene, at)[0]
    elif met.kind == KNOT:
        begin = nowhere() if step.knot == setting.ends[0] else _past(scene, step.at_knot, onward.p)
    return Here(_rolled_on(scene, begin.at), here.line, begin, nowhere(), onward, here.longest)


@compiled
def _rolled_on(scene: Scene, at: Equilibrium) -> Scene:
    """Scene of a rod that rolls, with its anchor where it has come to: the way from there is integrated anew."""
    if scene.phase != ROLLING:
        return scene
    contact = contact_at(scene, at)
    return anchored(scene, StuckContact(contact.p, contact.arclength))


@compiled
def in_mode(here: Here, changes: bool) -> tuple[bool, Here]:
    """Where a branch goes on sliding or sticking, and False if friction allows neither. `changes` says whether sliding
    or sticking has ended. Otherwise a contact that slides does so as long as friction opposes the slip, and one that
    sticks, sticks."""
    scene, line, begin, before, onward, longest = here
    delta, was_sliding = scene.rig.friction_angle, slides(scene.phase)
    if delta == 0.0 or not (changes or was_sliding) or not math.isfinite(begin.at.p):
        return True, here
    if was_sliding:
        along = leg_from(scene, begin, onward, 1.0).along
        ahead = _ahead(begin.at, along.p)  # at a knot, of the side that the contact goes to
        if not changes and math.copysign(1.0, delta) * slip(scene, ahead, along) <= NOT_SLIPPING:
            return True, here
        scene, at = stuck(scene, begin.at)
    else:
        scene, at = sliding_on(scene, begin.at)
    begin = balance(scene, at)[0]
    onward = times(math.copysign(1.0, begin.rates.travel), begin.tangent)
    there = Here(scene, line, begin, before, onward, longest)
    if was_sliding and changes:  # where the slip has vanished, the force leaves the edge of the cone to second order
        return True, there
    along, sense = leg_from(scene, begin, onward, 1.0).along, math.copysign(1.0, scene.rig.friction_angle)
    if was_sliding:
        return sense * along.q <= NOT_SLIPPING, there
    return sense * slip(scene, begin.at, along) <= _UNCLEAR, there


@inlined
def is_brief(stick: Balance, slip: Balance) -> bool:
    """Return True if a contact that sticks slips back, if at all, so soon that rounding may hide it."""
    return abs(slip.travel - stick.travel) < _HIDDEN


@compiled
def slid_back(here: Here) -> Here:
    """Where a contact slides back that would stick for so little travel that rounding hides it, for a rod that is as
    good as straight does not yield to a pull along it; NaN if it does not slide back. The force across the rod stays,
    to first order."""
    scene, line, begin, _, _, longest = here
    contact, delta = contact_at(scene, begin.at), scene.rig.friction_angle
    tip = tip_touches(scene.phase)
    scene = with_friction(in_phase(scene, touching(tip)), -delta)
    psi1 = contact.psi1 + contact.friction_angle + delta
    force = begin.at.force * math.cos(contact.psi1) / math.cos(psi1)
    at = Equilibrium(contact.p, psi1 if tip else contact.arclength, force)
    begin = settle(scene, at, NO_FORCE, BY_FORCE, force, SETTLED) if force > 0.0 else nowhere()
    onward = times(math.copysign(1.0, begin.rates.travel), begin.tangent)
    if math.copysign(1.0, delta) * slip(scene, begin.at, onward) < -_HIDDEN * abs(begin.rates.travel):
        begin = nowhere()
    return Here(scene, line, begin, nowhere(), onward, longest)


@inlined
def _stopped(here: Here) -> Here:
    return Here(here.scene, here.line, nowhere(), here.before, here.onward, here.longest)


@inlined
def _regained_at(here: Here, step: LegStep, met: Meeting, most: float, work: LegSeries) -> tuple[float, Balance]:
    """Position on a leg at which the travel exceeds its maximum again, as `regained`, and the equilibrium there."""
    scene, behind = here.scene, met.stop
    if step.end.at.force < 0.0:
        return LOST, here.begin
    if met.share < 1.0:
        sample_leg(scene, shortened(step.leg, met.share), here.begin, nowhere(), met.share, bool(0), work)
        behind = min(behind / met.share, 1.0)
    found = regained(behind, most, work)
    if not 0.0 <= found <= 1.0:
        return found, here.begin
    return found, settle_on(scene, step.leg, met.share * found, guess(work, found), SETTLED)


@inlined
def _on_next_line(here: Here, lines: Floats, step: LegStep, met: Meeting) -> Here:
    """Beginning of a leg on the next line of the drive; NaN after the last."""
    if not _goes_on(lines, here.line):
        return _stopped(here)
    line = here.line + 1
    scene = on_line(here.scene, lines, line)
    begin = settle(scene, met.left.at, met.left.at, step.leg.normal, 0.0, SETTLED)
    onward = times(math.copysign(1.0, begin.rates.travel), begin.tangent)
    longest = _length_on_line(scene, begin, onward) if _goes_on(lines, line) else LONGEST
    return Here(scene, line, begin, nowhere(), onward, longest)


@compiled
def _goes_on(lines: Floats, k: int) -> bool:
    """True if the drive continues after a line."""
    return k + 1 < lines.shape[0] and not math.isnan(lines[k + 1, 0])


@compiled
def _length_on_line(scene: Scene, begin: Balance, onward: Equilibrium) -> float:
    """Length of a leg up to somewhat beyond the end of the line of the drive, as far as its travel's rate tells."""
    leg = leg_from(scene, begin, onward, LONGEST)
    room = _ROOM_PAST_LINE * (scene.line.end - begin.travel)
    pace = begin.rates.travel / dot(leg.normal, begin.tangent)
    return LONGEST * room / pace if pace > room > 0.0 else LONGEST


@compiled
def _past(scene: Scene, at_knot: Balance, sense: float) -> Balance:
    """Equilibrium at a knot, with the tangent and the rates behind it."""
    at, travel, moment, force_x, force_y, _, _ = at_knot
    behind = balance(scene, _ahead(at, sense))[0]
    return Balance(at, travel, moment, force_x, force_y, behind.tangent, behind.rates)


@inlined
def _ahead(at: Equilibrium, sense: float) -> Equilibrium:
    """The same, with the contact beside where it is, on the side that it goes to."""
    return Equilibrium(at.p + math.copysign(NUDGE, sense), at.q, at.force)
