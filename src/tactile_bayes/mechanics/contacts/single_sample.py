"""The contact of one noisy sample: by raw Step 2, and the most likely one by descent (`fitting`)."""

from __future__ import annotations

import math
from typing import NamedTuple

from tactile_bayes.arrays import Floats, Index
from tactile_bayes.mechanics.compiler import cached, compiled
from tactile_bayes.mechanics.contacts.arc_states import NO_CONTACT, FoundContact
from tactile_bayes.mechanics.contacts.contact_map import contact_state, moved
from tactile_bayes.mechanics.contacts.fits import RawFit, Reading
from tactile_bayes.mechanics.contacts.states import contact_pair
from tactile_bayes.mechanics.poses.beam import Beam, Varied, mirrored_by

_SAME = 1e-9  # distance [L] below which two contact points differ by rounding only


# Largest deviation of a contact at which the moment does not vanish for the first time, in its standard deviations, or
# in L and rad without noise.
_POSSIBLE, _NEAR = 4.0, 1e-3


class SampleWorkspace(NamedTuple):
    """Arrays to write to, for k free coordinates."""

    trial: Floats  # shape (1, 4)
    slopes: Floats  # derivatives of the deviations, and the deviations in the last column, shape (4, k + 1)
    inverse: Floats  # shape (k, k)
    by: Floats  # as in `contact_state`


@compiled
def _miss(reading: Reading, beam: Beam, whitening: Floats, i: int, free: Index, workspace: SampleWorkspace) -> float:
    """Sum of squared deviations of the trial from a sample, in standard deviations; infinite if it is no contact."""
    z, slopes, by, count = workspace.trial, workspace.slopes, workspace.by, free.size
    contact_state(z, 0, beam, by)
    deviation, turned = reading.angle_deviation[i], z[0, 3] - reading.drive_angle[i]
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
    workspace: SampleWorkspace,
) -> None:
    """Descend by Levenberg–Marquardt steps until the gain that the next step promises is small. `whitening` is the
    inverse of the root of the covariance of the loads, `who` are the samples that descend, in the coordinates `free`
    (the drive angle last), for at most `steps`; with 0 they are evaluated where they are. `gain` is relative to one
    plus the sum of squares, the misfit. `normal`, shape (n, k, k + 1), holds half of its second derivatives in the
    Gauss–Newton approximation, and half of the first ones in the last column; `hardness` is the damping of the
    diagonal."""
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
            new = _miss(reading, beam, whitening, i, free, workspace)
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


class Room(NamedTuple):
    """Arrays that `raw_fits` writes to."""

    z: Floats  # coordinates of one contact, shape (1, 4)
    # Four independent errors of drive angle and loads, one standard deviation long, in rows, shape (4, 4).
    errors: Floats
    shifts: Floats  # shifts of the place and of ψ1 by them, of the two points that may be the contact, shape (2, 4, 5)
    by: Floats  # as in `contact_state`


class _Sample(NamedTuple):
    """A rod, what is read of it, and its friction."""

    beam: Beam
    drive_angle: float
    moment: float
    force_x: float
    force_y: float
    friction_angle: float


@cached
def raw_fits(
    reading: Reading,
    axes: Floats,
    delta: Floats,
    curvature: Floats,
    varied: Varied | None,
    stem: float,
    out: RawFit,
    room: Room,
) -> None:
    """Write the contacts of Step 2; see `raw_contacts`. Without noise `axes`, those of the covariance, have no rows."""
    has_noise = axes.shape[0] > 0
    for i in range(delta.size):
        loads = reading.loads[i]
        beam = mirrored_by(curvature[i], varied, stem)
        sample = _Sample(beam, reading.drive_angle[i], loads[0], loads[1], loads[2], delta[i])
        rising, falling = contact_pair(*sample)
        noisy = has_noise and _write_errors(reading, axes, i, room)
        deviation = _deviation(rising, sample, noisy, room, room.shifts[0])
        other_deviation = _deviation(falling, sample, noisy, room, room.shifts[1])
        found, other, falls = rising, falling, other_deviation < deviation or math.isnan(rising.arclength)
        if falls:
            found, other = falling, rising
            deviation, other_deviation = other_deviation, deviation
        is_second = falling.arclength < rising.arclength or math.isnan(rising.arclength)
        if is_second and not deviation < (_POSSIBLE if noisy else _NEAR):
            found = NO_CONTACT
        out.deviation[i], out.other_deviation[i], out.tip_angle[i] = deviation, other_deviation, found.tip_angle
        for k in range(4):
            out.place[i, k], out.other[i, k] = found[k], other[k]
        if has_noise:
            _write_spread(found, falls, sample, out, i, room)


