"""Kalman filter and smoother of readings with drift, bias, a discrepancy and white noise, compiled.

The reading of a channel is weight · g + drift + bias + white noise; the state of g, a Gaussian process with Matérn's
covariance for ν = 3/2, is g and its derivative over the rate (Hartikainen and Särkkä 2010, doi
10.1109/MLSP.2010.5589113). Beside a drift that does not decay, a bias is a part of it; beside one that does, without a
discrepancy, it is a regression on the filter's response to ones, which holds for a bias that is hardly known.
"""

from __future__ import annotations

import math

import numpy as np

from tactile_bayes.arrays import Floats, Index
from tactile_bayes.load_cell.discrepancy import Course, Discrepancy
from tactile_bayes.load_cell.drift import Zero
from tactile_bayes.mechanics.compiler import cached, compiled

_STATES = 4  # the process, its derivative over its rate, drift, and bias


def given_before(
    residual: Floats, noise: Floats, zero: Zero, discrepancy: Discrepancy | None = None
) -> tuple[Floats, Floats]:
    """Return residuals of samples given those before, shape (..., samples, channels), and their variances."""
    if _is_of_states(zero, discrepancy):
        return _run(False, residual, noise, zero, discrepancy)
    without = zero._replace(bias=np.zeros(1))
    residual, ones, _ = np.broadcast_arrays(residual, 1.0, noise)
    (new, of_one), (total, _) = _run(False, np.stack([residual, ones]), noise, without)
    with np.errstate(divide="ignore"):
        known = 1.0 / zero.bias + _sum_before(of_one**2 / total)
    new = new - of_one * _sum_before(of_one * new / total) / known
    return new, total + of_one**2 / known


def given_others(
    residual: Floats, noise: Floats, zero: Zero, discrepancy: Discrepancy | None = None
) -> tuple[Floats, Floats]:
    """Return residuals of samples given all others, and their variances: (Q r)_i / Q_ii and 1 / Q_ii, with the inverse
    Q of the covariance of all samples r (de Jong 1988, doi 10.1093/biomet/75.3.594).
    """
    if _is_of_states(zero, discrepancy):
        weighed, precision = _run(True, residual, noise, zero, discrepancy)
    else:
        # The bias is a change of rank one of Q: the Sherman–Morrison formula.
        without = zero._replace(bias=np.zeros(1))
        residual, ones, _ = np.broadcast_arrays(residual, 1.0, noise)
        (weighed, of_one), (precision, _) = _run(True, np.stack([residual, ones]), noise, without)
        with np.errstate(divide="ignore"):
            known = 1.0 / zero.bias + of_one.sum(axis=-2, keepdims=True)
        weighed = weighed - of_one * weighed.sum(axis=-2, keepdims=True) / known
        precision = precision - of_one**2 / known
    return weighed / precision, 1.0 / precision


def _is_of_states(zero: Zero, discrepancy: Discrepancy | None) -> bool:
    return zero.decay == 1.0 or not np.any(zero.bias) or discrepancy is not None


def _sum_before(values: Floats) -> Floats:
    """Return the sums over the samples before each."""
    sums = np.zeros_like(values)
    np.cumsum(values[..., :-1, :], axis=-2, out=sums[..., 1:, :])
    return sums


def _run(
    smooths: bool, residual: Floats, noise: Floats, zero: Zero, discrepancy: Discrepancy | None = None
) -> tuple[Floats, Floats]:
    """Filter, or smooth as well, with one axis for the batch."""
    noise = np.atleast_2d(noise)
    constant = zero.bias if zero.decay == 1.0 else 0.0
    variances = zero.initial + constant, zero.step, zero.bias - constant
    of_zero = [np.expand_dims(np.atleast_1d(values), -2) for values in variances]
    weight, rate = (np.zeros(()), np.zeros(())) if discrepancy is None else (discrepancy.deviation, discrepancy.rate)
    shapes = residual.shape, noise.shape, of_zero[0].shape, weight.shape, (*rate.shape, 1, 1)
    shape = np.broadcast_shapes(*shapes)
    course = Course(np.arange(shape[-2]), np.ones(shape[-2])) if discrepancy is None else discrepancy.course
    arrays = [np.broadcast_to(values, shape).reshape(-1, *shape[-2:]) for values in (residual, noise, weight)]
    arrays.append(np.broadcast_to(rate, shape[:-2]).ravel())
    arrays.append(np.stack([np.broadcast_to(v, (*shape[:-2], 1, shape[-1])).reshape(-1, shape[-1]) for v in of_zero]))
    # Arrays that are read only, or lie otherwise in memory, would each be another type, for which all is compiled anew.
    residual, noise, weight, rate, wandering = (np.require(values, requirements=["C", "W"]) for values in arrays)
    found = np.empty(residual.shape), np.empty(residual.shape)
    gains = np.empty((course.order.size if smooths else 0, _STATES))
    state = np.empty(_STATES), np.empty((_STATES, _STATES)), np.empty(_STATES), gains
    _filter_all((residual, noise, weight), rate, *course, wandering, zero.decay, smooths, found, state)
    return found[0].reshape(shape), found[1].reshape(shape)


