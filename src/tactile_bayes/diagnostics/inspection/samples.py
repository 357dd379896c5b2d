"""Samples that look wrong whatever the contour: outliers, stuck, cut-off and repeated readings, uneven steps."""

from __future__ import annotations

import math

import numpy as np
from scipy import stats
from scipy.special import fdtrc

from tactile_bayes.arrays import Flags, Floats, Index
from tactile_bayes.numerics.scatter import DEVIATION_OVER_MEDIAN, robust_deviation
from tactile_bayes.record import means_of_positions, positions_of

_CUT = 4.0  # robust standard deviations at which residuals are clipped, so that no single outlier dominates
_FEWEST = 8  # number of unloaded samples below which their scatter does not identify outliers
_EFFICIENCY = 0.37  # efficiency of the median absolute deviation relative to the standard deviation, in normal noise
_SHORTEST = 3  # smallest number of equal readings in a row that is reported
_JUMP = 2.0  # distance of a loaded outlier from the range of its four neighbours, over that range
_WIDER = 0.5  # difference of an uneven step from the usual step, over the usual step
_MOST_DIGITS = 6  # largest number of significant digits of a written reading that can make noisy ones equal
_WHOLE = 1e-6  # tolerated distance of a reading, in units of its last digit, from a whole number
_USUAL = 0.2  # largest share of uneven steps: with more of them, the drive is meant to move so


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


def autocorrelation(reading: Floats, stretches: list[Index]) -> tuple[float, float]:
    """Return the lag-one autocorrelation of unloaded readings, shape (samples,), and the same in standard errors.

    It is corrected for the bias from subtracting means; NaN if most readings are equal, or they are too few.
    """
    _, spread = centred(reading, stretches)
    if spread == 0.0:
        return np.nan, np.nan
    cut = [reading[rows] - np.median(reading[rows]) for rows in stretches if rows.size > 2]
    cut = [np.clip(residual, -_CUT * spread, _CUT * spread) for residual in cut]
    residuals = [residual - residual.mean() for residual in cut]
    pairs, square = sum(r.size - 1 for r in residuals), float(sum(r @ r for r in residuals))
    if pairs < 10 or square <= 0.0:
        return np.nan, np.nan
    product = float(sum(r[1:] @ r[:-1] for r in residuals))
    expected = -sum((r.size - 1) / r.size for r in residuals)
    variance = square / pairs  # a stretch of n has n − 1 degrees of freedom, as many as pairs
    value = (product / variance - expected) / pairs
    return float(np.clip(value, -1.0, 1.0)), float(value * np.sqrt(pairs))


def position_scatter(reading: Floats, stretches: list[Index], positions: list[Index]) -> tuple[float, float, float]:
    """Return the scatter of the means of unloaded positions, the same by the noise of single readings, and its p-value.

    The p-value is that of an analysis of variance; NaN where the drive does not stop, or positions are too few.
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


def outliers(reading: Floats, sweeps: list[Index], stretches: list[Index], step: float, *, false_alarm: float) -> Flags:
    """Flag readings, shape (n_samples,), far from their unloaded stretch, or, in contact, from all of four neighbours.

    A loaded reading must lie outside of its four neighbours by twice their range: no slope, kink or snap-off does that.
    """
    flags = np.zeros(reading.size, dtype=bool)
    residual, spread = centred(reading, stretches)
    if residual.size < _FEWEST:
        return flags
    spread += DEVIATION_OVER_MEDIAN * 0.5 * step
    level = 0.5 * false_alarm / reading.size
    most = float(stats.t.isf(level, max(_EFFICIENCY * (residual.size - len(stretches)), 1.0))) * spread
    unloaded = np.concatenate(stretches)
    flags[unloaded] = np.abs(residual) > most
    is_loaded = ~np.isin(np.arange(reading.size), unloaded)
    for rows in sweeps:
        if rows.size < 5:
            continue
        windows = np.lib.stride_tricks.sliding_window_view(reading[rows], 5)
        neighbours = windows[:, [0, 1, 3, 4]]
        highest, lowest = neighbours.max(axis=1), neighbours.min(axis=1)
        beyond = np.maximum(windows[:, 2] - highest, lowest - windows[:, 2])
        inner = rows[2:-2]
        flags[inner] |= (beyond > _JUMP * (highest - lowest) + most) & is_loaded[inner]
    return flags


def repeat_chance(reading: Floats, stretches: list[Index], step: float, noise: float) -> float:
    """Return the probability that two unloaded readings, shape (n_samples,), are equal by limited resolution."""
    by_steps = min(1.0, step / (2.0 * math.sqrt(math.pi) * noise)) if noise > 0.0 else 1.0
    values = np.concatenate([reading[rows][np.append(True, np.diff(reading[rows]) != 0.0)] for rows in stretches])
    if values.size < 2:
        return by_steps
    counts = np.unique(values, return_counts=True)[1]
    found = float(np.sum(counts * (counts - 1.0))) / (values.size * (values.size - 1.0))
    return max(by_steps, found)


def stuck(reading: Floats, sweeps: list[Index], chance: float, noise: float, *, false_alarm: float) -> Flags:
    """Flag readings, shape (n_samples,), that stay equal for longer than the limited resolution explains."""
    flags = np.zeros(reading.size, dtype=bool)
    chances = np.clip(_written_steps(reading) / (2.0 * math.sqrt(math.pi) * noise), chance, 1.0)
    for rows in sweeps:
        for run in np.split(rows, np.flatnonzero(np.diff(reading[rows])) + 1):
            if run.size >= _SHORTEST and reading.size * chances[run[0]] ** (run.size - 1) < false_alarm:
                flags[run] = True
    return flags


def _written_steps(reading: Floats) -> Floats:
    """Return the unit of each reading's last digit, where all are written with a few significant ones; else 0."""
    size = np.abs(reading)
    with np.errstate(divide="ignore"):
        power = np.where(size > 0.0, np.floor(np.log10(size)), 0.0)
    for digits in range(2, _MOST_DIGITS + 1):
        step = 10.0 ** (power - digits + 1)
        whole = reading / step
        if np.all(np.abs(whole - np.round(whole)) < _WHOLE):
            return np.where(size > 0.0, step, 0.0)
    return np.zeros(reading.size)


def repeated(readings: Floats, sweeps: list[Index], chances: Floats, *, false_alarm: float) -> Flags:
    """Flag samples of which all readings, shape (n_samples, n_channels), equal those of the sample before."""
    flags = np.zeros(len(readings), dtype=bool)
    if len(readings) * float(np.prod(chances)) >= false_alarm:
        return flags
    for rows in sweeps:
        same = np.all(np.diff(readings[rows], axis=0) == 0.0, axis=1)
        flags[rows[1:][same]] = True
    return flags


def uneven_steps(angle: Floats, rows: Index, sense: int) -> Flags:
    """Flag rows of a sweep, shape (rows,), whose preceding step of the angle [rad] is unusual; none if many are.

    Where the drive stops to measure, its steps are those between positions.
    """
    flags = np.zeros(rows.size, dtype=bool)
    positions = positions_of(angle[rows])
    step = sense * np.diff(means_of_positions(angle[rows], positions))
    if step.size < _FEWEST:
        return flags
    usual = float(np.median(step))
    spread = robust_deviation(step - usual)
    differs = np.abs(step - usual) > max(_WIDER * abs(usual), 6.0 * spread)
    if np.mean(differs) <= _USUAL:
        flags[np.flatnonzero(np.diff(positions))[differs] + 1] = True
    return flags
