"""Rest curvature and rigidity as polynomials: what is given is what they return, and what cannot be is refused."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.interpolate import PchipInterpolator

from helpers.refusals import refused
from tactile_bayes.errors import ParameterError
from tactile_bayes.mechanics.rods.profile import STEEPEST_TAPER, profile_of
from tactile_bayes.mechanics.rods.rod import Rod

S = np.linspace(0.0, 1.0, 1009)


def value(edges, rows, s):
    """Value of the piecewise polynomial."""
    cells = np.searchsorted(edges, s, side="right") - 1
    offset = s - edges[cells]
    return sum(rows[cells, k] * offset**k for k in range(rows.shape[1]))


def curvature(profile, s):
    return value(profile.edges, profile.curvature, s)


def rigidity(profile, s):
    return value(profile.edges, profile.rigidity, s)


def test_numbers_are_constant():
    profile = profile_of(0.3, taper=0.5)
    assert profile.edges.tolist() == [0.0, 1.0]
    assert profile.curvature.tolist() == [[0.3], [0.3]]
    assert profile.rigidity.tolist() == [[1.0], [1.0]]
    assert profile[3:6] == (0.5, 0.0, 1.0)


@pytest.mark.parametrize(
    "function",
    [
        lambda s: 1.0 - 3.0 * s**2,
        lambda s: np.exp(-6.0 * s),
        lambda s: np.cos(40.0 * s),
        lambda s: 1.0 / (1.0 + 100.0 * (s - 0.3) ** 2),
        lambda s: np.where(s < 0.5, 1.0, 0.2 + s),  # steps at halves are edges of cells
        lambda s: 0.0 * s,
        lambda s: 0.7,
    ],
)
def test_a_function_is_itself(function):
    expected = np.broadcast_to(function(S), S.shape)
    np.testing.assert_allclose(curvature(profile_of(function), S), expected, rtol=0, atol=3e-12)


def test_a_small_rigidity_is_as_accurate_as_a_large_one():
    profile = profile_of(0.0, lambda s: np.exp(-9.0 * s))
    np.testing.assert_allclose(rigidity(profile, S), np.exp(-9.0 * S), rtol=3e-12)


def test_a_polynomial_takes_as_many_coefficients_as_it_has():
    profile = profile_of(lambda s: 1.0 - 3.0 * s**2)
    np.testing.assert_allclose(profile.curvature, [[1.0, 0.0, -3.0], [-2.0, 0.0, 0.0]], atol=1e-13)


def test_tables_are_interpolated_between_their_neighbours():
    s = np.array([0.0, 0.2, 0.5, 0.52, 1.0])
    bent, rigid = np.array([0.0, 1.0, 0.5, -0.5, -0.5]), np.array([1.0, 1.0, 0.9, 1e-3, 1e-3])
    profile = profile_of((s, bent), (s.tolist(), rigid.tolist()))
    np.testing.assert_allclose(curvature(profile, S), PchipInterpolator(s, bent)(S), atol=1e-13)
    np.testing.assert_allclose(rigidity(profile, S), PchipInterpolator(s, rigid)(S), atol=1e-13)
    assert (rigidity(profile, S) >= 1e-3 - 1e-15).all()


def test_both_are_on_common_cells():
    profile = profile_of(([0.0, 0.3, 1.0], [0.0, 1.0, 0.5]), lambda s: np.exp(-4.0 * s))
    assert set(profile.edges) > {0.0, 0.3, 0.5, 1.0}
    np.testing.assert_allclose(rigidity(profile, S), np.exp(-4.0 * S), rtol=3e-12)
    np.testing.assert_allclose(
        curvature(profile, S), PchipInterpolator([0.0, 0.3, 1.0], [0.0, 1.0, 0.5])(S), atol=1e-13
    )


def test_rods_of_every_length_have_the_profile_of_one_in_its_own_units():
    """Of one length in six the product L · (1/L) is not 1, so that ends of cells differ by rounding."""
    for length in np.random.default_rng(0).uniform(0.01, 0.2, 60):
        profile = Rod(
            length, rest_curvature=lambda s, k=1.0 / length: k * (0.2 + 0.3 * np.cos(30.0 * k * s)), taper=0.2
        ).profile
        assert np.diff(profile.edges).min() > 1e-3
        np.testing.assert_allclose(curvature(profile, S), 0.2 + 0.3 * np.cos(30.0 * S), atol=1e-8)


def test_beyond_the_tip_values_are_those_of_the_tip():
    profile = profile_of(np.cos, (np.array([0.0, 0.4, 1.0]), np.array([1.0, 0.8, 0.3])))
    np.testing.assert_allclose(curvature(profile, np.array([1.0, 1.5])), math.cos(1.0), rtol=1e-13)
    np.testing.assert_allclose(rigidity(profile, np.array([1.0, 1.5])), 0.3, rtol=1e-13)


@pytest.mark.parametrize(
    ("given", "named"),
    [
        *((given, [repr(given)]) for given in ("bent", True, None, [1.0, 2.0, 3.0], math.nan, math.inf, 1j)),
        (([0.0, 1.0], [1.0]), ["same length"]),
        (([0.0], [1.0]), ["two points"]),
        (([0.0, 0.5, 0.4, 1.0], [1.0] * 4), ["0.5", "0.4", "order"]),
        (([0.0, 0.5, 0.5, 1.0], [1.0] * 4), ["0.5", "order"]),
        (([0.0, 0.9], [1.0, 1.0]), ["0.9", "tip"]),
        (([0.1, 1.0], [1.0, 1.0]), ["0.1", "base"]),
        (([0.0, 0.5, 1.0], [1.0, math.nan, 1.0]), ["nan", "s[1]"]),
        (([[0.0, 1.0]], [[1.0, 1.0]]), ["same length"]),
        (lambda s: abs(s - 0.3), ["smooth", "0.3"]),
        (lambda s: np.floor(3.0 * s), ["smooth", "arrays"]),
        (lambda s: np.sin(3e4 * s), ["smooth"]),
        (lambda s: 1.0 / (s - 0.5), ["finite", "0.5"]),
        (lambda s: math.cos(s), ["arrays", "np.vectorize"]),
        (lambda s: s[:3], ["shape", "(3,)"]),
    ],
)
def test_a_rest_curvature_that_is_none_is_refused(given, named):
    with refused(ParameterError, "rest_curvature", *named):
        profile_of(given)


@pytest.mark.parametrize(
    ("rigidity_profile", "named"),
    [
        (0.0, ["positive"]),
        (2.0, ["2", "base"]),
        (lambda s: 1.0 - 1.5 * s, ["positive", "s ="]),
        (lambda s: 2.0 - s, ["2", "base", "divide"]),
        (([0.0, 0.5, 1.0], [1.0, -0.1, 1.0]), ["-0.1", "s = 0.5"]),
    ],
)
def test_a_rigidity_that_is_none_is_refused(rigidity_profile, named):
    with refused(ParameterError, "rigidity_profile", *named):
        profile_of(0.0, rigidity_profile)


@pytest.mark.parametrize("taper", [-0.1, 0.99, 1.0, math.nan, "0.5", None])
def test_a_taper_that_is_none_is_refused(taper):
    with refused(ParameterError, str(STEEPEST_TAPER), taper=taper):
        profile_of(0.0, 1.0, taper)
