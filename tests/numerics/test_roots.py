"""Newton kept in its bracket, against scipy's brentq."""

import numpy as np
import pytest
from scipy.optimize import brentq

from tactile_bayes.numerics.roots import falling_root

EPS = np.finfo(float).eps


def shifted_cubes(shift):
    """x³ + x falls through `shift` from 2 to −2, one function a shift."""

    def function(i, x):
        return x**3 + x - shift[i], 3 * x**2 + 1

    return function


def test_many_roots_at_once_against_brentq():
    shift = np.linspace(-9.9, 9.9, 37)
    found = falling_root(shifted_cubes(shift), np.full(37, 2.0), np.full(37, -2.0))
    truth = [brentq(lambda x, s=s: x**3 + x - s, -2, 2, xtol=1e-15, rtol=4 * EPS) for s in shift]
    np.testing.assert_allclose(found, truth, rtol=0, atol=2e-14 * 4)  # 1e-14 of the bracket, from both


@pytest.mark.parametrize("start", [None, np.array([1.9]), np.array([0.2])])
def test_functions_that_send_newton_astray(start):
    """From 1.9 Newton on arctan(5 − 5x) leaves the bracket; the answer is the root all the same."""

    def function(_i, x):
        return np.arctan(100 * (1 - x)), -100 / (1 + (100 * (1 - x)) ** 2)

    root = falling_root(function, np.array([0.0]), np.array([2.0]), start)
    np.testing.assert_allclose(root, 1.0, rtol=0, atol=2e-14)


def test_a_kink_about_which_newton_goes_in_circles():
    """The tangent at 0.093 leads to −0.0006, on the other side of the kink at 0, and the tangent there leads back."""

    def kinked(_i, x):
        right = x > 0
        return (-0.1 + np.where(right, 7.22 * x - 11.9 * x * x, 1.065 * x), np.where(right, 7.22 - 23.8 * x, 1.065))

    truth = (7.22 - np.sqrt(7.22**2 - 4 * 11.9 * 0.1)) / (2 * 11.9)
    found = falling_root(kinked, np.array([0.3]), np.array([-2.0]), np.array([0.093]))
    np.testing.assert_allclose(found, truth, rtol=0, atol=2e-14 * 2.3)


def test_a_flat_root_and_an_infinite_slope():
    def cube(_i, x):
        return -(x**3), -3 * x**2

    def root(_i, x):
        with np.errstate(divide="ignore"):
            return -np.cbrt(x), -1 / (3 * np.cbrt(x) ** 2)

    for function, most in ((cube, 1e-4), (root, 2e-14)):
        assert abs(falling_root(function, np.array([-1.0]), np.array([0.7]))[0]) <= most


def test_bracket_of_no_width_nothing_and_inputs_left_alone():
    lo, hi = np.array([1.0, 2.0]), np.array([1.0, -2.0])
    found = falling_root(shifted_cubes(np.array([2.0, 0.0])), lo, hi)
    np.testing.assert_array_equal(lo, [1.0, 2.0])
    np.testing.assert_array_equal(hi, [1.0, -2.0])
    np.testing.assert_allclose(found, [1.0, 0.0], rtol=0, atol=4e-14)
    assert falling_root(shifted_cubes(np.zeros(0)), np.zeros(0), np.zeros(0)).shape == (0,)


def test_a_root_where_the_slope_vanishes_too_is_kept():
    """There Newton's step is no number."""
    root = falling_root(lambda i, x: (-(x**3), -3.0 * x**2), np.array([-1.0]), np.array([2.0]), start=np.array([0.0]))
    assert root[0] == 0.0
