"""The distribution of starting points, for targets that are known."""

import numpy as np
import pytest
from scipy import stats

from tactile_bayes.inference.deadline import NEVER, Deadline
from tactile_bayes.inference.starts.cloud import gather

PASSED = Deadline.after(0.0)
CENTRE = np.array([1.0, 2.0])
FAR = CENTRE + 0.3 * np.array([1.0, -1.0])
COVARIANCE = np.array([[1.0, 0.6], [0.6, 0.5]]) * 1e-4


def gaussian(points):
    return np.atleast_1d(stats.multivariate_normal(CENTRE, COVARIANCE).logpdf(points))


def gathered(density, guess=CENTRE, covariance=COVARIANCE, *deadline, count=1000):
    """A cloud, and points of it."""
    cloud = gather(density, np.array(guess), covariance, np.random.default_rng(1), *deadline)
    return cloud, cloud.draw(np.random.default_rng(2), count)


def test_a_good_guess_is_kept_and_its_cloud_is_twice_as_wide():
    cloud, points = gathered(gaussian)
    np.testing.assert_array_equal(cloud.centre, CENTRE)
    np.testing.assert_allclose(cloud.root @ cloud.root.T, 4.0 * COVARIANCE)
    # Hardly any point misses the floor: χ² of two degrees above 2 · 24 / 4 is rarer than 0.3 %.
    assert np.mean(gaussian(points) > cloud.floor) > 0.98


@pytest.mark.parametrize("width", [1e-2, 1.0, 100.0])
def test_a_bad_guess_is_mended(width):
    cloud, points = gathered(gaussian, FAR, width * np.eye(2))
    good = points[gaussian(points) > cloud.floor]
    assert len(good) > 300
    # Nothing hopeless: all within √(2 (12 · 2 + some)) standard deviations, yet at least as wide as the target.
    assert gaussian(good).min() > gaussian(CENTRE) - 24.0 - 5.0
    assert np.all(good.std(axis=0) > 0.8 * np.sqrt(np.diag(COVARIANCE)))


def test_a_sharp_peak_is_not_left_for_what_lies_around_it():
    """Nearly all points of a wide cloud are hopeless beside its centre: it shrinks, and does not move away."""

    def sharp(points):
        apart = np.abs(points - CENTRE).max(axis=1)
        return np.where(apart < 1e-3, gaussian(points), -1e5 - 1e3 * points[:, 0])

    _, points = gathered(sharp, CENTRE, np.eye(2))
    assert np.mean(sharp(points) > -100.0) > 0.3


def test_a_wall_is_respected():
    def walled(points):
        return np.where(points[:, 0] > 1.0, gaussian(points), -np.inf)

    cloud, points = gathered(walled, [0.5, 2.0], np.eye(2))
    assert np.mean(walled(points) > cloud.floor) > 0.15


def test_past_the_deadline_a_cloud_is_left_as_wide_as_it_is_and_has_no_floor():
    cloud, _ = gathered(gaussian, FAR, np.eye(2), PASSED)
    np.testing.assert_array_equal(cloud.centre, FAR)
    np.testing.assert_allclose(cloud.root @ cloud.root.T, 4.0 * np.eye(2), rtol=1e-12)
    assert cloud.floor_by(PASSED) == -np.inf
    assert cloud.floor_by(NEVER) == cloud.floor > -np.inf


def test_past_the_deadline_a_cloud_is_sought_as_long_as_little_of_it_is_possible():
    def walled(points):
        return np.where(np.abs(points - CENTRE).max(axis=1) < 1e-4, 0.0, -np.inf)

    _, points = gathered(walled, CENTRE, np.eye(2), PASSED, count=10_000)
    assert np.mean(np.isfinite(walled(points))) > 0.02  # more than 6 of 120 were: 1 % of seeds, if it is less
