"""Polylines: contours as points in their order, which need be neither convex nor smooth."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial import cKDTree

from tactile_bayes.arrays import Floats
from tactile_bayes.checks import check_arrays, check_numbers
from tactile_bayes.errors import ContourError

_JOINED = 1e-6  # distance below which two ends are one point, as a share of the extent
_BEYOND = 1e-9  # share of a segment by which a foot beyond it may be rounding


@dataclass(frozen=True, eq=False, repr=False)
class Polyline:
    """A contour of straight segments between points, in one piece or several, as of a probe or a drawing.

    Inferred contours are compared with it. It cannot be swept along; see `from_points`.

    Parameters
    ----------
    pieces : sequence of array_like, shape (n, 2)
        Points x, y of each piece in their order [length], at least two. Pieces that end at the same point are joined.

    Raises
    ------
    ParameterError, ContourError
        If a piece does not hold pairs of finite numbers; if there is none, or one has fewer than two points.

    Examples
    --------
    >>> corner = Polyline([[(0.0, 0.0), (2.0, 0.0)], [(2.0, 0.0), (2.0, 1.0)]])
    >>> corner.distance([1.0, 3.0, -1.0], [-0.5, 0.0, 0.0])
    array([0.5, 1. , nan])
    """

    pieces: tuple[Floats, ...]

    def __post_init__(self) -> None:
        correction = "give a pair of finite numbers x, y for each point"
        pieces = [check_numbers("pieces", piece, correction, shape=(None, 2)) for piece in self.pieces]
        if not pieces or min(map(len, pieces)) < 2:
            raise ContourError("Polyline: there are fewer than two points in a piece: at least two are needed")
        object.__setattr__(self, "pieces", tuple(pieces))

    def __repr__(self) -> str:
        return f"Polyline({len(self.pieces)} pieces, {sum(map(len, self.pieces))} points)"

    def distance(self, x: ArrayLike, y: ArrayLike) -> Floats:
        """Return the distance of each point from the nearest one of the polyline; NaN where that is a free end."""
        return np.asarray(np.vectorize(self._distance_of, otypes=[float])(*check_arrays(x=x, y=y)))

    def _distance_of(self, x: float, y: float) -> float:
        if not np.isfinite([x, y]).all():
            return np.nan
        starts, along, free = self._segments
        off = np.array([x, y]) - starts
        share = np.sum(off * along, axis=1) / np.sum(along**2, axis=1)
        away = np.hypot(*(off - np.clip(share, 0.0, 1.0)[:, None] * along).T)
        nearest = int(np.argmin(away))
        beyond = np.array([share[nearest] < -_BEYOND, share[nearest] > 1.0 + _BEYOND]) & free[nearest]
        return np.nan if beyond.any() else float(away[nearest])

    def height(self, x: ArrayLike, near: ArrayLike) -> Floats:
        """Return y of the polyline at each x, where it has several the one nearest to a height; NaN where it has none.

        Examples
        --------
        >>> Polyline([[(0, 0), (1, 0), (1, 1), (0, 1), (0, 0)]]).height([0.5, 0.5, 2.0], [0.4, 0.6, 0.0])
        array([ 0.,  1., nan])
        """
        return np.asarray(np.vectorize(self._height_at, otypes=[float])(*check_arrays(x=x, near=near)))

    def _height_at(self, x: float, near: float) -> float:
        starts, along, _ = self._segments
        (left, low), right = starts.T, starts[:, 0] + along[:, 0]
        over = (np.minimum(left, right) <= x) & (x <= np.maximum(left, right))
        if not over.any() or not np.isfinite(near):
            return np.nan
        # A vertical segment has all of its own heights.
        low, (run, rise) = low[over], along[over].T
        share = np.where(run == 0.0, near - low, x - left[over]) / np.where(run == 0.0, rise, run)
        heights = low + np.clip(share, 0.0, 1.0) * rise
        return float(heights[np.argmin(np.abs(heights - near))])

    @cached_property
    def _segments(self) -> tuple[Floats, Floats, NDArray[np.bool_]]:
        """Starts and extents of all segments, shape (n, 2), and whether their start and end are free."""
        ends = np.array([[piece[0], piece[-1]] for piece in self.pieces])
        extent = float(np.ptp(np.concatenate(self.pieces), axis=0).max())
        nearest_two, _ = cKDTree(ends.reshape(-1, 2)).query(ends.reshape(-1, 2), k=2)
        apart = np.asarray(nearest_two)[:, 1].reshape(-1, 2)
        starts, along, free = [], [], []
        for piece, is_free in zip(self.pieces, apart > _JOINED * extent, strict=True):
            kept = piece[np.r_[True, np.any(np.diff(piece, axis=0) != 0.0, axis=1)]]
            open_ends = np.zeros((len(kept) - 1, 2), dtype=bool)
            if len(kept) > 1:
                open_ends[0, 0], open_ends[-1, 1] = is_free
            starts.append(kept[:-1])
            along.append(np.diff(kept, axis=0))
            free.append(open_ends)
        return np.concatenate(starts), np.concatenate(along), np.concatenate(free)
