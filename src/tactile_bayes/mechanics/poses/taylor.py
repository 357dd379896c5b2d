"""Taylor series of a loaded rod along its arc length.

In the frame of the contact force f (`pose`) a rod of rest curvature κ0(s) and rigidity B(s) = EI(s)/EI(0) obeys

    ψ' = ±κ0 + P/B,    P' = f cos ψ,    u' = cos ψ,    v' = sin ψ

with + and P = M, the bending moment, from the pivot to the contact, and with − and P = −M from the contact to the
pivot. Where κ0 and B are polynomials, the coefficients of all series about a point follow from one another:

    q = P/B from B q = P,      cos ψ and sin ψ from (cos ψ)' = −ψ' sin ψ and (sin ψ)' = ψ' cos ψ.

A step goes as far as the last coefficients allow, and not beyond a cell of the profile. Derivatives by the state at the
contact and by the force obey the linearised equations, whose series need no other products than

    δψ' = δP/B,    δu' = −sin ψ δψ,    δv' = cos ψ δψ,    δP = f δu + u δf    (from the contact, where P = f u).

On a step the moment, or the distance from the pivot, may rise to a level: `rise`.
"""

from __future__ import annotations

import math
from typing import NamedTuple, TypeVar

import numpy as np

from tactile_bayes.arrays import Floats
from tactile_bayes.mechanics.compiler import compiled
from tactile_bayes.mechanics.newton import newton_step
from tactile_bayes.mechanics.rods.profile import MOST_MODES, Profile

__all__ = [
    "BACKWARD",
    "EXACT",
    "FARTHEST",
    "FORWARD",
    "ROUGH",
    "March",
    "Other",
    "Slope",
    "State",
    "Step",
    "advance",
    "begin",
    "cell_at",
    "most_rest_curvature",
    "moved",
    "peak",
    "rest_curvature_at",
    "rigidity_in",
    "rise",
    "slopes_moved",
    "workspace",
    "write_shape",
]

_TERMS = 24
"""Terms of the series."""

EXACT, ROUGH = 1e-15, 1e-6
"""Size of the last terms of a slope [rad], and that with which a rod is followed roughly, to a part in a thousand."""

FORWARD, BACKWARD = 1.0, -1.0
"""Directions: from the pivot, and from the contact."""

FARTHEST = 4.0
"""Arc length up to which a rod is continued beyond its tip, as it is at its tip [L]."""

_MOST_STEPS = 1000
"""Steps inside cells after which a march ends with NaN: the load is beyond all reason, as in some searches for
equilibria."""

_INVERSE = 1.0 / np.arange(1.0, _TERMS + 1.0)

_CURVATURE, _RIGIDITY, _QUOTIENT, _RATE, _SIN, _COS, _PSI, _U, _V = range(9)
_PSI_Q, _PSI_O, _PSI_F, _U_Q, _U_O, _U_F, _V_F, _QUOTIENT_Q, _QUOTIENT_O, _QUOTIENT_F = range(9, 19)
"""Columns of a workspace: coefficients, and those of derivatives by ψ1 or arc length, the other, and the force."""


def workspace() -> Floats:
    """Return an array to write series to."""
    return np.zeros((_TERMS + 1, 19))


_MOST_NEWTON_STEPS = 100

_SETTLED = 1e-15
"""Last step of Newton's method to a level."""

_FLAT = 1e-9
"""Distance from a maximum that does not matter to the value there."""


class State(NamedTuple):
    """State of a rod at a point of it."""

    psi: float
    """Slope over the direction across the force [rad]."""
    load: float
    """P."""
    u: float
    """Way from the start, across and against the force."""
    v: float


_NOWHERE = State(math.nan, math.nan, math.nan, math.nan)


class March(NamedTuple):
    """State of a rod, and where it is."""

    at: float
    """Arc length from the pivot [L]."""
    cell: int
    state: State
    steps: int
    """Steps so far that ended inside a cell."""


class Slope(NamedTuple):
    """Derivative of a state."""

    psi: float
    u: float
    v: float


Other = TypeVar("Other", Slope, None)
"""A derivative that is followed, or left out."""


class Step(NamedTuple):
    """A stretch of the rod on which series converge, in x from 0 to `share`."""

    length: float
    """Arc length at x = 1 [L]."""
    share: float
    terms: int
    rigid: int
    """Terms of the rigidity."""


