"""The contact of one noisy sample: by raw Step 2, and the most likely one by descent (`fitting`)."""

from __future__ import annotations

import math
from typing import NamedTuple

from tactile_bayes.arrays import Floats, Index
from tactile_bayes.mechanics.compiler import cached, compiled
from tactile_bayes.mechanics.contacts.arc_states import NO_CONTACT, Found
from tactile_bayes.mechanics.contacts.contact_map import contact_state, moved
from tactile_bayes.mechanics.contacts.fits import RawFit, Reading
from tactile_bayes.mechanics.contacts.states import contact_pair
from tactile_bayes.mechanics.poses.beam import Beam, Varied, mirrored_by

__all__ = ["Workspace", "descents", "raw_fits"]

_MOST_SWEEPS = 30

_ROUNDING = 1e-15
"""Correlation that counts as zero."""

_BEYOND_ALL = 1e300
"""Value that replaces a covariance that is not finite."""

_SAME = 1e-9
"""Distance [L] below which two contact points differ by rounding only."""


_POSSIBLE, _NEAR = 4.0, 1e-3
"""Largest deviation of a contact at which the moment does not vanish for the first time, in its standard deviations, or
in L and rad without noise."""


class Workspace(NamedTuple):
    """Arrays to write to, for k free coordinates."""

    trial: Floats
    """Shape (1, 4)."""
    slopes: Floats
    """Derivatives of the deviations, and the deviations in the last column, shape (4, k + 1)."""
    inverse: Floats
    """Shape (k, k)."""
    by: Floats
    """As in `contact_state`."""


@compiled
def _miss(
    reading: Reading, beam: Beam, whitening: Floats, i: int, z: Floats, j: int, free: Index, workspace: Workspace
) -> float:
    """Sum of squared deviations of a possible contact from a sample, in standard deviations; infinite if it is none."""
    slopes, by, count = workspace.slopes, workspace.by, free.size
    contact_state(z, j, beam, by)
    deviation, turned = reading.angle_deviation[i], z[j, 3] - reading.drive_angle[i]
    for r in range(4):
        for c in range(count + 1):
            slopes[r, c] = 0.0
    for s in range(3):
        lean = reading.leaning[i, s]
        off = by[0, s] - reading.loads[i, s] - lean * turned
        for r in range(s, 3):
            slopes[r, count] += whitening[i, r, s] * off
            for c in range(count):
                slopes[r, c] += whitening[i, r, s] * (by[1 + free[c], s] - (lean if free[c] == 3 else 0.0))
    if deviation > 0.0:
        slopes[3, count] = turned / deviation
        slopes[3, count - 1] = 1.0 / deviation if free[count - 1] == 3 else 0.0
    total = 0.0
    for r in range(4):
        total += slopes[r, count] * slopes[r, count]
    return math.inf if math.isnan(total) else total


@cached
def descents(
    reading: Reading,
    curvature: Floats,
    varied: Varied | None,
    stem: float,
    whitening: Floats,
    who: Index,
    free: Index,
    gain: float,
    steps: int,
    z: Floats,
    misfit: Floats,
    normal: Floats,
    hardness: Floats,
    workspace: Workspace,
) -> None:
    """Descend by Levenberg–Marquardt steps until the gain that the next step promises is small.

    Parameters
    ----------
    reading : Reading
    curvature, varied, stem
        As in `Rods`.
    whitening : ndarray, shape (n, 3, 3)
        Inverse of the lower triangular root of the covariance of the loads.
    who : ndarray
        Indices of the samples that descend.
    free : ndarray, shape (k,)
        Free coordinates; the drive angle is the last if it is among them.
    gain : float
        Gain that is small, relative to one plus the sum of squares.
    steps : int
        Largest number of steps; with 0 the samples are evaluated where they are.
    z, misfit, normal, hardness : ndarray, shapes (n, 4), (n,), (n, k, k + 1) and (n,)
        Coordinates; sums of squares; half of their second derivatives in the Gauss–Newton approximation, with half of
        the first derivatives in the last column; damping of the diagonal.
    """
    count, inverse, slopes, trial = free.size, workspace.inverse, workspace.slopes, workspace.trial
    for j in range(who.size):
        i = who[j]
        beam = mirrored_by(curvature[i], varied, stem)
        for _ in range(max(steps, 1)):
            settled = steps == 0
            for k in range(4):
                trial[0, k] = z[i, k]
            if steps > 0:
                if not misfit[i] < math.inf:
                    break
                _invert(normal, i, 1.0 + hardness[i], inverse)
                promised = 0.0
                for a in range(count):
                    step = 0.0
                    for b in range(count):
                        step += inverse[a, b] * normal[i, b, count]
                    promised += step * normal[i, a, count]
                    trial[0, free[a]] -= step
                settled = promised <= gain * (1.0 + misfit[i])
            new = _miss(reading, beam, whitening, i, trial, 0, free, workspace)
            if steps == 0 or new <= misfit[i]:
                misfit[i] = new
                hardness[i] *= 0.1
                for k in range(4):
                    z[i, k] = trial[0, k]
                for a in range(count):
                    for b in range(count + 1):
                        total = 0.0
                        for r in range(4):
                            total += slopes[r, a] * slopes[r, b]
                        normal[i, a, b] = total
            else:
                hardness[i] *= 10.0
            if settled:
                break


