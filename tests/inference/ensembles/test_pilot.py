"""Pilot runs."""

import numpy as np

from tactile_bayes.inference.ensembles import pilot_normal
from tactile_bayes.inference.ensembles.moves import whitened_moves


def test_mean_and_covariance_of_what_is_not_standard_normal_are_found():
    """One direction of twelve is three times as wide, all are shifted: after two runs they are standardised.

    Means within five standard errors of 200 draws. Eleven variances that are one change by less than a tenth; those of
    the draws themselves would be off by a fifth.
    """
    size, rng = 12, np.random.default_rng(1)
    axis = np.ones(size) / np.sqrt(size)
    mean, root = np.linspace(-1.0, 1.0, size), np.eye(size) + 2.0 * np.outer(axis, axis)
    inverse = np.linalg.inv(root)
    centre, spread, positions = np.zeros(size), np.eye(size), 1.4 * rng.normal(size=(200, size + 2))

    def density(points):
        there = centre + points[:, 2:] @ spread.T
        return -0.5 * np.sum(points[:, :2] ** 2, axis=1) - 0.5 * np.sum(((there - mean) @ inverse.T) ** 2, axis=1)

    for _ in range(3):
        found, own, positions = pilot_normal(density, whitened_moves(2), positions, slice(2, None), rng)
        positions[:, 2:] = np.linalg.solve(own, (positions[:, 2:] - found).T).T
        centre, spread = centre + spread @ found, spread @ own
    assert np.all(np.abs(inverse @ (centre - mean)) < 5.0 / np.sqrt(200.0))
    sizes = np.sort(np.linalg.eigvalsh(spread @ spread.T))
    assert abs(np.sqrt(sizes[-1]) / 3.0 - 1.0) < 0.25
    assert np.all(np.abs(sizes[:-1] - 1.0) < 0.1)