@compiled
def cell_at(profile: Profile, arclength: float, direction: float) -> int:
    """Cell before or behind a point of the rod."""
    cell = profile.edges.size - 1
    while cell > 0 and (profile.edges[cell] > arclength or (direction < 0.0 and profile.edges[cell] == arclength)):
        cell -= 1
    return cell


@compiled
def write_shape(modes: Floats, amplitudes: Floats, shape: Floats, curvature: Floats) -> None:
    """Write amplitudes of modes, and the rest curvature with them."""
    for k in range(MOST_MODES):
        shape[k] = amplitudes[k]
    for i in range(curvature.shape[0]):
        for j in range(curvature.shape[1]):
            curvature[i, j] = modes[0, i, j]
            for k in range(1, modes.shape[0]):
                curvature[i, j] += shape[k - 1] * modes[k, i, j]


@compiled
def rest_curvature_at(profile: Profile, cell: int, arclength: float) -> float:
    """Rest curvature at a point of a cell."""
    value, offset = 0.0, arclength - profile.edges[cell]
    for k in range(profile.curvature.shape[1] - 1, -1, -1):
        value = value * offset + profile.curvature[cell, k]
    return profile.sign * (value + profile.bend)


@compiled
def most_rest_curvature(profile: Profile) -> float:
    """Upper bound of the rest curvature."""
    most = -math.inf
    for cell in range(profile.edges.size - 1):
        bound, power = profile.sign * (profile.curvature[cell, 0] + profile.bend), 1.0
        for k in range(1, profile.curvature.shape[1]):
            power *= profile.edges[cell + 1] - profile.edges[cell]
            bound += max(profile.sign * profile.curvature[cell, k], 0.0) * power
        most = max(most, bound)
    return most


@compiled
def _shift(rows: Floats, cell: int, offset: float, step: float, work: Floats, column: int) -> int:
    """Write a polynomial about a point of its cell, scaled, and return the number of its terms."""
    count = rows.shape[1]
    for k in range(count):
        work[k, column] = rows[cell, k]
    for i in range(count - 1):
        for k in range(count - 2, i - 1, -1):
            work[k, column] += offset * work[k + 1, column]
    power = 1.0
    for k in range(1, count):
        power *= step
        work[k, column] *= power
    return count


@compiled
def _expand(
    profile: Profile, cell: int, arclength: float, direction: float, length: float, work: Floats
) -> tuple[int, int]:
    """Write rest curvature and rigidity about a point, and return the numbers of terms."""
    offset, step = arclength - profile.edges[cell], direction * length
    bent = _shift(profile.curvature, cell, offset, step, work, _CURVATURE)
    work[0, _CURVATURE] += profile.bend
    for k in range(bent):
        work[k, _CURVATURE] *= direction * profile.sign
    rigid = _shift(profile.rigidity, cell, offset, step, work, _RIGIDITY)
    if profile.taper != 0.0:
        beyond = cell == profile.edges.size - 1
        width, rate = 1.0 - profile.taper * (1.0 if beyond else arclength), 0.0 if beyond else -profile.taper * step
        for _ in range(4):
            work[rigid, _RIGIDITY] = 0.0
            for k in range(rigid, 0, -1):
                work[k, _RIGIDITY] = width * work[k, _RIGIDITY] + rate * work[k - 1, _RIGIDITY]
            work[0, _RIGIDITY] *= width
            rigid += 1
    return bent, rigid


@compiled
def _divided(work: Floats, rigid: int, inverse: float, n: int, term: float, column: int) -> float:
    """Term of a quotient by the rigidity."""
    for k in range(1, min(n + 1, rigid)):
        term -= work[k, _RIGIDITY] * work[n - k, column]
    term *= inverse
    work[n, column] = term
    return term


@compiled
def _size(work: Floats, n: int, length: float, quotient: int) -> float:
    """Size of the terms of an order, of an unloaded rod too: its derivatives by the force are those of a loaded one."""
    return max(abs(work[n, _RATE]), abs(work[n, _SIN]), abs(work[n, _COS]), abs(length * work[n, quotient]))


