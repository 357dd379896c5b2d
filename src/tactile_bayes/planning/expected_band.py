"""The expected band of a contour, to first order."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from scipy import stats
from scipy.linalg import solve_triangular

from tactile_bayes.arrays import Floats
from tactile_bayes.inference.contour_model import ContourModel
from tactile_bayes.numerics.differences import central_slopes
from tactile_bayes.planning.record_information import STEP
from tactile_bayes.sweep import Scan
from tactile_bayes.uncertainty.offsets import heights_of

_GRID_POINTS = 25  # number of grid points in every stretch


class Stretch(NamedTuple):
    """An interval of x that is touched or a gap, with its grid points."""

    name: str  # "touched", or "gap"
    begin: float  # left end [length]
    end: float  # right end [length]
    x: Floats  # grid points, evenly between the ends, in a gap without them [length]


def stretches(scan: Scan) -> list[Stretch]:
    """Return the intervals of x that the sweeps touch, and the gaps between them, in ascending order."""
    arcs = joined_arcs([sweep.first_contact.contact_x, sweep.snap_off.contact_x] for sweep in scan.sweeps)
    found = [Stretch("touched", begin, end, np.linspace(begin, end, _GRID_POINTS)) for begin, end in arcs]
    for (_, end), (onward, _) in pairwise(arcs):
        found.append(Stretch("gap", end, onward, np.linspace(end, onward, _GRID_POINTS + 2)[1:-1]))
    return sorted(found, key=lambda stretch: stretch.begin)


def joined_arcs(arcs: Iterable[Sequence[float]]) -> list[list[float]]:
    """Return the intervals that others, given by their two ends, cover together, in ascending order."""
    joined: list[list[float]] = []
    for begin, end in sorted(sorted(ends) for ends in arcs):
        if joined and begin <= joined[-1][1]:
            joined[-1][1] = max(joined[-1][1], end)
        else:
            joined.append([begin, end])
    return joined


def band_factor(probability: float) -> float:
    """Return the width of a pointwise band of a normal distribution, over its standard deviation."""
    return 2.0 * float(stats.norm.ppf(0.5 + 0.5 * probability))


def height_slopes(model: ContourModel, point: Floats, x: Floats) -> Floats:
    """Return the derivatives of the contour's heights at x [length] by all parameters, shape (x, d)."""
    own = len(model.family.parameters)
    slopes = np.zeros((x.size, point.size))
    scale = np.maximum(np.abs(point[:own]), 1e-3 * model.likelihood.rod.length)
    slopes[:, :own] = central_slopes(lambda points: heights_of(model.contours(points), x), point[:own], STEP * scale)
    return slopes


def deviation_of_heights(slopes: Floats, precision: Floats) -> Floats:
    """Return the standard deviation of each height [length], shape (x,); NaN where the contour has none."""
    scale = np.sqrt(np.maximum(np.diag(precision), 1e-300))
    scaled = precision / np.outer(scale, scale)
    try:
        root = np.linalg.cholesky(scaled)
    except np.linalg.LinAlgError:
        return np.full(len(slopes), np.inf)
    half = solve_triangular(root, (slopes / scale).T, lower=True, check_finite=False)
    return np.asarray(np.sqrt(np.sum(half**2, axis=0)))


def mean_of_known(widths: Floats) -> float:
    """Return the mean of the widths that are known: a circle has no height beyond its sides. NaN if none is."""
    known = widths[~np.isnan(widths)]
    return float(known.mean()) if known.size else math.nan
