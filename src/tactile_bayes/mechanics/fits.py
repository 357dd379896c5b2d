"""One contact from one noisy sample: what Step 2 makes of it, and the most likely one, as `fitting` has them.

The most likely contact is found on each sheet by Levenberg's and Marquardt's method; a sheet that is roughly fitted, and
much worse than the other, is left at that.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from tactile_bayes.mechanics.compiler import compiled, inlined, kept
from tactile_bayes.mechanics.fitting import ContactFit, RawFit, Reading, SheetFit
from tactile_bayes.mechanics.phases import NONE, TANGENTIAL, TIP
from tactile_bayes.mechanics.states import contact
from tactile_bayes.mechanics.touches import Move, moved, room_for_ratios, touch

__all__ = ["fits", "raw_fits", "sheet_fits"]

Floats = NDArray[np.float64]

_ROUGH, _ROUGH_STEPS = 1e-3, 10
_SETTLED, _MOST_STEPS = 1e-12, 100
"""Gain in the sum of squares that the next step promises, against one and the sum, at which a descent ends."""

_HARDNESS = 1e-3

_OUTDONE = 2.0, 10.0
"""Factor on the other sheet's sum of squares, and addend, beyond which a sheet that is roughly fitted is given up."""

_SHARES = (0.1, 0.3, 0.5, 0.7, 0.9)
"""Arc lengths to start from in tangential contact, and shares of its whole range for ψ1 in tip contact."""

_FORCES = (1.0, 0.5, 2.0)
"""Shares of the force to start from on the edge."""

_LEAST_MOMENT = 0.1
"""Standard deviations of the moment below which a start has not less of it."""

_MOST_SWEEPS = 30

_ROUNDING = 1e-15
"""Correlation that counts as none."""

_BEYOND_ALL = 1e300
"""Stands for a covariance that is not finite."""

_SAME = 1e-9
"""Distance below which two places are the same, but for rounding."""


class _Sample(NamedTuple):
    drive_angle: float
    moment: float
    force_x: float
    force_y: float
    leaning: tuple[float, float, float]
    whitening: tuple[float, float, float, float, float, float]
    """Rows of the inverse of the covariance's lower triangular root."""
    certainty: float
    """One over the standard deviation of the drive angle, or 0 where it is exact."""
    delta: float


class _Coordinates(NamedTuple):
    """As `touching` takes them."""

    force: float
    psi1: float
    arclength: float
    drive_angle: float


class _Miss(NamedTuple):
    """Squared deviations of a possible contact from a sample, in standard deviations, to second order.

    In force, in the way that leads to the edge (ψ1 in tip contact, else the arc length), and in drive angle.
    """

    misfit: float
    """Infinite where there is no such contact."""
    pull: tuple[float, float, float]
    """Half the derivatives."""
    normal: tuple[float, float, float, float, float, float]
    """Gauss's half of the second ones, as in `_inverse`; of what is held, the identity's."""


class _Descent(NamedTuple):
    at: _Coordinates
    miss: _Miss
    hardness: float


@compiled
def _sample(reading: Reading, i: int, delta: float) -> _Sample:
    covariance, leaning = reading.covariance, reading.leaning
    a = math.sqrt(covariance[i, 0, 0])
    b, d = covariance[i, 1, 0] / a, covariance[i, 2, 0] / a
    c = math.sqrt(covariance[i, 1, 1] - b * b)
    e = (covariance[i, 2, 1] - d * b) / c
    f = math.sqrt(covariance[i, 2, 2] - d * d - e * e)
    deviation = reading.angle_deviation[i]
    return _Sample(
        reading.drive_angle[i],
        reading.loads[i, 0],
        reading.loads[i, 1],
        reading.loads[i, 2],
        (leaning[i, 0], leaning[i, 1], leaning[i, 2]),
        (1.0 / a, -b / (a * c), 1.0 / c, (b * e - c * d) / (a * c * f), -e / (c * f), 1.0 / f),
        1.0 / deviation if deviation > 0.0 else 0.0,
        delta,
    )


@inlined
def _white(sample: _Sample, moment: float, force_x: float, force_y: float) -> tuple[float, float, float]:
    w = sample.whitening
    return w[0] * moment, w[1] * moment + w[2] * force_x, w[3] * moment + w[4] * force_x + w[5] * force_y