@compiled
def _advance(mean: Floats, covariance: Floats, a: float) -> None:
    """Advance the process and its derivative by a, the distance times the rate; anew where that is infinite."""
    if math.isinf(a):
        mean[:2] = 0.0
        covariance[:2, :] = 0.0
        covariance[:, :2] = 0.0
        covariance[0, 0] = covariance[1, 1] = 1.0
        return
    e = math.exp(-a)
    t00, t01, t10, t11 = e * (1.0 + a), e * a, -e * a, e * (1.0 - a)
    for k in range(2, _STATES):  # with the other states
        p0, p1 = covariance[0, k], covariance[1, k]
        covariance[0, k] = covariance[k, 0] = t00 * p0 + t01 * p1
        covariance[1, k] = covariance[k, 1] = t10 * p0 + t11 * p1
    p00, p01, p11 = covariance[0, 0], covariance[0, 1], covariance[1, 1]
    covariance[0, 0] = t00 * t00 * p00 + 2.0 * t00 * t01 * p01 + t01 * t01 * p11 + _new_variance(2.0 * a)
    covariance[1, 1] = t10 * t10 * p00 + 2.0 * t10 * t11 * p01 + t11 * t11 * p11
    covariance[1, 1] += 2.0 * a * (1.0 - a) * e * e - math.expm1(-2.0 * a)
    between = t00 * t10 * p00 + (t00 * t11 + t01 * t10) * p01 + t01 * t11 * p11 + 2.0 * t01 * t01
    covariance[0, 1] = covariance[1, 0] = between
    m0, m1 = mean[0], mean[1]
    mean[0], mean[1] = e * ((1.0 + a) * m0 + a * m1), e * ((1.0 - a) * m1 - a * m0)


@compiled
def _new_variance(x: float) -> float:
    """Return 1 − exp(−x) (1 + x + x²/2), the variance of the process given its state x/2 before."""
    if x > 1.0:
        return 1.0 - math.exp(-x) * (1.0 + x * (1.0 + 0.5 * x))
    series = 1.0
    for k in range(18, 3, -1):
        series = 1.0 + x / k * series
    return math.exp(-x) * x * x * x / 6.0 * series


@compiled
def _pull_back(vector: Floats, a: float) -> None:
    """Multiply the part of the process in a vector by the transposed transition matrix; zero where a is infinite."""
    if math.isinf(a):
        vector[:2] = 0.0
        return
    e = math.exp(-a)
    v0, v1 = vector[0], vector[1]
    vector[0], vector[1] = e * ((1.0 + a) * v0 - a * v1), e * (a * v0 + (1.0 - a) * v1)


@compiled
def _condition(
    mean: Floats,
    covariance: Floats,
    seen: Floats,
    error: float,
    variance: float,
    noise: float,
    bends: bool,
    drifts: bool,
) -> None:
    """Condition process, drift or both on a reading; a factor keeps the digits that a difference loses."""
    left = noise / variance
    for k in range(_STATES if drifts else 2):
        mean[k] += seen[k] * error / variance
    if not bends:
        covariance[2, 2] *= left
    elif drifts:
        for k in range(_STATES):
            for j in range(_STATES):
                covariance[k, j] -= seen[k] * seen[j] / variance
        _bound(covariance, _STATES)
    else:
        covariance[0, 0] *= left
        covariance[0, 1] *= left
        covariance[1, 0] *= left
        covariance[1, 1] -= seen[1] * seen[1] / variance
        _bound(covariance, 2)


@compiled
def _bound(covariance: Floats, states: int) -> None:
    """Keep variances ≥ 0 and correlations within ±1, of which rounding leaves less where the noise is next to none."""
    for k in range(states):
        covariance[k, k] = max(covariance[k, k], 0.0)
        for j in range(k):
            largest = covariance[k, k] * covariance[j, j]
            if covariance[k, j] * covariance[k, j] > largest:
                covariance[k, j] = covariance[j, k] = math.copysign(math.sqrt(largest), covariance[k, j])


