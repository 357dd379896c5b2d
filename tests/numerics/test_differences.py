"""Slopes by central differences: exact for polynomials of the second degree, zero at a jump."""

import numpy as np
import pytest

from tactile_bayes.numerics.differences import central_slopes


def test_slopes_of_a_quadratic_form_are_exact():
    """But for rounding: values of about 100 over steps of 1e-4."""
    rng = np.random.default_rng(1)
    linear, square, point = rng.normal(size=(5, 3)), rng.normal(size=(5, 3, 3)), rng.normal(size=3)

    def values(points):
        return points @ linear.T + np.einsum("ni,kij,nj->nk", points, square, points)

    right = linear + (square + square.swapaxes(1, 2)) @ point
    found = central_slopes(values, point, 1e-4)
    assert found.shape == (5, 3)
    np.testing.assert_allclose(found, right, rtol=0.0, atol=1e-9)


@pytest.mark.parametrize(
    ("values", "at", "step", "slope"),
    [
        (lambda x: x**3, 2.0, 1e-2, 12.0 + 1e-4),  # the square of the step is left
        (lambda x: 1e4 * x + 1e3 * x**2, 1.0, 1e-2, 1.2e4),  # a steep slope is no jump
        (lambda x: 400.0 * np.abs(x) + 100.0 * x, 0.0, 1e-5, 100.0),  # nor is a bend of 0.004: the mean of both sides
    ],
)
def test_slopes_of_a_number(values, at, step, slope):
    assert central_slopes(values, np.array([at]), step)[0, 0] == pytest.approx(slope, rel=1e-9)


def test_every_parameter_has_a_step_of_its_own():
    seen = []

    def values(points):
        seen.append(points)
        return points @ np.array([[1e6], [1e-6]])

    steps = np.array([1e-7, 1e4])
    found = central_slopes(values, np.array([3.0, -2e5]), steps)
    np.testing.assert_allclose(found, [[1e6, 1e-6]], rtol=1e-6)
    (points,) = seen
    np.testing.assert_allclose(np.ptp(points, axis=0), 2.0 * steps)
    assert len(points) == 5


@pytest.mark.parametrize("side", [1.0, -1.0])
@pytest.mark.parametrize("height", [-20.0, 0.1, 20.0])
def test_a_jump_is_no_slope(side, height):
    """Neither for that sample, nor for others."""

    def values(points):
        jumping = np.where(side * (points[:, 0] - 1.0) > 0.0, height, 0.0) + 3.0 * points[:, 1]
        return np.stack([jumping, 7.0 * points[:, 0] + 3.0 * points[:, 1]], axis=1)

    found = central_slopes(values, np.array([1.0, 0.0]), 1e-5)
    np.testing.assert_allclose(found, [[0.0, 3.0], [7.0, 3.0]], atol=1e-8)
