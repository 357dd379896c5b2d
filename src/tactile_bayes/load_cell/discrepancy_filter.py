"""Kalman filter and smoother of a discrepancy, beside drift, bias and white noise, compiled."""

from __future__ import annotations

import math

import numpy as np

from tactile_bayes.arrays import Floats, Index
from tactile_bayes.mechanics.compiler import cached, compiled

__all__ = ["innovations", "leave_one_out"]

_STATES = 4
"""Number of states: the process, its derivative over its rate, drift, and bias."""


def innovations(
    residual: Floats,
    noise: Floats,
    weight: Floats,
    rate: Floats,
    order: Index,
    step: Floats,
    wandering: Floats,
    decay: float,
) -> tuple[Floats, Floats]:
    """Return innovations of samples given those before, shape (n, samples, channels), and their variances.

    The reading of a channel is weight · g + drift + bias + white noise, with g a Gaussian process of variance one and
    the covariance (1 + rate · d) exp(−rate · d) over the distance d: Matérn's with ν = 3/2, the state of which is g and
    its derivative (Hartikainen and Särkkä 2010, doi 10.1109/MLSP.2010.5589113).
    """
    new, total = np.empty(residual.shape), np.empty(residual.shape)
    none = np.empty((0, 0))
    _filter(residual, noise, weight, rate, order, step, wandering, decay, new, total, *_state(), none)
    return new, total


def leave_one_out(
    residual: Floats,
    noise: Floats,
    weight: Floats,
    rate: Floats,
    order: Index,
    step: Floats,
    wandering: Floats,
    decay: float,
) -> tuple[Floats, Floats]:
    """Return Q r and the diagonal of Q, with the inverse Q of the covariance of all samples of a channel r.

    They are the smoothed errors of the noise over its variance (de Jong 1988, doi 10.1093/biomet/75.3.594). The
    arguments are those of `innovations`.
    """
    weighed, precision = np.empty(residual.shape), np.empty(residual.shape)
    gains = np.empty((residual.shape[1], _STATES))
    _smooth(residual, noise, weight, rate, order, step, wandering, decay, weighed, precision, *_state(), gains)
    return weighed, precision


def _state() -> tuple[Floats, Floats, Floats]:
    """Return memory for the mean, the covariance, and a vector of the states."""
    return np.empty(_STATES), np.empty((_STATES, _STATES)), np.empty(_STATES)


@compiled
def _advance(covariance: Floats, a: float) -> None:
    """Advance the covariance of the process and its derivative by a, the distance times the rate."""
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
def _advance_mean(mean: Floats, a: float) -> None:
    e = math.exp(-a)
    m0, m1 = mean[0], mean[1]
    mean[0], mean[1] = e * ((1.0 + a) * m0 + a * m1), e * ((1.0 - a) * m1 - a * m0)


@compiled
def _pull_back(vector: Floats, a: float) -> None:
    """Multiply the part of the process in a vector by the transposed transition matrix."""
    e = math.exp(-a)
    v0, v1 = vector[0], vector[1]
    vector[0], vector[1] = e * ((1.0 + a) * v0 - a * v1), e * (a * v0 + (1.0 - a) * v1)


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
def _filter_channel(
    residual: Floats,
    noise: Floats,
    weight: Floats,
    rate: float,
    order: Index,
    step: Floats,
    initial: float,
    growth: float,
    bias: float,
    decay: float,
    new: Floats,
    total: Floats,
    mean: Floats,
    covariance: Floats,
    seen: Floats,
    gains: Floats,
) -> None:
    """Filter one channel, arrays of shape (samples,); without drift and bias, samples without weight are white."""
    wanders = initial > 0.0 or growth > 0.0 or bias > 0.0
    mean[:] = 0.0
    covariance[:] = 0.0
    covariance[2, 2] = initial
    covariance[3, 3] = bias
    away = 0.0
    for i in range(order.size):
        sample = order[i]
        away += step[i]
        if i > 0 and wanders:
            mean[2] *= decay
            for k in range(_STATES):
                covariance[2, k] *= decay
                covariance[k, 2] *= decay
            covariance[2, 2] += growth
        w = weight[sample]
        if w == 0.0 and not wanders:
            new[sample], total[sample] = residual[sample], noise[sample]
            if gains.size:
                gains[i, :] = 0.0
            continue
        if math.isinf(away):
            mean[:2] = 0.0
            covariance[:2, :] = 0.0
            covariance[:, :2] = 0.0
            covariance[0, 0] = covariance[1, 1] = 1.0
        else:
            _advance(covariance, rate * away)
            _advance_mean(mean, rate * away)
        away = 0.0
        seen[0], seen[1] = w * covariance[0, 0], w * covariance[1, 0]
        # Rounding may leave a negative variance.
        variance = max(w * seen[0], 0.0) + noise[sample]
        at = w * mean[0]
        if wanders:
            for k in range(_STATES):
                seen[k] = w * covariance[k, 0] + covariance[k, 2] + covariance[k, 3]
            variance = max(w * seen[0] + seen[2] + seen[3], 0.0) + noise[sample]
            at += mean[2] + mean[3]
        error = residual[sample] - at
        new[sample], total[sample] = error, variance
        states = _STATES if wanders else 2
        for k in range(states):
            mean[k] += seen[k] * error / variance
        if wanders:
            for k in range(_STATES):
                for j in range(_STATES):
                    covariance[k, j] -= seen[k] * seen[j] / variance
        else:
            left = noise[sample] / variance  # a factor keeps the digits that a difference loses
            covariance[0, 0] *= left
            covariance[0, 1] *= left
            covariance[1, 0] *= left
            covariance[1, 1] -= seen[1] * seen[1] / variance
        _bound(covariance, states)
        if gains.size:
            gains[i, :] = 0.0
            for k in range(states):
                gains[i, k] = seen[k] / variance


