"""A property along a rod, as polynomials on cells."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple, TypeAlias

import numpy as np
from numpy.polynomial import Chebyshev, Polynomial
from numpy.polynomial.polynomial import polyval
from numpy.typing import ArrayLike

from tactile_bayes.arrays import Floats
from tactile_bayes.checks import as_number, as_numbers, check_number, refused
from tactile_bayes.errors import ParameterError
from tactile_bayes.numerics import chebyshev
from tactile_bayes.tasks.documents import read_json

_ORDER = 12  # coefficients of the polynomials that represent a function
MISS = 1e-12  # largest error of these, as a share of the largest value, if no other is stated
_ROUNDING = 1e-15  # size of coefficients that are rounding errors, as a share of the largest
_HALVINGS = 10
_MOST_CELLS = 256  # largest number of halvings of a cell, and of cells of a function
_SAME = 1e-9  # share of the length that counts as zero
_LARGEST = 1e100  # largest number in the text of polynomials


@dataclass(frozen=True)
class Along:
    """A property along a rod, as polynomials on cells. They begin at the edges, from 0, the base; the last edge is the
    rod's length. Each has coefficients by powers of the arc length from its beginning."""

    edges: tuple[float, ...]
    coefficients: tuple[tuple[float, ...], ...]

    def __call__(self, s: ArrayLike) -> Floats:
        """Return the values at arc lengths of any shape [length]."""
        s = np.asarray(s, dtype=float)
        edges, rows = np.array(self.edges), np.array(self.coefficients)
        cell = np.clip(np.searchsorted(edges, s, side="right") - 1, 0, len(rows) - 1)
        return np.asarray(polyval(s - edges[cell], np.moveaxis(rows[cell], -1, 0), tensor=False))

    def __repr__(self) -> str:
        first, last = self([0.0, self.edges[-1]])
        return f"Along(from {first:.6g} to {last:.6g}, {len(self.coefficients)} cells)"

    @property
    def mean(self) -> float:
        """Mean value."""
        edges = np.array(self.edges)
        widths = np.diff(edges)
        powers = np.arange(1, len(self.coefficients[0]) + 1)
        integrals = np.array(self.coefficients) * widths[:, None] ** powers / powers
        return float(integrals.sum() / edges[-1])

    def scaled(self, length: float, value: float) -> Along:
        """Return the property in other units: arc lengths and values are multiplied by these factors."""
        powers = length ** -np.arange(len(self.coefficients[0]), dtype=float)
        rows = value * powers * np.array(self.coefficients)
        return Along(tuple((length * np.array(self.edges)).tolist()), tuple(map(tuple, rows.tolist())))

    def plus(self, value: float | Along) -> Along:
        """Return the property with a number, or another property, added to all values."""
        if not isinstance(value, Along):
            return Along(self.edges, tuple((row[0] + value, *row[1:]) for row in self.coefficients))
        edges = united(self.edges, value.edges)
        one, other = (each.on(edges) for each in (self, value))
        terms = max(one.shape[1], other.shape[1])
        rows = sum(np.pad(each, ((0, 0), (0, terms - each.shape[1]))) for each in (one, other))
        return Along(tuple(edges.tolist()), tuple(map(tuple, np.asarray(rows).tolist())))

    def on(self, edges: Floats) -> Floats:
        """Return coefficients on finer cells between edges, shape (edges − 1, terms)."""
        cells = np.searchsorted(self.edges, edges[:-1], side="right") - 1
        rows, offsets = np.array(self.coefficients)[cells], edges[:-1] - np.array(self.edges)[cells]
        for i in range(rows.shape[1] - 1):
            for k in range(rows.shape[1] - 2, i - 1, -1):
                rows[:, k] += offsets * rows[:, k + 1]
        return rows

    @property
    def text(self) -> str:
        """The polynomials as JSON, for an attribute; `along` reads it."""
        return json.dumps({"edges": self.edges, "coefficients": self.coefficients})


def united(*edges: ArrayLike) -> Floats:
    """Return the edges of all properties; of those that differ by rounding the last."""
    every = np.unique(np.concatenate([np.asarray(each, dtype=float) for each in edges]))
    return every[np.append(np.diff(every) > _SAME * every[-1], True)]


# A property of a rod as users give it: a number, a function of s, or arrays (s, values).
GivenAlong: TypeAlias = float | Along | Callable[[Floats], ArrayLike] | tuple[ArrayLike, ArrayLike]


def along(name: str, given: Any, length: float, positive: bool = False, miss: float = MISS) -> float | Along:
    """Return a property of a rod of a length as a number or as polynomials; its name is for messages.

    Tables are interpolated by monotone cubic polynomials (PCHIP): values stay between those of neighbours, so that a
    rigidity stays positive, and steps do not ring. Functions are interpolated with an error `miss` over their largest
    value. A text is that of `Along.text`.

    >>> bend = along("rest_curvature", ([0.0, 0.1, 0.2], [0.0, 1.0, 3.0]), 0.2)
    >>> bend([0.0, 0.1, 0.2]), round(bend.mean, 6)
    (array([0., 1., 3.]), 1.166667)
    """
    number = as_number(given)
    if number is not None:
        value = check_number(name, given)
        _refuse_unless_positive(name, positive, np.zeros(1), np.array([value]))
        return value
    if isinstance(given, str):
        given = _read(name, given)
    if isinstance(given, Along):
        if abs(given.edges[-1] - length) > _SAME * length:
            raise ParameterError(
                f"{name} is given from s = 0 to {given.edges[-1]:.6g}, and the rod is {length:.6g} long: give it from "
                "the base to the tip; of a rod that goes on beyond its trace, state the length"
            )
        return given
    if callable(given):
        return _of_function(_Named(given, name, positive), length, miss)
    return _of_table(name, given, length, positive)


