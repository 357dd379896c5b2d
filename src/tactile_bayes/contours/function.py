"""Contours from a function."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.polynomial import Chebyshev
from numpy.typing import ArrayLike

from tactile_bayes.arrays import Floats
from tactile_bayes.checks import check_numbers
from tactile_bayes.contours.base import Graph, Single
from tactile_bayes.contours.checking import check_shape, probes
from tactile_bayes.contours.joined import SAME_SLOPE
from tactile_bayes.errors import ContourError, ParameterError

Function = Callable[[Floats], ArrayLike]

_MAX_DEGREE = 1024
# Largest size of the last coefficients of a resolved function, over the largest one and the root of the degree.
_RESOLVED = 1e-14
_REFOUND = 64.0  # largest error of an interpolant between its nodes, as a multiple of that size
_PROBES = 1000  # number of points, besides the ends, at which a function and its interpolant are checked
_PATCH = 32  # degree of the interpolants that locate a point where a function is not smooth


@dataclass(frozen=True, eq=False)
class FunctionContour(Graph, Single):
    """The graph of a function; see `from_function`."""

    g: Function
    slope: Function
    curvature: Function
    left: float
    right: float
    named: str = ""

    @property
    def domain(self) -> tuple[Floats, Floats]:
        return np.asarray(self.left), np.asarray(self.right)

    def end_name(self, side: Literal["left", "right"]) -> str:
        return "the end of the function's domain"

    def derivatives(self, x: Floats) -> tuple[Floats, Floats, Floats]:
        g, slope, curvature = (np.asarray(f(x), dtype=float) for f in (self.g, self.slope, self.curvature))
        return g, slope, np.maximum(curvature, 0.0)

    def __repr__(self) -> str:
        return f"from_function({self.named}, domain=({self.left:g}, {self.right:g}))"


def from_function(
    g: Function, domain: tuple[float, float], *, slope: Function | None = None, curvature: Function | None = None
) -> FunctionContour:
    """Contour y = g(x).

    Without derivatives the contour is g's Chebyshev interpolant, which equals g up to rounding, and g must be smooth on
    the whole domain. With derivatives it is g itself, and its curvature must be continuous. Where the curvature jumps,
    join two functions: `Joined`.

    Parameters
    ----------
    g : callable
        Maps an array of x to the heights there, of the same shape [length].
    domain : (float, float)
        Least and greatest x, the ends of the contour [length].
    slope, curvature : callable, optional
        g' and g'' [1/length], both or none.

    Raises
    ------
    ContourError
        If g is not strictly convex, not smooth or not finite (the message says where), or the given derivatives are
        not those of g.

    Examples
    --------
    >>> import numpy as np
    >>> from tactile_bayes.contours import from_function
    >>> catenary = from_function(lambda x: 0.3 + np.cosh(x) - 1.0, (-2.0, 2.0))
    >>> catenary.radius_of_curvature([0.0, 0.5]).round(12)  # 1/cos²α
    array([1.        , 1.29844641])
    """
    named = getattr(g, "__name__", repr(g))
    try:
        lo, hi = check_numbers("domain", domain, shape=(2,)).tolist()
    except ParameterError:
        raise ContourError(f"from_function: the domain is {domain!r}: give two finite numbers, (-1, 1)") from None
    if not lo < hi:
        raise ContourError(f"from_function: the domain is ({lo}, {hi}): give two finite numbers, the smaller first")
    for what, function in (("g", g), ("the slope", slope), ("the curvature", curvature)):
        if function is not None and not callable(function):
            raise ContourError(f"from_function: {what} is {function!r}: give a function of x")
    if (slope is None) != (curvature is None):
        raise ContourError("from_function: give both slope and curvature, or none of them")
    checked = _NamedFunction(g, named)
    x = _probes(lo, hi)
    _refuse_dents(x, checked(x))
    if slope is None or curvature is None:
        interpolant = _resolved(checked, lo, hi)
        contour = FunctionContour(interpolant, interpolant.deriv(), interpolant.deriv(2), lo, hi, named)
    else:
        for name, derivative in (("the slope", slope), ("the curvature", curvature)):
            _NamedFunction(derivative, name)(x)
        contour = FunctionContour(g, slope, curvature, lo, hi, named)
    check_shape(contour)
    return contour


@dataclass(frozen=True)
class _NamedFunction:
    """A function with finite values, and its name for messages."""

    function: Function
    name: str

    def __call__(self, x: Floats) -> Floats:
        try:
            with np.errstate(all="ignore"):  # values that are not finite are refused below
                values = np.asarray(self.function(x), dtype=float)
        except (TypeError, ValueError) as error:
            raise ContourError(
                f"from_function: {self.name} does not work on arrays ({error}): use functions of NumPy, np.cosh "
                "instead of math.cosh, or wrap it, np.vectorize(g)"
            ) from error
        if values.shape != x.shape:
            raise ContourError(
                f"from_function: for x of shape {x.shape} {self.name} gives {values.shape}: it must work on arrays, "
                "element by element (np.vectorize helps)"
            )
        bad = ~np.isfinite(values)
        if np.any(bad):
            where = f"{values[bad][0]} at x = {x[bad][0]:.6g}"
            raise ContourError(f"from_function: {self.name} is {where}: shrink the domain")
        return values


def _resolved(g: _NamedFunction, lo: float, hi: float) -> Chebyshev:
    interpolant = _interpolant(g, lo, hi)
    if interpolant is not None:
        return interpolant
    x = _probes(lo, hi)
    best = Chebyshev.interpolate(g, _MAX_DEGREE, domain=[lo, hi])
    at = _rough_place(g, lo, hi, x[np.argmax(np.abs(best(x) - g(x)))])
    for share in (0.1, 0.01, 0.001):
        near = _probes(max(lo, at - share * (hi - lo)), min(hi, at + share * (hi - lo)))
        _refuse_dents(near, g(near))
    gap = 0.01 * (hi - lo)
    if all(_interpolant(g, *part) for part in ((lo, at - gap), (at + gap, hi)) if part[0] < part[1]):
        join = f"join two functions there, Joined(left, right, x={at:.6g})"
        advice = join if _may_be_joined(g, lo, at, hi) else f"give slope and curvature, or if they jump, {join}"
        raise ContourError(f"from_function: {g.name} is not smooth enough at x ≈ {at:.6g}: {advice}")
    raise ContourError(
        f"from_function: {g.name} is not smooth enough on ({lo:g}, {hi:g}) for a polynomial of degree {_MAX_DEGREE}: "
        "give slope and curvature, shrink the domain, or join smooth parts with Joined"
    )


def _interpolant(g: _NamedFunction, lo: float, hi: float) -> Chebyshev | None:
    """Interpolant that equals g up to rounding, at its nodes and between them; None if there is none."""
    between = _probes(lo, hi)
    heights = g(between)
    degree = 16
    while degree <= _MAX_DEGREE:
        interpolant = Chebyshev.interpolate(g, degree, domain=[lo, hi])
        size = np.abs(interpolant.coef)
        small = _RESOLVED * np.sqrt(degree) * size.max()
        found = np.abs(interpolant(between) - heights).max() <= _REFOUND * small
        if found and np.all(size[-(degree // 8) :] <= small):
            return interpolant.trim(small)
        degree *= 2
    return None


def _may_be_joined(g: _NamedFunction, lo: float, at: float, hi: float) -> bool:
    """Return whether both sides of a point are smooth up to it, and the slope does not fall there."""
    if not lo < at < hi:
        return False
    left, right = _interpolant(g, lo, at), _interpolant(g, at, hi)
    return left is not None and right is not None and bool(left.deriv()(at) <= right.deriv()(at) + SAME_SLOPE)


def _rough_place(g: _NamedFunction, lo: float, hi: float, near: float) -> float:
    """Find a point where a function is not smooth, by descent into the worst of left, middle and right half."""
    size, width = np.abs(g(_probes(lo, hi))).max(), hi - lo
    lo, hi = max(lo, near - 0.02 * width), min(hi, near + 0.02 * width)
    while hi - lo > 1e-6 * width:
        quarter = 0.25 * (hi - lo)
        halves = [(start, start + 2.0 * quarter) for start in (lo, lo + quarter, lo + 2.0 * quarter)]
        misses = [_patch_miss(g, *half) for half in halves]
        if max(misses) <= 10.0 * _RESOLVED * size:
            break
        lo, hi = halves[int(np.argmax(misses))]
    return float(np.round(0.5 * (lo + hi), -int(np.ceil(np.log10(0.5 * (hi - lo)))))) + 0.0


def _patch_miss(g: _NamedFunction, lo: float, hi: float) -> float:
    patch = Chebyshev.interpolate(g, _PATCH, domain=[lo, hi])
    x = _probes(lo, hi, 2 * _PATCH)
    return float(np.abs(patch(x) - g(x)).max())


def _probes(lo: float, hi: float, count: int = _PROBES) -> Floats:
    """Return points to check, dense toward the ends, without the ends, where a contour may be vertical."""
    return 0.5 * (lo + hi) + 0.5 * (hi - lo) * probes(count)


def _refuse_dents(x: Floats, heights: Floats) -> None:
    """Refuse heights if some lie above the chord of their neighbours."""
    share = (x[1:-1] - x[:-2]) / (x[2:] - x[:-2])
    above = heights[1:-1] - (1.0 - share) * heights[:-2] - share * heights[2:]
    dented = np.flatnonzero(above > 1e-12 * np.abs(heights).max())
    if dented.size:
        raise ContourError(
            f"from_function: g is not strictly convex: it bends downward from x = {x[dented[0]]:.6g} to "
            f"{x[dented[-1] + 2]:.6g}; the contour is the lower boundary of the object, so leave that stretch out"
        )
