"""Proposals and their mixtures against distributions whose density, moments and mass are known exactly."""

import numpy as np
import pytest
from scipy import stats

from tactile_bayes.inference.densities import (
    Ends,
    Mixture,
    Proposal,
    approximate,
    at_maximum,
    effective_number,
    normalised,
    refined,
)

MEAN = np.array([1.0, -2.0, 0.5])
ROOT = np.array([[0.01, 0.0, 0.0], [3.0, 2.0, 0.0], [10.0, -20.0, 50.0]])  # units that differ, and correlations


def test_draws_have_the_spread_of_students_t():
    """Covariance is scale · 10/8; of 40,000 draws within 5 standard errors of 1 %."""
    points, _ = Proposal(MEAN, ROOT).draw(np.random.default_rng(2), 40_000)
    covariance = np.cov(points.T) * 0.8
    scale = np.sqrt(np.outer(*2 * [np.diag(ROOT @ ROOT.T)]))
    np.testing.assert_allclose(covariance / scale, ROOT @ ROOT.T / scale, atol=0.05)


def test_a_fit_has_the_moments_of_its_points_and_weights_count_like_repetitions():
    points, times = np.random.default_rng(3).normal(size=(200, 3)) @ ROOT.T + MEAN, np.arange(1, 201)
    fitted = Proposal.fitted(points)
    np.testing.assert_allclose(fitted.mean, points.mean(axis=0), rtol=1e-12)
    np.testing.assert_allclose(fitted.root @ fitted.root.T, 1.1**2 * np.cov(points.T), rtol=1e-9)
    weighted, repeated = Proposal.fitted(points, times / times.sum()), Proposal.fitted(np.repeat(points, times, axis=0))
    np.testing.assert_allclose(weighted.mean, repeated.mean, rtol=1e-12)
    ratio = (weighted.root @ weighted.root.T) / (repeated.root @ repeated.root.T)
    np.testing.assert_allclose(ratio, ratio[0, 0], rtol=1e-9)


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


def test_where_nothing_is_possible_nothing_is_promised():
    nowhere = approximate(lambda p: np.full(len(p), -np.inf), np.zeros(2), np.eye(2), np.random.default_rng(8))
    assert nowhere.efficiency == 0.0


@pytest.mark.parametrize("wrong", [0.3, 3.0])
def test_a_normal_target_has_its_mean_and_covariance_at_its_maximum(wrong):
    """From a guess that knows no correlation, five deviations off along a ridge a thousandth as wide as long."""
    target, size = stats.multivariate_normal(MEAN, ROOT @ ROOT.T), np.sqrt(np.diag(ROOT @ ROOT.T))
    middle, root = at_maximum(target.logpdf, MEAN + 5.0 * ROOT[:, 0], np.diag(wrong * size))
    np.testing.assert_allclose((middle - MEAN) / size, 0.0, atol=1e-5)
    np.testing.assert_allclose(root @ root.T, ROOT @ ROOT.T, rtol=1e-5)


def test_the_maximum_is_found_from_where_the_density_is_convex():
    """Student's t, whose logarithm is convex beyond the root of its freedom; its curvature is (ν + 1)/ν."""
    middle, root = at_maximum(lambda points: stats.t(3.0).logpdf(points).sum(axis=1), np.array([4.0, -6.0]), np.eye(2))
    np.testing.assert_allclose(middle, 0.0, atol=0.02)
    np.testing.assert_allclose(root @ root.T, 0.75 * np.eye(2), atol=0.1)


def test_a_maximum_at_an_end_is_approached_from_within():
    """Of a density that falls from zero on, and a guess that reaches below."""
    ends = Ends(np.array([0.0, -np.inf]), np.full(2, np.inf))

    def target(points):
        return np.where(ends.hold(points), -3.0 * points[:, 0] - 0.5 * points[:, 1] ** 2, -np.inf)

    middle, root = at_maximum(target, np.array([0.5, 2.0]), np.eye(2), ends=ends)
    assert 0.0 < middle[0] < 0.1
    assert np.isfinite(root).all()
    assert middle[1] == pytest.approx(0.0, abs=0.01)
    assert root[1, 1] == pytest.approx(1.0, abs=0.01)


def test_where_nothing_is_possible_the_guess_is_left():
    middle, root = at_maximum(lambda p: np.full(len(p), -np.inf), np.ones(2), np.eye(2))
    np.testing.assert_array_equal(middle, np.ones(2))
    np.testing.assert_array_equal(root, np.eye(2))


COVARIANCE = np.array([[1.0, 0.8], [0.8, 2.0]])
POSITIVE = Ends(np.array([0.0, -np.inf]), np.full(2, np.inf))


@pytest.mark.parametrize("middle", [-1.0, 0.0, 1.0, 6.0])
def test_what_ends_is_as_well_approximated_as_what_does_not(middle):
    """A normal target of which a part is cut off, from one that is as if it were not; the mass is known."""
    target, wide = stats.multivariate_normal([middle, 3.0], COVARIANCE), np.diag([4.0, 4.0])

    def log_probability(points):
        return np.where(POSITIVE.hold(points), target.logpdf(points), -np.inf)

    found = approximate(log_probability, np.array([0.1, 3.0]), wide, np.random.default_rng(3), ends=POSITIVE)
    whole = approximate(target.logpdf, np.array([middle, 3.0]), wide, np.random.default_rng(3))
    assert found.efficiency > 0.6
    # 120 draws of that efficiency: a standard error of 0.08 each, and four of them of the ratio.
    assert found.log_mass - whole.log_mass == pytest.approx(stats.norm.logcdf(middle), abs=0.45)
    points, density = found.draw(np.random.default_rng(4), 20_000)
    assert POSITIVE.hold(points).mean() > 0.999  # the rest would have taken too often
    np.testing.assert_allclose(density, found.log_density(points))


