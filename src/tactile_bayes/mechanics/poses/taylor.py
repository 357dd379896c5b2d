"""Taylor series of a loaded rod along its arc length.

In the frame of the contact force f (`pose`) a rod of rest curvature κ0(s) and rigidity EI(s)/EI(0) = B(s) w⁴, with the
width w = 1 − t s of a taper t, obeys

    ψ' = ±κ0 + P/(B w⁴),    P' = f cos ψ,    u' = cos ψ,    v' = sin ψ

with + and P = M, the bending moment, from the pivot to the contact, and with − and P = −M from the contact to the
pivot. A cone is similar to its parts: with steps ds = w dx, the rate e of w' = −e w, and

    p = P/w³,    C = cos ψ/w²,    S = sin ψ/w²,    U = u/w³,    V = v/w³

its equations do not depend on the place, and their series need no products but those of a rod without a taper:

    ψ' = ±w κ0 + q, B q = p,    p' = 3 e p + f C,    C' = 2 e C − ψ' S,    S' = 2 e S + ψ' C,
    U' = 3 e U + C,    V' = 3 e V + S.

Where κ0 and B are polynomials of s, all coefficients about a point follow from one another. A step goes as far as the
last ones allow, and not beyond a cell of the profile. Derivatives by the state at the contact and by the force obey the
linearised equations, with products of C and S alone: from the contact, where P = f u,

    δψ' = δq, B δq = f δU + U δf,    δU' = 3 e δU − S δψ,    δV' = 3 e δV + C δψ.

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

_TERMS, _FEWER = 24, 18  # most terms of the series, and of those that need not be exact
# Size of the last terms of a slope [rad]: for rounding errors of a pose, for errors of some 1e-9, and for those with
# which a rod is followed roughly, to a part in a thousand.
EXACT, CLOSE, ROUGH = 1e-15, 1e-7, 1e-6
FORWARD, BACKWARD = 1.0, -1.0  # directions: from the pivot, and from the contact
FARTHEST = 4.0  # arc length up to which a rod is continued beyond its tip, as it is at its tip [L]
# Steps inside cells after which a march ends with NaN: the load is beyond all reason, as in some searches for
# equilibria.
_MOST_STEPS = 1000
_INVERSE = 1.0 / np.arange(1.0, _TERMS + 1.0)

_RATE, _SIN, _COS, _PSI, _U, _V, _BENDING, _PSI_Q, _U_Q, _BENDING_Q = range(10)
# Columns of a workspace: coefficients, and those of derivatives by ψ1 or arc length, and the force.
_PSI_F, _U_F, _V_F, _BENDING_F, _CURVATURE, _RIGIDITY, _POLYNOMIAL, _POWERS = range(10, 18)
STATES = _V + 1  # the first columns, from which states along a step follow


def workspace() -> Floats:
    """Return an array to write series to."""
    return np.zeros((_TERMS + 1, 18))


_MOST_NEWTON_STEPS = 100

_SETTLED = 1e-15  # last step of Newton's method to a level
_FLAT = 1e-9  # distance from a maximum that does not matter to the value there


class State(NamedTuple):
    """State of a rod at a point of it."""

    psi: float  # slope over the direction across the force [rad]
    load: float  # P
    u: float  # way from the start, across and against the force
    v: float


_NOWHERE = State(math.nan, math.nan, math.nan, math.nan)


class March(NamedTuple):
    """State of a rod, and where it is."""

    at: float  # arc length from the pivot [L]
    cell: int
    state: State
    steps: int  # steps so far that ended inside a cell


class Slopes(NamedTuple):
    """Derivatives of a state by ψ1 or the arc length of the contact, and by the force."""

    psi_q: float
    u_q: float
    psi_f: float
    u_f: float
    v_f: float


Followed = TypeVar("Followed", Slopes, None)  # derivatives, followed or left out


class Step(NamedTuple):
    """A stretch of the rod on which series converge, in x from 0 to `share`."""

    length: float  # arc length at x = 1 [L]
    share: float
    terms: int
    width: float  # width at its beginning
    fall: float  # logarithm of the width at x = 0 over that at x = 1
    span: float  # ∫ ds/w up to x = 1


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
def _along_step(work: Floats, column: int, count: int, fall: float, pace: float) -> int:
    """Write a polynomial of the share of the arc length of a step as a series in x, and return the number of its terms.
    That share g obeys g' = pace − fall · g, and so do its powers."""
    if count < 2 or fall == 0.0:
        return count
    for k in range(count):
        work[k, _POLYNOMIAL], work[k, _POWERS] = work[k, column], 0.0
    work[0, _POWERS] = 1.0
    for n in range(_TERMS):
        work[n, column] = 0.0
        for k in range(count):
            work[n, column] += work[k, _POLYNOMIAL] * work[k, _POWERS]
        for k in range(count - 1, 0, -1):
            work[k, _POWERS] = k * _INVERSE[n] * (pace * work[k - 1, _POWERS] - fall * work[k, _POWERS])
        work[0, _POWERS] = 0.0
    return _TERMS


