"""Chebyshev interpolation on [0, 1]: exact for polynomials, geometric for analytic functions."""

import numpy as np
import pytest
from numpy.polynomial import Polynomial

from tactile_bayes.numerics import chebyshev

EPS = np.finfo(float).eps


@pytest.mark.parametrize("count", [1, 2, 7, 16, 33])
def test_polynomials_below_the_count_are_exact(count):
    p = Polynomial(np.random.default_rng(count).normal(size=count))
    z = np.linspace(0.0, 1.0, 23)
    fit = chebyshev.coefficients(p(chebyshev.nodes(count)))
    scale = count * np.sum(np.abs(p.coef))
    np.testing.assert_allclose(chebyshev.evaluate(fit, z), p(z), rtol=0, atol=4 * EPS * scale)
    if count > 1:
        # Markov: a derivative of a polynomial of degree n on [0, 1] is at most 2 n² times as large.
        slope = chebyshev.evaluate(chebyshev.derivative(fit), z)
        np.testing.assert_allclose(slope, p.deriv()(z), rtol=0, atol=4 * EPS * scale * 2 * count**2)


def test_nodes_increase_and_are_roots():
    for count in (1, 5, 34):
        node = chebyshev.nodes(count)
        assert np.all(np.diff(node) > 0)
        assert 0 < node[0] <= node[-1] < 1
        last = chebyshev.polynomials(count + 1, node)[:, -1]
        np.testing.assert_allclose(last, 0, atol=4 * EPS * count**2)


def test_error_falls_geometrically():
    """1/(z + 0.1): the nearest pole −0.1 lies on the ellipse of parameter ρ = 1.2 + √(1.2² − 1), about 1.863."""
    z = np.linspace(0, 1, 101)
    rho = 1.2 + np.sqrt(1.2**2 - 1)
    for count in (10, 20, 30):
        fit = chebyshev.coefficients(1 / (chebyshev.nodes(count) + 0.1))
        error = np.max(np.abs(chebyshev.evaluate(fit, z) - 1 / (z + 0.1)))
        # aₖ = 4 ρ^−k / √(1.2² − 1); interpolation is at most twice the sum of those left out.
        bound = 2 * 4 / np.sqrt(1.2**2 - 1) * rho ** (1.0 - count) / (rho - 1)
        assert bound / 50 < error < bound


def test_many_functions_at_once():
    rng = np.random.default_rng(1)
    values = rng.normal(size=(3, 4, 9))
    fit = chebyshev.coefficients(values)
    assert fit.shape == (9, 3, 4)
    z = rng.random(5)
    basis = chebyshev.polynomials(9, z)
    assert basis.shape == (5, 9)
    for i in range(3):
        for j in range(4):
            one = chebyshev.coefficients(values[i, j])
            np.testing.assert_allclose(fit[:, i, j], one, rtol=0, atol=64 * EPS)
            np.testing.assert_allclose(basis @ one, chebyshev.evaluate(one, z), rtol=0, atol=64 * EPS)
    each = chebyshev.evaluate(fit, np.broadcast_to(z[:4], (3, 4)))
    np.testing.assert_allclose(each, np.einsum("jk,kij->ij", basis[:4], fit), rtol=0, atol=64 * EPS)
