"""Misspecification: refused entries, and its effect on contour and rig."""

import math

import numpy as np
import pytest
from scipy import stats

import tactile_bayes as tb
from helpers.refusals import refused
from tactile_bayes.calibration.misspecification import Misspecification
from tactile_bayes.contours.families import family_named
from tactile_bayes.errors import ParameterError
from tactile_bayes.inference.record_likelihood.rig import Rig
from tactile_bayes.load_cell import LoadCell

DRAWN = family_named("parabola").build(np.array([0.6]), np.array([0.4]), np.array([0.1]))
"""A contour as a model draws it: y = 0.4 + 0.6 (x − 0.1)²."""


def radius(slope_angle):
    """Of curvature, of that parabola: (1 + tan²)^(3/2) over its second derivative."""
    return (1.0 + np.tan(slope_angle) ** 2) ** 1.5 / 1.2


# ---- what it may be


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("friction", "much"),
        ("friction", -0.1),
        ("friction", 1e308),
        ("friction", math.nan),
        ("rigidity_scale", None),
        ("drive_angle_offset", math.inf),
        ("drive_angle_offset", (0.1, 0.2)),
        ("base_shift", 0.1),
        ("base_shift", (0.1, math.nan)),
        ("further_base_shift", (0.1, 0.2, 0.3)),
        ("bias", 0.1),
        ("bias", (0.1, 0.2)),
        ("drift", ("a", "b", "c")),
        ("flat_spot", 0.3),
    ],
)
def test_what_is_no_number_is_refused(name, value):
    with refused(ParameterError, **{name: value}):
        Misspecification(**{name: value})


@pytest.mark.parametrize("entries", [{"rigidity_scale": 0.0}, {"rigidity_scale": -1.0}, {"flat_spot": (0.1, 0.0)}])
def test_factors_are_positive(entries):
    with refused(ParameterError, "rigidity_scale", "flat spot", "positive"):
        Misspecification(**entries)


def test_it_says_in_what_it_differs():
    assert repr(Misspecification()) == "Misspecification()"
    assert repr(Misspecification(friction=0, bias=(0.0, 0.0, 0.0))) == "Misspecification()"
    assert (
        repr(Misspecification(bias=(0.1, 0.0, 0.0), friction=0.2))
        == "Misspecification(friction=0.2, bias=(0.1, 0.0, 0.0))"
    )
    assert repr(Misspecification(load_cell=LoadCell(force_noise=0.1))).startswith(
        "Misspecification(load_cell=LoadCell(force_noise=0.1"
    )
    assert "priors={'a':" in repr(Misspecification(priors={"a": stats.norm()}))


def test_its_earlier_name_stands_for_it():
    assert tb.World is tb.Misspecification is Misspecification


def test_misspecifications_can_be_compared():
    assert Misspecification() == Misspecification()
    assert Misspecification(drift=(0.0, 0.1, 0.0)) == Misspecification(drift=(0.0, 0.1, 0.0)) != Misspecification()


# ---- the object


def test_without_a_flat_spot_the_object_is_what_was_drawn():
    assert Misspecification(friction=0.3).contour(DRAWN) is DRAWN


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
        there = np.ravel(object_.radius_of_curvature(np.asarray(slope_angles)))
        return there / radius(np.asarray(slope_angles))

    np.testing.assert_allclose(ratio([at]), factor, rtol=2e-4)
    np.testing.assert_allclose(ratio([at - 0.1, at + 0.1]), factor ** math.exp(-0.5), rtol=2e-4)
    far = np.linspace(-1.2, 1.2, 301)
    far = far[np.abs(far - at) > 0.5]
    np.testing.assert_allclose(ratio(far), 1.0, rtol=1e-5)


def test_flat_spot_leaves_the_lowest_point_where_it_was():
    object_ = Misspecification(flat_spot=(0.7, 2.0)).contour(DRAWN)
    assert object_.shape == (1,)
    np.testing.assert_allclose(np.ravel(object_.point(0.0)), [0.1, 0.4], atol=1e-12)
    x, y = object_.point(np.array([-0.5, 1.1]))
    expected = 0.1 + np.tan(-0.5) / 1.2
    np.testing.assert_allclose(np.ravel(x)[0], expected, atol=1e-5)  # before the spot all is as it was
    np.testing.assert_allclose(np.ravel(y)[0], 0.4 + 0.6 * (expected - 0.1) ** 2, atol=1e-5)
    assert np.ravel(x)[1] > 0.1 + np.tan(1.1) / 1.2 + 0.05  # and beyond it the object is wider


# ---- the rig


def test_by_default_the_rig_is_what_was_drawn():
    drawn = Rig(*(np.array([value]) for value in (0.02, 1.1, 0.01, 0.2, 0.03)), base_shifts=np.full((1, 2, 2), 0.03))
    rig = Misspecification().rig(drawn, 2)
    for mine, theirs in zip(rig, drawn, strict=True):
        np.testing.assert_array_equal(mine, theirs)


def test_what_differs_comes_on_top_of_what_was_drawn():
    world = Misspecification(
        friction=0.1,
        base_shift=(0.01, -0.02),
        further_base_shift=(0.1, 0.2),
        rigidity_scale=1.5,
        drive_angle_offset=0.03,
    )
    shifts = np.zeros((1, 2, 2))
    shifts[0, 1] = [0.5, 0.0]
    rig = world.rig(Rig(*(np.array([value]) for value in (0.02, 1.1, 0.01, 0.2, 0.03)), base_shifts=shifts), 3)
    np.testing.assert_allclose(rig.drive_angle_offset, [0.05])
    np.testing.assert_allclose(rig.rigidity_scale, [1.65])
    np.testing.assert_allclose(rig.suspension_compliance, [0.01])
    np.testing.assert_allclose(rig.friction, [0.3])
    np.testing.assert_allclose(rig.drive_angle_backlash, [0.03])
    np.testing.assert_allclose(rig.base_shifts, [[[0.01, -0.02], [0.61, 0.18], [0.11, 0.18]]], atol=1e-15)
    assert shifts[0, 0, 0] == 0.0  # what was drawn is as it was
