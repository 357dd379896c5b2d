"""Smooth contours of any shape: against quadrature, against families, and as compiled code sees them."""

import numpy as np
import pytest
from scipy.integrate import quad

from helpers.refusals import refused
from tactile_bayes.contours import Circle, Parabola, Smooth, check
from tactile_bayes.errors import ContourError
from tactile_bayes.inference.record_likelihood.likelihood import RecordLikelihood
from tactile_bayes.load_cell import LoadCell
from tactile_bayes.mechanics.rods.rod import Rod
from tactile_bayes.rig import Rig
from tactile_bayes.sweep import scan

NODES = 40


def wavy(alpha):
    return np.log(0.5) + 0.8 * np.sin(3.0 * alpha) + 0.5 * np.cos(2.0 * alpha)


@pytest.mark.parametrize("alpha", [-1.4, -0.3, 0.01, 0.7, 1.5])
def test_points_are_integrals_of_the_radius(alpha):
    contour = Smooth(wavy(Smooth.nodes(NODES)), q=0.3, x_c=0.1)
    x = 0.1 + quad(lambda a: np.exp(wavy(a)) * np.cos(a), 0.0, alpha, epsabs=1e-13)[0]
    y = 0.3 + quad(lambda a: np.exp(wavy(a)) * np.sin(a), 0.0, alpha, epsabs=1e-13)[0]
    np.testing.assert_allclose(contour.point(alpha), (x, y), rtol=0.0, atol=1e-11)
    assert contour.radius_of_curvature(alpha) == pytest.approx(np.exp(wavy(alpha)), rel=1e-8)


def test_a_flat_side_is_an_edge_of_its_length():
    """Its slope angles are normal, with a standard deviation of 0.01, so that its chord is shorter by 5e-5."""
    log_radius = wavy(Smooth.nodes(NODES))
    bare, sided = Smooth(log_radius, q=0.3), Smooth(log_radius, q=0.3, flat_length=0.4, flat_slope=0.6)
    further = np.array(sided.point([-0.5, 0.5, 0.7, 1.2])) - bare.point([-0.5, 0.5, 0.7, 1.2])
    chord = 0.4 * np.exp(-0.5 * 0.01**2) * np.array([np.cos(0.6), np.sin(0.6)])
    np.testing.assert_allclose(further, np.outer(chord, [0.0, 0.0, 1.0, 1.0]), rtol=0.0, atol=1e-6)
    check(sided)


def test_it_keeps_the_rules_of_a_contour():
    check(Smooth(wavy(Smooth.nodes(NODES)), q=0.3, x_c=0.1))
    check(Smooth(np.stack([wavy(Smooth.nodes(NODES)), np.zeros(NODES)]), q=0.3, x_c=[0.0, 0.2]))


def test_places_are_found():
    contours = Smooth(np.stack([wavy(Smooth.nodes(NODES)), np.zeros(NODES)]), q=0.3, x_c=[0.1, 0.2])
    alpha = np.array([-1.57, -1.0, -1e-9, 0.0, 0.3, 1.2, 1.57])
    x, _ = contours.take(np.array([[0], [1]])).point(alpha)
    np.testing.assert_allclose(contours.take(np.array([[0], [1]])).parameter_of_x(x), np.tile(alpha, (2, 1)), atol=1e-9)
    for end, outward in ((contours.locate(-0.5 * np.pi).x, -1.0), (contours.locate(0.5 * np.pi).x, 1.0)):
        assert np.isfinite(contours.height(end - 1e-12 * outward)).all()
        assert np.isnan(contours.height(end + 1e-6 * outward)).all()
    assert contours.take(0).height(0.1) == 0.3


def test_a_constant_radius_is_a_circle():
    record, circle = (scan(c, drive_step=0.05).record for c in (Smooth(np.full(8, np.log(0.6)), 0.4), Circle(0.6, 0.4)))
    for name in ("holding_moment", "force_x", "force_y"):
        np.testing.assert_allclose(record[name], circle[name], rtol=0.0, atol=1e-8)


@pytest.mark.parametrize("diameter", [0.0, 0.02])
def test_loads_are_the_exact_ones(diameter):
    """Also mirrored, from another pivot, and for a rod that has a diameter."""
    rod = Rod(diameter=diameter)
    cell = LoadCell(force_noise=0.05, moment_noise=0.02)
    likelihood = RecordLikelihood(
        scan(Parabola(0.5, 0.5), rig=Rig(rod=rod), base=[(0.0, 0.0), (0.2, 0.0)], drive_step=0.05).record, cell
    )
    rng = np.random.default_rng(1)
    waves = 0.3 * rng.normal(size=(20, 4, 1)) * np.cos(np.arange(4)[:, None] * (Smooth.nodes(NODES) + 0.7))
    contours = Smooth(np.log(0.8) + waves.sum(axis=1), q=rng.uniform(0.4, 0.6, 20), x_c=rng.normal(0.0, 0.05, 20))
    fast, usable = likelihood.predict(contours)
    likelihood.exact = True
    exact, reached = likelihood.predict(contours)
    np.testing.assert_array_equal(usable, reached)
    assert usable.sum() > 10
    off = np.abs(fast - exact)[usable].max(axis=2)
    assert np.quantile(off, 0.99) < 2e-4 * np.abs(fast).max()  # others are on either side of an event


@pytest.mark.parametrize(
    ("log_radius", "q", "named"),
    [
        ([0.0], 0.3, ["log_radius", "(1,)", 2]),
        ([0.0, np.nan], 0.3, ["log_radius", "finite"]),
        ([0.0, 0.0], np.inf, ["q", "x_c"]),
        (np.zeros((2, 4)), [0.1, 0.2, 0.3], ["broadcast"]),
        (np.full(4, 500.0), 0.3, ["log_radius", 500]),
    ],
)
def test_what_is_no_contour_is_refused(log_radius, q, named):
    with refused(ContourError, *named):
        Smooth(log_radius, q)
