"""Other coordinates than the parameters: what is drawn is the same."""

import numpy as np
import pytest

from tactile_bayes.inference.coordinates.base import Logarithms
from tactile_bayes.inference.ensembles import SamplerSettings, sample


def log_probability(points):
    """A gamma distribution of shape 3, and beside it a normal one."""
    size, place = points.T
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(size > 0.0, 2.0 * np.log(size) - size, -np.inf) - 0.5 * place**2


@pytest.mark.slow
def test_logarithms_change_what_is_walked_in_and_not_what_is_drawn():
    """Mean and variance of the gamma distribution are 3: within 5 standard errors of 4000 effective draws."""
    coordinates = Logarithms(np.array([True, False]))
    start = np.random.default_rng(1).normal(size=(4, 48, 2))
    draws = sample(
        log_probability,
        start,
        names=["size", "place"],
        seed=1,
        settings=SamplerSettings(min_ess=4000.0),
        coordinates=coordinates,
    )
    assert draws.converged
    assert draws.samples[..., 0].min() > 0.0
    assert draws.samples[..., 0].mean() == pytest.approx(3.0, abs=5.0 * np.sqrt(3.0 / 4000.0))
    assert draws.samples[..., 0].var() == pytest.approx(3.0, abs=0.6)
    assert draws.samples[..., 1].mean() == pytest.approx(0.0, abs=5.0 / np.sqrt(4000.0))
    points = draws.samples.reshape(-1, 2)
    np.testing.assert_allclose(draws.log_probability.ravel(), log_probability(points), rtol=0.0, atol=1e-9)


def test_coordinates_of_points_lead_back_to_them():
    coordinates = Logarithms(np.array([True, False, True]))
    points = np.exp(np.random.default_rng(2).normal(size=(5, 3)))
    there, growth = coordinates.parameters(coordinates.of(points))
    np.testing.assert_allclose(there, points, rtol=1e-14)
    np.testing.assert_allclose(growth, np.log(points[:, 0] * points[:, 2]), rtol=1e-12)
