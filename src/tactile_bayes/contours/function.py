"""Contours from a function of one's own."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from numpy.polynomial import Chebyshev
from numpy.typing import ArrayLike, NDArray

from tactile_bayes.contours.base import Floats, Graph, Single
from tactile_bayes.errors import ContourError

__all__ = ["FunctionContour", "from_function"]

Function = Callable[[NDArray[np.float64]], ArrayLike]

_MAX_DEGREE = 1024
_RESOLVED = 1e-14
"""Share of the largest coefficient below which the last ones of a resolved function lie, per root of the degree."""

_PROBES = 400
"""Places, besides the ends, at which a function is tried."""

_CONVEX = 1e-9
"""Negative second derivatives of this share of the largest are rounding."""


@dataclass(frozen=True)
class FunctionContour(Graph, Single):
    """The graph of a function; see `from_function`."""

    g: Function
    slope: Function
    curvature: Function
    left: float
    right: float
    named: str = field(default="", compare=False)

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
    g: Function,
    domain: tuple[float, float],
    *,
    slope: Function | None = None,
    curvature: Function | None = None,
) -> FunctionContour:
    """The contour y = g(x).

    Without derivatives the contour is g's Chebyshev interpolant, made fine enough to equal g up to rounding, so that
    point, slope and curvature fit together exactly; for that g must be smooth on the whole domain.

    Parameters
    ----------
    g : callable
        From an array of x to the heights there, the same shape [length].
    domain : (float, float)
        Least and greatest x; there the contour ends.
    slope, curvature : callable, optional
        g' and g'', both or none.

    Raises
    ------
    ContourError
        If g is not strictly convex (the message says where), not finite, or not smooth; if derivatives given are none
        of g.

    Examples
    --------
    >>> catenary = from_function(lambda x: 0.3 + np.cosh(x) - 1.0, (-2.0, 2.0))
    >>> catenary.radius_of_curvature([0.0, 0.5]).round(12)  # 1/cos²α
    array([1.        , 1.29844641])
    """
    lo, hi = (float(end) for end in domain)
    named = getattr(g, "__name__", repr(g))
    if not (np.isfinite(lo) and np.isfinite(hi) and lo < hi):
        raise ContourError(f"from_function: the domain is ({lo}, {hi}): give two finite numbers, the smaller first")
    if (slope is None) != (curvature is None):
        raise ContourError("from_function: give both slope and curvature, or none of them")
    if slope is None or curvature is None:
        interpolant = _resolved(g, lo, hi, named)
        contour = FunctionContour(interpolant, interpolant.deriv(), interpolant.deriv(2), lo, hi, named)
    else:
        contour = FunctionContour(g, slope, curvature, lo, hi, named)
        _refuse_other_derivatives(contour)
    _refuse_unless_convex(contour)
    return contour


def _sampled(function: Function, x: Floats, what: str) -> Floats:
    with np.errstate(all="ignore"):  # what is not finite is refused below
        values = np.asarray(function(x), dtype=float)
    if values.shape != x.shape:
        raise ContourError(
            f"from_function: for x of shape {x.shape} {what} gives {values.shape}: it must work on arrays, element by "
            "element (np.vectorize helps)"
        )
    bad = ~np.isfinite(values)
    if np.any(bad):
        raise ContourError(f"from_function: {what} is {values[bad][0]} at x = {x[bad][0]:.6g}: shrink the domain")
    return values


def _resolved(g: Function, lo: float, hi: float, named: str) -> Chebyshev:
    degree = 16
    while degree <= _MAX_DEGREE:
        interpolant = Chebyshev.interpolate(lambda x: _sampled(g, x, named), degree, domain=[lo, hi])
        size = np.abs(interpolant.coef)
        small = _RESOLVED * np.sqrt(degree) * size.max()
        if np.all(size[-(degree // 8) :] <= small):
            return interpolant.truncate(int(np.flatnonzero(size > small)[-1]) + 1)
        degree *= 2
    raise ContourError(
        f"from_function: {named} is not smooth enough on ({lo:g}, {hi:g}) for a polynomial of degree {_MAX_DEGREE}: "
        "give slope and curvature, shrink the domain, or join smooth parts with Joined"
    )


def _probes(contour: FunctionContour) -> Floats:
    """Places to try, dense toward the ends, which are left out: there a contour may stand upright."""
    inner = -np.cos(np.pi * (np.arange(_PROBES) + 0.5) / _PROBES)
    return 0.5 * (contour.left + contour.right) + 0.5 * (contour.right - contour.left) * inner


def _refuse_other_derivatives(contour: FunctionContour) -> None:
    """Each derivative, integrated between neighbouring probes, must be the change of what it is the derivative of."""
    x = _probes(contour)
    node, weight = np.polynomial.legendre.leggauss(8)
    half = 0.5 * np.diff(x)
    inside = 0.5 * (x[:-1] + x[1:])[:, None] + half[:, None] * node
    pairs = (("slope", contour.slope, "function", contour.g), ("curvature", contour.curvature, "slope", contour.slope))
    for name, derivative, whose, of in pairs:
        change = np.diff(_sampled(of, x, f"the {whose}"))
        miss = np.abs(
            _sampled(derivative, inside.ravel(), f"the {name}").reshape(inside.shape) @ weight * half - change
        )
        worst = int(np.argmax(miss))
        if miss[worst] > 1e-6 * np.abs(change).max():
            raise ContourError(
                f"from_function: the {name} given is not the derivative of the {whose}: from x = "
                f"{x[worst]:.6g} to {x[worst + 1]:.6g} they differ by {miss[worst]:.3g}"
            )


def _refuse_unless_convex(contour: FunctionContour) -> None:
    x = _probes(contour)
    bend = _sampled(contour.curvature, x, "the curvature")
    concave = bend < -_CONVEX * np.abs(bend).max()
    straight = (bend[1:] <= 0.0) & (bend[:-1] <= 0.0)
    if np.any(concave):
        at = np.flatnonzero(concave)
        stretch = f"from x = {x[at[0]]:.6g} to {x[at[-1]]:.6g}"
        raise ContourError(
            f"from_function: g is not strictly convex: its second derivative is negative {stretch} (least "
            f"{bend.min():.3g}); the contour is the lower boundary of the object, so leave that stretch out"
        )
    if np.any(straight):
        at = np.flatnonzero(straight)
        raise ContourError(
            f"from_function: g is not strictly convex: it is straight from x = {x[at[0]]:.6g} to {x[at[-1] + 1]:.6g}"
        )
