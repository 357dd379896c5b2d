"""The stretches of a record: its sweeps, and the unloaded part before and after contact of each."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.special import fdtrc

from tactile_bayes.arrays import Flags, Floats, Index
from tactile_bayes.numerics.scatter import robust_deviation
from tactile_bayes.record import means_of_positions

_CUT = 4.0  # robust standard deviations at which residuals are clipped, so that no single outlier dominates


class Autocorrelation(NamedTuple):
    """Lag-one autocorrelation of unloaded residuals."""

    value: float  # coefficient, corrected for the bias from subtracting means; NaN if there are too few samples
    score: float  # coefficient in standard errors, about standard normal for white noise


def unloaded_stretches(sweeps: list[Index], unloaded: Flags) -> list[Index]:
    """Return the rows of every stretch of consecutive unloaded samples; `unloaded` has shape (samples,)."""
    stretches = []
    for rows in sweeps:
        flags = unloaded[rows]
        parts = np.split(rows, np.flatnonzero(np.diff(flags)) + 1)
        stretches += [part for part in parts if part.size and unloaded[part[0]]]
    return stretches


def centred(reading: Floats, stretches: list[Index]) -> tuple[Floats, float]:
    """Return unloaded readings less the median of their stretch, shape (n,), and their robust standard deviation."""
    residuals = [reading[rows] - np.median(reading[rows]) for rows in stretches]
    together = np.concatenate([np.zeros(0), *residuals])
    return together, robust_deviation(together)


def autocorrelation(reading: Floats, stretches: list[Index]) -> Autocorrelation:
    """Return the autocorrelation of readings, shape (samples,), in all stretches; NaN if most readings are equal."""
    _, spread = centred(reading, stretches)
    if spread == 0.0:
        return Autocorrelation(np.nan, np.nan)
    cut = [reading[rows] - np.median(reading[rows]) for rows in stretches if rows.size > 2]
    cut = [np.clip(residual, -_CUT * spread, _CUT * spread) for residual in cut]
    residuals = [residual - residual.mean() for residual in cut]
    pairs, square = sum(r.size - 1 for r in residuals), float(sum(r @ r for r in residuals))
    if pairs < 10 or square <= 0.0:
        return Autocorrelation(np.nan, np.nan)
    product = float(sum(r[1:] @ r[:-1] for r in residuals))
    expected = -sum((r.size - 1) / r.size for r in residuals)
    variance = square / pairs  # a stretch of n has n − 1 degrees of freedom, as many as pairs
    value = (product / variance - expected) / pairs
    return Autocorrelation(float(np.clip(value, -1.0, 1.0)), float(value * np.sqrt(pairs)))


def position_scatter(reading: Floats, stretches: list[Index], positions: list[Index]) -> tuple[float, float, float]:
    """Return the scatter of the means of unloaded positions, of readings of shape (samples,) and positions of each.

    It is the standard deviation about the mean of the stretch, the same if only the noise of single readings causes it,
    and the p-value of that (analysis of variance); NaN where the drive does not stop, or positions are too few.
    """
    between, within, square, places, samples, groups = 0.0, 0.0, 0.0, 0, 0, 0
    for rows, stops in zip(stretches, positions, strict=True):
        means = means_of_positions(reading[rows], stops)
        if not 1 < means.size < rows.size:
            continue
        within += float(np.sum((reading[rows] - means[stops]) ** 2))
        between += float(np.sum((means[stops] - reading[rows].mean()) ** 2))
        square += float(np.sum((means - means.mean()) ** 2))
        places, samples, groups = places + means.size, samples + rows.size, groups + 1
    free, free_within = places - groups, samples - places
    if free < 1 or free_within < 1 or within <= 0.0:
        return np.nan, np.nan, np.nan
    variance = within / free_within
    p_value = float(fdtrc(free, free_within, between / free / variance))
    return float(np.sqrt(square / free)), float(np.sqrt(variance * places / samples)), p_value