@pytest.mark.parametrize("middle", [-0.8, 0.0, 1.0])
def test_a_fit_continues_what_is_cut_off(middle):
    points = np.random.default_rng(5).multivariate_normal([middle, 3.0], COVARIANCE, 200_000)
    fitted = Proposal.fitted(points[points[:, 0] > 0.0], ends=POSITIVE)
    np.testing.assert_allclose(fitted.mean, [middle, 3.0], atol=0.06)
    wider = Proposal.fitted(points).root
    np.testing.assert_allclose(fitted.root @ fitted.root.T, wider @ wider.T, atol=0.06)


# --- Mixtures ------------------------------------------------------------


def two_modes():
    parts = [Proposal(MEAN, ROOT, 0.5, np.log(0.3)), Proposal(MEAN + 100.0, 0.5 * ROOT, 0.8, np.log(0.7))]
    return Mixture(tuple(parts))


def test_density_of_a_mixture_is_that_of_its_parts():
    mixture = two_modes()
    points, density = mixture.draw(np.random.default_rng(1), 50)
    exact = [stats.multivariate_t(p.mean, p.root @ p.root.T, df=10).pdf(points) for p in mixture.parts]
    expected = np.log(0.3 * exact[0] + 0.7 * exact[1])
    np.testing.assert_allclose(density - density[0], expected - expected[0], atol=1e-9)
    np.testing.assert_allclose(mixture.log_density(points), density, rtol=1e-9)
    assert mixture.efficiency == pytest.approx(1.0 / (0.3 / 0.5 + 0.7 / 0.8))


def test_draws_of_a_mixture_do_not_know_their_place():
    """Each place has a draw of the first mode with probability 0.3: of 4000 draws, five standard errors are 0.036."""
    points, _ = two_modes().draw(np.random.RandomState(1), 4000)
    first = np.linalg.solve(ROOT, (points - MEAN).T)[0] < 5000.0
    assert np.mean(first) == pytest.approx(0.3, abs=0.036)
    assert np.mean(first[:2000]) == pytest.approx(0.3, abs=0.051)


UNITS = np.array([1.0, 1e-3, 50.0, 1.0])


def log_density_of_ridge(points):
    """Of a ridge that is bent in two columns; the third depends on the first, and the fourth is positive."""
    along, bent, linear, positive = (points / UNITS).T
    squares = along**2 + ((bent - along**2) / 0.1) ** 2 + (linear - 0.5 * along) ** 2 + positive**2
    return np.where(positive > 0.0, -0.5 * squares, -np.inf)


def test_a_bent_ridge_is_covered_by_pieces_that_find_it():
    """By draws of their own; the integral of the density, of which the tails are hardly seen, in closed form."""
    rng, ends = np.random.default_rng(1), Ends(np.array([-np.inf, -np.inf, -np.inf, 0.0]), np.full(4, np.inf))
    single = approximate(log_density_of_ridge, UNITS * np.ones(4), np.diag(UNITS**2), rng, ends=ends)
    pieces = refined(log_density_of_ridge, single, rng)

    def efficiency(proposal):
        points, density = proposal.draw(rng, 20_000)
        return effective_number(normalised(log_density_of_ridge(points) - density)) / len(points)

    assert efficiency(single) < 0.02
    assert efficiency(pieces) > 0.05
    assert pieces.efficiency <= 1.0
    mass = np.logaddexp.reduce([part.log_mass for part in pieces.parts])
    constant = pieces.parts[0].constant  # which log-densities of proposals lack
    expected = 2.0 * np.log(2.0 * np.pi) + np.log(0.1 * 0.5) + np.log(UNITS).sum()
    assert mass - constant == pytest.approx(expected, abs=0.25)


def test_pieces_are_left_out_where_one_suffices():
    rng = np.random.default_rng(1)
    single = approximate(lambda points: -0.5 * np.sum(points**2, axis=1), np.zeros(3), np.eye(3), rng)
    assert refined(lambda points: pytest.fail("no draw is needed"), single, rng).parts == (single,)


def test_one_piece_has_the_moments_of_its_points():
    rng = np.random.default_rng(2)
    points = MEAN + rng.normal(size=(200_000, 3)) @ ROOT.T
    for bent in ([0], [0, 2], [0, 1, 2]):
        (part,) = Mixture.fitted(points, bent, 1).parts
        root = np.linalg.solve(ROOT, part.root)
        np.testing.assert_allclose(np.linalg.solve(ROOT, part.mean - MEAN), 0.0, atol=0.01)
        np.testing.assert_allclose(root @ root.T, 1.1**2 * np.eye(3), atol=0.02)


@pytest.mark.parametrize("fit", [Proposal.fitted, lambda points: Mixture.fitted(points, [0, 1], 2)])
def test_points_in_a_plane_are_refused(fit):
    points = np.random.default_rng(3).normal(size=(50, 3))
    for flat in (points * [1.0, 1.0, 0.0] + [0.0, 0.0, 1.0], points * [1.0, 0.0, 1.0], points[:, [0, 0, 1]]):
        with pytest.raises(np.linalg.LinAlgError):
            fit(flat)
