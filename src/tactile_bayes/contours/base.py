"""What every strictly convex contour offers, and how a family is defined."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from typing import Any, ClassVar, Literal, NamedTuple, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tactile_bayes.arrays import Floats, Index
from tactile_bayes.checks import as_numbers, shown
from tactile_bayes.contours.halves import Halves
from tactile_bayes.errors import ContourError
from tactile_bayes.numerics.roots import falling_root

__all__ = [
    "Contour",
    "Graph",
    "Locus",
    "Parameter",
    "Single",
    "Vertexed",
    "alike",
    "as_parameter",
    "common_shape",
    "finite",
    "refuse_unless",
]

Parameter = float | Floats

_FARTHEST = 2.0**60
"""Where the search for a slope or a place on an endless contour is given up."""


class Locus(NamedTuple):
    """Points of a contour at given parameters, with the rates at which arc length and slope angle grow there."""

    x: Floats
    y: Floats
    slope_angle: Floats
    arclength_rate: Floats
    """dσ/dp ≥ 0, σ the arc length; zero only where the radius of curvature is: in an edge, where the contour turns on
    the spot, and at a vertex as sharp as that of |x|ⁿ with n < 2."""
    slope_rate: Floats
    """dα/dp ≥ 0; zero only where the radius of curvature is infinite."""


class Contour(ABC):
    """Lower boundary of a strictly convex object, traversed from left to right.

    A family is a frozen dataclass of its parameters, which are scalars or arrays that broadcast: one contour object may
    hold many contours. Its own parameter p may be whatever makes point and slope angle continuous functions of it.
    A family must say how to go from p to the point (`locate`) and where it ends (`domain`); everything else follows by
    root search, and is overridden where there is a formula. `check` tells whether a family of one's own is right.

    Contours are equal if they are of one family and all their parameters are, shapes included; a family that is to
    inherit this is a `dataclass(frozen=True, eq=False)`.
    """

    def __post_init__(self) -> None:
        """Make the parameters numbers, or arrays of numbers that broadcast."""
        family, given = type(self).__name__, vars(self)
        self.__dict__.update({name: as_parameter(family, name, value) for name, value in given.items()})
        common_shape(family, **{name: np.shape(value) for name, value in given.items()})

    def __eq__(self, other: object) -> bool:
        if type(other) is not type(self):
            return NotImplemented
        return self._identity() == other._identity()

    def __hash__(self) -> int:
        return hash((type(self), self._identity()))

    def _identity(self) -> tuple[Any, ...]:
        """The parameters as what can be compared and hashed."""
        return tuple(
            (name, v.shape, tuple(v.ravel().tolist())) if isinstance(v, np.ndarray) else (name, v)
            for name, v in vars(self).items()
            if not name.startswith("_")
        )

    @abstractmethod
    def locate(self, parameter: ArrayLike) -> Locus:
        """Points at the contour's own parameter."""

    @property
    @abstractmethod
    def domain(self) -> tuple[Floats, Floats]:
        """Least and greatest parameter; at a finite end the contour is over."""

    def end_name(self, side: Literal["left", "right"]) -> str:
        """What the end on one side is, for messages."""
        return "where it is over"

    def parameter_of_slope(self, slope_angle: ArrayLike) -> Floats:
        """The contour's own parameter at a slope angle [rad]; NaN where the contour has no such slope."""
        return self._parameter_where(slope_angle, lambda locus: (locus.slope_angle, locus.slope_rate))

    def parameter_of_x(self, x: ArrayLike) -> Floats:
        """The contour's own parameter at x, in the contour's unit of length; NaN beyond its ends."""
        return self._parameter_where(x, lambda locus: (locus.x, locus.arclength_rate * np.cos(locus.slope_angle)))

    def height(self, x: ArrayLike) -> Floats:
        """Height of the contour at x; NaN beyond its ends.

        Parameters
        ----------
        x : array_like
            In the contour's unit of length.
        """
        return self.locate(self.parameter_of_x(x)).y

    @property
    def knots(self) -> tuple[Floats, ...]:
        """Parameters between the ends beside which the contour is smooth, but perhaps not there.

        Wherever the radius of curvature jumps or the slope does there must be one; others do no harm.
        """
        return ()

    @property
    def halves(self) -> Halves | None:
        """Both sides of a level vertex, if they have formulas that compiled code knows; any other contour has none."""
        return None

    @property
    def shape(self) -> tuple[int, ...]:
        """Common shape of the parameters: () for a single contour."""
        return np.broadcast(*vars(self).values()).shape

    def broadcast_to(self, shape: tuple[int, ...]) -> Self:
        """The same contours with every parameter an array of one shape, as `take` wants them."""
        return self._each(lambda value: np.broadcast_to(value, (*shape, *np.shape(value)[len(self.shape) :])))

    def take(self, index: Index | tuple[Index, ...]) -> Self:
        """The contours at `index`, of a contour whose parameters are all arrays of one shape."""
        return self._each(lambda value: value[index])

    def _each(self, change: Callable[[Any], Floats]) -> Self:
        """The contours with all changed that has an entry for each."""
        other = object.__new__(type(self))  # the parameters have been checked, and this is called in inner loops
        other.__dict__.update({name: change(value) for name, value in vars(self).items()})
        return other

    def point(self, slope_angle: ArrayLike) -> tuple[Floats, Floats]:
        """Point at which the contour has a slope angle.

        Parameters
        ----------
        slope_angle : array_like
            In (−π/2, π/2) [rad].

        Returns
        -------
        x, y : ndarray
            NaN where the contour has no such slope.
        """
        locus = self.locate(self.parameter_of_slope(slope_angle))
        return locus.x, locus.y

    def radius_of_curvature(self, slope_angle: ArrayLike) -> Floats:
        """ρ = dσ/dα at a slope angle, in the contour's unit of length; infinite where the curvature vanishes.

        Parameters
        ----------
        slope_angle : array_like
            In (−π/2, π/2) [rad].
        """
        locus = self.locate(self.parameter_of_slope(slope_angle))
        with np.errstate(divide="ignore"):
            return locus.arclength_rate / locus.slope_rate

    def _parameter_where(self, wanted: ArrayLike, measure: Callable[[Locus], tuple[Floats, Floats]]) -> Floats:
        """Parameters at which something that grows along the contour, given with its rate, is as wanted; else NaN."""
        shape = np.broadcast_shapes(self.shape, np.shape(wanted))
        goal = np.broadcast_to(np.asarray(wanted, dtype=float), shape).ravel()
        many, place = self.broadcast_to(shape or (1,)), np.unravel_index(np.arange(goal.size), shape or (1,))

        def short_of(i: NDArray[np.intp], parameter: Floats) -> tuple[Floats, Floats]:
            value, rate = measure(many.take(tuple(axis[i] for axis in place)).locate(parameter))
            return goal[i] - value, -rate

        every = np.arange(goal.size)
        lo, hi = (np.broadcast_to(end, shape).ravel().astype(float) for end in self.domain)
        for end, outward in ((lo, -1.0), (hi, 1.0)):
            open_ended, way = np.flatnonzero(~np.isfinite(end)), 1.0
            while open_ended.size and way < _FARTHEST:
                end[open_ended] = outward * way
                inside = outward * short_of(open_ended, end[open_ended])[0] > 0.0
                open_ended, way = open_ended[inside], 2.0 * way
        with np.errstate(invalid="ignore"):
            there = (short_of(every, lo)[0] >= 0.0) & (short_of(every, hi)[0] <= 0.0)
        found = np.full(goal.size, np.nan)
        at = np.flatnonzero(there)
        found[at] = falling_root(lambda i, p: short_of(at[i], p), lo[at], hi[at])
        return found.reshape(shape)