@compiled
def _write_start(start: State, by_q: Slope | None, other: Slope | None, by_force: Slope | None, work: Floats) -> None:
    """Write the first terms of series."""
    work[0, _SIN], work[0, _COS], work[0, _PSI] = math.sin(start.psi), math.cos(start.psi), start.psi
    work[0, _U], work[0, _V] = start.u, start.v
    if by_q is not None:
        work[0, _PSI_Q], work[0, _U_Q] = by_q.psi, by_q.u
    if other is not None:
        work[0, _PSI_O], work[0, _U_O] = other.psi, other.u
    if by_force is not None:
        work[0, _PSI_F], work[0, _U_F], work[0, _V_F] = by_force.psi, by_force.u, by_force.v


@compiled
def series(
    profile: Profile,
    march: March,
    direction: float,
    length: float,
    force: float,
    work: Floats,
    remainder: float,
    by_q: Slope | None,
    other: Slope | None,
    by_force: Slope | None,
) -> Step:
    """Write the series of a state from a point of a cell on, over at most a length, and those of its derivatives.

    These begin at the contact, where P = f u; None is left out.
    """
    bent, rigid = _expand(profile, march.cell, march.at, direction, length, work)
    inverse, least, start = 1.0 / work[0, _RIGIDITY], max(bent, rigid, 3), march.state
    load, quotient, size, before = start.load, _QUOTIENT if by_force is None else _QUOTIENT_F, 0.0, 0.0
    _write_start(start, by_q, other, by_force, work)
    for n in range(_TERMS):
        rate = _divided(work, rigid, inverse, n, load, _QUOTIENT)
        if n < bent:
            rate += work[n, _CURVATURE]
        work[n, _RATE] = length * rate
        sin, cos, sin_q, sin_o, sin_f, cos_f = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
        for k in range(n + 1):
            j = n - k
            sin += work[k, _RATE] * work[j, _SIN]
            cos += work[k, _RATE] * work[j, _COS]
            if by_q is not None:
                sin_q += work[k, _SIN] * work[j, _PSI_Q]
            if other is not None:
                sin_o += work[k, _SIN] * work[j, _PSI_O]
            if by_force is not None:
                sin_f += work[k, _SIN] * work[j, _PSI_F]
                cos_f += work[k, _COS] * work[j, _PSI_F]
        share = _INVERSE[n]
        way = share * length
        work[n + 1, _PSI] = share * work[n, _RATE]
        work[n + 1, _U], work[n + 1, _V] = way * work[n, _COS], way * work[n, _SIN]
        work[n + 1, _SIN], work[n + 1, _COS] = share * cos, -share * sin
        load = force * work[n + 1, _U]
        if by_q is not None:
            rate_q = _divided(work, rigid, inverse, n, force * work[n, _U_Q], _QUOTIENT_Q)
            work[n + 1, _PSI_Q], work[n + 1, _U_Q] = way * rate_q, -way * sin_q
        if other is not None:
            rate_o = _divided(work, rigid, inverse, n, force * work[n, _U_O], _QUOTIENT_O)
            work[n + 1, _PSI_O], work[n + 1, _U_O] = way * rate_o, -way * sin_o
        if by_force is not None:
            rate_f = _divided(work, rigid, inverse, n, force * work[n, _U_F] + work[n, _U], _QUOTIENT_F)
            work[n + 1, _PSI_F], work[n + 1, _U_F], work[n + 1, _V_F] = way * rate_f, -way * sin_f, way * cos_f
        before, size = size, _size(work, n, length, quotient)
        if n >= least and max(size, before) <= remainder:
            return Step(length, 1.0, n + 1, rigid)
    size = max(size, before) / remainder
    return Step(length, min(1.0, size ** (-1.0 / (_TERMS - 1))) if size < math.inf else math.nan, _TERMS, rigid)


@compiled
def moved(start: State, force: float, step: Step, x: float, work: Floats) -> State:
    """State at a point of a step."""
    psi, u, v = 0.0, 0.0, 0.0
    for n in range(step.terms, 0, -1):
        psi = (psi + work[n, _PSI]) * x
        u = (u + work[n, _U]) * x
        v = (v + work[n, _V]) * x
    return State(start.psi + psi, start.load + force * u, start.u + u, start.v + v)


@compiled
def begin(profile: Profile, arclength: float, direction: float, state: State) -> March:
    """Start at a point of the rod."""
    return March(arclength, cell_at(profile, arclength, direction), state, 0)


