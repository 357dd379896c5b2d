"""Bends of measured points: whether heights along a line may be those of a convex contour."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from scipy.stats import t as student_t

from tactile_bayes.contours.base import Floats
from tactile_bayes.errors import ContourError

__all__ = ["FALSE_ALARM", "STRAIGHT", "Bends", "refuse_unless_convex"]

STRAIGHT = "; a contour must be curved: measure a longer stretch or more points"

FALSE_ALARM = 1e-3
"""How often points of a contour that is convex may be refused."""

_SEEN = 3.0
"""Standard errors by which the points must bend upward as a whole."""


class Bends(NamedTuple):
    """Parabolas fitted to stretches of neighbouring points; the last stretch is all of them.

    The quadratic term is the heights' product with a parabola that is + − + and orthogonal to lines. Less the line that
    meets them where it changes sign, heights of a convex contour are + − + too: their product is never negative.
    """

    first: Floats
    last: Floats
    size: Floats
    """Coefficients of the squares."""
    errors: Floats
    """The same in standard errors."""

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
    limit = float(student_t.isf(FALSE_ALARM / bends.errors.size, freedom))
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
            f"chord by {off_chord:.3g} ({remark}). Leave this stretch out, or give a larger scatter; an object that "
            "has a dent is outside this package"
        )
    if bends.errors[-1] < _SEEN:
        raise ContourError(
            f"from_points: the points cannot be told from a straight line: as a whole they bend upward by "
            f"{bends.errors[-1]:.1f} standard errors, and it takes {_SEEN:g} ({remark}){STRAIGHT}"
        )