class Vertexed(Contour):
    """Contours that positive sizes describe, and the vertex, at height q above x_c."""

    sizes: ClassVar[Mapping[str, str]]
    """What must be said of sizes, by name, where one is not positive and finite."""

    q: Parameter
    x_c: Parameter

    def __post_init__(self) -> None:
        super().__post_init__()
        family = type(self).__name__
        for name, rule in self.sizes.items():
            size = getattr(self, name)
            refuse_unless(np.greater(size, 0.0) & np.isfinite(size), family, rule, **{name: size})
        refuse_unless(finite(self.q, self.x_c), family, "q and x_c must be finite", q=self.q, x_c=self.x_c)


class Single(Contour):
    """A contour that stands alone, without parameters of a family; it equals itself only."""

    def __post_init__(self) -> None:
        pass

    __eq__ = object.__eq__
    __hash__ = object.__hash__

    @property
    def shape(self) -> tuple[int, ...]:
        return ()

    def _each(self, change: Callable[[Any], Floats]) -> Self:
        return self


class Graph(Contour):
    """A contour that is easiest to give as the graph y = g(x): its parameter is x.

    A family of one's own is a frozen dataclass of its parameters, with a method for g and its first two derivatives;
    `domain` is to be overridden where it ends, and `check` tells whether it is right. Parameters may be arrays, so
    formulas must work on arrays. A contour without parameters derives from `Graph` and `Single`.

    Examples
    --------
    >>> from dataclasses import dataclass
    >>> import numpy as np
    >>> from tactile_bayes.contours import Graph, check
    >>> @dataclass(frozen=True, eq=False)
    ... class Catenary(Graph):
    ...     size: float
    ...     q: float
    ...     def derivatives(self, x):
    ...         u = x / self.size
    ...         return self.q + self.size * (np.cosh(u) - 1.0), np.sinh(u), np.cosh(u) / self.size
    >>> check(Catenary(size=[0.5, 1.0], q=0.3))
    >>> Catenary(0.5, 0.3).radius_of_curvature([0.0, 0.5]).round(12)  # size/cos²α
    array([0.5       , 0.64922321])
    """

    @abstractmethod
    def derivatives(self, x: Floats) -> tuple[Floats, Floats, Floats]:
        """g(x), g'(x) and g''(x), for x between the ends."""

    @property
    def domain(self) -> tuple[Floats, Floats]:
        return np.asarray(-np.inf), np.asarray(np.inf)

    def parameter_of_x(self, x: ArrayLike) -> Floats:
        x, (lo, hi) = np.asarray(x, dtype=float), self.domain
        with np.errstate(invalid="ignore"):
            return np.where((x >= lo) & (x <= hi), x, np.nan)

    def locate(self, parameter: ArrayLike) -> Locus:
        x = np.asarray(parameter, dtype=float)
        x, g, slope, bend = np.broadcast_arrays(x, *self.derivatives(x))
        steepness = 1.0 + slope * slope
        return Locus(x, g, np.arctan(slope), np.sqrt(steepness), bend / steepness)


