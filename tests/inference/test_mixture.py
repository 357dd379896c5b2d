"""Mixtures of proposals against densities known exactly."""

import numpy as np
import pytest
from scipy import stats

from tactile_bayes.inference.densities import ANYTHING, Ends, Mixture, Proposal, effective_number, normalised
from tactile_bayes.inference.importance import approximate, refined

MEAN = np.array([1.0, -2.0, 0.5])
ROOT = np.array([[0.01, 0.0, 0.0], [3.0, 2.0, 0.0], [10.0, -20.0, 50.0]])  # units that differ, and correlations


def two_modes():
    parts = [Proposal(MEAN, ROOT, 0.5, np.log(0.3)), Proposal(MEAN + 100.0, 0.5 * ROOT, 0.8, np.log(0.7))]
    return Mixture(tuple(parts))


def test_density_of_a_mixture_is_that_of_its_parts():
    mixture = two_modes()
    points, density = mixture.draw(np.random.default_rng(1), 50)
    exact = [stats.multivariate_t(p.mean, p.root @ p.root.T, df=10).pdf(points) for p in mixture.parts]
    expected = np.log(0.3 * exact[0] + 0.7 * exact[1])
    np.testing.assert_allclose(density - density[0], expected - expected[0], atol=1e-9)
    assert mixture.efficiency == pytest.approx(1.0 / (0.3 / 0.5 + 0.7 / 0.8))


def test_draws_of_a_mixture_do_not_know_their_place():
    """Each place has a draw of the first mode with probability 0.3: of 4000 draws, five standard errors are 0.036."""
    points, _ = two_modes().draw(np.random.RandomState(1), 4000)
    first = np.linalg.solve(ROOT, (points - MEAN).T)[0] < 5000.0
    assert np.mean(first) == pytest.approx(0.3, abs=0.036)
    assert np.mean(first[:2000]) == pytest.approx(0.3, abs=0.051)


UNITS = np.array([1.0, 1e-3, 50.0, 1.0])  # units of the columns of `ridge`


def ridge(rng, count):
    """Draw a bent ridge in the first two columns, one that depends on the first linearly, and one that is positive."""
    along, rest = rng.normal(size=count), rng.normal(size=(count, 3))
    columns = [along, along**2 + 0.1 * rest[:, 0], 0.5 * along + rest[:, 1], np.abs(rest[:, 2])]
    return UNITS * np.stack(columns, axis=1)


def log_density_of_ridge(points):
    along, bent, linear, positive = (points / UNITS).T
    squares = along**2 + ((bent - along**2) / 0.1) ** 2 + (linear - 0.5 * along) ** 2 + positive**2
    return np.where(positive > 0.0, -0.5 * squares, -np.inf)


def accepted(proposal, rng):
    """Return the share of a proposal's draws that are accepted from draws of the ridge."""
    there, density = proposal.draw(rng, 4000)
    here = ridge(rng, 4000)
    with np.errstate(invalid="ignore"):
        logs = log_density_of_ridge(there) - density - log_density_of_ridge(here) + proposal.log_density(here)
    return np.exp(np.minimum(logs, 0.0)).mean()


def test_pieces_follow_a_bent_ridge():
    rng = np.random.default_rng(1)
    points, ends = ridge(rng, 500), Ends(np.array([-np.inf, -np.inf, -np.inf, 0.0]), np.full(4, np.inf))
    single, pieces = accepted(Proposal.fitted(points, ends=ends), rng), Mixture.fitted(points, [0, 1], 8, ends)
    assert single < 0.2
    assert accepted(pieces, rng) > 2.0 * single
    assert accepted(pieces, rng) > accepted(Mixture.fitted(points, [0, 1], 8, ANYTHING), rng)


def test_a_bent_ridge_is_covered_by_pieces_that_find_it():
    """By draws of their own; the integral of the density, of which the tails are hardly seen, in closed form."""
    rng, ends = np.random.default_rng(1), Ends(np.array([-np.inf, -np.inf, -np.inf, 0.0]), np.full(4, np.inf))
    single = approximate(log_density_of_ridge, UNITS * np.ones(4), np.diag(UNITS**2), rng, ends=ends)
    pieces = refined(log_density_of_ridge, single, rng)

    def efficiency(proposal):
        points, density = proposal.draw(rng, 20_000)
        return effective_number(normalised(log_density_of_ridge(points) - density)) / len(points)

    assert efficiency(single) < 0.02
    assert efficiency(pieces) > 0.1
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


def test_points_in_a_plane_have_no_mixture():
    points = np.random.default_rng(3).normal(size=(50, 3))
    for flat in (points * [1.0, 0.0, 1.0], points[:, [0, 0, 1]]):
        with pytest.raises(np.linalg.LinAlgError):
            Mixture.fitted(flat, [0, 1], 2)
