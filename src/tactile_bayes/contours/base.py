"""The base of all strictly convex contours, from which a family derives."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from typing import Any, ClassVar, Literal, NamedTuple, Self

import numpy as np
from numpy.typing import ArrayLike

from tactile_bayes.arrays import Floats, Index
from tactile_bayes.checks import as_numbers, check_array, refused, shown
from tactile_bayes.contours.halves import Half, Halves
from tactile_bayes.errors import ContourError
from tactile_bayes.numerics.roots import bound_ends, falling_root

Parameter = float | Floats


class Locus(NamedTuple):
    """Points of a contour at given parameters, and the rates of arc length and slope angle there.

    Examples
    --------
    >>> from tactile_bayes.contours import Parabola
    >>> parabola = Parabola(0.5, q=0.3)
    >>> parabola.locate(parabola.parameter_of_x(0.1)).y.round(3).item()
    0.305
    """

    x: Floats
    y: Floats
    slope_angle: Floats
    # dσ/dp ≥ 0 with the arc length σ; zero only where the radius of curvature is: in an edge, where the contour turns
    # on the spot, and at a vertex as sharp as that of |x|ⁿ with n < 2.
    arclength_rate: Floats
    slope_rate: Floats  # dα/dp ≥ 0; zero only where the radius of curvature is infinite


class Contour(ABC):
    """Lower boundary of a strictly convex object, traversed from left to right.

    A family is a frozen dataclass of its parameters, which are scalars or arrays that broadcast: one contour object may
    hold many contours. The contour's own parameter p is any variable of which point and slope angle are continuous
    functions. A family defines the point at p (`locate`) and its ends (`domain`), if it has any; all else follows by
    root search and is overridden where there is a formula. `check` verifies a new family.

    Methods take arrays that broadcast with the parameters, and return arrays of the broadcast shape, NaN where the
    contour has no such point; lengths are in the contour's unit, angles in rad. They raise ParameterError for arguments
    that are not numbers, or do not broadcast with the parameters.

    Contours are equal if they are of one family and all their parameters are equal, including their shapes. A family
    that inherits this is a `dataclass(frozen=True, eq=False)`.

    Examples
    --------
    >>> from tactile_bayes.contours import Circle
    >>> circles = Circle([0.5, 0.8], q=0.3)
    >>> circles.shape, circles.height(0.1).round(4).tolist()
    ((2,), [0.3101, 0.3063])
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
        """Parameters in a form that can be compared and hashed."""
        return tuple(
            (name, v.shape, tuple(v.ravel().tolist())) if isinstance(v, np.ndarray) else (name, v)
            for name, v in vars(self).items()
            if not name.startswith("_")
        )

    @abstractmethod
    def locate(self, parameter: ArrayLike) -> Locus:
        """Points at the contour's own parameter."""

    @property
    def domain(self) -> tuple[Floats, Floats]:
        """Least and greatest parameter; the contour ends at a finite one, and is endless at an infinite one."""
        return np.asarray(-np.inf), np.asarray(np.inf)

    def _at(self, name: str, values: ArrayLike) -> Floats:
        """Return the argument of a method as an array, or refuse one that does not broadcast with the parameters."""
        numbers = check_array(name, values)
        if numbers.ndim and (shape := self.shape):
            try:
                np.broadcast_shapes(numbers.shape, shape)
            except ValueError:
                wanted = f"give a number, or numbers of a shape that broadcasts with that of the contours, {shape}"
                raise refused(name, values, wanted) from None
        return numbers

    def _own(self, name: str, values: ArrayLike) -> Floats:
        """Return the argument of a method that is the contour's own parameter, NaN beyond the ends."""
        numbers, (lo, hi) = self._at(name, values), self.domain
        with np.errstate(invalid="ignore"):
            return np.where((numbers >= lo) & (numbers <= hi), numbers, np.nan)

    def end_name(self, side: Literal["left", "right"]) -> str:
        """Description of the end on one side, for messages."""
        return "where it ends"

    def parameter_of_slope(self, slope_angle: ArrayLike) -> Floats:
        """Contour's own parameter at a slope angle α [rad]."""
        wanted = self._at("slope_angle", slope_angle)
        return self._parameter_where(wanted, lambda locus: (locus.slope_angle, locus.slope_rate))

    def parameter_of_x(self, x: ArrayLike) -> Floats:
        """Contour's own parameter at a position x [length]."""
        wanted = self._at("x", x)
        return self._parameter_where(wanted, lambda locus: (locus.x, locus.arclength_rate * np.cos(locus.slope_angle)))

    def height(self, x: ArrayLike) -> Floats:
        """Height of the contour at a position x [length]."""
        return self.locate(self.parameter_of_x(x)).y

    @property
    def knots(self) -> tuple[Floats, ...]:
        """Parameters between the ends at which the contour may not be smooth.

        There must be one wherever the radius of curvature or the slope jumps; others do no harm.
        """
        return ()

    @property
    def halves(self) -> Halves | None:
        """Both sides of a level vertex if compiled code has formulas for them; else None."""
        return None

    @property
    def shape(self) -> tuple[int, ...]:
        """Common shape of the parameters; () for a single contour."""
        return np.broadcast(*vars(self).values()).shape

    def broadcast_to(self, shape: tuple[int, ...]) -> Self:
        """Contours with every parameter broadcast to one shape, as `take` requires."""
        try:
            return self._each(lambda value: np.broadcast_to(value, (*shape, *np.shape(value)[len(self.shape) :])))
        except (TypeError, ValueError):
            wanted = f"give a shape to which that of the contours, {self.shape}, broadcasts"
            raise refused("shape", shape, wanted) from None

    def take(self, index: Index | tuple[Index, ...]) -> Self:
        """Contours at `index`, of a contour whose parameters are all arrays of one shape."""
        try:
            return self._each(lambda value: value[index])
        except (IndexError, TypeError, ValueError):
            wanted = f"give an index of the contours, whose shape is {self.shape}, after broadcast_to"
            raise refused("index", index, wanted) from None

    def _each(self, change: Callable[[Any], Floats]) -> Self:
        """Contours with a change applied to every array that has an entry for each."""
        other = object.__new__(type(self))  # the parameters have been checked, and this is called in inner loops
        other.__dict__.update({name: change(value) for name, value in vars(self).items()})
        return other

    def point(self, slope_angle: ArrayLike) -> tuple[Floats, Floats]:
        """Point (x, y) [length] at which the contour has a slope angle α in (−π/2, π/2) [rad]."""
        locus = self.locate(self.parameter_of_slope(slope_angle))
        return locus.x, locus.y

    def radius_of_curvature(self, slope_angle: ArrayLike) -> Floats:
        """Radius of curvature ρ = dσ/dα [length] at a slope angle α [rad]; infinite where the curvature vanishes."""
        locus = self.locate(self.parameter_of_slope(slope_angle))
        with np.errstate(divide="ignore"):
            return locus.arclength_rate / locus.slope_rate

    def _parameter_where(self, wanted: Floats, measure: Callable[[Locus], tuple[Floats, Floats]]) -> Floats:
        """Parameters at which an increasing function of the parameter, given with its rate, has a value; else NaN."""
        shape = np.broadcast_shapes(self.shape, np.shape(wanted))
        goal = np.broadcast_to(wanted, shape).ravel()
        many, place = self.broadcast_to(shape or (1,)), np.unravel_index(np.arange(goal.size), shape or (1,))

        def short_of(i: Index, parameter: Floats) -> tuple[Floats, Floats]:
            value, rate = measure(many.take(tuple(axis[i] for axis in place)).locate(parameter))
            return goal[i] - value, -rate

        every = np.arange(goal.size)
        lo, hi = (np.broadcast_to(end, shape).ravel().astype(float) for end in self.domain)
        bound_ends(short_of, lo, hi, np.zeros(goal.size))
        with np.errstate(invalid="ignore"):
            there = (short_of(every, lo)[0] >= 0.0) & (short_of(every, hi)[0] <= 0.0)
        found = np.full(goal.size, np.nan)
        at = np.flatnonzero(there)
        found[at] = falling_root(lambda i, p: short_of(at[i], p), lo[at], hi[at])
        return found.reshape(shape)


