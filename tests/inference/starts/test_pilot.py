"""Pilot runs."""

from dataclasses import dataclass, field, replace

import numpy as np
import pytest

from tactile_bayes.inference.starts.contour_start import standardise

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