@compiled
def _expand(
    profile: Profile, taper: float, march: March, direction: float, length: float, work: Floats
) -> tuple[Step, int, int, int]:
    """Write rest curvature times width and rigidity from a point on, and return the numbers of their terms, and the
    number from which on none is zero by chance."""
    cell, offset, step = march.cell, march.at - profile.edges[march.cell], direction * length
    beyond = cell == profile.edges.size - 1
    width, lost = 1.0 - taper * (1.0 if beyond else march.at), 0.0 if beyond else taper * step
    fall, pace = 0.0, 1.0
    if lost != 0.0:
        fall = -math.log1p(-lost / width)
        pace = fall * width / lost
    bent = _shift(profile.curvature, cell, offset, step, work, _CURVATURE)
    work[0, _CURVATURE] += profile.bend
    work[bent, _CURVATURE] = 0.0
    for k in range(bent, -1, -1):
        before = work[k - 1, _CURVATURE] if k > 0 else 0.0
        work[k, _CURVATURE] = direction * profile.sign * (width * work[k, _CURVATURE] - lost * before)
    bent += 1
    while bent > 0 and work[bent - 1, _CURVATURE] == 0.0:
        bent -= 1
    rigid = _shift(profile.rigidity, cell, offset, step, work, _RIGIDITY)
    least = max(bent, rigid, 3)
    bent = _along_step(work, _CURVATURE, bent, fall, pace)
    rigid = _along_step(work, _RIGIDITY, rigid, fall, pace)
    return Step(length, 1.0, _TERMS, width, fall, pace * length / width), bent, rigid, least


@compiled
def _divided(work: Floats, rigid: int, inverse: float, n: int, term: float, column: int) -> float:
    """Term of a quotient by the rigidity."""
    for k in range(1, min(n + 1, rigid)):
        term -= work[k, _RIGIDITY] * work[n - k, column]
    term *= inverse
    work[n, column] = term
    return term


@compiled
def _write_start(start: State, slopes: Slopes | None, width: float, work: Floats) -> None:
    """Write the first terms of series."""
    square, cube = 1.0 / (width * width), 1.0 / (width * width * width)
    work[0, _SIN], work[0, _COS], work[0, _PSI] = square * math.sin(start.psi), square * math.cos(start.psi), start.psi
    work[0, _U], work[0, _V] = cube * start.u, cube * start.v
    if slopes is not None:
        work[0, _PSI_Q], work[0, _U_Q], work[0, _PSI_F] = slopes.psi_q, cube * slopes.u_q, slopes.psi_f
        work[0, _U_F], work[0, _V_F] = cube * slopes.u_f, cube * slopes.v_f


@compiled
def series(
    profile: Profile,
    march: March,
    direction: float,
    length: float,
    force: float,
    work: Floats,
    remainder: float,
    slopes: Slopes | None,
) -> Step:
    """Write the series of a state from a point of a cell on, over at most a length, and those of its derivatives. These
    begin at the contact, where P = f u; None is left out."""
    is_loaded = force != 0.0 or march.state.load != 0.0 or slopes is not None
    taper = profile.taper if is_loaded else 0.0  # the shape at rest does not depend on it
    step, bent, rigid, least = _expand(profile, taper, march, direction, length, work)
    _write_start(march.state, slopes, step.width, work)
    inverse, width, span = 1.0 / work[0, _RIGIDITY], step.width, step.span
    square, twice, thrice = width * width, 2.0 * step.fall, 3.0 * step.fall
    cube = square * width
    most = _TERMS if remainder < CLOSE else _FEWER
    load, size, before = march.state.load / cube, 0.0, 0.0
    for n in range(most):
        share, at_sin, at_cos, u, v = _INVERSE[n], work[n, _SIN], work[n, _COS], work[n, _U], work[n, _V]
        bending = _divided(work, rigid, inverse, n, load, _BENDING)
        rate = span * (bending + work[n, _CURVATURE] if n < bent else bending)
        work[n, _RATE] = rate
        sin, cos, sin_q, sin_f, cos_f = 0.0, 0.0, 0.0, 0.0, 0.0
        for k in range(n + 1):
            j = n - k
            sin += work[k, _RATE] * work[j, _SIN]
            cos += work[k, _RATE] * work[j, _COS]
            if slopes is not None:
                sin_q += work[k, _SIN] * work[j, _PSI_Q]
                sin_f += work[k, _SIN] * work[j, _PSI_F]
                cos_f += work[k, _COS] * work[j, _PSI_F]
        work[n + 1, _PSI] = share * rate
        work[n + 1, _U], work[n + 1, _V] = share * (thrice * u + span * at_cos), share * (thrice * v + span * at_sin)
        work[n + 1, _SIN], work[n + 1, _COS] = share * (twice * at_sin + cos), share * (twice * at_cos - sin)
        load = share * (thrice * load + force * span * at_cos)
        if slopes is not None:
            u_q, u_f, v_f = work[n, _U_Q], work[n, _U_F], work[n, _V_F]
            bending_q = _divided(work, rigid, inverse, n, force * u_q, _BENDING_Q)
            bending = _divided(work, rigid, inverse, n, force * u_f + u, _BENDING_F)
            work[n + 1, _PSI_Q], work[n + 1, _PSI_F] = share * span * bending_q, share * span * bending
            work[n + 1, _U_Q] = share * (thrice * u_q - span * sin_q)
            work[n + 1, _U_F] = share * (thrice * u_f - span * sin_f)
            work[n + 1, _V_F] = share * (thrice * v_f + span * cos_f)
        # Of an unloaded rod too: its derivatives by the force are those of a loaded one.
        moved, turned = cube * max(abs(u), abs(v)), square * max(abs(at_sin), abs(at_cos))
        before, size = size, max(abs(rate), abs(span * bending), moved, turned)
        if n >= least and max(size, before) <= remainder:
            return Step(length, 1.0, n + 1, width, step.fall, span)
    size = max(size, before) / remainder
    share = min(1.0, size ** (-1.0 / (most - 1))) if size < math.inf else math.nan
    return Step(length, share, most, width, step.fall, span)


