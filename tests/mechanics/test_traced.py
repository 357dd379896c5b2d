"""Rest curvature from traced points: exact without noise, within its errors with noise, else refused."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.integrate import cumulative_simpson, solve_ivp
from scipy.stats import chi2

from helpers.refusals import refused
from tactile_bayes.errors import ParameterError
from tactile_bayes.mechanics.profile import profile_of
from tactile_bayes.mechanics.traced import traced_rod

S = np.linspace(0.0, 1.0, 11)

CURVATURES = {
    "straight": lambda s: 0.0 * s,
    "arc": lambda s: 1.0 + 0.0 * s,
    "spiral": lambda s: 5.0 * s,
    "bent both ways": lambda s: 2.0 - 4.0 * s,
    "wavy": lambda s: 2.0 * np.cos(5.0 * s),
}


def points_of(curvature, s, length=80.0):
    """Points of a rod whose base is off the origin and turned."""

    def slope(at, state):
        return [curvature(at), np.cos(state[0]), np.sin(state[0])]

    solution = solve_ivp(slope, (0.0, 1.0), [0.7, 0.0, 0.0], method="DOP853", t_eval=s, rtol=1e-13, atol=1e-14)
    return 5.0 + length * solution.y[1], length * solution.y[2] - 3.0


@pytest.mark.parametrize(("name", "miss"), [("straight", 1e-9), ("arc", 1e-9), ("spiral", 1e-9), ("wavy", 2e-3)])
def test_exact_points_give_the_rest_curvature(name, miss):
    """Nine terms leave an error of the wavy rod, largest at its ends."""
    spacing = np.sort(np.random.default_rng(2).uniform(0.0, 1.0, 60))
    s = np.concatenate([[0.0], spacing, [1.0]])
    rod = traced_rod(*points_of(CURVATURES[name], s))
    np.testing.assert_allclose(rod.length, 80.0, rtol=1e-5)
    np.testing.assert_allclose(rod.rest_curvature(S), CURVATURES[name](S), atol=miss)


@pytest.mark.parametrize("name", CURVATURES)
def test_deviations_are_those_of_the_errors(name):
    """Mean squares of 40 standardised errors lie within the chi-square range of 1e-6 at either end, and 1.4² for the
    choice of the number of terms."""
    rng = np.random.default_rng(9)
    s, count, scatter = np.linspace(0.0, 1.0, 100), 40, 0.1
    x, y = points_of(CURVATURES[name], s)
    errors, found = [], []
    for _ in range(count):
        noise = rng.normal(0.0, scatter, (2, s.size))
        rod = traced_rod(x + noise[0], y + noise[1])
        errors.append((rod.rest_curvature(S) - CURVATURES[name](S)) / rod.deviation(S))
        found.append(rod.scatter)
    squares = np.mean(np.square(errors), axis=0)
    assert (squares > chi2.ppf(1e-6, count) / count).all()
    assert (squares < 1.4**2 * chi2.isf(1e-6, count) / count).all()
    np.testing.assert_allclose(np.mean(found), scatter, rtol=0.05)


def test_the_place_the_direction_and_the_unit_do_not_matter():
    x, y = points_of(CURVATURES["spiral"], np.linspace(0.0, 1.0, 40))
    x, y = (values + np.random.default_rng(1).normal(0.0, 0.1, values.size) for values in (x, y))
    rod = traced_rod(x, y)
    other = traced_rod(1e-3 * (-y + 7.0), 1e-3 * (x - 4.0))
    np.testing.assert_allclose(other.length, 1e-3 * rod.length, rtol=1e-7)
    np.testing.assert_allclose(other.rest_curvature(S), rod.rest_curvature(S), atol=1e-6)
    np.testing.assert_allclose(other.deviation(S), rod.deviation(S), rtol=1e-5)
    mirrored = traced_rod(-x, y)
    np.testing.assert_allclose(mirrored.rest_curvature(S), -rod.rest_curvature(S), atol=1e-6)


def test_a_scatter_that_is_given_is_used():
    x, y = points_of(CURVATURES["arc"], np.linspace(0.0, 1.0, 40))
    x = x + np.random.default_rng(1).normal(0.0, 0.1, x.size)
    estimated, given = traced_rod(x, y), traced_rod(x, y, scatter=0.2)
    assert given.scatter == 0.2
    np.testing.assert_allclose(given.deviation(S) / 0.2, estimated.deviation(S) / estimated.scatter)
    with refused(ParameterError, "0.01", "scatter"):
        traced_rod(x, y, scatter=0.01)


def test_a_traced_rod_has_a_profile():
    rod = traced_rod(*points_of(CURVATURES["bent both ways"], np.linspace(0.0, 1.0, 40)))
    assert profile_of(rod.rest_curvature).edges.size == 2


@pytest.mark.parametrize(
    ("x", "y", "named"),
    [
        (S[:7], S[:7], ["7", "8"]),
        (S, S[:10], ["11", "10"]),
        ([*S[:10], math.nan], S, ["x"]),
        (np.abs(S - 0.5), 0.0 * S, ["turn back", "order"]),
        (np.append(S, S), np.append(0.0 * S, 0.0 * S + 0.3), ["turn back"]),
        (0.0 * S, 0.0 * S, ["turn back"]),
        (S[[0, 1, 2, 3, 4, 6, 5, 7, 8, 9, 10]], 0.0 * S, ["x[6]", "behind"]),
        (np.linspace(0.0, 1.0, 40), 0.2 * (np.arange(40) % 2), ["rod"]),
    ],
)
def test_points_of_no_rod_are_refused(x, y, named):
    with refused(ParameterError, *named):
        traced_rod(x, y)


def test_a_scatter_that_is_none_is_refused():
    with refused(ParameterError, scatter=-1.0):
        traced_rod(S, S, scatter=-1.0)


def test_no_terms_are_added_for_the_sake_of_scatter():
    """Polynomials of high degree swing at the ends: their curvature there would be off by its own size."""
    s = np.linspace(0.0, 0.1, 40)
    slope = 2.0 * s + 20.0 * s**2
    x, y = (cumulative_simpson(way, x=s, initial=0.0) for way in (np.cos(slope), np.sin(slope)))
    at = np.linspace(0.0, 1.0, 21)
    for seed in (101, *range(20)):  # the first would take nine terms by the least criterion
        rng = np.random.default_rng(seed)
        found = traced_rod(x + rng.normal(0.0, 1e-4, s.size), y + rng.normal(0.0, 1e-4, s.size))
        assert np.abs(found.rest_curvature(at) - 0.1 * (2.0 + 4.0 * at)).max() < 0.4
