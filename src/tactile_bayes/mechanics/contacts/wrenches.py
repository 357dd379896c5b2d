"""Step 1 for single states: contact → base wrench.

A straight, uniform rod is a piece of Euler's elastica that begins at a point of zero curvature, the contact (`arc`):
with ψ = φ − β it obeys κ' = f cos ψ and κ(s1) = 0 (equations 19, 20 and 27 of Merker et al. 2018, doi
10.1155/2018/1613945). A contact force of magnitude f acts on it along (sin β, −cos β), with β = α + δ for slope angle α
and friction angle δ. Other rods are found by `continuation`. Quantities are dimensionless and relative to the pivot;
contacts are forward ones.
"""

from __future__ import annotations

import math

from numpy import int8
from numpy.typing import NDArray

from tactile_bayes.arrays import Floats
from tactile_bayes.mechanics.compiler import cached, compiled
from tactile_bayes.mechanics.contacts.continuation import NOWHERE, ContactState, Start, continued_state, unloaded_arc
from tactile_bayes.mechanics.contacts.tables import MOST_FRICTION, Tables, Workspace, in_polar, prepare, series
from tactile_bayes.mechanics.phases import NONE, TANGENTIAL, TIP
from tactile_bayes.mechanics.poses.arc import Arc, chord_deficit, chord_deficit_rate, chord_direction_rate
from tactile_bayes.mechanics.poses.beam import Varied, mirrored_by
from tactile_bayes.mechanics.poses.chord import NO_ARC, tangential_arc, tip_arc
from tactile_bayes.mechanics.rods.profile import Profile

_BEYOND = 1e-12  # angle by which rounding may turn a chord beyond the line of force through the pivot [rad]


@compiled
def _tangential(x: float, y: float, alpha: float, delta: float, workspace: Workspace) -> tuple[float, Arc, Arc]:
    """Arc length of tangential contact, its arc, and the derivatives of the arc by the amplitude."""
    sin, cos = math.sin(alpha), math.cos(alpha)
    along, across = x * cos + y * sin, y * cos - x * sin
    angle, largest = math.atan2(across, along), 0.5 * math.pi + delta
    if not (across >= 0.0 and angle <= largest + _BEYOND and abs(alpha) <= 0.5 * math.pi):
        return math.nan, NO_ARC, NO_ARC
    angle = min(angle, largest)
    m = 0.5 * (1.0 + math.sin(delta))
    if delta <= MOST_FRICTION:
        guess = math.sqrt(max(angle * series(workspace, angle / largest), 0.0))
    else:
        guess = min(math.sqrt(3.0 * angle / math.sqrt(m * (1.0 - m))), math.pi)
    chi, arc, by_chi = tangential_arc(angle, m, guess)
    length = math.sqrt(x * x + y * y)
    if chi > 0.0:
        length *= arc.length / math.hypot(arc.length - arc.shortfall, arc.offset)
    return length, arc, by_chi


@compiled
def _tangential_state(
    x: float, y: float, alpha: float, delta: float, length: float, arc: Arc, by_chi: Arc
) -> ContactState:
    """State in tangential contact (Phase B)."""
    force = (arc.length / length) ** 2
    turning = by_chi.turn / chord_direction_rate(arc, by_chi) if arc.turn > 0.0 else 3.0
    beta = alpha + delta
    sin, cos = math.sin(beta), math.cos(beta)
    moment = force * (x * cos + y * sin)
    return ContactState(alpha + arc.turn, moment, -force * sin, force * cos, length, alpha, 1.0 - turning, 0.0)


