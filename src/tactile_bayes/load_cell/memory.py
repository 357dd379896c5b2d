"""The memory of a sensor: a lag of first order, and play, which makes a loop of hysteresis, by samples xₖ in their
order.

A lag of n readings gives yₖ = xₖ + c (yₖ₋₁ − xₖ) with c = exp(−1/n), from the first reading on, n being τ/Δt for one in
seconds; a steady change is read c/(1 − c) readings late. Play of half a width r gives yₖ₋₁, moved into xₖ ± r, from
zero on (the play operator of Krasnosel'skii and Pokrovskii 1989, doi 10.1007/978-3-642-61302-9).
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np

from tactile_bayes.arrays import Floats
from tactile_bayes.errors import ParameterError

_NO_TIME = 1e-300  # [s]


def remembered(loads: Floats, memory: Iterable[Any], times: Floats | None = None) -> Floats:
    """Return loads, shape (..., samples, 3), as a sensor with memory reads them: lag, then play. A memory is a lag in
    readings, one in seconds, and a play, as a share of the largest load of each channel, which broadcast against loads,
    and are the same for all samples, whose times [s] have the shape (samples,).
    """
    lag, lag_seconds, play = memory
    if np.any(lag_seconds):
        if times is None:
            raise ParameterError(
                "lag_seconds of the load cell says nothing of loads without times: take a record with a column of "
                "times, or give its lag in readings"
            )
        with np.errstate(over="ignore"):
            lag = lag + lag_seconds / steps_of(times)
    if np.any(lag):
        loads = _delayed(loads, np.asarray(lag))
    return _loose(loads, (play * np.abs(loads).max(axis=-2, keepdims=True))[..., 0, :]) if np.any(play) else loads


def steps_of(times: Floats) -> Floats:
    """Return the times from the samples before to each, shape (samples, 1), hardly any to the first."""
    return np.maximum(np.diff(times, prepend=times[:1]), _NO_TIME)[:, None]


def delays_of(lag: Any, lag_seconds: Any, times: Floats) -> Floats:
    """Return how late a steady change is read at each sample, shape (samples, 3), in the unit of the times."""
    steps = steps_of(times)
    with np.errstate(divide="ignore", over="ignore"):
        late = steps / np.expm1(steps / (np.asarray(lag) * steps + np.asarray(lag_seconds)))
    return np.broadcast_to(late, (times.size, 3))


def _delayed(loads: Floats, lag: Floats) -> Floats:
    with np.errstate(divide="ignore"):
        left = np.exp(-1.0 / lag)
    left, out = np.broadcast_to(left, np.broadcast_shapes(left.shape, (loads.shape[-2], 1))), loads.copy()
    for k in range(1, loads.shape[-2]):
        out[..., k, :] += left[..., k, :] * (out[..., k - 1, :] - loads[..., k, :])
    return out


def _loose(loads: Floats, half: Floats) -> Floats:
    """Return the output of play with half widths of the shape of the loads of a sample."""
    out, now = np.empty_like(loads), np.zeros_like(half)
    for k in range(loads.shape[-2]):
        now = np.clip(now, loads[..., k, :] - half, loads[..., k, :] + half)
        out[..., k, :] = now
    return out
