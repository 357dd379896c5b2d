"""Families of one's own: what `check` finds, parameters that are lists, and equality."""

import copy
import math
from dataclasses import dataclass

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from helpers.contours_drawn import FAMILIES
from helpers.refusals import refused
from tactile_bayes import scan
from tactile_bayes.contours import (
    Circle,
    Contour,
    Ellipse,
    Graph,
    Joined,
    Locus,
    Parabola,
    PowerLaw,
    ShapeFree,
    Single,
    check,
    paper_profile,
)
from tactile_bayes.errors import ContourError


@pytest.mark.parametrize("n", [1.85, 1.9, 1.99])
def test_a_vertex_that_is_almost_an_ordinary_one_is_right(n):
    """There the rate of the parameter rises like a small power, which is as steep as a jump."""
    power, parabola = PowerLaw(1.0, n, 0.5), Parabola(1.0, 0.5)
    for contour in (power, Joined(power, power), Joined(power, parabola), Joined(parabola, power)):
        check(contour)


@pytest.mark.parametrize("family", FAMILIES.values(), ids=FAMILIES)
@settings(max_examples=settings.default.max_examples // 4, deadline=None, derandomize=True, database=None)
@given(data=st.data())
def test_every_family_is_right(family, data):
    check(data.draw(family))


KNOTS = np.linspace(-1.3, 1.3, 5)


@dataclass(frozen=True, eq=False)
class Hyperbola(Graph):
    """Endless, with slopes that end at ±45°, and a vertex that may be sharp and far away."""

    size: float
    x_c: float = 0.0

    def derivatives(self, x):
        u = x - self.x_c
        y = np.sqrt(self.size**2 + u**2)
        return y, u / y, self.size**2 / y**3


def test_a_family_of_ones_own_that_is_right():
    check(Hyperbola(0.3))
    check(Hyperbola([0.3, 1e-3], [[0.0], [100.0]]))
    assert np.isfinite(scan(Hyperbola(0.3)).sweeps[0].snap_off.drive_angle)
    many = Hyperbola([0.3, 0.4])
    assert many.shape == (2,)
    np.testing.assert_allclose(many.height(0.2), np.sqrt(np.array([0.3, 0.4]) ** 2 + 0.04))


def graph(g, slope, curvature, **members):
    """A family of one parameter, k."""

    def derivatives(self, x):
        return g(x, self.k), slope(x, self.k), curvature(x, self.k)

    family = type("Own", (Graph,), {"derivatives": derivatives, "__annotations__": {"k": float}, **members})
    return dataclass(frozen=True, eq=False)(family)


def side(x):
    return np.where(x < 0, 1.0, 2.0)


def outside(x):
    return np.maximum(np.abs(x) - 0.5, 0.0)


PARABOLA = (lambda x, k: k * x**2, lambda x, k: 2 * k * x, lambda x, k: 2 * k)

WRONG = {
    "a wave": (
        graph(lambda x, k: k + np.sin(x), lambda x, k: np.cos(x), lambda x, k: -np.sin(x)),
        r"convex.* 0\.785\d* to -0\.7\d* rad, from x = ",
    ),
    "a slope that is none": (
        graph(lambda x, k: k * x**2, lambda x, k: k * x, lambda x, k: k + 0 * x),
        r"g' .* g: from x = ",
    ),
    "a curvature that is none": (
        graph(lambda x, k: k * x**2, lambda x, k: 2 * k * x, lambda x, k: k + 0 * x),
        r"g'' .* g': from x = ",
    ),
    "a jump": (
        graph(lambda x, k: k * side(x) * x**2, lambda x, k: 2 * k * side(x) * x, lambda x, k: 2 * k * side(x)),
        r"g'' jumps at x ≈ 0, from .*`knots`",
    ),
    "a flat bottom": (
        graph(
            lambda x, k: k * outside(x) ** 4,
            lambda x, k: 4 * k * np.sign(x) * outside(x) ** 3,
            lambda x, k: 12 * k * outside(x) ** 2,
        ),
        r"straight from x = -0\.4\d* to 0\.4\d*",
    ),
    "no numbers": (
        graph(lambda x, k: k * x**2 + 0 * np.sqrt(x + 1), lambda x, k: 2 * k * x, lambda x, k: 2 * k),
        r"y is nan at parameter -",
    ),
    "no arrays": (
        graph(lambda x, k: k * math.cosh(x), lambda x, k: k * math.sinh(x), lambda x, k: k * math.cosh(x)),
        "arrays",
    ),
    "a domain upside down": (
        graph(*PARABOLA, domain=property(lambda self: (np.asarray(1.0), np.asarray(-1.0)))),
        "domain",
    ),
    "another height": (graph(*PARABOLA, height=lambda self, x: self.k * np.asarray(x)), r"height .* at x = "),
    "another slope": (
        graph(*PARABOLA, parameter_of_slope=lambda self, slope_angle: np.tan(slope_angle) / self.k),
        r"parameter_of_slope .* at x = ",
    ),
    "other contours": (
        graph(*PARABOLA, broadcast_to=lambda self, shape: type(self)(np.full(shape, 0.4))),
        r"broadcast_to .* at x = ",
    ),
}


@pytest.mark.parametrize(("family", "message"), WRONG.values(), ids=WRONG)
@pytest.mark.parametrize("k", [0.3, [0.3, 0.5]], ids=["one", "two"])
def test_what_is_wrong_is_said_with_its_place(family, message, k):
    with pytest.raises(ContourError, match=message) as error:
        check(family(k))
    assert str(error.value).startswith("Own(k=")


def test_of_many_the_wrong_one_is_named():
    family = graph(
        lambda x, k: k * x**2, lambda x, k: np.where(k == 0.7, 1.9, 2.0) * k * x, lambda x, k: 2.0 * k + 0 * x
    )
    check(family([[0.3], [0.5]]))
    with refused(ContourError, "index (1, 0)", "g'"):
        check(family([[0.3], [0.7]]))


@dataclass(frozen=True, eq=False)
class Arc(Contour):
    """A circle by another parameter, the arc length, with an error in one of its rates."""

    r: float
    error: float = 0.0

    @property
    def domain(self):
        return -0.5 * np.pi * np.asarray(self.r), 0.5 * np.pi * np.asarray(self.r)

    def locate(self, parameter):
        p = np.asarray(parameter, dtype=float)
        alpha = p / self.r
        x, y = self.r * np.sin(alpha), self.r * (1.3 - np.cos(alpha))
        return Locus(x, y, alpha, 1.0 + self.error + 0.0 * p, 1.0 / self.r + 0.0 * p)


def test_rates_of_a_family_that_is_no_graph():
    check(Arc(0.7))
    check(Arc([0.7, 2.0]))
    with refused(ContourError, "arclength_rate", "slope_angle", "from x ="):
        check(Arc(0.7, error=1e-3))


@pytest.mark.parametrize(
    ("listed", "arrays"),
    [
        (Parabola([0.5, 0.6], 0.3), Parabola(np.array([0.5, 0.6]), 0.3)),
        (Circle([1, 2], 0.3), Circle(np.array([1.0, 2.0]), 0.3)),
        (Ellipse([1, 2], 1, (0.3, 0.4)), Ellipse(np.array([1.0, 2.0]), 1.0, np.array([0.3, 0.4]))),
        (PowerLaw([1, 2], 3, 0.3), PowerLaw(np.array([1.0, 2.0]), 3.0, 0.3)),
        (
            Joined(Parabola(0.2, 0.3, 1), Parabola(0.2, 0.3, -1), x=[0.0, 0.0]),
            Joined(Parabola(0.2, 0.3, 1.0), Parabola(0.2, 0.3, -1.0), x=np.zeros(2)),
        ),
        (
            ShapeFree(KNOTS.tolist(), [[0] * 5, [1] * 5], [0, 1], 0.3),
            ShapeFree(KNOTS, np.array([[0.0] * 5, [1.0] * 5]), np.array([0.0, 1.0]), 0.3),
        ),
        (Hyperbola([0.3, 0.4]), Hyperbola(np.array([0.3, 0.4]))),
    ],
)
def test_lists_are_arrays(listed, arrays):
    assert listed.shape == (2,)
    np.testing.assert_array_equal(listed.height(0.1), arrays.height(0.1))
    assert listed == arrays
    assert hash(listed) == hash(arrays)


def test_numbers_stay_numbers():
    contour = Parabola(np.float32(0.5), 1, np.array(0.25))
    assert repr(contour) == "Parabola(a=0.5, q=1.0, x_c=0.25)"
    assert {type(value) for value in vars(contour).values()} == {float}


def test_a_contour_does_not_change_with_the_array_that_it_was_given():
    a = np.array([0.5, 0.6])
    contour = Parabola(a, 0.3)
    a[0] = -1.0
    np.testing.assert_array_equal(contour.a, [0.5, 0.6])


def test_equality():
    assert Parabola(0.5, 0.3) == Parabola(0.5, 0.3, 0.0)
    assert Parabola(0.5, 0.3) != Parabola(0.5, 0.31)
    assert Parabola(0.5, 0.3) != Circle(0.5, 0.3)
    assert Parabola([0.5, 0.5], 0.3) != Parabola(0.5, 0.3)
    assert Parabola(0.5, 0.3) != 0.5
    assert paper_profile("IV", 0.3) == paper_profile("IV", 0.3) != paper_profile("IV", 0.4)
    assert len({Parabola([0.5, 0.6], -0.0), Parabola((0.5, 0.6), 0.0), Parabola([0.6, 0.5], 0.0)}) == 2
    many = Parabola([0.5, 0.6, 0.5], 0.3).broadcast_to((3,))
    assert many.take(np.array([0, 1])) == many.take(np.array([2, 1]))
    assert copy.deepcopy(many) == many


def test_what_is_no_contour_and_no_parameter_is_refused():
    with refused(ContourError, None):
        check(None)
    with refused(ContourError, "Hyperbola", "size", np.abs):
        Hyperbola(np.abs)


def test_the_largest_exponent_does_not_overflow():
    """Warnings are errors here, and unit lengths are large."""
    unit = 1000.0
    contour = PowerLaw(unit**-49, 50.0, 0.3 * unit)
    assert np.isfinite([contour.height([0.0, 900.0]), *contour.point([-1.5, 1.5])]).all()


def test_a_contour_without_parameters():
    class Bowl(Graph, Single):
        def derivatives(self, x):
            return 0.5 + x**4 + x**2, 4 * x**3 + 2 * x, 12 * x**2 + 2

    bowl = Bowl()
    check(bowl)
    assert bowl == bowl != Bowl()
    assert len({bowl, bowl, Bowl()}) == 2
    assert Joined(bowl, Circle(1.0, 0.5)) == Joined(bowl, Circle(1.0, 0.5))
    assert np.isfinite(scan(bowl).sweeps[0].snap_off.drive_angle)
