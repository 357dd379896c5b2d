"""The memory of a sensor: a lag of first order, and play, which makes a loop of hysteresis.

Both act on the loads of a record in its order. With a lag of n readings a share c = exp(−1/n) of the difference is left
at each reading, yₖ = xₖ + c (yₖ₋₁ − xₖ): a steady change is read c/(1 − c) readings late. With play of half a width r
the output stays where it is until the input is further from it than r, and follows at that distance: yₖ is yₖ₋₁, moved
into xₖ ± r (the play operator of Krasnosel'skii and Pokrovskii 1989, doi 10.1007/978-3-642-61302-9). The lag starts at
the first reading, and play without load.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from tactile_bayes.arrays import Floats


def remembered(loads: Floats, lag: Any, play: Any) -> Floats:
    """Return loads, shape (n, ..., samples, 3), as a sensor with memory reads them: lag, then play.

    Lags [samples] and plays, shares of the largest load of each channel, are numbers or have the shape (n,).
    """
    lag, play = (np.reshape(value, (-1, *(1,) * (loads.ndim - 2))) for value in (lag, play))
    if np.any(lag):
        loads = _delayed(loads, lag)
    return _loose(loads, play * np.abs(loads).max(axis=-2)) if np.any(play) else loads


def delay_of(lag: float) -> float:
    """Return by how many samples a steady change is read late."""
    with np.errstate(divide="ignore", over="ignore"):
        return float(1.0 / np.expm1(1.0 / np.float64(lag)))


def _delayed(loads: Floats, lag: Floats) -> Floats:
    with np.errstate(divide="ignore"):
        left = np.exp(-1.0 / lag)
    out = loads.copy()
    for k in range(1, loads.shape[-2]):
        out[..., k, :] += left * (out[..., k - 1, :] - loads[..., k, :])
    return out


def _loose(loads: Floats, half: Floats) -> Floats:
    """Return the output of play with half widths of the shape of the loads of a sample."""
    out, now = np.empty_like(loads), np.zeros_like(half)
    for k in range(loads.shape[-2]):
        now = np.clip(now, loads[..., k, :] - half, loads[..., k, :] + half)
        out[..., k, :] = now
    return out