@compiled
def _filter(
    readings: tuple[Floats, Floats, Floats],
    rate: float,
    order: Index,
    step: Floats,
    variances: tuple[float, float, float],
    decay: float,
    found: tuple[Floats, Floats],
    state: tuple[Floats, Floats, Floats, Floats],
) -> None:
    """Filter one channel, arrays of shape (samples,)."""
    (residual, white, weight), (new, total), (mean, covariance, seen, gains) = readings, found, state
    initial, growth, bias = variances
    wanders = initial > 0.0 or growth > 0.0 or bias > 0.0
    mean[:] = 0.0
    covariance[:] = 0.0
    covariance[2, 2] = initial
    covariance[3, 3] = bias
    seen[:] = 0.0
    away = 0.0
    for i in range(order.size):
        sample = order[i]
        noise, w = white[sample], weight[sample]
        away += step[i]
        if i > 0 and wanders:
            mean[2] *= decay
            for k in range(_STATES):
                covariance[2, k] *= decay
                covariance[k, 2] *= decay
            covariance[2, 2] += growth
        if w == 0.0 and not wanders:
            new[sample], total[sample] = residual[sample], noise
            if gains.size:
                gains[i, :] = 0.0
            continue
        if rate > 0.0:
            _advance(mean, covariance, rate * away)
            away = 0.0
        if wanders:
            for k in range(_STATES):
                seen[k] = w * covariance[k, 0] + covariance[k, 2] + covariance[k, 3]
            variance = max(w * seen[0] + seen[2] + seen[3], 0.0) + noise  # rounding may leave a negative one
            error = residual[sample] - (w * mean[0] + mean[2] + mean[3])
        else:
            seen[0], seen[1] = w * covariance[0, 0], w * covariance[1, 0]
            variance = max(w * seen[0], 0.0) + noise
            error = residual[sample] - w * mean[0]
        new[sample], total[sample] = error, variance
        if gains.size:
            for k in range(_STATES):
                gains[i, k] = seen[k] / variance
        _condition(mean, covariance, seen, error, variance, noise, rate > 0.0, wanders)


@compiled
def _smooth(
    weight: Floats,
    rate: float,
    order: Index,
    step: Floats,
    decay: float,
    found: tuple[Floats, Floats],
    state: tuple[Floats, Floats, Floats, Floats],
) -> None:
    """Replace innovations and their variances by Q r and the diagonal of Q, from the last sample backward."""
    (weighed, precision), (pull, push, across, gains) = found, state
    pull[:] = 0.0
    push[:] = 0.0
    for i in range(order.size - 1, -1, -1):
        sample, gain = order[i], gains[i]
        w = weight[sample]
        error, certain = weighed[sample] / precision[sample], 1.0 / precision[sample]
        for k in range(_STATES):
            error -= gain[k] * pull[k]
            across[k] = 0.0
            for j in range(_STATES):
                across[k] += push[k, j] * gain[j]
        for k in range(_STATES):
            certain += gain[k] * across[k]
        weighed[sample], precision[sample] = error, certain
        for k in range(_STATES):
            of_k = w if k == 0 else 0.0 if k == 1 else 1.0
            pull[k] += of_k * error
            for j in range(_STATES):
                of_j = w if j == 0 else 0.0 if j == 1 else 1.0
                push[k, j] += of_k * of_j * certain - of_k * across[j] - across[k] * of_j
        if rate > 0.0:
            _pull_back(pull, rate * step[i])
            for k in range(_STATES):
                _pull_back(push[k], rate * step[i])
            for k in range(_STATES):
                _pull_back(push[:, k], rate * step[i])
        pull[2] *= decay
        for k in range(_STATES):
            push[2, k] *= decay
            push[k, 2] *= decay


@cached
def _filter_all(
    readings: tuple[Floats, Floats, Floats],
    rate: Floats,
    order: Index,
    step: Floats,
    wandering: Floats,
    decay: float,
    smooths: bool,
    found: tuple[Floats, Floats],
    state: tuple[Floats, Floats, Floats, Floats],
) -> None:
    (residual, white, weight), (new, total) = readings, found
    for p in range(rate.size):
        for c in range(residual.shape[2]):
            own = residual[p, :, c], white[p, :, c], weight[p, :, c]
            variances = wandering[0, p, c], wandering[1, p, c], wandering[2, p, c]
            of_channel = new[p, :, c], total[p, :, c]
            _filter(own, rate[p], order, step, variances, decay, of_channel, state)
            if smooths:
                _smooth(own[2], rate[p], order, step, decay, of_channel, state)
