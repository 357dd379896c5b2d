"""Positions of a drive that stops to measure: runs of readings at one place of a sweep."""

from __future__ import annotations

import numpy as np

from tactile_bayes.arrays import Floats, Index

_APART = 1.5  # least ratio of the smallest step between positions to the largest difference of readings at one position
_FEWEST_STEPS = 3
_MOST_POSITIONS = 2.0 / 3.0  # largest number of steps between positions, over the number of all steps
# Largest net motion at positions over the way between them; share of their differences that it may make up; and largest
# sum of these differences, over the way between positions, for which it may make up more.
_DRIFT, _ONE_SIDED, _CREEP = 0.3, 0.5, 0.03


def positions_of(travel: Floats) -> Index:
    """Return the position, counted from 0, at which each sample of a sweep was read; one a sample if none is shared.
    Differences of neighbours are divided where two successive sizes are furthest apart in ratio, if the larger ones may
    be steps of the drive, and the smaller ones noise.
    """
    steps = np.diff(travel) * (1.0 if travel[-1] >= travel[0] else -1.0)
    sizes = np.sort(np.abs(steps))
    larger = sizes.size - np.arange(1, sizes.size)  # number of steps above each of the possible divisions
    with np.errstate(divide="ignore", invalid="ignore"):
        ratios = np.where(sizes[1:] > 0.0, sizes[1:] / sizes[:-1], 1.0)
    ratios[(larger < _FEWEST_STEPS) | (larger > _MOST_POSITIONS * sizes.size)] = 1.0
    for place in np.argsort(-ratios, kind="stable"):
        if not ratios[place] > _APART:
            break
        jumps = np.abs(steps) >= sizes[place + 1]
        if _stops(steps[jumps], steps[~jumps]):
            return np.append(0, np.cumsum(jumps)).astype(np.intp)
    return np.arange(travel.size, dtype=np.intp)


def end_of_rest(travel: Floats, begin: int, end: int) -> int:
    """Return the end of a sweep with all readings at its last position; noise puts the turning point among them."""
    positions = positions_of(travel[begin:end])
    means = means_of_positions(travel[begin:end], positions)
    if means.size == end - begin:
        return end
    away = np.abs(travel[end:] - means[-1]) > 0.5 * np.median(np.abs(np.diff(means)))
    return end + int(np.argmax(away)) if away.any() else end


def _stops(jumps: Floats, others: Floats) -> bool:
    """Return whether the drive moves by some steps, and rests in the others."""
    way, motion, noise = jumps.sum(), others.sum(), np.abs(others).sum()
    return bool(
        np.all(jumps > 0.0) and motion <= _DRIFT * way and (motion <= _ONE_SIDED * noise or noise <= _CREEP * way)
    )


def means_of_positions(values: Floats, positions: Index) -> Floats:
    """Return the mean of the values, shape (samples, ...), at each position, shape (positions, ...)."""
    starts = np.flatnonzero(np.append(True, np.diff(positions) != 0))
    if starts.size == len(values):
        return values
    counts = np.diff(np.append(starts, len(values))).astype(float)
    return np.asarray(np.add.reduceat(values, starts, axis=0) / counts.reshape(-1, *(1,) * (values.ndim - 1)))
