"""The stretches of a record: its sweeps, and the unloaded part before and after contact of each."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from tactile_bayes.arrays import Flags, Floats, Index
from tactile_bayes.numerics.scatter import robust_deviation

__all__ = ["Autocorrelation", "autocorrelation", "centred", "unloaded_stretches"]

_CUT = 4.0
"""Robust standard deviations at which residuals are clipped, so that no single outlier dominates."""


class Autocorrelation(NamedTuple):
    """Lag-one autocorrelation of unloaded residuals."""

    value: float
    """Coefficient, corrected for the bias from subtracting means; NaN if there are too few samples."""
    score: float
    """Coefficient in standard errors, about standard normal for white noise."""


def unloaded_stretches(sweeps: list[Index], unloaded: Flags) -> list[Index]:
    """Return the rows of every stretch of consecutive unloaded samples; `unloaded` has shape (samples,)."""
    stretches = []
    for rows in sweeps:
        flags = unloaded[rows]
        parts = np.split(rows, np.flatnonzero(np.diff(flags.astype(np.int8))) + 1)
        stretches += [part for part in parts if part.size and unloaded[part[0]]]
    return stretches


def centred(reading: Floats, stretches: list[Index]) -> tuple[Floats, float]:
    """Return unloaded readings less the median of their stretch, shape (n,), and their robust standard deviation."""
    residuals = [reading[rows] - np.median(reading[rows]) for rows in stretches]
    together = np.concatenate(residuals) if residuals else np.zeros(0)
    return together, robust_deviation(together)


def autocorrelation(reading: Floats, stretches: list[Index]) -> Autocorrelation:
    """Return the autocorrelation of readings, shape (samples,), in all stretches; NaN if most readings are equal."""
    _, spread = centred(reading, stretches)
    if spread == 0.0:
        return Autocorrelation(np.nan, np.nan)
    product, square, pairs, expected = 0.0, 0.0, 0, 0.0
    for rows in stretches:
        if rows.size < 3:
            continue
        residual = np.clip(reading[rows] - np.median(reading[rows]), -_CUT * spread, _CUT * spread)
        residual = residual - residual.mean()
        product += float(residual[1:] @ residual[:-1])
        square += float(residual @ residual)
        pairs += rows.size - 1
        expected -= (rows.size - 1) / rows.size
    if pairs < 10 or square <= 0.0:
        return Autocorrelation(np.nan, np.nan)
    variance = square / pairs  # a stretch of n has n − 1 degrees of freedom, as many as pairs
    value = (product / variance - expected) / pairs
    return Autocorrelation(float(np.clip(value, -1.0, 1.0)), float(value * np.sqrt(pairs)))
