"""Signed distances of contours from one of them along its normals, also after each is moved onto it."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from tactile_bayes.arrays import Floats, Index
from tactile_bayes.checks import check_choice
from tactile_bayes.contours import Contour
from tactile_bayes.contours.base import Locus
from tactile_bayes.numerics.blocks import blocks
from tactile_bayes.numerics.roots import bound_ends, falling_root
from tactile_bayes.numerics.selection import evenly_spread

# What the moves of `aligned` consist of, in the terms of Procrustes analysis, and the number of their columns.
ALIGNMENTS = {"translation": 2, "rigid": 3, "similarity": 4}

_NUMBERS_PER_HEIGHT = 12  # numbers that a shape-free contour reads for one of its heights
_BLOCK = 100_000  # number of normals that are searched at once
# Lower bound of the rate: where the contour's parameter does not move the point, the root stays as it is.
_SLOWEST = float(np.finfo(float).tiny)
# Distance of a point from a normal, relative to the lengths involved, beyond which the normal misses the contour.
_MISSED = 1e-9
_FEET = 25  # number of feet by which contours are moved
_ROUNDS, _SHARES = 3, (1.0, 0.5, 0.25, 0.125)  # Gauss–Newton steps, and the shares of each that are tried
_SETTLED = 1e-9  # step, as a share of the size of what is moved, that no longer counts
# Share of the largest singular value below which a move leaves the contour as it is, like a turn of a circle.
_INVARIANT = 1e-3


class Feet(NamedTuple):
    """Points with directions, from whose normals offsets are measured; each of shape (k,), or (n, k) for n contours."""

    x: Floats
    y: Floats
    slope_angle: Floats


class Moves(NamedTuple):
    """A similarity of each of n contours, in the complex plane: z → about + factor (z − about) + shift."""

    about: complex
    shift: NDArray[np.complex128]
    factor: NDArray[np.complex128]

    def undone(self, feet: Feet | Locus) -> Feet:
        """Return the feet as each contour has them before its move; shape (n, k)."""
        moved = feet.x + 1j * feet.y - self.about - self.shift[:, None]
        place = self.about + moved / self.factor[:, None]
        return Feet(place.real, place.imag, feet.slope_angle - np.angle(self.factor)[:, None])


def feet_of(contour: Contour, x: Floats) -> Feet:
    """Return the points of one contour at positions x, NaN where it ends before."""
    locus = contour.locate(contour.parameter_of_x(x))
    return Feet(locus.x, locus.y, locus.slope_angle)


def heights_of(contours: Contour, x: Floats) -> Floats:
    """Return the heights of n contours at x, shape (k,), or each at its own x, shape (n, k); shape (n, k)."""
    x = np.broadcast_to(x, (contours.shape[0], x.shape[-1]))
    heights = np.empty(x.shape)
    with np.errstate(over="ignore"):  # far out, where no contour is
        for block in blocks(len(heights), _NUMBERS_PER_HEIGHT * x.shape[1]):
            heights[block] = contours.take(block[:, None]).height(x[block])
    return heights


def most_central(contours: Contour, x: Floats) -> Contour:
    """Return the contour with heights nearest to the pointwise medians, among those defined at the most grid points."""
    heights = heights_of(contours, x)
    reaching = np.isfinite(heights)
    some = reaching.any(axis=0)
    away = np.nansum(np.abs(heights[:, some] - np.nanmedian(heights[:, some], axis=0)), axis=1)
    best = np.lexsort((away, -np.count_nonzero(reaching, axis=1)))[0]
    return contours.take(np.asarray(best))


def aligned(contours: Contour, feet: Feet, alignment: str) -> Moves:
    """Return the moves by which n contours come nearest to k feet, by the sum of squares along the feet's normals."""
    check_choice("align", alignment, ALIGNMENTS)
    some = evenly_spread(feet.x.size, _FEET)
    feet = Feet(feet.x[some], feet.y[some], feet.slope_angle[some])
    count = contours.shape[0]
    there = np.isfinite(feet.x)
    about = complex(np.mean(feet.x[there]), np.mean(feet.y[there])) if there.any() else 0j
    moves = Moves(about, np.zeros(count, dtype=complex), np.ones(count, dtype=complex))
    sin, cos = np.sin(feet.slope_angle), np.cos(feet.slope_angle)
    x, y = feet.x - about.real, feet.y - about.imag
    # A turn and a growth count as they move the feet.
    size = (float(np.sqrt(np.nanmean(x**2 + y**2))) if there.any() else 0.0) or 1.0
    effects = np.stack([-sin, cos, (sin * y + cos * x) / size, (cos * y - sin * x) / size])[: ALIGNMENTS[alignment]]
    offsets = normal_offsets(contours, feet, moves)
    for count_of in range(2, ALIGNMENTS[alignment] + 1):  # a shift first: a turn that is large is no small one
        for _ in range(_ROUNDS):
            before, (moves, offsets) = moves, _nearer(contours, feet, moves, offsets, effects[:count_of], size)
            if moves is before:
                break
    return moves