class Vertexed(Contour):
    """Contours with positive sizes and a vertex at height q above x_c."""

    sizes: ClassVar[Mapping[str, str]]  # messages by name of a size, for a size that is not positive and finite

    q: Parameter
    x_c: Parameter

    @property
    @abstractmethod
    def half(self) -> Half:
        """Either side of the vertex, for compiled code."""

    @property
    def halves(self) -> Halves:
        return Halves(self.half, self.half, np.asarray(self.x_c), np.asarray(self.q))

    def __post_init__(self) -> None:
        super().__post_init__()
        family = type(self).__name__
        for name, rule in self.sizes.items():
            size = getattr(self, name)
            refuse_unless(np.greater(size, 0.0) & np.isfinite(size), family, rule, **{name: size})
        refuse_unless(finite(self.q, self.x_c), family, "q and x_c must be finite", q=self.q, x_c=self.x_c)


class Tabled(Contour):
    """Contours by slope angle with tables of a row for each; `_row` is its index, so that `take` copies no table."""

    # Names of the arrays with an entry for each contour, `log_radius` first and `_row` last.
    _by_contour: ClassVar[tuple[str, ...]]

    log_radius: Floats

    def _take_arrays(self, *names: str) -> None:
        """Convert parameters to arrays of numbers."""
        family = type(self).__name__
        self.__dict__.update({n: np.asarray(as_parameter(family, n, getattr(self, n))) for n in names})

    def _share_shape(self) -> None:
        """Broadcast the arrays with an entry for each contour to one shape, and number the contours."""
        family, values = type(self).__name__, self.log_radius
        others = {name: self.__dict__[name] for name in self._by_contour[1:-1]}
        shapes = {"log_radius[..., 0]": values.shape[:-1], **{name: v.shape for name, v in others.items()}}
        shape = common_shape(family, **shapes)
        refuse_unless(np.isfinite(values), family, "log_radius must be finite", log_radius=values)
        refuse_unless(finite(*others.values()), family, f"{' and '.join(others)} must be finite", **others)
        self.__dict__.update({name: np.broadcast_to(v, shape) for name, v in others.items()})
        self.__dict__["log_radius"] = np.broadcast_to(values, (*shape, values.shape[-1]))
        self.__dict__["_row"] = np.arange(math.prod(shape)).reshape(shape)

    @property
    def shape(self) -> tuple[int, ...]:
        return np.shape(self.__dict__["_row"])

    def parameter_of_slope(self, slope_angle: ArrayLike) -> Floats:
        return self._own("slope_angle", slope_angle)

    def _each(self, change: Callable[[Any], Floats]) -> Self:
        other = object.__new__(type(self))  # the tables are shared
        other.__dict__.update(self.__dict__)
        other.__dict__.update((name, change(self.__dict__[name])) for name in self._by_contour)
        return other


