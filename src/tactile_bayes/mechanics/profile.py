"""Rest curvature and rigidity along a rod, as piecewise polynomials.

Quantities are dimensionless: arc length s from 0, the base, to 1, the tip; rest curvature in 1/L; rigidity in EI(0).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple, TypeAlias

import numpy as np
from numpy.polynomial import Chebyshev, Polynomial
from numpy.typing import ArrayLike
from scipy.interpolate import PchipInterpolator

from tactile_bayes.arrays import Floats
from tactile_bayes.checks import as_number, as_numbers, check_number, refused
from tactile_bayes.errors import ParameterError
from tactile_bayes.numerics import chebyshev

__all__ = ["STEEPEST_TAPER", "Along", "Profile", "profile_of"]

Along: TypeAlias = float | Callable[[Floats], ArrayLike] | tuple[ArrayLike, ArrayLike]
"""A property of a rod: a number, a function of s, or arrays (s, values)."""

STEEPEST_TAPER = 0.95
"""Largest taper: the rod bends 1.6e5 times as easily at its tip as at its base."""

_ORDER = 12
"""Coefficients of the polynomials that represent a function."""

_MISS = 1e-12
"""Largest error of these, as a share of the largest value."""

_ROUNDING = 1e-15
"""Size of coefficients that are rounding errors, as a share of the largest."""

_HALVINGS = 10
_MOST_CELLS = 256
"""Largest number of halvings of a cell, and of cells of a function."""

_SAME = 1e-9
"""Distance from the ends of the rod that counts as zero, and difference of the rigidity at the base from one."""


class Profile(NamedTuple):
    """A rod in the form that the compiled forward model takes."""

    edges: Floats
    """Where cells begin, from base to tip, shape (n + 1,); the last one lies beyond the tip, with its values."""
    curvature: Floats
    """Coefficients of the rest curvature by powers of the arc length from the beginning of a cell, shape (n + 1, …)."""
    rigidity: Floats
    """Coefficients of the rigidity without the taper, likewise."""
    taper: float
    """t of a diameter that falls linearly to 1 − t at the tip: a factor (1 − t s)⁴ on the rigidity."""
    bend: float
    """A number to be added to the rest curvature [1/L]."""
    sign: float
    """−1 for the mirrored rod of backward sweeps, else 1."""


class _Pieces(NamedTuple):
    """A function on [0, 1]."""

    edges: Floats
    coefficients: Floats
    """By powers of the distance from the beginning of a cell, shape (cells, terms)."""


def profile_of(rest_curvature: Along = 0.0, rigidity_profile: Along = 1.0, taper: float = 0.0) -> Profile:
    """Return the profile of a rod.

    Tables are interpolated by monotone cubic polynomials (PCHIP): values stay between those of neighbours, so that the
    rigidity stays positive, and steps do not ring. Functions are interpolated to 1e-12 of their largest value.

    Parameters
    ----------
    rest_curvature : float, callable or (s, curvature)
        Curvature of the unloaded rod [1/L], > 0 where it bends counter-clockwise.
    rigidity_profile : float, callable or (s, EI/EI0)
        Flexural rigidity over that at the base, where it is 1.
    taper : float
        The diameter falls linearly to (1 − taper) of that at the base: a factor (1 − taper·s)⁴ on the rigidity.

    Returns
    -------
    Profile

    Raises
    ------
    ParameterError
        If a table is not ordered from base to tip, a function is not smooth or does not work on arrays, a value is not
        finite, or a rigidity is not positive or not 1 at the base.

    Examples
    --------
    >>> profile = profile_of(rest_curvature=lambda s: 0.3 * s, rigidity_profile=([0.0, 0.5, 1.0], [1.0, 0.5, 0.4]))
    >>> profile.edges
    array([0. , 0.5, 1. ])
    """
    taper = check_number(
        "taper", taper, f"give a number from 0 (none) to {STEEPEST_TAPER}", least=0.0, most=STEEPEST_TAPER
    )
    bent, rigid = _pieces("rest_curvature", rest_curvature, False), _pieces("rigidity_profile", rigidity_profile, True)
    base = rigid.coefficients[0, 0]
    if abs(base - 1.0) > _SAME:
        raise ParameterError(
            f"rigidity_profile is {base:.6g} at the base: divide it by this value, since it is relative to the base"
        )
    edges = np.union1d(bent.edges, rigid.edges)
    return Profile(edges, _on(edges, bent), _on(edges, rigid), taper, 0.0, 1.0)


def _on(edges: Floats, pieces: _Pieces) -> Floats:
    """Coefficients on finer cells, and beyond the tip."""
    cells = np.clip(np.searchsorted(pieces.edges, edges, side="right") - 1, 0, len(pieces.coefficients) - 1)
    rows = pieces.coefficients[cells]
    offsets = edges - pieces.edges[cells]
    for i in range(rows.shape[1] - 1):
        for k in range(rows.shape[1] - 2, i - 1, -1):
            rows[:, k] += offsets * rows[:, k + 1]
    rows[-1, 1:] = 0.0
    return rows


def _pieces(name: str, given: Any, positive: bool) -> _Pieces:
    number = as_number(given)
    if number is not None:
        value = check_number(name, given)
        found = _Pieces(np.array([0.0, 1.0]), np.array([[value]]))
        _refuse_unless_positive(name, positive, np.zeros(1), found.coefficients[0])
        return found
    if callable(given):
        return _of_function(_Named(given, name, positive))
    return _of_table(name, given, positive)


def _refuse_unless_positive(name: str, positive: bool, s: Floats, values: Floats) -> None:
    if positive and not np.all(values > 0.0):
        at = int(np.argmax(~(values > 0.0)))
        raise ParameterError(f"{name} is {values[at]:.6g} at s = {s[at]:.6g}: a rigidity is positive, EI(s)/EI(0)")


def _of_table(name: str, given: Any, positive: bool) -> _Pieces:
    correction = "give a number, a function of s, or a pair of arrays (s, values)"
    try:
        s, values = given
    except (TypeError, ValueError):
        raise refused(name, given, correction) from None
    s, values = as_numbers(s), as_numbers(values)
    if s is None or values is None or s.ndim != 1 or s.shape != values.shape or s.size < 2:
        raise refused(name, given, f"{correction} of the same length, with at least two points")
    if not (np.isfinite(s).all() and np.isfinite(values).all()):
        at = int(np.argmin(np.isfinite(s) & np.isfinite(values)))
        raise ParameterError(f"{name} is {values[at]} at s[{at}] = {s[at]}: leave out points that are not finite")
    if not np.all(np.diff(s) > 0.0):
        at = int(np.argmin(np.diff(s) > 0.0))
        raise ParameterError(
            f"{name} has s = {s[at]:.6g} before s = {s[at + 1]:.6g}: order the points from base to tip, each once"
        )
    if abs(s[0]) > _SAME or abs(s[-1] - 1.0) > _SAME:
        raise ParameterError(
            f"{name} is given from s = {s[0]:.6g} to {s[-1]:.6g}: give it from the base, 0, to the tip, 1"
        )
    _refuse_unless_positive(name, positive, s, values)
    s = np.concatenate([[0.0], s[1:-1], [1.0]])
    spline = PchipInterpolator(s, values)
    return _Pieces(s, np.ascontiguousarray(spline.c[::-1].T))


class _Named(NamedTuple):
    """A function with finite values, and its name for messages."""

    function: Callable[[Floats], ArrayLike]
    name: str
    positive: bool

    def __call__(self, s: Floats) -> Floats:
        try:
            with np.errstate(all="ignore"):  # values that are not finite are refused below
                values = np.asarray(self.function(s), dtype=float)
        except (TypeError, ValueError) as error:
            raise ParameterError(
                f"{self.name} does not work on arrays ({error}): use functions of NumPy, or wrap it with np.vectorize"
            ) from error
        if values.shape not in (s.shape, ()):
            raise ParameterError(
                f"{self.name} returns shape {values.shape} for s of shape {s.shape}: it must work on arrays, element "
                "by element (np.vectorize helps)"
            )
        values = np.broadcast_to(values, s.shape)
        if not np.isfinite(values).all():
            at = int(np.argmin(np.isfinite(values)))
            raise ParameterError(f"{self.name} is {values[at]} at s = {s[at]:.6g}: it must be finite from 0 to 1")
        _refuse_unless_positive(self.name, self.positive, s, values)
        return values


def _of_function(function: _Named) -> _Pieces:
    """Polynomials on cells that are halved until they equal a function, at nodes and between them."""
    probes = chebyshev.nodes(2 * _ORDER + 1)
    largest = float(np.abs(function(np.linspace(0.0, 1.0, 201))).max())
    waiting, done = [(0.0, 1.0)], []
    while waiting:
        begin, end = waiting.pop()
        series = chebyshev.coefficients(function(begin + (end - begin) * chebyshev.nodes(_ORDER)))
        values = function(begin + (end - begin) * probes)
        miss = np.abs(chebyshev.evaluate(series, probes) - values).max()
        # A rigidity counts by its inverse: each cell is as accurate as any.
        if miss <= _MISS * (float(values.min()) if function.positive else largest):
            done.append((begin, _powers(series, end - begin)))
            continue
        if end - begin < 0.5**_HALVINGS or len(waiting) + len(done) >= _MOST_CELLS:
            raise ParameterError(
                f"{function.name} is not smooth enough at s ≈ {0.5 * (begin + end):.3g}: give a smooth function, or "
                "arrays (s, values) with close points there"
            )
        middle = 0.5 * (begin + end)
        waiting += [(middle, end), (begin, middle)]
    edges, rows = zip(*done, strict=True)
    coefficients = np.array(rows)
    terms = 1 + int(np.flatnonzero(coefficients.any(axis=0)).max(initial=0))
    return _Pieces(np.append(edges, 1.0), np.ascontiguousarray(coefficients[:, :terms]))


def _powers(series: Floats, width: float) -> Floats:
    """Coefficients by powers of the distance from the beginning of a cell."""
    kept = Chebyshev(series, domain=[0.0, 1.0]).trim(_ROUNDING * np.abs(series).max())
    powers = np.asarray(kept.convert(kind=Polynomial).coef, dtype=float)
    return np.pad(powers, (0, _ORDER - powers.size)) / width ** np.arange(_ORDER)
