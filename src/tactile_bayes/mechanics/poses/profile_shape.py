"""The shape of a rod of any rest curvature and rigidity: loaded, at rest, and where it is bent most.

Shapes begin where the rod does. At rest it lies in the frame of its base, whose direction is that of x; distances and
directions are from the pivot, which a rigid stem may keep away from the rod.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from tactile_bayes.arrays import Floats
from tactile_bayes.mechanics.compiler import compiled
from tactile_bayes.mechanics.poses.taylor import (
    EXACT,
    FARTHEST,
    FORWARD,
    ROUGH,
    STATES,
    March,
    State,
    Step,
    advance,
    arclength_to,
    begin,
    bending_at,
    cell_at,
    moved,
    peak,
    point_at,
    rest_curvature_at,
    rise,
    workspace,
)
from tactile_bayes.mechanics.rods.profile import Profile

_STEPS, _STEPS_PER_CELL = 64, 16  # room for steps of a rod at rest
_AT, _PSI, _U, _V, _LENGTH, _SHARE, _TERMS, _FARTHEST = range(8)  # columns of these steps

_SAMPLES = 48  # points of a rod of length one, and one for each step, at which the bending is compared


class RestPoint(NamedTuple):
    """Point of a rod at rest, in the frame of its base."""

    arclength: float  # arc length from where the rod begins [L]
    distance: float  # distance from the pivot [L]
    bearing: float  # direction in which it is seen from the pivot [rad]
    slope: float  # slope of the rod there [rad]
    curvature: float  # rest curvature there [1/L]


class AtRest(NamedTuple):
    """The rod at rest, as steps from its beginning on: the same for all distances at which it is met."""

    # Beginning of a step, state there, size as in `Step`, and the largest distance from the pivot on it, shape
    # (steps, 8). The beginning after the last one is `FARTHEST`, or NaN where there is no room for more.
    steps: Floats
    series: Floats  # of the states, as in a workspace, shape (steps, terms, columns)


def room_at_rest(cells: int) -> AtRest:
    """Return room for the steps of a rod of so many cells."""
    rows = _STEPS + _STEPS_PER_CELL * cells
    return AtRest(np.full((rows, 8), math.nan), np.empty((rows, *workspace()[:, :STATES].shape)))


@compiled
def shape_along(
    profile: Profile,
    phi0: float,
    moment: float,
    fx: float,
    fy: float,
    contact: float,
    arclengths: Floats,
    x: Floats,
    y: Floats,
    work: Floats,
) -> None:
    """Write the centreline at increasing arc lengths, for the arc length of the contact: zero if there is none."""
    force, beta = math.sqrt(fx * fx + fy * fy), math.atan2(-fx, fy)
    cos, sin = math.cos(beta), math.sin(beta)
    march = begin(profile, 0.0, FORWARD, State(phi0 - beta, -moment, 0.0, 0.0))
    x[:] = math.nan
    y[:] = math.nan
    for k in range(arclengths.size):
        if arclengths[k] == 0.0:
            x[k], y[k] = 0.0, 0.0
    tip = arclengths[-1]
    while march.at < tip:
        before, acting, end = march, force, min(contact, tip)
        if not before.at < contact:
            state = before.state
            unloaded = State(state.psi, 0.0, state.u, state.v)
            before, acting, end = March(before.at, before.cell, unloaded, before.steps), 0.0, tip
        step, march, _ = advance(profile, before, FORWARD, end, acting, work, EXACT, None)
        for k in range(arclengths.size):
            if before.at < arclengths[k] <= march.at:
                at = moved(before.state, acting, step, point_at(step, arclengths[k] - before.at), work)
                x[k], y[k] = at.u * cos - at.v * sin, at.u * sin + at.v * cos


@compiled
def rest_along(profile: Profile, stem: float, arclength: float, work: Floats) -> RestPoint:
    """Point of the rod at rest at an arc length."""
    march = _at_rest(profile, begin(profile, 0.0, FORWARD, State(0.0, 0.0, stem, 0.0)), arclength, work)
    return _chord(profile, march.at, march.state)


@compiled
def beyond_along(profile: Profile, arclength: float, work: Floats) -> tuple[float, float]:
    """Tip of the rod at rest, along the rod at an arc length, and to its left."""
    end = _at_rest(profile, begin(profile, arclength, FORWARD, State(0.0, 0.0, 0.0, 0.0)), 1.0, work).state
    return end.u, end.v


@compiled
def _at_rest(profile: Profile, march: March, until: float, work: Floats) -> March:
    while march.at < until:
        _, march, _ = advance(profile, march, FORWARD, until, 0.0, work, EXACT, None)
    return march


@compiled
def chord_along(profile: Profile, stem: float, distance: float, work: Floats) -> RestPoint:
    """First point of the rod at rest at a distance from the pivot; the farthest if there is none. The rod is continued
    beyond its tip as in `contacts.states`."""
    beginning = State(0.0, 0.0, stem, 0.0)
    march = begin(profile, 0.0, FORWARD, beginning)
    found, farthest, at = beginning, 0.0, 0.0
    while march.at < FARTHEST:
        before = march
        step, march, _ = advance(profile, before, FORWARD, FARTHEST, 0.0, work, EXACT, None)
        x = rise(before.state, 0.0, step, 0.0, distance, work)
        reaches = x >= 0.0
        if not reaches:
            x = peak(before.state, 0.0, step, 0.0, work)
        end = moved(before.state, 0.0, step, x, work)
        far = math.hypot(end.u, end.v)
        if reaches or far > farthest:
            found, farthest, at = end, far, before.at + arclength_to(step, x)
        if reaches:
            break
    if math.isnan(march.state.psi):
        at, found = march.at, march.state
    return _chord(profile, at, found)


@compiled
def write_at_rest(profile: Profile, stem: float, work: Floats, out: AtRest) -> None:
    """Write the steps of the rod at rest."""
    march, k = begin(profile, 0.0, FORWARD, State(0.0, 0.0, stem, 0.0)), 0
    while march.at < FARTHEST and k < out.steps.shape[0] - 1:
        before, row = march, out.steps[k]
        step, march, _ = advance(profile, before, FORWARD, FARTHEST, 0.0, work, EXACT, None)
        end = moved(before.state, 0.0, step, peak(before.state, 0.0, step, 0.0, work), work)
        row[_AT], row[_PSI], row[_U], row[_V] = before.at, before.state.psi, before.state.u, before.state.v
        row[_LENGTH], row[_SHARE], row[_TERMS] = step.length, step.share, step.terms
        row[_FARTHEST] = math.hypot(end.u, end.v)
        for n in range(step.terms + 1):
            for c in range(STATES):
                out.series[k, n, c] = work[n, c]
        k += 1
    out.steps[k, _AT] = math.nan if march.at < FARTHEST else march.at


@compiled
def chord_at_rest(profile: Profile, stem: float, distance: float, at_rest: AtRest, work: Floats) -> RestPoint:
    """The same as `chord_along`, from the steps of the rod or its mirror image."""
    steps, farthest = at_rest.steps, 0
    k = 0
    while steps[k, _AT] < FARTHEST:
        if steps[k, _FARTHEST] >= distance:
            found = _point_of(profile, at_rest, k, distance)
            if not math.isnan(found.distance):
                return found
        if steps[k, _FARTHEST] > steps[farthest, _FARTHEST]:
            farthest = k
        k += 1
    if math.isnan(steps[k, _AT]):
        return chord_along(profile, stem, distance, work)
    return _point_of(profile, at_rest, farthest, math.inf)


@compiled
def _point_of(profile: Profile, at_rest: AtRest, k: int, distance: float) -> RestPoint:
    """First point of a step at a distance, NaN without one, or its farthest one if the distance is infinite."""
    row, series = at_rest.steps[k], at_rest.series[k]
    # Without a load, steps do not depend on a taper.
    step = Step(row[_LENGTH], row[_SHARE], int(row[_TERMS]), 1.0, 0.0, row[_LENGTH])
    begins = State(row[_PSI], 0.0, row[_U], row[_V])
    x = rise(begins, 0.0, step, 0.0, distance, series) if distance < math.inf else peak(begins, 0.0, step, 0.0, series)
    end = moved(begins, 0.0, step, x, series)
    end = State(profile.sign * end.psi, 0.0, end.u, profile.sign * end.v)
    return _chord(profile, row[_AT] + arclength_to(step, x), end)


@compiled
def _chord(profile: Profile, arclength: float, at: State) -> RestPoint:
    curvature = rest_curvature_at(profile, cell_at(profile, arclength, FORWARD), arclength)
    return RestPoint(arclength, math.hypot(at.u, at.v), math.atan2(at.v, at.u), at.psi, curvature)


@compiled
def largest_bending_along(
    profile: Profile, phi0: float, moment: float, fx: float, fy: float, contact: float, work: Floats
) -> float:
    """Largest change of curvature between pivot and contact, times the diameter over that at the base [1/L]. It is that
    of a base wrench and the arc length of its contact, to a part in a thousand."""
    force, beta = math.sqrt(fx * fx + fy * fy), math.atan2(-fx, fy)
    march = begin(profile, 0.0, FORWARD, State(phi0 - beta, -moment, 0.0, 0.0))
    end = min(contact, 1.0)
    strain = 0.0
    while march.at < end:
        step, march, _ = advance(profile, march, FORWARD, end, force, work, ROUGH, None)
        count = 2 + int(_SAMPLES * step.share * step.length)
        for k in range(count):
            strain = max(strain, abs(bending_at(step, step.share * k / (count - 1), work)))
    return math.nan if math.isnan(march.state.psi) else strain