def modes_along(name: str, given: Any, length: float, most: int) -> tuple[Along, ...]:
    """Return so many properties of a rod, or fewer, as polynomials; a text is that of `text_along`."""
    if isinstance(given, str):
        try:
            given = [_read(name, json.dumps(each)) for each in read_json(given, name)["modes"]]
        except (TypeError, KeyError) as error:
            raise ParameterError(f"{name} is {given[:40]!r}: give modes as JSON, each with polynomials") from error
    if not isinstance(given, list | tuple) or len(given) > most or any(as_number(each) is not None for each in given):
        raise refused(name, given, f"give at most {most}, each as a function of s, or as arrays (s, values)")
    return tuple(along(name, each, length) for each in given)  # type: ignore[misc]


def text_along(value: Any) -> Any:
    """Return properties along a rod as the text that states them, and all else as it is."""
    if isinstance(value, tuple):
        return json.dumps({"modes": [json.loads(each.text) for each in value]})
    return value.text if isinstance(value, Along) else value


def _read(name: str, text: str) -> Along:
    """Return polynomials from their text."""
    try:
        found = read_json(text, name)
        edges = tuple(float(edge) for edge in found["edges"])
        rows = tuple(tuple(float(c) for c in row) for row in found["coefficients"])
    except (ValueError, TypeError, KeyError, OverflowError) as error:
        raise ParameterError(f"{name} is {text[:40]!r}: give a number, or polynomials as JSON") from error
    whole = np.array([*edges, *(c for row in rows for c in row)])
    sizes = {len(row) for row in rows}
    if len(edges) != len(rows) + 1 or len(sizes) != 1 or 0 in sizes or not np.isfinite(whole).all():
        raise ParameterError(f"{name} has {len(edges)} edges and {len(rows)} cells: its text is incomplete")
    if edges[0] != 0.0 or not np.all(np.diff(edges) > 0.0):
        raise ParameterError(f"{name} has the edges {edges[:4]}: they increase from 0, the base")
    if np.abs(whole).max() > _LARGEST:
        raise ParameterError(f"{name} has the number {whole[np.abs(whole).argmax()]}, which no rod can have")
    return Along(edges, rows)


def _refuse_unless_positive(name: str, positive: bool, s: Floats, values: Floats) -> None:
    if positive and not np.all(values > 0.0):
        at = int(np.argmax(~(values > 0.0)))
        raise ParameterError(f"{name} is {values[at]:.6g} at s = {s[at]:.6g}: a rigidity is positive, EI(s)/EI(0)")


def _of_table(name: str, given: Any, length: float, positive: bool) -> Along:
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
    if abs(s[0]) > _SAME * length or abs(s[-1] - length) > _SAME * length:
        raise ParameterError(
            f"{name} is given from s = {s[0]:.6g} to {s[-1]:.6g}: give it from the base, 0, to the tip, {length:.6g}"
        )
    _refuse_unless_positive(name, positive, s, values)
    s = np.concatenate([[0.0], s[1:-1], [length]])
    from scipy.interpolate import PchipInterpolator  # takes a while to load

    spline = PchipInterpolator(s, values)
    return Along(tuple(s.tolist()), tuple(map(tuple, spline.c[::-1].T.tolist())))


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
            raise ParameterError(f"{self.name} is {values[at]} at s = {s[at]:.6g}: it must be finite from base to tip")
        _refuse_unless_positive(self.name, self.positive, s, values)
        return values


def _of_function(function: _Named, length: float, most: float) -> Along:
    """Polynomials on cells that are halved until they equal a function, at nodes and between them."""
    probes = chebyshev.nodes(2 * _ORDER + 1)
    largest = float(np.abs(function(np.linspace(0.0, length, 201))).max())
    waiting, done = [(0.0, 1.0)], []
    while waiting:
        begin, end = waiting.pop()
        series = chebyshev.coefficients(function(length * (begin + (end - begin) * chebyshev.nodes(_ORDER))))
        values = function(length * (begin + (end - begin) * probes))
        miss = np.abs(chebyshev.evaluate(series, probes) - values).max()
        # A rigidity counts by its inverse: each cell is as accurate as any.
        if miss <= most * (float(values.min()) if function.positive else largest):
            done.append((length * begin, _powers(series, length * (end - begin))))
            continue
        if end - begin < 0.5**_HALVINGS or len(waiting) + len(done) >= _MOST_CELLS:
            raise ParameterError(
                f"{function.name} is not smooth enough at s ≈ {0.5 * length * (begin + end):.3g}: give a smooth "
                "function, or arrays (s, values) with close points there"
            )
        middle = 0.5 * (begin + end)
        waiting += [(middle, end), (begin, middle)]
    edges, rows = zip(*done, strict=True)
    coefficients = np.array(rows)
    terms = 1 + int(np.flatnonzero(coefficients.any(axis=0)).max(initial=0))
    return Along((*edges, length), tuple(map(tuple, coefficients[:, :terms].tolist())))


def _powers(series: Floats, width: float) -> Floats:
    """Coefficients by powers of the distance from the beginning of a cell."""
    kept = Chebyshev(series, domain=[0.0, 1.0]).trim(_ROUNDING * np.abs(series).max())
    powers = np.asarray(kept.convert(kind=Polynomial).coef, dtype=float)
    return np.pad(powers, (0, _ORDER - powers.size)) / width ** np.arange(_ORDER)