@cached
def _filter(
    residual: Floats,
    noise: Floats,
    weight: Floats,
    rate: Floats,
    order: Index,
    step: Floats,
    wandering: Floats,
    decay: float,
    new: Floats,
    total: Floats,
    mean: Floats,
    covariance: Floats,
    seen: Floats,
    gains: Floats,
) -> None:
    for p in range(rate.size):
        for c in range(residual.shape[2]):
            _filter_channel(
                residual[p, :, c],
                noise[p, :, c],
                weight[p, :, c],
                rate[p],
                order,
                step,
                wandering[0, c],
                wandering[1, c],
                wandering[2, c],
                decay,
                new[p, :, c],
                total[p, :, c],
                mean,
                covariance,
                seen,
                gains,
            )


@cached
def _smooth(
    residual: Floats,
    noise: Floats,
    weight: Floats,
    rate: Floats,
    order: Index,
    step: Floats,
    wandering: Floats,
    decay: float,
    weighed: Floats,
    precision: Floats,
    mean: Floats,
    covariance: Floats,
    seen: Floats,
    gains: Floats,
) -> None:
    for p in range(rate.size):
        for c in range(residual.shape[2]):
            # Innovations and their variances, which the second pass replaces.
            new, total = weighed[p, :, c], precision[p, :, c]
            _filter_channel(
                residual[p, :, c],
                noise[p, :, c],
                weight[p, :, c],
                rate[p],
                order,
                step,
                wandering[0, c],
                wandering[1, c],
                wandering[2, c],
                decay,
                new,
                total,
                mean,
                covariance,
                seen,
                gains,
            )
            pull, push = mean, covariance
            pull[:] = 0.0
            push[:] = 0.0
            for i in range(order.size - 1, -1, -1):
                sample = order[i]
                w, gain = weight[p, sample, c], gains[i]
                error, certain = new[sample] / total[sample], 1.0 / total[sample]
                for k in range(_STATES):
                    error -= gain[k] * pull[k]
                    seen[k] = 0.0
                    for j in range(_STATES):
                        seen[k] += push[k, j] * gain[j]
                for k in range(_STATES):
                    certain += gain[k] * seen[k]
                new[sample], total[sample] = error, certain
                for k in range(_STATES):
                    of_k = w if k == 0 else 0.0 if k == 1 else 1.0
                    pull[k] += of_k * error
                    for j in range(_STATES):
                        of_j = w if j == 0 else 0.0 if j == 1 else 1.0
                        push[k, j] += of_k * of_j * certain - of_k * seen[j] - seen[k] * of_j
                if i == 0:
                    break
                if math.isinf(step[i]):
                    pull[:2] = 0.0
                    push[:2, :] = 0.0
                    push[:, :2] = 0.0
                else:
                    _pull_back(pull, rate[p] * step[i])
                    for k in range(_STATES):
                        _pull_back(push[k], rate[p] * step[i])
                    for k in range(_STATES):
                        _pull_back(push[:, k], rate[p] * step[i])
                pull[2] *= decay
                for k in range(_STATES):
                    push[2, k] *= decay
                    push[k, 2] *= decay
