"""The consistency check of the formulas of a family of contours."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import ArrayLike, NDArray

from tactile_bayes.arrays import Flags, Floats
from tactile_bayes.contours.base import Contour, Graph, Locus
from tactile_bayes.errors import ContourError

BatchIndex = tuple[int, ...]
Rate = Callable[[Floats], Floats]

# Number of points at which rates are checked, and the stride of the points at which searches are checked.
_PROBES, _FEW = 400, 10
_STEEPEST = 1.5  # largest slope angle at which a contour is checked [rad]
# Endless parameters are first sampled at the former times the hyperbolic sine of up to the latter, up to 4e17.
_NEAREST, _ENDLESS = 1e-9, 62.0
_STRAIGHT = 5  # number of neighbouring points without curvature that make a contour straight; rounding may cause fewer
_HALVINGS = 60  # by which the place where a contour is too steep is found
_MISS = 1e-6  # tolerated error of an integral, as a share of the largest change between neighbouring stops
_ROUNDING = 16.0 * np.finfo(float).eps
_SUSPECTS = 16  # number of the worst stretches that are examined
_RATE_HALVINGS = 8
# If the derivative is right, the misses of a stretch shrink at least by this factor after so many halvings: only those
# about a jump or a kink remain. The misses of a wrong derivative keep their sum.
_SHRINKS = 0.25
_JUMP = 1e-6  # tolerated change of a rate over a distance of rounding, as a share of the largest rate
_SAME = 1e-9  # rounding error, as a share of a contour's size, or as an angle [rad]


def check(contour: Contour) -> None:
    """Refuse a contour whose formulas are inconsistent, or which is not strictly convex; it serves new families.

    At 400 points, where it is not steeper than 1.5 rad, the rates of point and slope angle are compared with their
    changes from point to point, and the growth of the slope angle, the height, and the searches for the parameter of a
    slope angle and of an x are verified. Features much narrower than the distance of the points may be overlooked.

    Parameters
    ----------
    contour : Contour
        One contour, or many with arrays of parameters.

    Raises
    ------
    ContourError
        If a formula is wrong; the message says which, where on the contour, and by how much.

    Examples
    --------
    >>> from dataclasses import dataclass
    >>> from tactile_bayes.contours import Graph, check
    >>> @dataclass(frozen=True, eq=False)
    ... class Wrong(Graph):
    ...     a: float
    ...     def derivatives(self, x):
    ...         return self.a * x**2, self.a * x, self.a + 0 * x
    >>> check(Wrong(0.5))
    Traceback (most recent call last):
        ...
    tactile_bayes.errors.ContourError: Wrong(a=0.5): g' is not the derivative of g: from x = ... they differ by ...
    """
    if not isinstance(contour, Contour):
        raise ContourError(f"{contour!r} is no contour: give one, such as Parabola(0.5, 0.3)")
    try:
        places = check_shape(contour)
        with np.errstate(all="ignore"):
            _Checked(contour).refuse_searches(places[::_FEW])
    except ContourError:
        raise
    except (TypeError, ValueError, IndexError) as error:
        raise ContourError(f"{contour}: its formulas do not work on arrays of any shape: {error}") from error


@np.errstate(all="ignore")  # what is not finite is refused
def check_shape(contour: Contour) -> Floats:
    """Refuse a contour that is not strictly convex, or has wrong rates; return the parameters at which it was tried."""
    return _Checked(contour).refuse_shape()


class _Checked:
    def __init__(self, contour: Contour) -> None:
        self.contour, self.shape = contour, contour.shape

    def refuse_shape(self) -> Floats:
        lo, hi = self._window()
        places = lo + 0.5 * (hi - lo) * (1.0 + self._each(probes(_PROBES)))
        knots = [np.clip(np.broadcast_to(knot, self.shape), lo, hi)[None] for knot in self.contour.knots]
        stops = np.sort(np.concatenate([places, *knots]), axis=0)
        self._refuse_falling(self._finite(stops))
        self._refuse_rates(stops)
        self._refuse_straight(self._finite(places))
        return places

    def _each(self, values: Floats) -> Floats:
        """Repeat values along the first axis for each contour."""
        return values.reshape(-1, *(1,) * len(self.shape)) + np.zeros(self.shape)

    def _located(self, stops: Floats) -> Locus:
        """Locus with all members broadcast to the shape of the parameters."""
        return Locus(*(np.broadcast_to(np.asarray(v, dtype=float), stops.shape) for v in self.contour.locate(stops)))

    def _refusal(self, index: BatchIndex, what: str) -> ContourError:
        which = f" at index {index if index[1:] else index[0]}" if index else ""
        return ContourError(f"{self.contour}{which}: {what}")

    def _window(self) -> tuple[Floats, Floats]:
        """Parameters between which a contour is checked: not too steep, and not where an endless one is straight."""
        lo, hi = (np.broadcast_to(end, self.shape).astype(float) for end in self.contour.domain)
        if not np.all(lo < hi):
            raise self._refusal((), f"its domain is {self.contour.domain}: the first must be the smaller")
        begins, ends = np.isfinite(lo), np.isfinite(hi)

        def parameter(way: Floats) -> Floats:
            after, before, both = (_NEAREST * np.sinh(_ENDLESS * t) for t in (0.5 + 0.5 * way, 0.5 - 0.5 * way, way))
            between = 0.5 * ((1.0 - way) * np.where(begins, lo, 0.0) + (1.0 + way) * np.where(ends, hi, 0.0))
            endless = np.where(begins, lo + after, np.where(ends, hi - before, both))
            return np.asarray(np.where(begins & ends, between, endless))

        ways = np.linspace(-1.0, 1.0, _PROBES + 1)
        locus = self._located(parameter(self._each(ways)))
        angle = locus.slope_angle
        if np.any(lost := ~np.isfinite(angle).any(axis=0)):
            raise self._refusal(_first(lost), "its slope angle is nowhere finite")
        self._refuse_falling(locus)
        margin = 0.05 * np.nanmax(angle, axis=0) - 0.05 * np.nanmin(angle, axis=0)
        least = np.maximum(np.where(begins, -np.inf, np.nanmin(angle, axis=0) + margin), -_STEEPEST)
        greatest = np.minimum(np.where(ends, np.inf, np.nanmax(angle, axis=0) - margin), _STEEPEST)

        def bisected(inside: Floats, outside: Floats, within: Callable[[Floats], Flags]) -> Floats:
            for _ in range(_HALVINGS if np.any(inside != outside) else 0):
                middle = 0.5 * (inside + outside)
                good = within(self._located(parameter(middle)[None]).slope_angle[0])
                inside, outside = np.where(good, middle, inside), np.where(good, outside, middle)
            return parameter(inside)

        steep_left, steep_right = ~(angle >= least), ~(angle <= greatest)
        if np.any(lost := steep_left.all(axis=0) | steep_right.all(axis=0)):
            raise self._refusal(_first(lost), f"it is nowhere less steep than {_STEEPEST} rad")
        first, last = steep_left.argmin(axis=0), _PROBES - steep_right[::-1].argmin(axis=0)
        return (
            bisected(ways[first], ways[np.maximum(first - 1, 0)], lambda found: found >= least),
            bisected(ways[last], ways[np.minimum(last + 1, _PROBES)], lambda found: found <= greatest),
        )

    def _finite(self, stops: Floats) -> Locus:
        locus = self._located(stops)
        for name, values in locus._asdict().items():
            if np.any(bad := ~np.isfinite(values)):
                at, *index = _first(bad)
                raise self._refusal(tuple(index), f"{name} is {values[bad][0]} at parameter {stops[at, *index]:.6g}")
        return locus

    def _refuse_falling(self, locus: Locus) -> None:
        """Refuse an x or a slope angle that decreases along the contour; the message names the middle stretch."""
        for name, values, unit in (("x", locus.x, ""), ("slope angle", locus.slope_angle, " rad")):
            falls = np.diff(values, axis=0) < -_SAME * (1.0 if unit else np.abs(values[1:]))
            if np.any(falls):
                _, *index = _first(falls)
                at = np.flatnonzero(falls[_of(index)])
                runs = np.split(at, np.flatnonzero(np.diff(at) > 1) + 1)
                run = min(runs, key=lambda run: np.abs(run - len(falls) // 2).min())
                first, last = (run[0], *index), (run[-1] + 1, *index)
                raise self._refusal(
                    tuple(index),
                    f"it is not strictly convex, or runs backward: its {name} falls from {values[first]:.4g} to "
                    f"{values[last]:.4g}{unit}, from x = {_text(locus.x[first])} to {_text(locus.x[last])}",
                )

    def _refuse_rates(self, stops: Floats) -> None:
        contour, located = self.contour, self._located
        pairs: dict[tuple[str, str], tuple[Rate, Rate]]
        if isinstance(contour, Graph):

            def derivative(order: int) -> Rate:
                return lambda x: np.broadcast_to(contour.derivatives(x)[order], x.shape)

            pairs = {("g'", "g"): (derivative(1), derivative(0)), ("g''", "g'"): (derivative(2), derivative(1))}
        else:

            def along(direction: Callable[[Floats], Floats]) -> Rate:
                return lambda p: (at := located(p)).arclength_rate * direction(at.slope_angle)

            pairs = {
                ("arclength_rate · cos(slope_angle)", "x"): (along(np.cos), lambda p: located(p).x),
                ("arclength_rate · sin(slope_angle)", "y"): (along(np.sin), lambda p: located(p).y),
                ("slope_rate", "slope_angle"): (lambda p: located(p).slope_rate, lambda p: located(p).slope_angle),
            }
        for (name, whose), (function, of) in pairs.items():
            found = mismatch(function, of, stops)
            if found is None:
                continue
            ends, one = self._each(np.array([found.left, found.right])), _of(found.contour)
            x = [_text(v) for v in self._located(ends).x[one]]
            wrong = f"is not the derivative of {whose}: from x = {x[0]} to {x[1]} they differ by {found.miss:.3g}"
            if np.isnan(found.miss):
                before, after = function(ends)[one]
                wrong = (
                    f"jumps at x ≈ {x[1]}, from {before:.3g} to {after:.3g}: name the parameter there in `knots`, or "
                    f"join two contours there, Joined(left, right, x={x[1]})"
                )
            raise self._refusal(found.contour, f"{name} {wrong}")

    def _refuse_straight(self, locus: Locus) -> None:
        flat = (locus.slope_rate <= 0.0) & (locus.arclength_rate > 0.0)
        if np.any(straight := sliding_window_view(flat, _STRAIGHT, axis=0).all(axis=-1)):
            at, *index = _first(straight)
            last = at + int(np.argmin(np.append(flat[_of(index)][at:], False))) - 1
            x = _text(locus.x[at, *index]), _text(locus.x[last, *index])
            raise self._refusal(tuple(index), f"it is not strictly convex: it is straight from x = {x[0]} to {x[1]}")

    def refuse_searches(self, stops: Floats) -> None:
        """Refuse contours that are elsewhere when picked, or whose searches find other points."""
        contour, locus, shape = self.contour, self._located(stops), self.shape or (1,)
        picked = contour.broadcast_to(shape).take(tuple(axis.ravel() for axis in np.indices(shape)))
        rows = stops.reshape(len(stops), -1)
        y = np.broadcast_to(picked.locate(rows).y, rows.shape).reshape(stops.shape)
        x = contour.locate(contour.parameter_of_x(locus.x)).x
        angle = contour.locate(contour.parameter_of_slope(locus.slope_angle)).slope_angle
        size = np.abs(locus.x).max(axis=0) + np.abs(locus.y).max(axis=0)
        for name, found, wanted, rounding in (
            ("y, picked by broadcast_to and take,", y, locus.y, size),
            ("the height at x", contour.height(locus.x), locus.y, size * (1.0 + np.abs(np.tan(locus.slope_angle)))),
            ("the x that parameter_of_x finds", x, locus.x, size),
            ("the slope angle that parameter_of_slope finds", angle, locus.slope_angle, 1.0),
        ):
            if np.any(bad := ~(np.abs(found - wanted) <= _SAME * rounding)):
                at, *index = _first(bad)
                raise self._refusal(
                    tuple(index),
                    f"{name} is {np.broadcast_to(found, stops.shape)[bad][0]:.6g} at x = "
                    f"{_text(locus.x[at, *index])}, not {wanted[bad][0]:.6g}",
                )


def _first(bad: ArrayLike) -> BatchIndex:
    return tuple(int(i) for i in np.argwhere(bad)[0])


def _of(index: Sequence[int]) -> tuple[Any, ...]:
    """Return the index of all values of one contour."""
    return (slice(None), *index)


def _text(x: float) -> str:
    return f"{0.0 if abs(x) < 1e-12 else float(x):.6g}"


class Mismatch(NamedTuple):
    """A stretch over which a function is not the integral of another."""

    left: float
    right: float
    miss: float  # difference over the stretch; NaN if the derivative only jumps, at `right`
    contour: tuple[int, ...]  # index of the function among many


def probes(count: int) -> Floats:
    """Return points in (−1, 1), dense toward the ends. They are shifted a little to the left, so that zero, a likely
    position of a jump, is neither one of them nor in the middle between two, where no integral would miss it."""
    return -np.cos(np.pi * (np.arange(count) + 0.38) / count)


def mismatch(rate: Rate, of: Rate, stops: Floats) -> Mismatch | None:
    """Find the worst stretch between stops, (n, ...), over which a function's change is not the integral of its rate. A
    rate may jump at stops only; a jump elsewhere is returned if there is nothing worse."""
    change, miss = _misses(rate, of, stops)
    excess = miss - _MISS * np.abs(change).max(axis=0) - _ROUNDING * np.abs(of(stops)).max(axis=0)
    jump = None
    for place in np.argsort(excess, axis=None)[::-1][:_SUSPECTS]:
        stretch, *index = (int(i) for i in np.unravel_index(place, excess.shape))
        at = (stretch, *index)
        if excess[at] <= 0.0:
            break
        ends = stops[stretch], stops[stretch + 1]
        _, finer = _misses(rate, of, np.linspace(*ends, 2**_RATE_HALVINGS + 1))
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