@compiled
def advance(
    profile: Profile,
    march: March,
    direction: float,
    until: float,
    force: float,
    work: Floats,
    remainder: float,
    by_q: Slope | None = None,
    other: Slope | None = None,
    by_force: Slope | None = None,
) -> tuple[Step, March]:
    """Write the series of a step toward an arc length, and return the step and its end; NaN after too many steps."""
    beside = march.cell if direction < 0.0 else march.cell + 1
    edge = math.inf if beside == profile.edges.size else profile.edges[beside]
    end = max(edge, until) if direction < 0.0 else min(edge, until)
    length = direction * (end - march.at)
    step = series(profile, march, direction, length, force, work, remainder, by_q, other, by_force)
    state = moved(march.state, force, step, step.share, work)
    if step.share < 1.0:
        steps = march.steps + 1
        if steps == _MOST_STEPS:
            return step, March(math.nan, march.cell, _NOWHERE, steps)
        return step, March(march.at + direction * step.share * length, march.cell, state, steps)
    if end != edge:
        return step, March(end, march.cell, state, march.steps)
    return step, March(end, march.cell + (-1 if direction < 0.0 else 1), state, march.steps)


@compiled
def rigidity_in(step: Step, x: float, work: Floats) -> float:
    """Rigidity at a point of a step."""
    rigidity = 0.0
    for n in range(step.rigid - 1, -1, -1):
        rigidity = rigidity * x + work[n, _RIGIDITY]
    return rigidity


@compiled
def slopes_moved(step: Step, other: Other, work: Floats) -> tuple[Slope, Other, Slope]:
    """Derivatives at the end of a step, of v only that by the force; None is left out."""
    x, psi, u, psi_f, u_f, v_f = step.share, 0.0, 0.0, 0.0, 0.0, 0.0
    for n in range(step.terms, -1, -1):
        psi, u = psi * x + work[n, _PSI_Q], u * x + work[n, _U_Q]
        psi_f, u_f, v_f = psi_f * x + work[n, _PSI_F], u_f * x + work[n, _U_F], v_f * x + work[n, _V_F]
    return Slope(psi, u, 0.0), _other_moved(step, other, work), Slope(psi_f, u_f, v_f)


@compiled
def _other_moved(step: Step, other: Other, work: Floats) -> Other:
    if other is None:
        return None
    psi, u = 0.0, 0.0
    for n in range(step.terms, -1, -1):
        psi, u = psi * step.share + work[n, _PSI_O], u * step.share + work[n, _U_O]
    return Slope(psi, u, 0.0)


@compiled
def _value_and_slope(
    start: State, force: float, step: Step, sense: float, level: float, x: float, work: Floats
) -> tuple[float, float]:
    """The moment times its sense, 1 or −1, less the level; with a sense of 0 that of the squared distance."""
    at = moved(start, force, step, x, work)
    cos, sin = math.cos(at.psi), math.sin(at.psi)
    if sense != 0.0:
        return sense * at.load - level, sense * force * step.length * cos
    return at.u * at.u + at.v * at.v - level * level, 2.0 * step.length * (at.u * cos + at.v * sin)


@compiled
def peak(start: State, force: float, step: Step, sense: float, work: Floats) -> float:
    """Point of a step at which the moment times its sense, or the distance, is largest: its end, or a maximum."""
    low, high = 0.0, step.share
    if not (
        _value_and_slope(start, force, step, sense, 0.0, low, work)[1] > 0.0
        and _value_and_slope(start, force, step, sense, 0.0, high, work)[1] < 0.0
    ):
        return high
    while high - low > _FLAT:
        middle = 0.5 * (low + high)
        if _value_and_slope(start, force, step, sense, 0.0, middle, work)[1] > 0.0:
            low = middle
        else:
            high = middle
    return low


@compiled
def rise(start: State, force: float, step: Step, sense: float, level: float, work: Floats) -> float:
    """Point x of a step at which the moment times its sense, or the distance, rises to a level; NaN without one."""
    top = peak(start, force, step, sense, work)
    if not _value_and_slope(start, force, step, sense, level, top, work)[0] >= 0.0:
        return math.nan
    # Newton's method for a function that falls through zero.
    x, below, above, before = 0.5 * top, 0.0, top, top
    for _ in range(_MOST_NEWTON_STEPS):
        value, slope = _value_and_slope(start, force, step, sense, level, x, work)
        new, below, above, before = newton_step(x, -value, -slope, below, above, before)
        moved_by = abs(new - x)
        x = new
        if not moved_by > _SETTLED or value == 0.0:
            break
    return x
