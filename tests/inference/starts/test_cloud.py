"""The distribution of starting points, for targets that are known, and pilot runs."""

from dataclasses import dataclass, field, replace

import numpy as np
import pytest
from scipy import stats

from tactile_bayes.inference.deadline import NEVER, Deadline
from tactile_bayes.inference.starts.cloud import gather
from tactile_bayes.inference.starts.contour_start import standardise

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


_SIZE, _BENT, _WALKERS = 12, 2, 100


@dataclass(frozen=True)
class _Shifted:
    """Coordinates of which all but the first two are standardised by mean and root."""

    mean: np.ndarray = field(default_factory=lambda: np.zeros(_SIZE))
    root: np.ndarray = field(default_factory=lambda: np.eye(_SIZE))
    bent = _BENT

    def parameters(self, coordinates):
        there = self.mean + coordinates[:, _BENT:] @ self.root.T
        return np.hstack([coordinates[:, :_BENT], there]), np.zeros(len(coordinates))

    def of(self, points):
        standard = np.linalg.solve(self.root, (points[:, _BENT:] - self.mean).T).T
        return np.hstack([points[:, :_BENT], standard])

    def standardised(self, mean, root):
        return replace(self, mean=self.mean + self.root @ mean, root=self.root @ root)


def _found(mean, root, *, spread):
    """Return coordinates, and the start in parameters before and after, for a normal target."""
    rng = np.random.default_rng(1)
    start = spread * rng.normal(size=(2, _WALKERS, _SIZE + _BENT))

    def density(points):
        standard = np.linalg.solve(root, (points[:, _BENT:] - mean).T).T
        return -0.5 * np.sum(points[:, :_BENT] ** 2, axis=1) - 0.5 * np.sum(standard**2, axis=1)

    found, after = standardise(density, _Shifted(), start, slice(_BENT, None), rng)
    return found, start, np.stack([found.parameters(one)[0] for one in after])


@pytest.mark.parametrize("width", [3.0, 0.4])
def test_mean_and_covariance_of_what_is_not_standard_normal_are_found(width):
    """One direction of twelve has another width, all are shifted: afterwards they are standardised.

    Means within five standard errors of as many draws as walkers; eleven widths of one change by less than a tenth,
    where those of as many draws would be off by a third.
    """
    axis = np.ones(_SIZE) / np.sqrt(_SIZE)
    mean, root = np.linspace(-1.0, 1.0, _SIZE), np.eye(_SIZE) + (width - 1.0) * np.outer(axis, axis)
    found, _, _ = _found(mean, root, spread=1.4)
    left = np.linalg.solve(root, found.mean - mean)
    assert np.all(np.abs(left) < 5.0 / np.sqrt(_WALKERS))
    sizes = np.linalg.svd(np.linalg.solve(root, found.root), compute_uv=False)
    assert np.all(np.abs(sizes - 1.0) < 0.25)
    assert np.sum(np.abs(sizes - 1.0) < 0.1) >= _SIZE - 1


def test_starting_points_stay_where_they_are():
    """Other coordinates name the same parameters."""
    _, before, after = _found(np.full(_SIZE, 0.5), 2.0 * np.eye(_SIZE), spread=2.0)
    np.testing.assert_allclose(after, before, rtol=0.0, atol=1e-12)
