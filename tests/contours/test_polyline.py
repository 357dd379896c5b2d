"""Polylines: distances that are exact, and where there is none."""

import numpy as np
import pytest

from helpers.refusals import refused
from tactile_bayes.contours import Polyline
from tactile_bayes.errors import ContourError, ParameterError


def arc(radius, *, centre=(0.0, 0.0), ends=(-np.pi, 0.0), points=20_001):
    angle = np.linspace(*ends, points)
    return np.column_stack([centre[0] + radius * np.cos(angle), centre[1] + radius * np.sin(angle)])


def test_a_circle_is_as_far_from_a_shifted_or_larger_one_as_the_shift():
    x, y = arc(0.1, ends=(-2.5, -0.6), points=101).T
    assert Polyline([arc(0.103)]).distance(x, y) == pytest.approx(np.full(101, 3e-3), abs=1e-8)
    shifted = Polyline([arc(0.1, centre=(0.0, 2e-3))]).distance(x, y)
    assert shifted.max() == pytest.approx(2e-3, rel=1e-4)  # at the lowest point
    exact = np.abs(np.hypot(x, y - 2e-3) - 0.1)
    assert shifted == pytest.approx(exact, abs=1e-8)


def test_beyond_a_free_end_there_is_no_distance_and_beyond_a_joint_there_is():
    half, other = arc(0.1, ends=(-np.pi, -1.0)), arc(0.1, ends=(-1.0, 0.0))
    outside = 0.12 * np.cos([-1.0, 0.3]), 0.12 * np.sin([-1.0, 0.3])
    alone = Polyline([half]).distance([0.12 * np.cos(-0.8)], [0.12 * np.sin(-0.8)])
    assert np.isnan(alone).all()
    both = Polyline([half, other[::-1]]).distance(*outside)
    assert both[0] == pytest.approx(0.02, abs=1e-8)
    assert np.isnan(both[1])
    square = Polyline([[(0, 0), (1, 0), (1, 1), (0, 1), (0, 0)]])  # closed: no end is free
    assert square.distance(-3.0, -4.0) == pytest.approx(5.0)


def test_the_height_is_that_nearest_to_what_is_asked():
    square = Polyline([[(0, 0), (1, 0), (1, 0), (1, 1), (0, 1), (0, 0)]])
    found = square.height([0.5, 0.5, 1.0, 1.5, 0.5], [0.4, 0.6, 0.3, 0.0, np.nan])
    assert found == pytest.approx([0.0, 1.0, 0.3, np.nan, np.nan], nan_ok=True)


@pytest.mark.parametrize(
    ("pieces", "error", "words"),
    [
        ([], ContourError, "fewer than two points"),
        ([[(0.0, 0.0)]], ContourError, "fewer than two points"),
        ([[(0.0, 0.0, 1.0)]], ParameterError, "a pair of finite numbers"),
        ([[(0.0, 0.0), (np.nan, 1.0)]], ParameterError, "a pair of finite numbers"),
    ],
)
def test_what_is_no_polyline_is_refused(pieces, error, words):
    with refused(error, words):
        Polyline(pieces)


def test_arguments_broadcast():
    square = Polyline([[(0, 0), (1, 0), (1, 1), (0, 1), (0, 0)]])
    assert square.height(0.5, [[0.4], [0.6]]).tolist() == [[0.0], [1.0]]
    assert square.height([0.25, 2.0], 0.0).tolist() == pytest.approx([0.0, np.nan], nan_ok=True)
    assert square.distance(0.5, [-0.5, 1.25]).tolist() == [0.5, 0.25]
