"""Other coordinates than the parameters."""

import numpy as np

from tactile_bayes.inference.coordinates.base import Logarithms


def test_coordinates_of_points_lead_back_to_them():
    coordinates = Logarithms(np.array([True, False, True]))
    points = np.exp(np.random.default_rng(2).normal(size=(5, 3)))
    there, growth = coordinates.parameters(coordinates.of(points))
    np.testing.assert_allclose(there, points, rtol=1e-14)
    np.testing.assert_allclose(growth, np.log(points[:, 0] * points[:, 2]), rtol=1e-12)