class Single(Contour):
    """A single contour without parameters of a family; it equals itself only.

    Examples
    --------
    >>> from tactile_bayes.contours import from_function
    >>> isinstance(from_function(lambda x: 0.5 * x**2 + 0.3, (-1.0, 1.0)), Single)
    True
    """

    def __post_init__(self) -> None:
        pass

    __eq__ = object.__eq__
    __hash__ = object.__hash__

    @property
    def shape(self) -> tuple[int, ...]:
        return ()

    def _each(self, change: Callable[[Any], Floats]) -> Self:
        return self


def check_single(name: str, value: Any, correction: str = "give one contour, such as Parabola(0.5, 0.3)") -> None:
    """Refuse an argument that is not a single contour."""
    if not isinstance(value, Contour) or value.shape != ():
        raise refused(name, value, correction)


class Graph(Contour):
    """A contour given as the graph y = g(x), with the parameter x.

    A new family is a frozen dataclass of its parameters, with a method for g and its first two derivatives, whose
    formulas work on arrays. A contour without parameters derives from `Graph` and `Single`.

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
        """Values of g [length], g' and g'' [1/length] at positions x between the ends [length]."""

    def parameter_of_x(self, x: ArrayLike) -> Floats:
        return self._own("x", x)

    @np.errstate(over="ignore", invalid="ignore")
    def locate(self, parameter: ArrayLike) -> Locus:
        x = self._at("parameter", parameter)
        x, g, slope, bend = np.broadcast_arrays(x, *self.derivatives(x))
        steepness = 1.0 + slope * slope
        return Locus(x, g, np.arctan(slope), np.sqrt(steepness), bend / steepness)


def locus_of(*members: Floats) -> Locus:
    """Broadcast the members of a locus to one shape, with a short cut for equal shapes, as inner loops call it."""
    shape = np.shape(members[0])
    return Locus(*(members if all(np.shape(m) == shape for m in members) else np.broadcast_arrays(*members)))


def as_parameter(family: str, name: str, given: Any) -> Parameter:
    """Return a parameter as a number, or as a new array of numbers."""
    values = as_numbers(given)
    if values is None:
        raise ContourError(f"{family}: {name} is {shown(given)}: give a number, or an array of numbers")
    return values if values.ndim else float(values)


def common_shape(family: str, **shapes: tuple[int, ...]) -> tuple[int, ...]:
    """Return the common shape of parameters, or raise ContourError if they do not broadcast."""
    try:
        return np.broadcast_shapes(*shapes.values())
    except ValueError:
        found = ", ".join(f"{name} of shape {shape}" for name, shape in shapes.items() if shape)
        raise ContourError(
            f"{family}: {found} do not broadcast: give numbers, and arrays of one shape or of shapes that broadcast"
        ) from None


def refuse_unless(holds: Any, family: str, rule: str, **values: Parameter) -> None:
    """Raise ContourError with the first offending values where a rule on the parameters of a family fails."""
    if np.all(holds):
        return
    fails = ~np.asarray(holds)
    found = ", ".join(f"{k} = {np.broadcast_to(v, fails.shape)[fails].flat[0]}" for k, v in values.items())
    raise ContourError(f"{family}: {rule}; found {found}")


def finite(*values: Parameter) -> Any:
    """Return an array that is True where all given parameters are finite."""
    return np.logical_and.reduce(np.broadcast_arrays(*(np.isfinite(v) for v in values)))