@compiled
def _write_errors(reading: Reading, axes: Floats, i: int, room: Room) -> bool:
    """Write the errors of a sample, and return whether any is not zero."""
    errors, deviation = room.errors, reading.angle_deviation[i]
    noisy = deviation != 0.0
    errors[3, 0] = deviation
    for k in range(3):
        errors[k, 0], errors[3, k + 1] = 0.0, deviation * reading.leaning[i, k]
        for a in range(3):
            errors[k, a + 1] = axes[i, a, k]
            noisy = noisy or axes[i, a, k] != 0.0
    if not noisy:
        room.shifts[:] = 0.0
    return noisy


@compiled
def _deviation(found: FoundContact, sample: _Sample, noisy: bool, room: Room, shifts: Floats) -> float:
    """Deviation of a point without moment from a contact at the tip or along the rod, in standard deviations, or in L
    and rad without noise; infinite for no point. With noise the shifts are written."""
    if math.isnan(found.arclength):
        return math.inf
    turn = found.tip_angle - found.slope_angle
    turn -= 2.0 * math.pi * math.floor(0.5 * turn / math.pi + 0.25)
    by_length, by_turn = 1.0, 1.0
    if noisy:
        z, errors = room.z, room.errors
        z[0, 0], z[0, 1] = math.hypot(sample.force_x, sample.force_y), turn - sample.friction_angle
        z[0, 2], z[0, 3] = found.arclength, sample.drive_angle
        pose = contact_state(z, 0, sample.beam, room.by)
        length_variance, turn_variance = 0.0, 0.0
        for k in range(4):
            error = errors[k, 0], errors[k, 1], errors[k, 2], errors[k, 3]
            shift = moved(z, 0, pose, room.by, *error)
            for p in range(5):
                shifts[k, p] = shift[p]
            length_variance += shift[3] * shift[3]
            turn_variance += shift[4] * shift[4]
        by_length = 1.0 / max(math.sqrt(length_variance), _SAME)
        by_turn = 1.0 / max(math.sqrt(turn_variance), _SAME)
    ends = math.hypot(by_length * (found.arclength - 1.0), by_turn * max(-turn, turn - math.pi, 0.0))
    lies = math.hypot(by_turn * turn, by_length * max(found.arclength - 1.0, 0.0))
    return min(ends, lies)


@compiled
def _write_spread(found: FoundContact, falls: bool, sample: _Sample, out: RawFit, i: int, room: Room) -> None:
    """Write the covariance of a place from its shifts, and its bend from the contacts of samples with the errors."""
    covariance, shifts, errors = out.covariance[i], room.shifts[1 if falls else 0], room.errors
    is_none = math.isnan(found.arclength)
    out.bend[i] = math.nan if is_none else 0.0
    for a in range(4):
        for b in range(4):
            covariance[a, b] = out.bend[i]
            for k in range(4):
                covariance[a, b] += shifts[k, a] * shifts[k, b]
    if is_none:
        return
    for k in range(4 if errors[3, 0] > 0.0 else 3):
        x, y = -found.x, -found.y
        for sign in (1.0, -1.0):
            angle, moment = sample.drive_angle + sign * errors[k, 0], sample.moment + sign * errors[k, 1]
            force_x, force_y = sample.force_x + sign * errors[k, 2], sample.force_y + sign * errors[k, 3]
            pair = contact_pair(sample.beam, angle, moment, force_x, force_y, sample.friction_angle)
            aside = pair[1] if falls else pair[0]
            x, y = x + 0.5 * aside.x, y + 0.5 * aside.y
        out.bend[i] = _bent(out.bend[i], x, y, covariance)


@compiled
def _bent(bend: float, x: float, y: float, covariance: Floats) -> float:
    """Larger of two bends, the second that of contacts whose mean is off by (x, y); NaN counts as the largest."""
    if math.isnan(bend) or x * x + y * y < _SAME * _SAME:
        return bend
    xx, yy, xy = covariance[0, 0], covariance[1, 1], covariance[0, 1]
    shift = (yy * x * x - 2.0 * xy * x * y + xx * y * y) / (xx * yy - xy * xy)
    return bend if shift <= bend else shift
