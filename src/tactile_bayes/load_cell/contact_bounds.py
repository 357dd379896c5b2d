"""Bounds of the onset and the end of contact in one sweep, from readings alone."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from scipy.special import betainc, betaln, fdtrc, fdtri, stdtrit

from tactile_bayes.arrays import Flags, Floats, Index
from tactile_bayes.numerics.scatter import DEVIATION_OVER_MEDIAN

FEWEST = 3  # least number of samples for an estimate of bias and noise
# Range of a smooth course of the readings, in standard deviations of the noise between neighbours, from which it is a
# load whatever the zero: less may be a drift.
_FIRM = 20.0
_CLIP = 3.0
_DOUBT = 0.05
_FEWEST_OF_COURSE = 6
_ROUNDS = 10
_SHORT = 16
_TINY = 1e-290


@dataclass(frozen=True)
class ContactBounds:
    """Bounds of contact in one sweep of the samples [0, n)."""

    p_value: float  # upper bound of the p-value of the hypothesis of no contact
    found: bool  # whether contact is significant
    # Last sample before the event and first sample after it that are certain; -1 where there is none.
    onset: tuple[int, int]
    snap_off: tuple[int, int]
    before: int  # number of unloaded samples at the start of the sweep
    after: int  # and at its end


def contact_bounds(readings: Floats, false_alarm: float, floor: Floats) -> ContactBounds:
    """Find contact and its bounds in the readings of one sweep, (samples, channels), by the method of `zero_load`."""
    n = len(readings)
    readings = readings - readings[0]
    p_value, before, after = _contact(readings, floor)
    if p_value < false_alarm:  # a few outliers must not cause it
        p_value = max(p_value, _contact(_clipped(readings, floor), floor)[0])
    if not p_value < false_alarm:
        of_course = _course(readings, floor)
        if of_course < false_alarm:  # without an unloaded sample the ends are as loaded as the rest
            return ContactBounds(of_course, True, (-1, -1), (-1, -1), 0, 0)
        parts = readings, readings[: n // 2], readings[n // 2 :]
        doubtful = p_value < _DOUBT or any(_trend(part, _DOUBT / len(parts)) for part in parts)
        return ContactBounds(p_value, False, (-1, -1), (-1, -1), 0 if doubtful else n, 0)
    onset, snap_off = (-1, -1), (-1, -1)
    # Long ends include weak loads, which shift their mean by more than its error: start from half of them.
    before, after = (max(min(end, _SHORT), end // 2) for end in (before, after))
    for _ in range(_ROUNDS):
        bounds = _refined(readings, before, after, false_alarm, floor)
        if bounds is None:  # no sample or block is certainly loaded: keep away from the samples between
            before, after = before // 2, after // 2
            onset, snap_off = (before - 1, n - after - 1), (before, n - after if after else -1)
            break
        onset, snap_off = bounds
        found = onset[0] + 1, n - snap_off[1] if snap_off[1] >= 0 else 0
        if found == (before, after) or sum(found) < FEWEST:
            before, after = found
            break
        before, after = found
    if before and _trend(readings[:before], false_alarm):
        before, onset = 0, (-1, onset[1])
    if after and _trend(readings[n - after :], false_alarm):
        after, snap_off = 0, (snap_off[0], -1)
    if before + after < FEWEST:
        return ContactBounds(p_value, True, (-1, -1), (-1, -1), 0, 0)
    return ContactBounds(p_value, True, onset, snap_off, before, after)


# ---- the test for contact


def _contact(readings: Floats, floor: Floats) -> tuple[float, int, int]:
    """Upper bound of the p-value of no contact, and the numbers of samples at both ends that give it."""
    n = len(readings)
    before, after = _tested_ends(n)
    if not before.size:
        return 1.0, 0, 0
    size = (before + after).astype(float)
    first, second = _sums(readings), _sums(readings**2)
    last, last_second = _sums(readings[::-1]), _sums(readings[::-1] ** 2)
    total = second[-1] - first[-1] ** 2 / n
    inner = second[before] + last_second[after] - (first[before] + last[after]) ** 2 / size[:, None]
    inner = np.maximum(inner, floor * size[:, None])
    share = np.minimum(inner / np.maximum(total, np.maximum(inner, _TINY)), 1.0)
    share[~np.isfinite(share)] = 1.0
    share[np.broadcast_to(total <= floor * n, share.shape)] = 1.0
    log_p = _log_beta_cdf(share, 0.5 * (size - 1.0)[:, None], 0.5 * (n - size)[:, None])
    # The ends maximise the joint evidence of all channels: one of them may end at zero load in contact. Without noise,
    # where several have probability zero, the longest is taken.
    pair = np.lexsort((size, -log_p.sum(axis=1)))[-1]
    return float(min(1.0, np.exp(min(log_p.min() + np.log(log_p.size), 0.0)))), int(before[pair]), int(after[pair])


def _course(readings: Floats, floor: Floats) -> float:
    """Upper bound of the p-value of no contact, from a course of the readings that is smooth and large: a parabola for
    each channel (an F-test, exact in white normal noise); 1 if none spans `_FIRM` deviations.
    """
    n, channels = readings.shape
    if n < _FEWEST_OF_COURSE:
        return 1.0
    time = np.linspace(-1.0, 1.0, n)
    root, _ = np.linalg.qr(np.stack([np.ones(n), time, time**2], axis=1))
    total = ((readings - readings.mean(axis=0)) ** 2).sum(axis=0)
    parts = root @ (root.T @ readings)
    rest = np.maximum(((readings - parts) ** 2).sum(axis=0), np.maximum(floor * n, 1e-14 * total + _TINY))
    noise = np.sqrt(np.mean(np.diff(readings, n=2, axis=0) ** 2, axis=0) / 6.0)  # of white noise on a smooth course
    firm = np.ptp(parts, axis=0) > _FIRM * np.sqrt(np.maximum(noise**2, floor)) + _TINY
    if not firm.any():
        return 1.0
    p_values = fdtrc(2, n - 3, 0.5 * (n - 3) * np.maximum(total - rest, 0.0) / rest)
    return float(min(1.0, channels * p_values[firm].min()))


def _clipped(readings: Floats, floor: Floats) -> Floats:
    """Clip readings beyond both neighbours at three deviations from the median, unless half of them are equal."""
    off = readings - np.median(readings, axis=0)
    deviation = DEVIATION_OVER_MEDIAN * np.median(np.abs(off), axis=0)
    limit = np.where(deviation > 0.0, _CLIP * np.sqrt(deviation**2 + floor), np.inf)
    padded = np.concatenate([off[:1] * 0.0, off, off[:1] * 0.0])
    least, most = np.minimum(padded[:-2], padded[2:]), np.maximum(padded[:-2], padded[2:])
    return np.clip(off, np.minimum(-limit, least), np.maximum(limit, most))


@lru_cache(maxsize=256)
def _tested_ends(n: int) -> tuple[Index, Index]:
    """Return the numbers of samples at both ends of a sweep of n samples that are compared with the rest."""
    # 0, and steps of half an octave: 1, 2, 3, 4, 6, 8, 12, ...
    ends = [0, 1, *sorted(factor << k for k in range(n.bit_length()) for factor in (2, 3) if factor << k < n)]
    ends = [k for k in ends if k < n]
    before, after = (k.ravel() for k in np.meshgrid(ends, ends))
    tested = (before + after >= FEWEST) & (before + after < n)
    return before[tested], after[tested]


def _sums(values: Floats) -> Floats:
    return np.concatenate([np.zeros((1, values.shape[1])), np.cumsum(values, axis=0)])


def _log_beta_cdf(x: Floats, a: Floats, b: Floats) -> Floats:
    """Logarithm of the regularised incomplete beta function; where it underflows, by its first term."""
    a, b = np.broadcast_to(a, x.shape), np.broadcast_to(b, x.shape)
    p = betainc(a, b, x)
    tiny = p <= _TINY
    log_p = np.log(p, where=~tiny, out=np.empty_like(p))
    a, b, x = a[tiny], b[tiny], x[tiny]
    with np.errstate(divide="ignore"):
        log_p[tiny] = a * np.log(x) + b * np.log1p(-np.minimum(x, 0.5)) - np.log(a) - betaln(a, b)
    return log_p


# ---- onset and end


def _refined(
    readings: Floats, before: int, after: int, false_alarm: float, floor: Floats
) -> tuple[tuple[int, int], tuple[int, int]] | None:
    """Bounds of onset and snap-off, with bias and noise from the ends; None if no sample is certainly loaded."""
    n, channels = readings.shape
    ends = np.concatenate([readings[:before], readings[n - after :]])
    freedom = len(ends) - 1
    deviation = np.sqrt(np.maximum(((ends - ends.mean(axis=0)) ** 2).sum(axis=0) / freedom, np.maximum(floor, _TINY)))
    z = (readings - ends.mean(axis=0)) / deviation
    scales = [1 << k for k in range(max(1, (n // 2).bit_length()))]
    limit = -stdtrit(freedom, 0.5 * false_alarm / (channels * n * len(scales)))
    # A single outlier is no load: a sample needs a neighbour, and no sample may make a block significant by itself.
    first, last, width = n, -1, 1
    limit_one = limit * np.sqrt(1.0 + 1.0 / len(ends))
    sums = _sums(np.clip(z, -limit_one, limit_one))
    for m in scales:
        if m == 1:
            certain = (np.abs(z) > limit_one) & _neighboured(z)
        else:
            certain = np.abs(sums[m:] - sums[:-m]) / m > limit * np.sqrt(1.0 / m + 1.0 / len(ends))
        flat = certain.ravel()  # only the first and the last sample that is loaded in any channel matter
        begin = int(flat.argmax())
        if flat[begin]:
            first = min(first, begin // channels + m - 1)
            end = (flat.size - 1 - int(flat[::-1].argmax())) // channels
            if end > last:
                last, width = end, m
    if last < 0:
        return None
    begin = _last_before_ramp(readings, first, after, false_alarm, floor)
    end = _first_after_drop(z, last, width, float(fdtri(1, freedom, 1.0 - 2.0 * false_alarm)))
    # Contact may begin between two samples. If only a block shows a load, neither bound may lie beyond the block.
    begin, end = max(min(begin - 1, last - 1), -1), max(end, first + 1)
    return (begin, first), (last, end if end < n else -1)


def _neighboured(z: Floats) -> Flags:
    """Return whether the sample before or after deviates to the same side by more than three deviations."""
    padded = np.concatenate([np.zeros((1, z.shape[1])), z, np.zeros((1, z.shape[1]))])
    return np.asarray(np.maximum(padded[:-2] * np.sign(z), padded[2:] * np.sign(z)) > _CLIP)


def _last_before_ramp(readings: Floats, loaded: int, after: int, false_alarm: float, floor: Floats) -> int:
    """Lower limit of the last unloaded sample, for a load that grows linearly from zero up to the loaded sample: bias
    and slope are least squares for every possible start of the ramp; samples after contact are included.
    """
    n, channels = readings.shape
    known = np.concatenate([readings[: loaded + 1], readings[max(n - after, loaded + 1) :]])
    known = known - known.mean(axis=0)
    size = len(known)
    if loaded == 0 or size <= FEWEST:
        return -1
    start = np.arange(-1, loaded)
    height = (loaded - start).astype(float)  # of the ramp i − start at the loaded sample
    ramp, square = 0.5 * height * (height + 1.0), height * (height + 1.0) * (2.0 * height + 1.0) / 6.0
    product = np.cumsum(np.cumsum(known[loaded::-1], axis=0), axis=0)[::-1]
    total = (known**2).sum(axis=0)
    explained = product**2 / (square - ramp**2 / size)[:, None]
    residual = np.maximum(total - explained, np.maximum(floor * size, 1e-14 * total + _TINY))
    best = np.argmin(np.log(residual).sum(axis=1))
    freedom = size - FEWEST
    worse = (freedom * (residual / residual[best] - 1.0)).sum(axis=1)
    likely = worse <= fdtri(1, channels * freedom, 1.0 - 2.0 * false_alarm)
    return int(start[np.argmax(likely)])


def _first_after_drop(z: Floats, loaded: int, width: int, limit: float) -> int:
    """Upper limit of the first sample after the drop of a load that stays as it was around a loaded sample."""
    z = z[max(0, loaded - width + 1) :]
    known = min(loaded + 1, width)
    count = np.arange(1, len(z) + 1)[:, None]
    # Sum of squares that a constant load up to sample i explains, relative to zero load.
    explained = (np.cumsum(z, axis=0) ** 2 / count).sum(axis=1)[known - 1 :]
    likely = explained >= explained.max() - limit
    return loaded + 1 + int(np.flatnonzero(likely)[-1])


def _trend(stretch: Floats, false_alarm: float) -> bool:
    """Return whether a stretch has a significant slope."""
    n, channels = stretch.shape
    if n <= FEWEST:
        return False
    time = np.arange(n) - 0.5 * (n - 1)
    slope = time @ stretch / (time @ time)
    residual = stretch - stretch.mean(axis=0) - time[:, None] * slope
    error = np.sqrt((residual**2).sum(axis=0) / (n - 2) / (time @ time))
    return bool(np.any(np.abs(slope) > -stdtrit(n - 2, 0.5 * false_alarm / channels) * error))
