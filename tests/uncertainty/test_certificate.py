"""The triangle that convexity leaves, against hand geometry and convex contours of any shape."""

import numpy as np
import pytest

from tactile_bayes.contours import Circle, Joined, Parabola, PowerLaw
from tactile_bayes.contours.base import Locus
from tactile_bayes.contours.shape_free import ShapeFree
from tactile_bayes.uncertainty.gap import triangle


def at(contour, *x):
    return [contour.locate(contour.parameter_of_x(np.atleast_1d(value))) for value in x]


def corner(x, y, slope_angle):
    values = [np.atleast_1d(np.asarray(v, dtype=float)) for v in (x, y, slope_angle)]
    return Locus(*values, np.ones(1), np.ones(1))


def test_a_right_angle_on_its_tip():
    found = triangle(corner(-1.0, 1.0, -np.pi / 4), corner(1.0, 1.0, np.pi / 4))
    np.testing.assert_allclose(
        [found.apex_x, found.apex_y, found.height, found.width], [[0], [0], [1], [1]], atol=1e-15
    )


def test_on_an_incline_height_and_width_differ():
    """The triangle of before, turned by 30 degrees about its tip."""
    turn = np.pi / 6
    left, right = (s * np.cos(turn) - np.sin(turn) + 1j * (s * np.sin(turn) + np.cos(turn)) for s in (-1.0, 1.0))
    found = triangle(corner(left.real, left.imag, turn - np.pi / 4), corner(right.real, right.imag, turn + np.pi / 4))
    np.testing.assert_allclose([found.apex_x, found.apex_y], 0.0, atol=1e-15)
    np.testing.assert_allclose([found.height[0], found.width[0]], [1.0, 1.0 / np.cos(turn)], rtol=1e-14)
    lower, upper = found.between(np.array([0.0]))
    np.testing.assert_allclose(upper - lower, found.width[:, None], rtol=1e-14)


def test_of_a_circle():
    """Tangents at ± 0.5 meet at r / cos 0.5 from the centre; the chord is at r cos 0.5."""
    r, half = 2.0, 0.5
    found = triangle(*at(Circle(r, q=-r), -r * np.sin(half), r * np.sin(half)))
    np.testing.assert_allclose(found.apex_y, -r / np.cos(half), rtol=1e-14)
    np.testing.assert_allclose(found.height, r / np.cos(half) - r * np.cos(half), rtol=1e-13)


def test_upright_tangents_have_a_triangle():
    found = triangle(corner(-1.0, 1.0, -np.pi / 2), corner(1.0, 1.5, np.pi / 4))
    np.testing.assert_allclose([found.apex_x, found.apex_y], [[-1.0], [-0.5]], rtol=1e-14)


def drawn(rng, kind):
    """A convex contour that extends beyond x from −0.5 to 0.5."""
    if kind == "shape-free":
        return ShapeFree(np.linspace(-1.4, 1.4, 7), rng.normal(0.0, 0.4, 7), x=0.0, y=rng.normal())
    q, x_c = rng.normal(0.0, 0.1, 2)
    if kind == "circle":
        return Circle(rng.uniform(0.9, 2.0), q, x_c)
    if kind == "power-law":
        return PowerLaw(rng.uniform(0.2, 2.0), rng.uniform(1.2, 6.0), q, x_c)
    return Joined(Parabola(rng.uniform(0.2, 2.0), q, x_c), PowerLaw(1.0, rng.uniform(2.0, 6.0), q, x_c))


@pytest.mark.parametrize("kind", ["shape-free", "circle", "power-law", "joined"])
def test_the_contour_lies_in_its_triangle(kind):
    rng = np.random.default_rng(1)
    for _ in range(40):
        contour, (low, high) = drawn(rng, kind), np.sort(rng.uniform(-0.5, 0.5, 2))
        found = triangle(*at(contour, low, high))
        x = np.linspace(low, high, 101)[1:-1]
        lower, upper = found.between(x)
        y = contour.height(x)
        assert np.all(y >= lower - 1e-12)
        assert np.all(y <= upper + 1e-12)
        assert np.max(upper - lower) <= found.width[0] * (1.0 + 1e-9)
        assert low < found.apex_x[0] < high


def test_an_all_but_straight_stretch_has_no_height():
    found = triangle(*at(PowerLaw(1.0, 50.0, q=0.3), -1e-8, 1e-8))
    assert found.height.tolist() == found.width.tolist() == [0.0]
    np.testing.assert_array_equal(found.apex_x, 0.0)


def test_ends_that_overlap_have_none():
    found = triangle(*at(Parabola(0.5, q=0.3), 0.1, -0.1))
    assert np.isnan([found.height, found.width, found.apex_x, found.apex_y]).all()
    assert np.isnan(found.between(np.linspace(-0.1, 0.1, 5))).all()


def test_beside_the_ends_it_says_nothing():
    lower, upper = triangle(*at(Parabola(0.5, q=0.3), -0.1, 0.1)).between(np.array([-0.2, 0.0, 0.2]))
    assert np.isnan(lower).tolist() == np.isnan(upper).tolist() == [[True, False, True]]