@compiled
def _invert(normal: Floats, i: int, harder: float, inverse: Floats) -> None:
    """Invert a symmetric positive matrix with its diagonal times `harder`; NaN where there is no inverse."""
    count = inverse.shape[0]
    for a in range(count):
        for b in range(count):
            inverse[a, b] = normal[i, a, b] / math.sqrt(normal[i, a, a] * normal[i, b, b]) / harder
        inverse[a, a] = 1.0 + 1e-14
    for p in range(count):
        pivot = inverse[p, p]
        inverse[p, p] = 1.0
        for b in range(count):
            inverse[p, b] /= pivot
        for a in range(count):
            if a != p:
                factor = inverse[a, p]
                inverse[a, p] = 0.0
                for b in range(count):
                    inverse[a, b] -= factor * inverse[p, b]
    for a in range(count):
        for b in range(count):
            inverse[a, b] /= math.sqrt(normal[i, a, a] * normal[i, b, b]) * harder


@cached
def raw_fits(
    reading: Reading,
    delta: Floats,
    curvature: Floats,
    varied: Varied | None,
    stem: float,
    out: RawFit,
    z: Floats,
    errors: Floats,
    changes: Floats,
    matrix: Floats,
    axes: Floats,
    by: Floats,
) -> None:
    """Write the contacts of Step 2; see `raw_contacts`."""
    for i in range(delta.size):
        angle, moment = reading.drive_angle[i], reading.loads[i, 0]
        force_x, force_y = reading.loads[i, 1], reading.loads[i, 2]
        beam = mirrored_by(curvature[i], varied, stem)
        rising, falling = contact_pair(beam, angle, moment, force_x, force_y, delta[i])
        out.bend[i] = math.nan
        for k in range(4):
            out.place[i, k], out.other[i, k] = math.nan, math.nan
            for p in range(4):
                out.covariance[i, k, p] = math.nan
        _write_errors(reading, i, matrix, axes, errors)
        out.deviation[i] = _deviation(rising, delta[i], beam, reading, i, z, errors, by, changes)
        out.other_deviation[i] = _deviation(falling, delta[i], beam, reading, i, z, errors, by, changes)
        found, other = rising, falling
        falls = out.other_deviation[i] < out.deviation[i] or math.isnan(rising.arclength)
        if falls:
            found, other = falling, rising
            out.deviation[i], out.other_deviation[i] = out.other_deviation[i], out.deviation[i]
        is_second = falling.arclength < rising.arclength or math.isnan(rising.arclength)
        if is_second and not out.deviation[i] < (_POSSIBLE if _is_noisy(errors) else _NEAR):
            found = NO_CONTACT
        out.tip_angle[i] = found.tip_angle
        for k in range(4):
            out.place[i, k], out.other[i, k] = found[k], other[k]
        if math.isnan(found.arclength):
            continue
        _deviation(found, delta[i], beam, reading, i, z, errors, by, changes)
        _spread(changes, out.covariance, i)
        out.bend[i] = 0.0
        for k in range(4 if reading.angle_deviation[i] > 0.0 else 3):
            x_off, y_off = -found.x, -found.y
            for sign in (1.0, -1.0):
                a, m, fx, fy = sign * errors[k, 0], sign * errors[k, 1], sign * errors[k, 2], sign * errors[k, 3]
                pair = contact_pair(beam, angle + a, moment + m, force_x + fx, force_y + fy, delta[i])
                aside = pair[1] if falls else pair[0]
                x_off, y_off = x_off + 0.5 * aside.x, y_off + 0.5 * aside.y
            out.bend[i] = _bent(out.bend[i], x_off, y_off, out.covariance, i)


