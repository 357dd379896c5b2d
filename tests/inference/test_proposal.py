"""The proposal against distributions whose moments are known exactly."""

import numpy as np
import pytest
from scipy import stats

from tactile_bayes.inference.densities import Ends, Proposal
from tactile_bayes.inference.importance import approximate

MEAN = np.array([1.0, -2.0, 0.5])
ROOT = np.array([[0.01, 0.0, 0.0], [3.0, 2.0, 0.0], [10.0, -20.0, 50.0]])  # units that differ, and correlations


def test_density_is_that_of_students_t():
    proposal = Proposal(MEAN, ROOT)
    points, density = proposal.draw(np.random.default_rng(1), 50)
    exact = stats.multivariate_t(MEAN, ROOT @ ROOT.T, df=10).logpdf(points)
    np.testing.assert_allclose(proposal.log_density(points), density, rtol=1e-9)
    np.testing.assert_allclose(density - density[0], exact - exact[0], atol=1e-9)


def test_draws_have_the_spread_of_students_t():
    """Covariance is scale · 10/8; of 40,000 draws within 5 standard errors of 1 %."""
    points, _ = Proposal(MEAN, ROOT).draw(np.random.default_rng(2), 40_000)
    covariance = np.cov(points.T) * 0.8
    scale = np.sqrt(np.outer(*2 * [np.diag(ROOT @ ROOT.T)]))
    np.testing.assert_allclose(covariance / scale, ROOT @ ROOT.T / scale, atol=0.05)


def test_a_fit_has_the_moments_of_its_points():
    points = np.random.default_rng(3).normal(size=(200, 3)) @ ROOT.T + MEAN
    fitted = Proposal.fitted(points)
    np.testing.assert_allclose(fitted.mean, points.mean(axis=0), rtol=1e-12)
    np.testing.assert_allclose(fitted.root @ fitted.root.T, 1.1**2 * np.cov(points.T), rtol=1e-9)


def test_weights_count_like_repetitions():
    points = np.random.default_rng(4).normal(size=(20, 3))
    times = np.arange(1, 21)
    weighted = Proposal.fitted(points, times / times.sum())
    repeated = Proposal.fitted(np.repeat(points, times, axis=0))
    np.testing.assert_allclose(weighted.mean, repeated.mean, rtol=1e-12)
    ratio = (weighted.root @ weighted.root.T) / (repeated.root @ repeated.root.T)
    np.testing.assert_allclose(ratio, ratio[0, 0], rtol=1e-9)


def test_points_in_a_plane_are_refused():
    points = np.random.default_rng(5).normal(size=(20, 3))
    points[:, 2] = 1.0
    with pytest.raises(np.linalg.LinAlgError):
        Proposal.fitted(points)


@pytest.mark.parametrize("wrong", [1.0, 3.0, 0.3])
def test_a_normal_target_is_found_from_a_poor_guess(wrong):
    """Two deviations off, too wide or too narrow by 3; as efficient as is said, by 20,000 draws of its own."""
    target = stats.multivariate_normal(MEAN, ROOT @ ROOT.T)
    guess = MEAN + 2.0 * np.sqrt(np.diag(ROOT @ ROOT.T))
    found = approximate(target.logpdf, guess, wrong**2 * ROOT @ ROOT.T, np.random.default_rng(6))
    assert found.efficiency > 0.4
    points, density = found.draw(np.random.default_rng(7), 20_000)
    weights = np.exp(target.logpdf(points) - density)
    assert found.efficiency == pytest.approx(weights.mean() ** 2 / np.mean(weights**2), abs=0.15)


def test_an_efficiency_is_that_of_weights():
    """Against a uniform target on a box, whose share of a proposal's draws is known."""
    box = stats.t(df=10).cdf(1.0) - stats.t(df=10).cdf(-1.0)

    def target(points):
        inside = np.abs(points[:, 0]) < 1.1
        return np.where(inside, -5.5 * np.log1p((points[:, 0] / 1.1) ** 2 / 10.0), -np.inf)

    found = approximate(target, np.zeros(1), np.eye(1), np.random.default_rng(7))
    assert found.efficiency == pytest.approx(box, abs=0.2)


def test_where_nothing_is_possible_nothing_is_promised():
    nowhere = approximate(lambda p: np.full(len(p), -np.inf), np.zeros(2), np.eye(2), np.random.default_rng(8))
    assert nowhere.efficiency == 0.0


def test_the_mass_of_a_target_is_found():
    """Of two normal targets the second has three times the mass, and is wider; by 8 rounds of 180 draws each."""
    found = []
    for mass, width in ((1.0, 1.0), (3.0, 2.5)):
        target = stats.multivariate_normal(MEAN, width**2 * ROOT @ ROOT.T)

        def log_probability(points, target=target, mass=mass):
            return target.logpdf(points) + np.log(mass)

        found.append(approximate(log_probability, MEAN, width**2 * ROOT @ ROOT.T, np.random.default_rng(1)))
    # Weights of efficiency 0.9 on 180 draws: a standard error of 0.03 each, and five of them of the ratio.
    assert found[1].log_mass - found[0].log_mass == pytest.approx(np.log(3.0), abs=0.2)


@pytest.mark.parametrize("middle", [-1.0, 0.0, 1.0, 6.0])
def test_what_ends_is_as_well_approximated_as_what_does_not(middle):
    """A normal target of which a part is cut off, from one that is as if it were not; the mass is known."""
    covariance = np.array([[1.0, 0.8], [0.8, 2.0]])
    target, ends = (
        stats.multivariate_normal([middle, 3.0], covariance),
        Ends(np.array([0.0, -np.inf]), np.full(2, np.inf)),
    )

    def log_probability(points):
        return np.where(ends.hold(points), target.logpdf(points), -np.inf)

    found = approximate(log_probability, np.array([0.1, 3.0]), np.diag([4.0, 4.0]), np.random.default_rng(3), ends=ends)
    whole = approximate(target.logpdf, np.array([middle, 3.0]), np.diag([4.0, 4.0]), np.random.default_rng(3))
    assert found.efficiency > 0.6
    # 120 draws of that efficiency: a standard error of 0.08 each, and four of them of the ratio.
    assert found.log_mass - whole.log_mass == pytest.approx(stats.norm.logcdf(middle), abs=0.45)
    points, density = found.draw(np.random.default_rng(4), 20_000)
    assert ends.hold(points).mean() > 0.999  # the rest would have taken too often
    np.testing.assert_allclose(density, found.log_density(points))


@pytest.mark.parametrize("middle", [-0.8, 0.0, 1.0])
def test_a_fit_continues_what_is_cut_off(middle):
    covariance = np.array([[1.0, 0.8], [0.8, 2.0]])
    points = np.random.default_rng(5).multivariate_normal([middle, 3.0], covariance, 200_000)
    fitted = Proposal.fitted(points[points[:, 0] > 0.0], ends=Ends(np.array([0.0, -np.inf]), np.full(2, np.inf)))
    np.testing.assert_allclose(fitted.mean, [middle, 3.0], atol=0.06)
    wider = Proposal.fitted(points).root
    np.testing.assert_allclose(fitted.root @ fitted.root.T, wider @ wider.T, atol=0.06)
