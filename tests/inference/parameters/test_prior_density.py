"""Densities in closed form against those of SciPy."""

import numpy as np
import pytest
from scipy import stats

from tactile_bayes.inference.parameters.prior_density import log_density_of

COMMON = [
    stats.norm(),
    stats.norm(0.3, 2.0),
    stats.norm(loc=-1.0, scale=1e-6),
    stats.halfnorm(scale=0.3),
    stats.halfnorm(0.1, 0.5),
    stats.lognorm(s=0.4, scale=0.7),
    stats.lognorm(0.4, 0.2, 3.0),
    stats.uniform(-1.0, 2.5),
    stats.uniform(loc=0.3),
]
OTHERS = [stats.loguniform(0.1, 10.0), stats.t(df=3, scale=0.2), stats.norm(np.zeros(3), 1.0), stats.truncnorm(-1, 1)]


def points(prior):
    inside = prior.rvs(60, random_state=1) if np.ndim(prior.mean()) == 0 else np.zeros(3)
    return np.append(inside, [-100.0, -1e-9, 0.0, 0.3, 1.0, 1.3, 100.0]) if inside.size > 3 else inside


@pytest.mark.parametrize("prior", COMMON + OTHERS, ids=lambda p: f"{p.dist.name}{p.args}{p.kwds}")
def test_as_scipy_has_it(prior):
    at = points(prior)
    np.testing.assert_allclose(log_density_of(prior)(at), prior.logpdf(at), rtol=1e-13, atol=1e-13)
    np.testing.assert_allclose(log_density_of(prior)(at.reshape(1, -1)), prior.logpdf(at)[None], rtol=1e-13, atol=1e-13)


@pytest.mark.parametrize("prior", COMMON, ids=lambda p: f"{p.dist.name}{p.args}{p.kwds}")
def test_common_ones_do_without_scipy(prior):
    assert log_density_of(prior) != prior.logpdf


def test_what_is_no_frozen_distribution_is_asked_itself():
    class Own:
        def logpdf(self, x):
            return -x

    np.testing.assert_array_equal(log_density_of(Own())(np.ones(2)), [-1.0, -1.0])
