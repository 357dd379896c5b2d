"""What a load cell does to loads: moments and distributions of every flaw, alone and with others."""

import numpy as np
import pytest
from scipy import stats

from helpers.load_cells import CELL, GAIN, NORMAL, SHARED, UNKNOWN, WALK, cell, moments
from helpers.refusals import refused
from tactile_bayes.errors import ParameterError
from tactile_bayes.load_cell import LoadCell
from tactile_bayes.load_cell.measurement import corrupted_angles

N, REPLICATES = 5, 10_000
LOADS = np.array([[0.0, 0.0, 0.0], [0.1, -0.2, 0.3], [0.4, 0.1, 1.0], [0.5, -0.5, 2.0], [0.0, 0.0, 0.0]])


def replicates(sheet, seed, loads=LOADS, count=REPLICATES):
    return sheet.simulate(np.broadcast_to(loads, (count, *loads.shape)), rng=seed)


def refuse_moments(sheet, made, loads=LOADS):
    """Means and all covariances, over samples and channels, within 5.5 standard errors of those that were stated.

    135 numbers are so for all but one seed in 200 000.
    """
    mean, covariance = moments(sheet, loads)
    off = made.reshape(len(made), -1) - mean
    assert np.abs(off.mean(axis=0) * np.sqrt(len(made) / np.diag(covariance))).max() < 5.5
    products = off[:, :, None] * off[:, None, :]
    spread = products.std(axis=0)
    assert np.abs((products.mean(axis=0) - covariance) * np.sqrt(len(made)) / spread).max() < 5.5


@pytest.mark.parametrize("name", NORMAL)
def test_normal_readings_have_the_stated_mean_covariance_and_distribution(name):
    """Made independent, they are standard normal; Kolmogorov's test fails for one seed in a million."""
    sheet = NORMAL[name]
    made = replicates(sheet, 31)
    refuse_moments(sheet, made)
    mean, covariance = moments(sheet, LOADS)
    white = np.linalg.solve(np.linalg.cholesky(covariance), (made.reshape(len(made), -1) - mean).T)
    assert stats.kstest(white.ravel(), "norm").pvalue > 1e-6


@pytest.mark.parametrize("nu", [1.0, 3.0, 12.0])
def test_outliers_follow_students_t(nu):
    sheet = cell(degrees_of_freedom=nu, bias=(0.1, 0.2, 0.3), gain=GAIN)
    made = replicates(sheet, 32)
    mean, _ = moments(sheet, LOADS)
    scaled = (made - mean.reshape(N, 3)) / [0.02, 0.05, 0.05]
    assert stats.kstest(scaled.ravel(), stats.t(nu).cdf).pvalue > 1e-6
    # Independent between channels and samples: the signs are, and the sizes; each 5 standard errors.
    signs, sizes = np.sign(scaled).reshape(-1, 15), (np.abs(scaled) > stats.t(nu).isf(0.25)).reshape(-1, 15) - 0.5
    for numbers in (signs, 2 * sizes):
        together = numbers.T @ numbers / np.sqrt(REPLICATES)
        assert np.abs(together - np.diag(np.diag(together))).max() < 5.5


def test_outliers_beside_drift_and_bias_have_the_sum_of_variances():
    further = {"drift": WALK, "bias_uncertainty": UNKNOWN, "relative_noise": 0.1, "bias": (0.1, 0.2, 0.3)}
    made = replicates(cell(degrees_of_freedom=12.0, **further), 33)
    wider = np.sqrt(12.0 / 10.0)
    further["relative_noise"] *= wider
    refuse_moments(LoadCell(force_noise=0.05 * wider, moment_noise=0.02 * wider, **further), made)


def test_the_stated_standard_deviations_are_those_of_the_readings():
    """Which are normal or of Student's t, by the tests above."""
    noise = {"holding_moment": 0.02, "force_x": 0.05, "force_y": 0.05}
    assert list(CELL.standard_deviations.items()) == list(noise.items())
    for nu, factor in ((12.0, np.sqrt(12.0 / 10.0)), (2.0, np.inf)):
        found = cell(degrees_of_freedom=nu).standard_deviations
        assert found == pytest.approx({name: factor * value for name, value in noise.items()})


def test_no_samples_are_none():
    assert cell(drift=WALK, bias_uncertainty=UNKNOWN).simulate(np.empty((0, 3)), rng=1).shape == (0, 3)


# --- Range, then steps ------------------------------------------------------------------------------------------


def test_readings_are_cut_off_and_then_rounded():
    sheet = LoadCell(moment_range=1.0, moment_resolution=0.3, force_range=2.0, gain=GAIN, bias=(0.0, 0.0, 0.5))
    loads = np.array([[1.0, 0.0, 0.0], [-5.0, 0.0, 0.0], [0.2, 3.0, 1.6], [0.1, -2.5, -9.0]])
    expected = np.array([[0.9, -0.02, 0.5], [-0.9, 0.1, 0.5], [0.3, 2.0, 2.0], [0.0, -2.0, -2.0]])
    np.testing.assert_allclose(sheet.simulate(loads, rng=1), expected, rtol=0, atol=1e-15)