@compiled
def _write_errors(reading: Reading, i: int, matrix: Floats, axes: Floats, errors: Floats) -> None:
    """Write four independent errors of drive angle and loads, one standard deviation long, in rows."""
    for a in range(3):
        for b in range(3):
            value = reading.covariance[i, a, b]
            matrix[a, b] = value if math.isfinite(value) else _BEYOND_ALL
    _principal(matrix, axes)
    deviation = reading.angle_deviation[i]
    for k in range(3):
        errors[k, 0], errors[3, k + 1] = 0.0, deviation * reading.leaning[i, k]
        for a in range(3):
            errors[k, a + 1] = axes[a, k]
    errors[3, 0] = deviation


@compiled
def _is_noisy(errors: Floats) -> bool:
    """True if any error is not zero."""
    for k in range(4):
        for a in range(4):
            if errors[k, a] != 0.0:
                return True
    return False


@compiled
def _deviation(
    found: Found,
    delta: float,
    beam: Beam,
    reading: Reading,
    i: int,
    z: Floats,
    errors: Floats,
    by: Floats,
    changes: Floats,
) -> float:
    """Deviation of a point without moment from a contact at the tip or along the rod, in standard deviations, or in L
    and rad without noise; infinite for no point. Writes the shifts of place and ψ1 by the errors, in rows."""
    if math.isnan(found.arclength):
        return math.inf
    turn = found.tip_angle - found.slope_angle
    turn -= 2.0 * math.pi * math.floor(0.5 * turn / math.pi + 0.25)
    z[0, 0], z[0, 1] = math.hypot(reading.loads[i, 1], reading.loads[i, 2]), turn - delta
    z[0, 2], z[0, 3] = found.arclength, reading.drive_angle[i]
    bend = contact_state(z, 0, beam, by)
    length_variance, turn_variance = 0.0, 0.0
    for k in range(4):
        change = moved(z, 0, beam, bend, by, errors[k, 0], errors[k, 1], errors[k, 2], errors[k, 3])
        for p in range(5):
            changes[k, p] = change[p]
        length_variance += change[3] * change[3]
        turn_variance += change[4] * change[4]
    by_length, by_turn = 1.0, 1.0
    if _is_noisy(errors):
        by_length = 1.0 / max(math.sqrt(length_variance), _SAME)
        by_turn = 1.0 / max(math.sqrt(turn_variance), _SAME)
    ends = math.hypot(by_length * (found.arclength - 1.0), by_turn * max(-turn, turn - math.pi, 0.0))
    lies = math.hypot(by_turn * turn, by_length * max(found.arclength - 1.0, 0.0))
    return min(ends, lies)


@compiled
def _spread(changes: Floats, covariance: Floats, i: int) -> None:
    """Store the covariance of a place from its shifts by four independent errors."""
    for a in range(4):
        for b in range(4):
            covariance[i, a, b] = 0.0
            for k in range(4):
                covariance[i, a, b] += changes[k, a] * changes[k, b]


@compiled
def _bent(bend: float, x: float, y: float, covariance: Floats, i: int) -> float:
    """Larger of two bends, the second that of contacts whose mean is off by (x, y); NaN counts as the largest."""
    if math.isnan(bend) or x * x + y * y < _SAME * _SAME:
        return bend
    xx, yy, xy = covariance[i, 0, 0], covariance[i, 1, 1], covariance[i, 0, 1]
    shift = (yy * x * x - 2.0 * xy * x * y + xx * y * y) / (xx * yy - xy * xy)
    return bend if shift <= bend else shift


@compiled
def _principal(matrix: Floats, axes: Floats) -> None:
    """Principal axes of a covariance, one standard deviation long, in columns, by Jacobi rotations; the matrix is
    overwritten."""
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