@compiled
def _tip_state(x: float, y: float, alpha: float, delta: float, known: Tables, workspace: Workspace) -> ContactState:
    """State in tip contact (Phase A): distance and direction of the tip give amplitude and direction at the contact."""
    larger, smaller = max(abs(x), abs(y)), min(abs(x), abs(y))
    deficit2 = (1.0 - larger) * (1.0 + larger) - smaller * smaller
    if not deficit2 >= 0.0:
        return NOWHERE
    beta = alpha + delta
    sin, cos = math.sin(beta), math.cos(beta)
    u, v = x * cos + y * sin, y * cos - x * sin
    deficit, chord_angle = math.sqrt(deficit2), max(math.atan2(u, v), 0.0)
    angle, share, by_angle, by_share = in_polar(known, deficit, chord_angle, workspace)
    chi, epsilon1, arc, by_chi, by_psi1 = tip_arc(
        deficit, chord_angle, math.sqrt(max(angle * by_angle, 0.0)), share * by_share
    )
    by_slope, by_distance = math.nan, -math.inf
    if chi > 0.0:
        angle_x, angle_1 = chord_direction_rate(arc, by_chi), 1.0 + chord_direction_rate(arc, by_psi1)
        value = chord_deficit(arc)
        value_x, value_1 = chord_deficit_rate(arc, value, by_chi), chord_deficit_rate(arc, value, by_psi1)
        det = value_x * angle_1 - value_1 * angle_x
        by_slope = 1.0 - (value_x * (1.0 + by_psi1.turn) - value_1 * by_chi.turn) / det
        by_distance = -0.5 * (angle_1 * by_chi.turn - angle_x * (1.0 + by_psi1.turn)) / det / value
    force, tip_angle = arc.length * arc.length, beta + 0.5 * math.pi - epsilon1
    return ContactState(
        tip_angle + arc.turn, force * u, -force * sin, force * cos, 1.0, tip_angle, by_slope, by_distance
    )


@cached
def wrenches(columns: Floats, known: Tables, workspace: Workspace, phase: NDArray[int8], out: Floats) -> None:
    """Write states of straight rods (fields of `ContactState`, and the arc length of tangential contact), shape (n, 9).
    Contacts (contact point, slope angle, friction angle) are mirrored to forward ones, shape (n, 4). A phase is stored
    where it was `NONE`, for unknown."""
    prepared = math.nan
    for i in range(columns.shape[0]):
        x, y, alpha, delta = columns[i, 0], columns[i, 1], columns[i, 2], columns[i, 3]
        if delta != prepared:
            prepare(known, delta, workspace)
            prepared = delta
        out[i] = math.nan
        if phase[i] != TIP:
            length, arc, by_chi = _tangential(x, y, alpha, delta, workspace)
            out[i, 8] = length
            if phase[i] == TANGENTIAL or length <= 1.0:
                _store(_tangential_state(x, y, alpha, delta, length, arc, by_chi), out[i])
                phase[i] = TANGENTIAL
        if phase[i] == TIP or (phase[i] == NONE and out[i, 8] > 1.0):
            ending = _tip_state(x, y, alpha, delta, known, workspace)
            _store(ending, out[i])
            phase[i] = NONE if math.isnan(ending.arclength) else TIP


@cached
def continued_wrenches(
    varied: Varied | None,
    room: Profile | None,
    columns: Floats,
    known: Tables,
    workspace: Workspace,
    phase: NDArray[int8],
    out: Floats,
) -> None:
    """Write states of arcs, or of a rod with a profile, as `wrenches` does, by continuation. A fifth column is the rest
    curvature of an arc; with a profile −1 for the mirrored rod, else 1. The room is a profile of the same shape to be
    written to."""
    for i in range(columns.shape[0]):
        x, y, alpha, delta = columns[i, 0], columns[i, 1], columns[i, 2], columns[i, 3]
        beam = mirrored_by(columns[i, 4], varied, 0.0)
        sin, cos = math.sin(alpha + delta), math.cos(alpha + delta)
        u, v = x * cos + y * sin, y * cos - x * sin
        out[i] = math.nan
        if phase[i] != TIP:
            lying = continued_state(x, y, alpha, delta, beam, False, unloaded_arc(u, v, delta), room)
            out[i, 8] = lying.arclength
            if phase[i] == TANGENTIAL or lying.arclength <= 1.0:
                _store(lying, out[i])
                phase[i] = TANGENTIAL
                continue
        straight = _tip_state(x, y, alpha, delta, known, workspace)
        psi1 = straight.tip_angle - alpha - delta
        start = Start(0.0, psi1, math.hypot(straight.force_x, straight.force_y))
        ending = continued_state(x, y, alpha, delta, beam, True, start, room)
        if phase[i] == TIP or ending.tip_angle >= alpha:
            _store(ending, out[i])
        phase[i] = NONE if math.isnan(out[i, 4]) else TIP


@compiled
def _store(state: ContactState, out: Floats) -> None:
    for k in range(8):
        out[k] = state[k]