@pytest.mark.parametrize("further", [{}, {"degrees_of_freedom": 3.0}, {"correlation": SHARED, "drift": WALK}])
def test_readings_are_steps_within_the_range(further):
    sheet = cell(moment_range=0.1, moment_resolution=0.03, force_range=0.2, force_resolution=0.04, **further)
    made = replicates(sheet, 39)
    # Cut off and rounded is what would have been read without.
    free = replicates(cell(**further), 39)
    steps, limit = np.array([0.03, 0.04, 0.04]), np.array([0.09, 0.2, 0.2])
    np.testing.assert_allclose(made, np.round(np.clip(free, -limit, limit) / steps) * steps, rtol=1e-14, atol=1e-14)


def test_steps_are_white_noise_of_a_twelfth_of_their_square():
    """Of the forces as wide as the noise, of the moment twice."""
    sheet = cell(moment_resolution=0.04, force_resolution=0.05, correlation=SHARED, gain=GAIN)
    loads = LOADS + np.random.default_rng(40).uniform(-0.02, 0.02, LOADS.shape)
    made = replicates(sheet, 41, loads)
    mean, covariance = moments(sheet, loads)
    off = made.reshape(REPLICATES, -1) - mean
    # To within 6 standard errors, and what the approximation leaves: 2 exp(−2π² (noise/step)²) of a step at most.
    left = np.tile([0.04 * np.exp(-(np.pi**2) / 2), 1e-9, 1e-9], N)
    assert (np.abs(off.mean(axis=0)) < 6.0 * np.sqrt(np.diag(covariance) / REPLICATES) + left).all()
    products = off[:, :, None] * off[:, None, :]
    allowed = 6.0 * products.std(axis=0) / np.sqrt(REPLICATES) + 0.05 * (left[:, None] + left)
    assert (np.abs(products.mean(axis=0) - covariance) < allowed).all()


# --- The encoder ------------------------------------------------------------------------------------------------


def test_an_encoder_with_backlash_reads_more_forward_than_backward():
    angles = np.linspace(1.0, 1.2, 5)
    slack = LoadCell(drive_angle_offset=0.3, drive_angle_backlash=0.01)
    for direction, off in (("forward", 0.305), ("backward", 0.295)):
        made = corrupted_angles(slack, angles, direction, np.random.default_rng(1))
        np.testing.assert_allclose(made, angles + off, rtol=1e-15)


# --- Seeds, factors, and what is refused ------------------------------------------------------------------------


@pytest.mark.parametrize("name", NORMAL)
def test_a_factor_is_on_white_noise_only(name):
    sheet = NORMAL[name]
    loads = np.broadcast_to(LOADS, (3, N, 3))
    one, two = (sheet.simulate(loads, rng=44, noise_scale=f) for f in ((1.0, 1.0, 1.0), [[1.0, 2.0, 3.0]] * 3))
    none = sheet.simulate(loads, rng=44, noise_scale=1e-300)
    np.testing.assert_allclose(two - none, (one - none) * [1.0, 2.0, 3.0], rtol=0, atol=1e-14)
    assert sheet.simulate(LOADS, rng=1, noise_scale=np.ones((4, 3))).shape == (4, N, 3)


def test_white_noise_is_the_same_whatever_else_there_is():
    plain = CELL.simulate(LOADS, rng=45) - LOADS
    further = cell(bias=(0.1, 0.2, 0.3), bias_uncertainty=UNKNOWN, drift=WALK)
    wandering = LoadCell(bias=(0.1, 0.2, 0.3), bias_uncertainty=UNKNOWN, drift=WALK)
    both = [sheet.simulate(LOADS, rng=45) for sheet in (further, wandering)]
    np.testing.assert_allclose(both[0] - both[1], plain, rtol=0, atol=1e-15)


@pytest.mark.parametrize(
    ("loads", "options", "named"),
    [
        *((np.zeros(shape), {}, ["shape", shape]) for shape in ((3,), (4, 2), ())),
        (LOADS, {"noise_scale": -1.0}, ["noise_scale", -1.0]),
        (LOADS, {"noise_scale": np.ones((4, 2))}, ["noise_scale", "(4, 2)", "(3,)"]),
        (LOADS, {"rng": "1"}, ["rng", "'1'"]),
    ],
)
def test_loads_and_factors_that_do_not_fit_are_refused(loads, options, named):
    with refused(ParameterError, *named):
        CELL.simulate(loads, **{"rng": 1} | options)
