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
        points = np.stack(np.broadcast_arrays(*check_arrays(x=x, y=y)), axis=-1)
        starts, along, free = self._segments
        squares = np.sum(along**2, axis=1)
        found = np.full(points.shape[:-1], np.nan)
        for at in np.ndindex(found.shape):
            off = points[at] - starts
            share = np.sum(off * along, axis=1) / squares
            beyond = np.stack([share < -_BEYOND, share > 1.0 + _BEYOND], axis=1) & free
            away = np.hypot(*(off - np.clip(share, 0.0, 1.0)[:, None] * along).T)
            if np.isfinite(points[at]).all() and not beyond[nearest := int(np.argmin(away))].any():
                found[at] = away[nearest]
        return found

    def height(self, x: ArrayLike, near: ArrayLike) -> Floats:
        """Return y of the polyline at each x, where it has several the one nearest to a height; NaN where it has none.

        Examples
        --------
        >>> Polyline([[(0, 0), (1, 0), (1, 1), (0, 1), (0, 0)]]).height([0.5, 0.5, 2.0], [0.4, 0.6, 0.0])
        array([ 0.,  1., nan])
        """
        positions, heights = np.broadcast_arrays(*check_arrays(x=x, near=near))
        starts, along, _ = self._segments
        left, right = (edge(starts[:, 0], starts[:, 0] + along[:, 0]) for edge in (np.minimum, np.maximum))
        found = np.full(positions.shape, np.nan)
        for at in np.ndindex(found.shape):
            over = (left <= positions[at]) & (positions[at] <= right)
            if over.any() and np.isfinite(heights[at]):
                found[at] = _nearest_height(starts[over], along[over], float(positions[at]), float(heights[at]))
        return found

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


def _nearest_height(starts: Floats, along: Floats, x: float, near: float) -> float:
    """Return the height of segments over x that is nearest to a given one; a vertical segment has all of its own."""
    steep = along[:, 0] == 0.0
    share = np.where(steep, near - starts[:, 1], x - starts[:, 0]) / np.where(steep, along[:, 1], along[:, 0])
    heights = np.asarray(starts[:, 1] + np.clip(share, 0.0, 1.0) * along[:, 1])
    return float(np.take(heights, np.argmin(np.abs(heights - near))))