@inlined
def _dot(a: tuple[float, float, float], b: tuple[float, float, float]) -> float:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@compiled
def _miss(at: _Coordinates, sample: _Sample, sheet: int, ratios: Floats) -> _Miss:
    """On the sheet of a phase, or on the edge (`NONE`)."""
    found = touch(at.force, at.psi1, at.arclength, at.drive_angle, ratios)
    rod, lean, turned = found.rod, sample.leaning, at.drive_angle - sample.drive_angle
    off = _white(
        sample,
        rod.moment - sample.moment - lean[0] * turned,
        rod.force_x - sample.force_x - lean[1] * turned,
        rod.force_y - sample.force_y - lean[2] * turned,
    )
    last = turned * sample.certainty
    misfit = _dot(off, off) + last * last
    by, to = found.by_force, found.by_psi1 if sheet == TIP else found.by_arclength
    force = _white(sample, by.moment, by.force_x, by.force_y)
    way = _white(sample, to.moment, to.force_x, to.force_y)
    angle = _white(sample, -lean[0], -rod.force_y - lean[1], rod.force_x - lean[2])
    ways, angles = 0.0 if sheet == NONE else 1.0, 1.0 if sample.certainty > 0.0 else 0.0
    return _Miss(
        misfit if misfit < math.inf else math.inf,
        (_dot(force, off), ways * _dot(way, off), angles * _dot(angle, off) + last * sample.certainty),
        (
            _dot(force, force),
            ways * _dot(force, way),
            ways * _dot(way, way) + 1.0 - ways,
            angles * _dot(force, angle),
            ways * angles * _dot(way, angle),
            angles * _dot(angle, angle) + sample.certainty**2 + 1.0 - angles,
        ),
    )


@compiled
def _inverse(
    a: float, b: float, c: float, d: float, e: float, f: float
) -> tuple[float, float, float, float, float, float]:
    """Of a symmetric positive matrix with rows a; b, c; d, e, f up to the diagonal; infinite where there is none."""
    x, y, z = math.sqrt(a), math.sqrt(c), math.sqrt(f)
    b, d, e, one = b / (x * y), d / (x * z), e / (y * z), 1.0 + 1e-14
    if not math.isfinite(b + d + e):
        return math.inf, math.inf, math.inf, math.inf, math.inf, math.inf
    aa, ab, ad = one * one - e * e, d * e - b * one, b * e - d * one
    det = one * aa + b * ab + d * ad
    return (
        aa / (det * x * x),
        ab / (det * x * y),
        (one * one - d * d) / (det * y * y),
        ad / (det * x * z),
        (b * d - e * one) / (det * y * z),
        (one * one - b * b) / (det * z * z),
    )


@compiled
def _descended(start: _Descent, sample: _Sample, sheet: int, gain: float, steps: int, ratios: Floats) -> _Descent:
    """After as many steps as it takes until the gain that the next one promises is small."""
    at, miss, hardness = start
    if not miss.misfit < math.inf:
        return start
    for _ in range(steps):
        n, pull, hard = miss.normal, miss.pull, 1.0 + hardness
        a, b, c, d, e, f = _inverse(n[0] * hard, n[1], n[2] * hard, n[3], n[4], n[5] * hard)
        step = _dot((a, b, d), pull), _dot((b, c, e), pull), _dot((d, e, f), pull)
        settled = _dot(step, pull) <= gain * (1.0 + miss.misfit)
        trial = _Coordinates(
            at.force - step[0],
            at.psi1 - step[1] if sheet == TIP else at.psi1,
            at.arclength - step[1] if sheet == TANGENTIAL else at.arclength,
            at.drive_angle - step[2],
        )
        new = _miss(trial, sample, sheet, ratios)
        if new.misfit <= miss.misfit:
            at, miss, hardness = trial, new, 0.1 * hardness
        else:
            hardness *= 10.0
        if settled:
            break
    return _Descent(at, miss, hardness)


