"""Misspecification: refused entries, and its effect on contour and pivots."""

import math

import numpy as np
import pytest

from helpers.refusals import refused
from tactile_bayes.calibration.simulated_experiment import Misspecification
from tactile_bayes.contours.families import family_named
from tactile_bayes.errors import ParameterError
from tactile_bayes.inference.family import Family
from tactile_bayes.inference.parameters.unknowns import RigValues

# A contour as a model draws it: y = 0.4 + 0.6 (x − 0.1)².
DRAWN = family_named("parabola").build(np.array([0.6]), np.array([0.4]), np.array([0.1]))


def radius(slope_angle):
    """Of curvature, of that parabola: (1 + tan²)^(3/2) over its second derivative."""
    return (1.0 + np.tan(slope_angle) ** 2) ** 1.5 / 1.2


@pytest.mark.parametrize(
    ("wrong", "named"),
    [
        ({"base_shift": (0.1, math.nan)}, ["base_shift", "(0.1, nan)"]),
        ({"flat_spot": 0.3}, ["flat_spot", "0.3"]),
        ({"flat_spot": (0.1, 0.0)}, ["flat spot", "positive", "0"]),
        ({"family": "cube"}, ["'cube'"]),
    ],
    ids=str,
)
def test_what_cannot_be_is_refused(wrong, named):
    with refused(ParameterError, *named):
        Misspecification(**wrong)


def test_it_says_in_what_it_differs_and_can_be_compared():
    assert repr(Misspecification()) == "Misspecification()"
    assert repr(Misspecification(base_shift=(0, 0.0))) == "Misspecification()"
    assert repr(Misspecification(base_shift=[0.1, 0])) == "Misspecification(base_shift=(0.1, 0.0))"
    assert repr(Misspecification(family="circle")) == "Misspecification(family=Family('circle'))"
    assert Misspecification() == Misspecification()
    assert Misspecification(family="circle") == Misspecification(family=Family("circle")) != Misspecification()
    assert Misspecification(family=Family("circle", r=0.5)) != Misspecification(family="circle")


@pytest.mark.parametrize("at", [0.3, -0.8, 0.0])
@pytest.mark.parametrize("factor", [2.0, 0.5])
def test_flat_spot_is_where_it_should_be_and_nowhere_else(at, factor):
    """The bell curve is 1 at its middle, exp(−½) at 0.1 rad from there, and below 4e-6 beyond 0.5 rad.

    The logarithm of the radius is a spline through knots 0.025 rad apart, a quarter of the bell's width h: the error of
    cubic interpolation is at most 5/384 of h⁴ times the fourth derivative, 3, and so 1.6e-4 of log 2. That of the
    parabola's own is 1e-6 where it is not steep.
    """
    object_ = Misspecification(flat_spot=(at, factor)).contour(DRAWN)

    def ratio(slope_angles):
        return np.ravel(object_.radius_of_curvature(np.array(slope_angles))) / radius(np.array(slope_angles))

    np.testing.assert_allclose(ratio([at]), factor, rtol=2e-4)
    np.testing.assert_allclose(ratio([at - 0.1, at + 0.1]), factor ** math.exp(-0.5), rtol=2e-4)
    every = np.linspace(-1.2, 1.2, 301)
    np.testing.assert_allclose(ratio(every[np.abs(every - at) > 0.5]), 1.0, rtol=1e-5)


def test_flat_spot_leaves_the_lowest_point_where_it_was():
    assert Misspecification(base_shift=(0.1, 0.0)).contour(DRAWN) is DRAWN
    object_ = Misspecification(flat_spot=(0.7, 2.0)).contour(DRAWN)
    assert object_.shape == (1,)
    np.testing.assert_allclose(np.ravel(object_.point(0.0)), [0.1, 0.4], atol=1e-12)
    x, y = object_.point(np.array([-0.5, 1.1]))
    expected = 0.1 + np.tan(-0.5) / 1.2
    np.testing.assert_allclose(np.ravel(x)[0], expected, atol=1e-5)  # before the spot all is as it was
    np.testing.assert_allclose(np.ravel(y)[0], 0.4 + 0.6 * (expected - 0.1) ** 2, atol=1e-5)
    assert np.ravel(x)[1] > 0.1 + np.tan(1.1) / 1.2 + 0.05  # and beyond it the object is wider


def test_all_pivots_are_shifted_on_top_of_what_was_drawn():
    shifts = np.zeros((1, 2, 2))
    shifts[0, 1] = [0.5, 0.0]
    drawn = RigValues(*(np.array([value]) for value in (0.02, 1.1, 0.01, 0.2, 0.03)), base_shifts=shifts)
    rig = Misspecification(base_shift=(0.01, -0.02)).shifted(drawn, 3)
    np.testing.assert_allclose(rig.base_shifts, [[[0.01, -0.02], [0.51, -0.02], [0.01, -0.02]]], atol=1e-15)
    assert shifts[0, 0, 0] == 0.0  # what was drawn is as it was
    assert rig._replace(base_shifts=None) == drawn._replace(base_shifts=None)
    np.testing.assert_array_equal(Misspecification().shifted(drawn, 2).base_shifts, shifts)