def alike(*arrays: Floats) -> tuple[Floats, ...]:
    """The arrays, broadcast to one shape: at once where they have it, since this is called in inner loops."""
    shape = np.shape(arrays[0])
    return arrays if all(np.shape(a) == shape for a in arrays) else np.broadcast_arrays(*arrays)


def as_parameter(family: str, name: str, given: Any) -> Parameter:
    """A parameter as a number, or a copy of it as an array of numbers."""
    values = as_numbers(given)
    if values is None:
        raise ContourError(f"{family}: {name} is {shown(given)}: give a number, or an array of numbers")
    return values if values.ndim else float(values)


def common_shape(family: str, **shapes: tuple[int, ...]) -> tuple[int, ...]:
    """The shape that the shapes of some parameters broadcast to."""
    try:
        return np.broadcast_shapes(*shapes.values())
    except ValueError:
        found = ", ".join(f"{name} of shape {shape}" for name, shape in shapes.items() if shape)
        raise ContourError(
            f"{family}: {found} do not broadcast: give numbers, and arrays of one shape or of shapes that broadcast"
        ) from None


def refuse_unless(holds: Any, family: str, rule: str, **values: Parameter) -> None:
    """Raise ContourError, naming the first offending values, where a rule on the parameters of a family fails."""
    if np.all(holds):
        return
    fails = ~np.asarray(holds)
    found = ", ".join(f"{k} = {np.broadcast_to(v, fails.shape)[fails].flat[0]}" for k, v in values.items())
    raise ContourError(f"{family}: {rule}; found {found}")


def finite(*values: Parameter) -> Any:
    """Where all of some parameters are finite."""
    return np.logical_and.reduce(np.broadcast_arrays(*(np.isfinite(v) for v in values)))