@compiled
def _started(sample: _Sample, sheet: int, psi1: float, arclength: float, ratios: Floats) -> _Descent:
    """From raw Step 2, or the best of several starts where that has no answer."""
    force, low = math.hypot(sample.force_x, sample.force_y), -sample.delta
    at, none = _Coordinates(math.nan, math.nan, math.nan, math.nan), (math.nan, math.nan, math.nan)
    miss = _Miss(math.inf, none, (math.nan, math.nan, math.nan, math.nan, math.nan, math.nan))
    for number in range(0 if sheet == NONE or not math.isnan(arclength) else 1, 3 if sheet == NONE else 6):
        trial = _Coordinates(force, low, 1.0, sample.drive_angle)
        if sheet == NONE:
            trial = _Coordinates(force * _FORCES[number], low, 1.0, sample.drive_angle)
        elif sheet == TIP:
            share = _SHARES[max(number - 1, 0)] * (0.5 * math.pi - low) + low
            way = min(max(psi1, low), 1.4) if number == 0 else share
            trial = _Coordinates(force, way, 1.0, sample.drive_angle)
        else:
            way = min(max(arclength, 0.02), 1.0) if number == 0 else _SHARES[number - 1]
            trial = _Coordinates(force, low, way, sample.drive_angle)
        new = _miss(trial, sample, sheet, ratios)
        if new.misfit < miss.misfit:
            at, miss = trial, new
            if number == 0 and sheet != NONE:
                break
    return _Descent(at, miss, _HARDNESS)


@compiled
def _raw_start(reading: Reading, i: int, delta: float) -> tuple[float, float]:
    """ψ1 and arc length of raw Step 2; where the moment has the wrong sign, of one that is small and right."""
    least = _LEAST_MOMENT * math.sqrt(reading.covariance[i, 0, 0])
    moment, force_x, force_y = reading.loads[i]
    raw = contact(reading.drive_angle[i], least if moment < least else moment, force_x, force_y, delta)
    return raw.tip_angle - raw.slope_angle - delta, raw.arclength


@compiled
def _fitted(sample: _Sample, sheet: int, psi1: float, arclength: float, ratios: Floats) -> _Descent:
    start = _started(sample, sheet, psi1, arclength, ratios)
    return _descended(start, sample, sheet, _SETTLED, _MOST_STEPS, ratios)


@compiled
def _store_covariance(miss: _Miss, sheet: int, certainty: float, out: Floats) -> None:
    """Of the coordinates; zero for those that are held."""
    inverse, way = _inverse(*miss.normal), 1 if sheet == TIP else 2
    out[:] = 0.0
    out[0, 0] = inverse[0]
    if sheet != NONE:
        out[0, way] = out[way, 0] = inverse[1]
        out[way, way] = inverse[2]
    if certainty > 0.0:
        out[0, 3] = out[3, 0] = inverse[3]
        out[3, 3] = inverse[5]
        if sheet != NONE:
            out[way, 3] = out[3, way] = inverse[4]


@kept
def sheet_fits(reading: Reading, delta: Floats, sheet: int, out: SheetFit) -> None:
    """Contacts as `fit_sheet` finds them; `NONE` is the edge."""
    ratios = room_for_ratios()
    for i in range(delta.size):
        sample = _sample(reading, i, delta[i])
        found = _fitted(sample, sheet, *_raw_start(reading, i, delta[i]), ratios)
        out.misfit[i] = found.miss.misfit
        for k in range(4):
            out.coordinates[i, k] = found.at[k]
        _store_covariance(found.miss, sheet, sample.certainty, out.covariance[i])


