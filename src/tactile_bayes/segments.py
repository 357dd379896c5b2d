"""Smooth stretches of equilibrium paths: cut where the phase changes and where the contour's curvature jumps."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tactile_bayes import chebyshev
from tactile_bayes.accuracy import Accuracy
from tactile_bayes.contours.seen import SeenContour
from tactile_bayes.elastica import quick_tangential_arclength, tangential_arclength
from tactile_bayes.reach import Limits, Reach
from tactile_bayes.roots import falling_root

__all__ = ["BRIEF", "Segments", "cut_path", "first_of_lane", "last_of_lane", "polish_changes", "resolved", "whole"]

Floats = NDArray[np.float64]
Index = NDArray[np.intp]

BRIEF = 1e-6
"""Share of a path so short that what changes on it may be lost in rounding."""

_HALVINGS = 8
"""How often a stretch is halved at most; where something is not smooth at its end that is never enough."""

_MOST_MORE = 64
"""Segments of a path, beyond those that are there, from which on none is halved: what is rough everywhere, like a
contour whose curvature is interpolated, is not smooth in smaller pieces either.
"""


class Segments(NamedTuple):
    """Smooth stretches of all the paths; lanes may have one or several, in the order of the path."""

    lane: Index
    begin: Floats
    """Contour parameter where the stretch begins (the greater one)."""
    end: Floats
    tip: NDArray[np.bool_]
    """Whether the tip touches here."""
    rooted: NDArray[np.bool_]
    """Whether contact began here with the tip: loads then grow like the square root of the arc since."""

    def take(self, index: Any) -> Segments:
        return Segments(*(a[index] for a in self))

    def along(self, way: Floats) -> tuple[Floats, Floats]:
        """Contour parameter a way of 0 to 1 along, in which loads are smooth, and its derivative."""
        span = self.end - self.begin
        parameter = self.begin + span * np.where(self.rooted, way * way, way)
        return parameter, span * np.where(self.rooted, 2.0 * way, 1.0)

    def halved(self, chosen: NDArray[np.bool_]) -> tuple[Segments, NDArray[np.bool_]]:
        """With the chosen ones in two halves each, in their place; and which of all are halves."""
        middle, _ = self.along(np.full(self.lane.size, 0.5))
        origin = np.repeat(np.arange(self.lane.size), np.where(chosen, 2, 1))
        first, second = origin[:-1] == origin[1:], origin[1:] == origin[:-1]
        first, second = np.append(first, False), np.append(False, second)
        lane, begin, end, tip, rooted = self.take(origin)
        begin, end = np.where(second, middle[origin], begin), np.where(first, middle[origin], end)
        return Segments(lane, begin, end, tip, rooted & ~second), first | second


def resolved(
    segments: Segments, sample: Callable[[Segments, Floats], Floats], order: int, tolerance: float
) -> tuple[Segments, Floats]:
    """Segments halved until polynomials follow what is sampled along them, and those polynomials.

    Parameters
    ----------
    segments : Segments
    sample : callable
        From segments and ways, shape (segments, k), to what is wanted there, shape (segments, ..., k); of several
        things the first must be smooth.
    order : int
        Number of Chebyshev nodes on a segment.
    tolerance : float
        Share of the change on a segment that the last two coefficients may reach.

    Returns
    -------
    Segments, ndarray of shape (order, segments, ...)
    """

    def fit(some: Segments) -> Floats:
        return chebyshev.coefficients(sample(some, np.broadcast_to(chebyshev.nodes(order), (some.lane.size, order))))

    series = fit(segments)
    lanes = int(segments.lane.max(initial=-1)) + 1
    most = np.bincount(segments.lane, minlength=lanes) + _MOST_MORE
    for _ in range(_HALVINGS):
        size = np.abs((series if series.ndim == 2 else series[..., 0])[1:])
        begin, end = whole(segments)
        long = segments.begin - segments.end > BRIEF * (begin - end)
        few = (np.bincount(segments.lane, minlength=lanes) < most)[segments.lane]
        rough = long & few & (size[-2:].max(axis=0) > tolerance * size.max(axis=0))
        if not np.any(rough):
            break
        segments, halves = segments.halved(rough)
        kept = series[:, ~rough]
        series = np.empty((order, halves.size, *series.shape[2:]))
        series[:, ~halves], series[:, halves] = kept, fit(segments.take(halves))
    return segments, series


def cut_path(seen: SeenContour, limits: Limits, friction_angle: Floats, order: int, accuracy: Accuracy) -> Segments:
    """Cut the paths that there are at knots, and where tangential contact takes exactly the rod's length."""
    lanes = np.flatnonzero(limits.reach == Reach.TOUCHES)
    begin, end = limits.begin, limits.end
    knots = np.sort(np.clip(seen.knots()[:, lanes], end[lanes], begin[lanes]), axis=0)[::-1]
    bounds = np.vstack([begin[lanes], knots, end[lanes]])
    start, stop = bounds[:-1].T.ravel(), bounds[1:].T.ravel()
    lane = np.repeat(lanes, bounds.shape[0] - 1)
    some = start - stop > 1e-13 * (begin[lane] - end[lane])
    unknown = np.zeros(np.count_nonzero(some), dtype=bool)
    pieces = Segments(lane[some], start[some], stop[some], unknown, unknown)

    rubs = bool(np.any(friction_angle))

    def excess_of(some: Segments, ways: Floats) -> Floats:
        locus = seen.locate(some.lane[:, None], some.take(np.s_[:, None]).along(ways)[0])
        if rubs:
            return tangential_arclength(*locus[:3], friction_angle[some.lane, None]) - 1.0
        return quick_tangential_arclength(locus.x, locus.y, locus.slope_angle, roughly=accuracy.roughly) - 1.0

    pieces, excess = resolved(pieces, excess_of, order, accuracy.resolved)
    grid = np.concatenate([[0.0], chebyshev.nodes(order), [1.0]])
    beyond = chebyshev.tabulate(excess, grid) > 0.0
    piece, cell = np.nonzero(beyond[:, :-1] != beyond[:, 1:])
    sign = np.where(beyond[piece, cell], 1.0, -1.0)
    both = sign * chebyshev.with_slope(excess)[..., piece]
    change = falling_root(
        lambda i, z: chebyshev.value_and_slope(both[..., i], z),
        grid[cell],
        grid[cell + 1],
        last_step=accuracy.last_step,
    )
    owner = np.concatenate([np.arange(pieces.lane.size), piece])
    cut = np.concatenate([np.zeros(pieces.lane.size), change])
    order_of = np.lexsort((cut, owner))
    owner, cut = owner[order_of], cut[order_of]
    following = np.where(last_of_lane(owner), 1.0, np.append(cut[1:], 1.0)[: cut.size])
    tip = chebyshev.evaluate(excess[:, owner], 0.5 * (cut + following)) > 0.0
    lane, begin, end, _, _ = pieces.take(owner)
    span = end - begin
    rooted = tip & limits.tip_first[lane] & first_of_lane(lane)
    return Segments(lane, begin + cut * span, begin + following * span, tip, rooted)


