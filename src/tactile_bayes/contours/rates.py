"""The comparison of a function with the derivative of another, by integrals."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from tactile_bayes.arrays import Floats

Rate = Callable[[Floats], Floats]

_MISS = 1e-6  # tolerated error of an integral, as a share of the largest change between neighbouring stops
_ROUNDING = 16.0 * np.finfo(float).eps

_SUSPECTS = 16  # number of the worst stretches that are examined
_HALVINGS = 8
# If the derivative is right, the misses of a stretch shrink at least by this factor after so many halvings: only those
# about a jump or a kink remain. The misses of a wrong derivative keep their sum.
_SHRINKS = 0.25
_JUMP = 1e-6  # tolerated change of a rate over a distance of rounding, as a share of the largest rate


class Mismatch(NamedTuple):
    """A stretch over which a function is not the integral of another."""

    left: float
    right: float
    miss: float  # difference over the stretch; NaN if the derivative only jumps, at `right`
    contour: tuple[int, ...]  # index of the function among many


def probes(count: int) -> Floats:
    """Return points in (−1, 1), dense toward the ends.

    They are shifted a little to the left, so that zero, a likely position of a jump, is neither one of them nor in the
    middle between two, where no integral would miss it.
    """
    return -np.cos(np.pi * (np.arange(count) + 0.38) / count)


def mismatch(rate: Rate, of: Rate, stops: Floats) -> Mismatch | None:
    """Find the worst stretch between stops, (n, ...), over which a function's change is not the integral of its rate.

    A rate may jump at stops only; a jump elsewhere is returned if there is nothing worse.
    """
    change, miss = _misses(rate, of, stops)
    excess = miss - _MISS * np.abs(change).max(axis=0) - _ROUNDING * np.abs(of(stops)).max(axis=0)
    jump = None
    for place in np.argsort(excess, axis=None)[::-1][:_SUSPECTS]:
        stretch, *index = (int(i) for i in np.unravel_index(place, excess.shape))
        at = (stretch, *index)
        if excess[at] <= 0.0:
            break
        ends = stops[stretch], stops[stretch + 1]
        _, finer = _misses(rate, of, np.linspace(*ends, 2**_HALVINGS + 1))
        if finer.sum(axis=0)[tuple(index)] > _SHRINKS * miss[at]:
            return Mismatch(float(stops[at]), float(stops[stretch + 1, *index]), float(miss[at]), tuple(index))
        left, right, size = (v[tuple(index)] for v in _steepest(rate, *ends))
        begin, end = (stop[tuple(index)] for stop in ends)
        inside = begin < left and right < end  # at a stop it may jump, or rise as steeply as a power of almost zero
        if jump is None and inside and size > _JUMP * np.abs(rate(stops)).max(axis=0)[tuple(index)]:
            jump = Mismatch(float(left), float(right), np.nan, tuple(index))
    return jump


def _misses(rate: Rate, of: Rate, stops: Floats) -> tuple[Floats, Floats]:
    """Changes between neighbouring stops, and the errors of the integrals, by eight Gauss–Legendre nodes."""
    node, weight = np.polynomial.legendre.leggauss(8)
    half, middle = 0.5 * np.diff(stops, axis=0), 0.5 * (stops[:-1] + stops[1:])
    inside = middle[:, None] + half[:, None] * node.reshape(-1, *(1,) * (stops.ndim - 1))
    rates = rate(inside.reshape(-1, *stops.shape[1:])).reshape(inside.shape)
    change = np.diff(of(stops), axis=0)
    return change, np.abs(np.tensordot(weight, rates, axes=(0, 1)) * half - change)


def _steepest(rate: Rate, left: NDArray[np.floating], right: NDArray[np.floating]) -> tuple[Floats, Floats, Floats]:
    """Neighbouring points between which a rate changes most, and the change, by bisection."""
    a, b = rate(np.stack([left, right]))
    for _ in range(60):
        middle = 0.5 * (left + right)
        (m,) = rate(middle[None])
        first = np.abs(m - a) >= np.abs(b - m)
        left, a = np.where(first, left, middle), np.where(first, a, m)
        right, b = np.where(first, middle, right), np.where(first, m, b)
    return np.asarray(left), np.asarray(right), np.abs(b - a)
