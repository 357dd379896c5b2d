"""Rest curvature from traced points: exact without noise, within its errors with noise, else refused."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.integrate import cumulative_simpson, solve_ivp
from scipy.stats import chi2

from helpers.refusals import refused
from tactile_bayes.errors import ParameterError
from tactile_bayes.mechanics.rods.profile import MOST_MODES, profile_of
from tactile_bayes.mechanics.rods.traced import traced_rod
from tactile_bayes.numerics import chebyshev

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


@pytest.mark.parametrize(("name", "miss"), [("straight", 1e-12), ("arc", 1e-11), ("spiral", 1e-9), ("wavy", 1e-6)])
def test_exact_points_give_the_rest_curvature(name, miss):
    """Twenty terms leave an error of the wavy rod, largest at its ends."""
    spacing = np.sort(np.random.default_rng(2).uniform(0.0, 1.0, 60))
    s = np.concatenate([[0.0], spacing, [1.0]])
    rod = traced_rod(*points_of(CURVATURES[name], s))
    np.testing.assert_allclose(rod.length, 80.0, rtol=1e-5)
    np.testing.assert_allclose(rod.rest_curvature(S), CURVATURES[name](S), atol=miss)


def noisy(x, y, scatter, rng):
    noise = rng.normal(0.0, scatter, (2, x.size))
    return x + noise[0], y + noise[1]


def drawn_curvature(rng):
    """Return a random smooth function with a correlation length of half a rod."""
    waves, phases = rng.normal(0.0, 2.0, 40), rng.uniform(0.0, 2.0 * np.pi, 40)
    size = rng.uniform(0.3, 2.0) * np.sqrt(2.0 / 40.0)
    return lambda s: size * np.cos(np.multiply.outer(s, waves) + phases).sum(axis=-1)


def standardised(curvature, x, y, scatter=None):
    """Errors of the curvature at `S`, and of its mean, over their standard deviations."""
    rod = traced_rod(x, y, scatter=scatter)
    fine = np.linspace(0.0, 1.0, 201)
    off = cumulative_simpson(rod.rest_curvature(fine) - curvature(fine), x=fine)[-1]
    return np.append((rod.rest_curvature(S) - curvature(S)) / rod.deviation(S), off / rod.deviation_of_mean)


def squares_of_drawn_rods(rng, count, points, scatter, given):
    """Mean squares of standardised errors over drawn rods, traced at so many points."""
    errors = []
    for _ in range(count):
        curvature = drawn_curvature(rng)
        traced = noisy(*points_of(curvature, np.linspace(0.0, 1.0, points)), scatter, rng)
        errors.append(standardised(curvature, *traced, given))
    return np.mean(np.square(errors), axis=0)


@pytest.mark.parametrize(
    ("scatter", "given"), [(0.02, None), pytest.param(0.2, None, marks=pytest.mark.slow), (0.2, 0.2)]
)
def test_deviations_are_those_of_the_errors(scatter, given):
    """Over drawn rods, at the ends too: mean squares of 60 standardised errors are below the chi-square limit of 1e-6.
    The drawn rods are smoother than the prior, so that errors may be half as large as stated."""
    squares = squares_of_drawn_rods(np.random.default_rng(9), 60, 40, scatter, given)
    assert (squares > 0.2).all()
    assert (squares < chi2.isf(1e-6, 60) / 60).all()


@pytest.mark.parametrize("name", CURVATURES)
def test_deviations_of_each_rod_hold(name):
    """Errors of rods of linear curvature are smaller: their deviations allow for more. The scatter is found."""
    rng = np.random.default_rng(9)
    s, count, scatter = np.linspace(0.0, 1.0, 100), 40, 0.1
    x, y = points_of(CURVATURES[name], s)
    errors, found = [], []
    for _ in range(count):
        traced = noisy(x, y, scatter, rng)
        errors.append(standardised(CURVATURES[name], *traced))
        found.append(traced_rod(*traced).scatter)
    squares = np.mean(np.square(errors), axis=0)
    assert (squares < chi2.isf(1e-6, count) / count).all()
    assert (squares > 0.1).all()
    np.testing.assert_allclose(np.mean(found), scatter, rtol=0.05)


def test_a_bend_near_the_tip_leaves_the_rest_straight():
    """Polynomials of few terms would swing at the ends."""
    rng = np.random.default_rng(4)

    def bend(s):
        return 2.0 + 2.0 * np.tanh((s - 0.65) / 0.1)

    rod = traced_rod(*noisy(*points_of(bend, np.linspace(0.0, 1.0, 60)), 0.05, rng))
    assert np.abs(rod.rest_curvature([0.0, 0.1, 0.3])).max() < 0.3
    assert abs(rod.rest_curvature(1.0) - 4.0) < 4.0 * rod.deviation(1.0)


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
    assert (given.deviation(S) > 1.5 * estimated.deviation(S)).all()
    with refused(ParameterError, "0.01", "scatter"):
        traced_rod(x, y, scatter=0.01)


def test_a_traced_rod_has_a_profile():
    rod = traced_rod(*points_of(CURVATURES["bent both ways"], np.linspace(0.0, 1.0, 40)))
    assert profile_of(rod.rest_curvature).edges.size == 2


@pytest.mark.parametrize(
    ("x", "y", "options", "named"),
    [
        (S[:7], S[:7], {}, ["7", "8"]),
        (S, S[:10], {}, ["11", "10"]),
        ([*S[:10], math.nan], S, {}, ["x"]),
        (np.abs(S - 0.5), 0.0 * S, {}, ["turn back", "order"]),
        (np.append(S, S), np.append(0.0 * S, 0.0 * S + 0.3), {}, ["turn back"]),
        (0.0 * S, 0.0 * S, {}, ["turn back"]),
        (S[[0, 1, 2, 3, 4, 6, 5, 7, 8, 9, 10]], 0.0 * S, {}, ["x[6]", "behind"]),
        (np.linspace(0.0, 1.0, 40), 0.2 * (np.arange(40) % 2), {}, ["rod"]),
        (S, S, {"scatter": -1.0}, ["scatter", -1.0]),
        *((80.0 * S, 0.0 * S, {"length": length}, ["length"]) for length in (70.0, 130.0, np.nan)),
    ],
)
def test_points_of_no_rod_are_refused(x, y, options, named):
    with refused(ParameterError, *named):
        traced_rod(x, y, **options)


def test_few_points_of_known_scatter_need_no_terms_for_it():
    """The strength of the noise is not sought where the points alone could not tell it from scatter."""
    squares = squares_of_drawn_rods(np.random.default_rng(3), 40, 8, 0.4, 0.4)
    assert (squares < chi2.isf(1e-6, 40) / 40).all()


def test_curvature_does_not_follow_the_scatter():
    """It would be off by its own size at the ends."""
    s = np.linspace(0.0, 0.1, 40)
    slope = 2.0 * s + 20.0 * s**2
    x, y = (cumulative_simpson(way, x=s, initial=0.0) for way in (np.cos(slope), np.sin(slope)))
    at = np.linspace(0.0, 1.0, 21)
    for seed in (101, *range(20)):
        rng = np.random.default_rng(seed)
        found = traced_rod(x + rng.normal(0.0, 1e-4, s.size), y + rng.normal(0.0, 1e-4, s.size))
        assert np.abs(found.rest_curvature(at) - 0.1 * (2.0 + 4.0 * at)).max() < 0.4


@pytest.mark.parametrize("name", CURVATURES)
@pytest.mark.parametrize("given", [False, pytest.param(True, marks=pytest.mark.slow)])
def test_a_rod_may_go_on_beyond_its_points(name, given):
    """Its trend goes on, with errors that are as large as stated; the points tell no less of the rest."""
    rng = np.random.default_rng(12)
    s, count, scatter = np.linspace(0.0, 0.9, 60), 30, 0.05
    x, y = points_of(CURVATURES[name], s)
    at = np.array([0.2, 0.6, 0.95, 1.0])
    errors, short = [], []
    for _ in range(count):
        points = noisy(x, y, scatter, rng)
        rod = traced_rod(*points, scatter=scatter if given else None, length=80.0)
        assert rod.length == 80.0
        errors.append((rod.rest_curvature(at) - CURVATURES[name](at)) / rod.deviation(at))
        short.append(rod.scatter / traced_rod(*points).scatter - 1.0)
    squares = np.mean(np.square(errors), axis=0)
    assert (squares < chi2.isf(1e-6, count) / count).all()
    deviations = traced_rod(x, y, scatter=scatter, length=80.0).deviation(at)
    assert deviations[3] > deviations[2] > 1.5 * deviations[1]
    assert given or np.abs(short).max() < 0.02


def test_exact_points_of_a_part_give_the_whole():
    x, y = points_of(CURVATURES["spiral"], np.linspace(0.0, 0.8, 30))
    rod = traced_rod(x, y, length=80.0)
    np.testing.assert_allclose(rod.rest_curvature(S), 5.0 * S, atol=1e-6)


def test_modes_hold_what_a_trace_leaves_open_of_deflections():
    """Of points all along, nearly all of their variance, independent of what is left."""
    rng, s = np.random.default_rng(8), np.linspace(0.0, 1.0, 25)
    for name, scatter in (("spiral", 0.08), ("wavy", 0.2), ("straight", 0.02)):
        x, y = points_of(CURVATURES[name], s)
        rod = traced_rod(x + rng.normal(0.0, scatter, s.size), y + rng.normal(0.0, scatter, s.size))
        modes = rod.modes(MOST_MODES)
        fine = np.linspace(0.0, 1.0, 101)
        levers = np.maximum(np.subtract.outer(fine, fine), 0.0) * 0.01
        each = levers @ chebyshev.polynomials(rod.coefficients.size, fine)
        whole, held = (np.einsum("ci,ij,cj->c", each, of, each) for of in (rod.covariance, modes.T @ modes))
        assert held.sum() > 0.999 * whole.sum()
        assert np.all(held <= whole * (1.0 + 1e-9))
        assert np.linalg.eigvalsh(rod.covariance - modes.T @ modes).min() > -1e-9 * np.abs(rod.covariance).max()
