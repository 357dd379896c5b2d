"""Tests whether measured points can be points of a convex contour: in one band, and nowhere bent downward."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from scipy.special import stdtrit

from tactile_bayes.arrays import Floats
from tactile_bayes.errors import ContourError

STRAIGHT = "; a contour must be curved: measure a longer stretch or more points, of the lower boundary only"

FALSE_ALARM = 1e-3  # probability that the points of a convex contour are refused
_LEAST_BEND = 3.0  # least upward bend of all points together, in standard errors
# Number of neighbouring points that are tested for two bands, and the least number of all points.
_NEIGHBOURS, _FEWEST_BANDED = 8, 20


class Bends(NamedTuple):
    """Parabolas fitted to stretches of neighbouring points, the last of all points, by the product with a parabola of
    signs + − + that is orthogonal to lines. Heights of a convex contour, less the line through them at its sign
    changes, have the signs + − + too, so that their product is never negative."""

    first: Floats
    last: Floats
    size: Floats  # coefficients of the squares
    errors: Floats  # coefficients in standard errors

    @property
    def mean_curvature(self) -> float:
        return 2.0 * float(self.size[-1])

    @classmethod
    def of(cls, u: Floats, heights: Floats, noise: Floats) -> Bends:
        u, at = np.unique(u, return_inverse=True)
        weight = np.bincount(at, noise**-2.0)
        heights = np.bincount(at, heights * noise**-2.0) / weight
        found = []
        length = 3
        while True:
            length = min(length, u.size)
            starts = np.arange(0, u.size - length + 1, max(1, length // 8))
            starts = np.union1d(starts, u.size - length)
            x, y, w = (np.asarray(sliding_window_view(c, length)[starts], float) for c in (u, heights, weight))
            offset = x - _mean(x, w)
            spread = _mean(offset**2, w)
            square = offset**2 - spread - _mean(offset**3, w) / spread * offset
            y = y - _mean(y, w)
            y = y - _mean(offset * y, w) / spread * offset
            norm = np.sum(w * square**2, axis=1)
            product = np.sum(w * square * y, axis=1)
            found.append((x[:, 0], x[:, -1], product / norm, product / np.sqrt(norm)))
            if length == u.size:
                return cls(*(np.concatenate(column) for column in zip(*found, strict=True)))
            length = int(np.ceil(1.35 * length))


def _mean(values: Floats, weight: Floats) -> Floats:
    return np.asarray(np.sum(weight * values, axis=1, keepdims=True) / np.sum(weight, axis=1, keepdims=True))


def refuse_unless_convex(bends: Bends, freedom: float, place: Callable[[float], float], remark: str) -> None:
    limit = -float(stdtrit(freedom, FALSE_ALARM / bends.errors.size))
    worst = int(np.argmin(bends.errors))
    if bends.errors[-1] < -limit and bends.errors.max() < limit:
        raise ContourError(
            "from_points: the points are upside down: they bend downward. The contour is the lower boundary of an "
            "object that lies above the pivot; if it was measured from above, mirror y"
        )
    if bends.errors[worst] < -limit:
        first, last = bends.first[worst], bends.last[worst]
        off_chord = -bends.size[worst] * (0.5 * (last - first)) ** 2
        raise ContourError(
            f"from_points: the points are not convex from x = {place(first):.6g} to {place(last):.6g}: there they bend "
            f"downward by {-bends.errors[worst]:.1f} standard errors ({limit:.1f} pass as chance), and stand off a "
            f"chord by {off_chord:.3g} ({remark}). Leave this stretch out, or give a larger scatter; an object "
            "with a dent cannot be modelled"
        )
    if bends.errors[-1] < _LEAST_BEND:
        raise ContourError(
            f"from_points: the points cannot be distinguished from a straight line: as a whole they bend upward by "
            f"{bends.errors[-1]:.1f} standard errors, and {_LEAST_BEND:g} are needed ({remark}){STRAIGHT}"
        )


def refuse_two_bands(x: Floats, y: Floats) -> None:
    """Refuse points with two heights at about the same x, like those of a closed outline.

    The heights of eight neighbours are parted at their widest gap. If upper and lower ones alternate, with a gap twice
    as wide as either part, in more than a third of all groups, it is an outline; of those that scatter, 1 in 150 does.
    """
    if x.size < _FEWEST_BANDED:
        return
    _, place = np.unique(x, return_inverse=True)
    order = np.lexsort((np.where(place % 2, -y, y), x))  # where an x repeats, with as few turns as possible
    groups = sliding_window_view(y[order], _NEIGHBOURS)
    heights = np.sort(groups, axis=1)
    last = 1 + np.argmax(np.diff(heights, axis=1)[:, 1:-1], axis=1)  # at least two in either part
    group = np.arange(len(groups))
    below, above = heights[group, last], heights[group, last + 1]
    spans = np.maximum(below - heights[:, 0], heights[:, -1] - above)
    turns = np.count_nonzero(np.diff(groups > below[:, None], axis=1), axis=1)
    banded = (above - below > 2.0 * spans) & (turns > 2)
    if 3 * np.count_nonzero(banded) > banded.size:
        at = int(np.argmax(np.where(banded, above - below, -np.inf)))
        middle = float(np.round(x[order[at + _NEIGHBOURS // 2]], 12)) + 0.0
        raise ContourError(
            f"from_points: near x = {middle:.6g} there are points at y = {below[at]:.6g} and at y = {above[at]:.6g}, "
            "as on a closed outline: give the lower boundary only, the side that faces the pivot"
        )