def _nearer(
    contours: Contour, feet: Feet, moves: Moves, offsets: Floats, effects: Floats, size: float
) -> tuple[Moves, Floats]:
    """Return moves and offsets after a Gauss–Newton step, or the part of it by which a contour comes nearer.

    The moves are the same object if no step counts.
    """
    met = np.isfinite(offsets).all(axis=0)
    steps = np.zeros((4, len(offsets)))
    steps[: len(effects)] = -np.linalg.pinv(effects[:, met].T, rcond=_INVARIANT) @ offsets[:, met].T
    left = np.flatnonzero(np.abs(steps).max(axis=0) > _SETTLED * size)  # contours that are not nearer yet
    if not left.size:
        return moves, offsets
    steps[2:] /= size
    about, (shift, factor), offsets = moves.about, map(np.copy, moves[1:]), offsets.copy()
    least = np.sum(offsets[:, met] ** 2, axis=1)
    for share in _SHARES:
        shift_x, shift_y, turn, growth = share * steps[:, left]
        more = (1.0 + growth) * np.exp(1j * turn)
        tried = Moves(about, more * moves.shift[left] + shift_x + 1j * shift_y, more * moves.factor[left])
        found = normal_offsets(contours.take(left), feet, tried)
        better = np.sum(found[:, met] ** 2, axis=1) < least[left]  # not where a normal no longer meets its contour
        nearer, left = left[better], left[~better]
        shift[nearer], factor[nearer], offsets[nearer] = tried.shift[better], tried.factor[better], found[better]
        if not left.size:
            break
    return Moves(about, shift, factor), offsets


def normal_offsets(contours: Contour, feet: Feet | Locus, moves: Moves | None = None) -> Floats:
    """Return the signed distances of n contours, or of what they are moved to, from k feet along their normals, (n, k).

    They are positive to the left of the slope's direction, and NaN where a normal misses a contour or a point is NaN.
    """
    count = contours.shape[0]
    contours = contours.broadcast_to((count,))
    own = feet if moves is None else moves.undone(feet)
    each = [np.broadcast_to(v, (count, v.shape[-1])) for v in (own.x, own.y, own.slope_angle)]
    offsets = np.full((count, feet.x.shape[-1]), np.nan)
    given = np.flatnonzero(np.isfinite(feet.x) & np.isfinite(feet.y) & np.isfinite(feet.slope_angle))
    size = feet.x.shape[-1]
    for row in blocks(count, size, _BLOCK // max(1, size) or 1):
        many = contours.take(np.repeat(row, given.size))
        ours = [values[row[:, None], given].ravel() for values in each]
        offsets[row[:, None], given] = _offsets(many, *ours).reshape(row.size, given.size)
    return offsets if moves is None else offsets * np.abs(moves.factor)[:, None]


def _offsets(many: Contour, x: Floats, y: Floats, slope_angle: Floats) -> Floats:
    """Return the signed distance of each contour from its own point along the normal there.

    Until its tangent turns by a right angle from the foot's, a contour meets the normal at most once.
    """
    sin, cos = np.sin(slope_angle), np.cos(slope_angle)
    every = np.arange(x.size)

    def short_of(i: Index, parameter: Floats) -> tuple[Floats, Floats]:
        locus = many.take(i).locate(parameter)
        turn = locus.slope_angle - slope_angle[i]
        along = (locus.x - x[i]) * cos[i] + (locus.y - y[i]) * sin[i]
        along = np.where(np.abs(turn) > 0.5 * np.pi, np.copysign(np.inf, turn), along)
        rate = np.maximum(locus.arclength_rate * np.cos(turn), _SLOWEST)
        return -along, -rate

    lo, hi = (np.broadcast_to(end, x.shape).astype(float) for end in many.domain)
    near = many.parameter_of_x(x)
    near = np.clip(np.where(np.isfinite(near), near, 0.0), lo, hi)
    with np.errstate(over="ignore"):
        bound_ends(short_of, lo, hi, near)
        root = falling_root(short_of, lo, hi, near)
        missed = np.abs(short_of(every, root)[0])
    locus = many.locate(root)
    met = missed <= _MISSED * (np.abs(x) + np.abs(y) + np.abs(locus.x) + np.abs(locus.y))
    return np.where(met, (locus.y - y) * cos - (locus.x - x) * sin, np.nan)