def polish_changes(seen: SeenContour, segments: Segments, friction_angle: Floats) -> Segments:
    """Phase changes to rounding, by secants from the interpolant's answer."""
    inner = np.flatnonzero(~first_of_lane(segments.lane))
    inner = inner[segments.tip[inner] != segments.tip[inner - 1]]
    lane = segments.lane[inner]
    room = np.minimum(segments.begin[inner - 1] - segments.end[inner - 1], segments.begin[inner] - segments.end[inner])

    def excess(parameter: Floats) -> Floats:
        locus = seen.locate(lane, parameter)
        return tangential_arclength(*locus[:3], friction_angle[lane]) - 1.0

    old, now = segments.begin[inner] + 1e-4 * room, segments.begin[inner]
    at_old, at_now = excess(old), excess(now)
    for _ in range(4):
        with np.errstate(divide="ignore", invalid="ignore"):
            step = at_now * (now - old) / (at_now - at_old)
        new = np.where(np.isfinite(step) & (np.abs(step) < 0.1 * room), now - step, now)
        old, at_old, now = now, at_now, new
        at_now = excess(now)
    begin, end = segments.begin.copy(), segments.end.copy()
    begin[inner] = end[inner - 1] = now
    return segments._replace(begin=begin, end=end)


def whole(segments: Segments) -> tuple[Floats, Floats]:
    """Where the path of which a segment is part begins and ends, for every segment."""
    count = np.arange(segments.lane.size)
    first = np.maximum.accumulate(np.where(first_of_lane(segments.lane), count, 0))
    last = np.minimum.accumulate(np.where(last_of_lane(segments.lane), count, count.size)[::-1])[::-1]
    return segments.begin[first], segments.end[last]


def first_of_lane(lane: Index) -> NDArray[np.bool_]:
    return np.append(True, np.diff(lane) != 0)[: lane.size]


def last_of_lane(lane: Index) -> NDArray[np.bool_]:
    return np.append(np.diff(lane) != 0, True)[: lane.size] if lane.size else np.zeros(0, dtype=bool)
