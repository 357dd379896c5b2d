"""The anchor of a shape-free contour, against the contour itself."""

import numpy as np
import pytest

from tactile_bayes.contours import Smooth
from tactile_bayes.inference.shape_free_posterior.normal_approximation import Anchor

_NODES = 32


def _log_radii(count, seed=1):
    """Return logarithms of radii that change by some tens of per cent along a contour, shape (count, nodes)."""
    alpha = Smooth.nodes(_NODES)
    waves = np.stack([np.cos(k * alpha + k) for k in range(4)])
    return -0.5 + np.random.default_rng(seed).normal(scale=0.3, size=(count, 4)) @ waves


def _place(log_radius, slope_angle):
    """Return heights and distances from the vertex at a slope angle, shape (n, 2)."""
    at = Smooth(log_radius, q=np.zeros(len(log_radius))).locate(np.full((1,), slope_angle))
    return np.column_stack([at.y, at.x])


@pytest.mark.parametrize("slope_angle", [-1.2, -0.3, 0.8])
def test_what_is_beyond_a_line_is_the_rest_of_the_contours_place(slope_angle):
    """The line is through differences of the contour's place."""
    centre, others = _log_radii(1)[0], _log_radii(5, seed=2)
    steps = 1e-5 * np.eye(_NODES)
    slopes = (_place(centre + steps, slope_angle) - _place(centre - steps, slope_angle)) / 2e-5
    linear = _place(centre[None], slope_angle) + (others - centre) @ slopes
    beyond = Anchor(slope_angle, centre).beyond_line(others)
    assert np.all(np.abs(beyond) > 1e-4)
    np.testing.assert_allclose(beyond, _place(others, slope_angle) - linear, rtol=1e-4, atol=1e-7)


def test_at_the_centre_and_for_small_changes_there_is_nothing_beyond():
    centre = _log_radii(1)[0]
    anchor = Anchor(0.7, centre)
    np.testing.assert_array_equal(anchor.beyond_line(centre[None]), 0.0)
    assert np.abs(anchor.beyond_line(centre + 1e-4 * np.eye(_NODES))).max() < 1e-8


def test_the_best_anchor_is_where_the_deviations_leave_the_contour():
    """The only deviation changes a radius everywhere, and the vertex so that one place stays."""
    centre = np.full(_NODES, np.log(0.5))
    wider = np.full((1, _NODES), 0.2)
    stays = 0.6
    vertex = -0.2 * 0.5 * np.array([[1.0 - np.cos(stays), np.sin(stays)]])
    assert Anchor.best(centre, wider, vertex).slope_angle == pytest.approx(stays, abs=0.026)


def test_huge_radii_leave_finite_numbers():
    assert np.isfinite(Anchor(1.4, _log_radii(1)[0]).beyond_line(np.full((1, _NODES), 700.0))).all()