@compiled
def arclength_to(step: Step, x: float) -> float:
    """Arc length from the beginning of a step to a point of it."""
    return step.length * (math.expm1(-step.fall * x) / math.expm1(-step.fall) if step.fall != 0.0 else x)


@compiled
def point_at(step: Step, arclength: float) -> float:
    """Point x of a step at an arc length from its beginning."""
    share = arclength / step.length
    return -math.log1p(share * math.expm1(-step.fall)) / step.fall if step.fall != 0.0 else share


@compiled
def width_at(step: Step, x: float) -> float:
    """Width at a point of a step."""
    return step.width * math.exp(-step.fall * x) if step.fall != 0.0 else step.width


@compiled
def bending_at(step: Step, x: float, work: Floats) -> float:
    """Change of curvature at a point of a step, times the width."""
    bending = 0.0
    for n in range(step.terms - 1, -1, -1):
        bending = bending * x + work[n, _BENDING]
    return bending


@compiled
def moved(start: State, force: float, step: Step, x: float, work: Floats) -> State:
    """State at a point of a step."""
    psi, u, v, width = 0.0, 0.0, 0.0, width_at(step, x)
    for n in range(step.terms, -1, -1):
        psi, u, v = psi * x + work[n, _PSI], u * x + work[n, _U], v * x + work[n, _V]
    cube = width * width * width
    return State(psi, start.load + force * (cube * u - start.u), cube * u, cube * v)


@compiled
def _slopes_moved(step: Step, slopes: Followed, work: Floats) -> Followed:
    """Derivatives at the end of a step."""
    if slopes is None:
        return None
    x, psi_q, u_q, psi_f, u_f, v_f = step.share, 0.0, 0.0, 0.0, 0.0, 0.0
    for n in range(step.terms, -1, -1):
        psi_q, u_q = psi_q * x + work[n, _PSI_Q], u_q * x + work[n, _U_Q]
        psi_f, u_f, v_f = psi_f * x + work[n, _PSI_F], u_f * x + work[n, _U_F], v_f * x + work[n, _V_F]
    width = width_at(step, x)
    cube = width * width * width
    return Slopes(psi_q, cube * u_q, psi_f, cube * u_f, cube * v_f)


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
    slopes: Followed,
) -> tuple[Step, March, Followed]:
    """Write the series of a step toward an arc length, and return the step, its end, and the derivatives there. The end
    is NaN after too many steps."""
    beside = march.cell if direction < 0.0 else march.cell + 1
    edge = math.inf if beside == profile.edges.size else profile.edges[beside]
    end = max(edge, until) if direction < 0.0 else min(edge, until)
    length = direction * (end - march.at)
    step = series(profile, march, direction, length, force, work, remainder, slopes)
    state, slopes = moved(march.state, force, step, step.share, work), _slopes_moved(step, slopes, work)
    if step.share < 1.0:
        steps = march.steps + 1
        if steps == _MOST_STEPS:
            return step, March(math.nan, march.cell, _NOWHERE, steps), slopes
        at = march.at + direction * arclength_to(step, step.share)
        return step, March(at, march.cell, state, steps), slopes
    cell = march.cell if end != edge else march.cell + (-1 if direction < 0.0 else 1)
    return step, March(end, cell, state, march.steps), slopes


@compiled
def _value_and_slope(
    start: State, force: float, step: Step, sense: float, level: float, x: float, work: Floats
) -> tuple[float, float]:
    """The moment times its sense, 1 or −1, less the level; with a sense of 0 that of the squared distance."""
    at = moved(start, force, step, x, work)
    cos, sin, rate = math.cos(at.psi), math.sin(at.psi), step.span * width_at(step, x)
    if sense != 0.0:
        return sense * at.load - level, sense * force * rate * cos
    return at.u * at.u + at.v * at.v - level * level, 2.0 * rate * (at.u * cos + at.v * sin)


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