@kept
def fits(reading: Reading, delta: Floats, out: ContactFit) -> None:
    """Contacts as `fit_contacts` finds them."""
    ratios, matrix, axes = room_for_ratios(), np.empty((3, 3)), np.empty((3, 3))
    for i in range(delta.size):
        sample = _sample(reading, i, delta[i])
        psi1, arclength = _raw_start(reading, i, delta[i])
        tip = _started(sample, TIP, psi1, arclength, ratios)
        lying = _started(sample, TANGENTIAL, psi1, arclength, ratios)
        tip = _descended(tip, sample, TIP, _ROUGH, _ROUGH_STEPS, ratios)
        lying = _descended(lying, sample, TANGENTIAL, _ROUGH, _ROUGH_STEPS, ratios)
        of_tip, of_lying = _before_edge(tip, sample), _before_edge(lying, sample)
        if of_tip <= _OUTDONE[0] * of_lying + _OUTDONE[1]:
            tip = _descended(tip, sample, TIP, _SETTLED, _MOST_STEPS, ratios)
        if of_lying <= _OUTDONE[0] * of_tip + _OUTDONE[1]:
            lying = _descended(lying, sample, TANGENTIAL, _SETTLED, _MOST_STEPS, ratios)
        of_tip, of_lying = _before_edge(tip, sample), _before_edge(lying, sample)
        at_edge = math.isinf(min(of_tip, of_lying))
        # Of a contact on the edge the variance is that of the sheet which the data miss by less.
        ends = tip.miss.misfit < lying.miss.misfit if at_edge else of_tip < of_lying
        best, sheet = (tip, TIP) if ends else (lying, TANGENTIAL)
        covariance = out.covariance[i]
        _store_covariance(best.miss, sheet, sample.certainty, covariance)
        clearance = (best.at.psi1 + delta[i]) / math.sqrt(covariance[1, 1])
        if not ends:
            clearance = (1.0 - best.at.arclength) / math.sqrt(covariance[2, 2])
        rival = max(of_tip, of_lying) - best.miss.misfit
        if at_edge:
            best, clearance, rival = _fitted(sample, NONE, psi1, arclength, ratios), 0.0, math.inf
        for k in range(4):
            out.coordinates[i, k] = best.at[k]
        out.misfit[i], out.phase[i], out.at_edge[i] = best.miss.misfit, sheet, at_edge
        out.clearance[i], out.rival[i] = clearance, rival

        at, way = best.at, 1 if ends else 2
        found = touch(at.force, at.psi1, at.arclength, at.drive_angle, ratios)
        rod, by, to, on = found.rod, found.by_force, found.by_psi1 if ends else found.by_arclength, found.by_drive_angle
        out.moment[i] = rod.moment
        _store_place(Move(rod.x, rod.y, rod.beta - delta[i], at.arclength), out.place[i])
        order = (0, way, 3)
        scale = (_scale(covariance[0, 0]), _scale(covariance[way, way]), _scale(covariance[3, 3]))
        for a in range(3):
            for b in range(3):
                matrix[a, b] = covariance[order[a], order[b]] / scale[a] / scale[b]
        _principal(matrix, axes)
        spread = out.place_covariance[i]
        spread[:] = 0.0
        for k in range(3):
            f, w, d = scale[0] * axes[0, k], scale[1] * axes[1, k], scale[2] * axes[2, k]
            x, y = by.x * f + to.x * w + on.x * d, by.y * f + to.y * w + on.y * d
            _add(Move(x, y, by.beta * f + to.beta * w + d, 0.0 if ends else w), spread)
        bend = 0.0
        for k in range(3 if sample.certainty > 0.0 else 2):
            f, w, d = scale[0] * axes[0, k], scale[1] * axes[1, k], scale[2] * axes[2, k]
            p, s = (w, 0.0) if ends else (0.0, w)
            more = touch(at.force + f, at.psi1 + p, at.arclength + s, at.drive_angle + d, ratios).rod
            less = touch(at.force - f, at.psi1 - p, at.arclength - s, at.drive_angle - d, ratios).rod
            bend = _bent(bend, 0.5 * (more.x + less.x) - rod.x, 0.5 * (more.y + less.y) - rod.y, spread)
        out.bend[i] = bend


@kept
def raw_fits(reading: Reading, delta: Floats, out: RawFit) -> None:
    """Contacts as `raw_contacts` finds them."""
    ratios, matrix, axes = room_for_ratios(), np.empty((3, 3)), np.empty((3, 3))
    for i in range(delta.size):
        angle, deviation = reading.drive_angle[i], reading.angle_deviation[i]
        moment, force_x, force_y = reading.loads[i]
        found = contact(angle, moment, force_x, force_y, delta[i])
        _store_place(Move(found.x, found.y, found.slope_angle, found.arclength), out.place[i])
        out.tip_angle[i] = found.tip_angle
        spread = out.covariance[i]
        out.bend[i] = spread[:] = math.nan
        if math.isnan(found.arclength):
            continue
        psi1 = found.tip_angle - found.slope_angle - delta[i]
        at = touch(math.hypot(force_x, force_y), psi1, found.arclength, angle, ratios)
        for a in range(3):
            for b in range(3):
                value = reading.covariance[i, a, b]
                matrix[a, b] = value if math.isfinite(value) else _BEYOND_ALL
        _principal(matrix, axes)
        lean = reading.leaning[i]
        spread[:] = 0.0
        for k in range(4):
            if k < 3:
                d = 0.0, axes[0, k], axes[1, k], axes[2, k]
            else:
                d = deviation, deviation * lean[0], deviation * lean[1], deviation * lean[2]
            _add(moved(at, psi1, found.arclength, d[0], d[1], d[2], d[3]), spread)
        bend = 0.0
        for k in range(4 if deviation > 0.0 else 3):
            if k < 3:
                d = 0.0, axes[0, k], axes[1, k], axes[2, k]
            else:
                d = deviation, deviation * lean[0], deviation * lean[1], deviation * lean[2]
            more = contact(angle + d[0], moment + d[1], force_x + d[2], force_y + d[3], delta[i])
            less = contact(angle - d[0], moment - d[1], force_x - d[2], force_y - d[3], delta[i])
            bend = _bent(bend, 0.5 * (more.x + less.x) - found.x, 0.5 * (more.y + less.y) - found.y, spread)
        out.bend[i] = bend


@compiled
def _before_edge(found: _Descent, sample: _Sample) -> float:
    """Sum of squares; infinite for contacts beyond the edge."""
    beyond = found.at.psi1 < -sample.delta or found.at.arclength > 1.0
    return math.inf if beyond else found.miss.misfit


@inlined
def _scale(variance: float) -> float:
    return math.sqrt(variance) if variance > 0.0 else 1.0


@compiled
def _store_place(place: Move, out: Floats) -> None:
    for k in range(4):
        out[k] = place[k]


@compiled
def _add(move: Move, covariance: Floats) -> None:
    """What an independent error adds, by how far it moves the place."""
    for a in range(4):
        for b in range(4):
            covariance[a, b] += move[a] * move[b]


@compiled
def _bent(bend: float, x: float, y: float, covariance: Floats) -> float:
    """The larger of two bends, the second of contacts whose mean is off by x and y; NaN counts as the largest."""
    if math.isnan(bend) or x * x + y * y < _SAME * _SAME:
        return bend
    xx, yy, xy = covariance[0, 0], covariance[1, 1], covariance[0, 1]
    shift = (yy * x * x - 2.0 * xy * x * y + xx * y * y) / (xx * yy - xy * xy)
    return bend if shift <= bend else shift


@compiled
def _principal(matrix: Floats, axes: Floats) -> None:
    """Axes of a covariance, one standard deviation long, in columns, by Jacobi's rotations; the matrix is lost."""
    for a in range(3):
        for b in range(3):
            axes[a, b] = 1.0 * (a == b)
    for _ in range(_MOST_SWEEPS):
        turns = False
        for p in range(2):
            for q in range(p + 1, 3):
                size = math.sqrt(abs(matrix[p, p])) * math.sqrt(abs(matrix[q, q]))
                if abs(matrix[p, q]) > _ROUNDING * size:
                    turns = True
                    ratio = 0.5 * (matrix[q, q] - matrix[p, p]) / matrix[p, q]
                    tan = math.copysign(1.0 / (abs(ratio) + math.sqrt(1.0 + ratio * ratio)), ratio)
                    cos = 1.0 / math.sqrt(1.0 + tan * tan)
                    sin = tan * cos
                    for k in range(3):
                        one, other = axes[k, p], axes[k, q]
                        axes[k, p], axes[k, q] = cos * one - sin * other, sin * one + cos * other
                        one, other = matrix[k, p], matrix[k, q]
                        matrix[k, p], matrix[k, q] = cos * one - sin * other, sin * one + cos * other
                    for k in range(3):
                        one, other = matrix[p, k], matrix[q, k]
                        matrix[p, k], matrix[q, k] = cos * one - sin * other, sin * one + cos * other
                    matrix[p, q] = matrix[q, p] = 0.0
        if not turns:
            break
    for k in range(3):
        variance = matrix[k, k]
        length = 0.0 if variance < 0.0 else math.sqrt(variance)
        for a in range(3):
            axes[a, k] *= length
