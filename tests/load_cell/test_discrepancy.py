"""The discrepancy of a model in the likelihood: against dense covariances, and against records drawn from them."""

from dataclasses import replace

import mpmath
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats

from helpers.load_cells import CELL, SHARED, UNKNOWN, WALK, WANDER, cell, moments
from helpers.refusals import refused
from tactile_bayes.errors import ParameterError
from tactile_bayes.load_cell import kalman
from tactile_bayes.load_cell.discrepancy import Course, Discrepancy
from tactile_bayes.load_cell.drift import Zero

N = 40
SWEEPS = (np.arange(0, 18), np.arange(18, N))
BESIDE = {
    "white": CELL,
    "gain, bias, lever": cell(gain=((1.02, 0.01, 0.0), (-0.02, 0.97, 0.03), (0.0, 0.02, 1.05)), bias=(0.1, -0.2, 0.3)),
    "relative noise": cell(relative_noise=0.2),
    "unknown bias": cell(bias_uncertainty=UNKNOWN),
    "random walk": cell(drift=WALK),
    "drift that forgets": cell(drift=WANDER, bias_uncertainty=UNKNOWN, relative_noise=0.1),
    "steps": cell(force_resolution=0.05, moment_resolution=0.02),
}


def drawn(seed, *, batch=(), repeated=False):
    """A discrepancy with contact in the middle of each sweep, readings and loads."""
    rng = np.random.default_rng(seed)
    coordinate = np.concatenate([np.sort(rng.uniform(0.0, 2.0, rows.size)) for rows in SWEEPS])
    sweeps = [np.arange(N)] if repeated else SWEEPS
    deviation = rng.uniform(0.02, 0.3, (*batch, N, 3))
    deviation[..., [0, 1, 2, 16, 17, 18, 19, 38, 39], :] = 0.0
    discrepancy = Discrepancy(Course.along(coordinate, sweeps), deviation, rng.uniform(0.05, 3.0, batch))
    loads = 0.5 * rng.normal(size=(*batch, N, 3))
    scale = rng.uniform(0.5, 2.0, (*batch, 3))
    measured = 0.3 * rng.normal(size=(N, 3))
    return discrepancy, coordinate, sweeps, measured, loads, scale


def matern(distance, length):
    a = np.sqrt(3.0) * distance / length
    return (1.0 + a) * np.exp(-a)


def dense(sheet, discrepancy, coordinate, sweeps, loads, scale):
    """Mean and covariance of one channel after another, written out."""
    mean, covariance = moments(sheet, loads, scale)
    together = np.zeros((N, N))
    for rows in sweeps:
        together[np.ix_(rows, rows)] = matern(
            np.abs(np.subtract.outer(coordinate[rows], coordinate[rows])), float(discrepancy.length)
        )
    covariance = covariance.reshape(N, 3, N, 3).copy()
    for c in range(3):
        deviation = discrepancy.deviation[:, c]
        covariance[:, c, :, c] += deviation[:, None] * together * deviation
    return mean, covariance.reshape(3 * N, 3 * N)


@pytest.mark.parametrize(
    ("name", "repeated"),
    [(name, False) for name in BESIDE] + [(name, True) for name, sheet in BESIDE.items() if sheet.drift is None],
)
def test_it_is_dense(name, repeated):
    """The likelihood, and each sample given all others."""
    sheet = BESIDE[name]
    for seed in range(4):
        discrepancy, coordinate, sweeps, measured, loads, scale = drawn(seed, repeated=repeated)
        mean, covariance = dense(sheet, discrepancy, coordinate, sweeps, loads, scale)
        expected = stats.multivariate_normal(mean, covariance).logpdf(measured.ravel())
        found = sheet.log_likelihood(measured, loads, noise_scale=scale, discrepancy=discrepancy)
        assert found == pytest.approx(expected, rel=1e-9, abs=1e-9)
        by_sample = sheet.log_likelihood(measured, loads, noise_scale=scale, discrepancy=discrepancy, pointwise=True)
        assert by_sample.sum() == pytest.approx(expected, rel=1e-9, abs=1e-9)
        precision = np.linalg.inv(covariance)
        left_out = sheet.log_density_left_out(measured, loads, noise_scale=scale, discrepancy=discrepancy)
        for i in range(N):
            own = precision[3 * i : 3 * i + 3, 3 * i : 3 * i + 3]
            pull = (precision @ (measured.ravel() - mean))[3 * i : 3 * i + 3]
            given_others = stats.multivariate_normal(np.zeros(3), np.linalg.inv(own)).logpdf(np.linalg.solve(own, pull))
            assert left_out[i] == pytest.approx(given_others, rel=1e-9, abs=1e-8)


def test_a_batch_is_its_members_and_missing_channels_do_not_count():
    discrepancy, _, _, measured, loads, scale = drawn(5, batch=(3,))
    measured[:, 1] = np.nan
    together = CELL.log_likelihood(measured, loads, noise_scale=scale, discrepancy=discrepancy)
    for i, alone in enumerate(together):
        of_one = CELL.log_likelihood(measured, loads[i], noise_scale=scale[i], discrepancy=discrepancy.take(i))
        assert of_one == pytest.approx(alone, rel=1e-13)
    moved = replace(discrepancy, deviation=discrepancy.deviation * [1.0, 7.0, 1.0])
    np.testing.assert_array_equal(together, CELL.log_likelihood(measured, loads, noise_scale=scale, discrepancy=moved))


@pytest.mark.parametrize("name", BESIDE)
def test_without_size_it_is_the_likelihood_without_it(name):
    discrepancy, _, _, measured, loads, scale = drawn(6, batch=(2,))
    nothing = replace(discrepancy, deviation=0.0 * discrepancy.deviation)
    sheet = replace(BESIDE[name], force_resolution=0.0, moment_resolution=0.0)
    for density in (sheet.log_likelihood, sheet.log_density_left_out):
        expected = density(measured, loads, noise_scale=scale)
        found = density(measured, loads, noise_scale=scale, discrepancy=nothing)
        np.testing.assert_allclose(found, expected, rtol=1e-12, atol=1e-11)


@given(st.floats(1e-6, 1e3), st.floats(1e-4, 1e12), st.floats(1e-6, 1e2))
def test_the_density_is_finite_and_decreases_with_the_residual(length, size, noise):
    course = Course.along(np.linspace(0.0, 1.0, N), [np.arange(N)])
    discrepancy = Discrepancy(course, np.full((N, 3), size), np.asarray(length))
    sheet = cell(force_noise=noise, moment_noise=noise)
    shape = np.sin(np.arange(3 * N)).reshape(N, 3)
    logs = [sheet.log_likelihood(share * shape, np.zeros((N, 3)), discrepancy=discrepancy) for share in (0.0, 0.5, 1.0)]
    assert np.isfinite(logs).all()
    assert size > 1e6 * noise or logs[0] > logs[1] > logs[2]


@pytest.mark.parametrize("length", [0.5, 1e4, 1e7])
@pytest.mark.parametrize("size", [1.0, 1e6, 1e10])
def test_it_is_exact_where_loads_are_far_above_the_noise(size, length):
    """Against Cholesky's decomposition with 80 digits."""
    count, step, noise = 20, 0.03, 2e-3
    residual = np.random.default_rng(1).standard_normal(count)
    deviation = np.repeat([0.0, size, 3.0 * size], [3, 10, 7])
    steps = np.append(np.inf, np.full(count - 1, step))
    discrepancy = Discrepancy(Course(np.arange(count), steps), deviation[:, None], np.asarray(length))
    still = Zero(*np.zeros((3, 1)), 1.0)
    found, variance = kalman.given_before(residual[:, None], np.full((count, 1), noise), still, discrepancy)
    with mpmath.workdps(80):
        a = [mpmath.mpf(np.sqrt(3.0) / length) * mpmath.mpf(step) * k for k in range(count)]
        fading = [(1 + each) * mpmath.exp(-each) for each in a]
        covariance = mpmath.matrix(count, count)
        for i in range(count):
            for j in range(count):
                both = mpmath.mpf(deviation[i]) * mpmath.mpf(deviation[j])
                covariance[i, j] = both * fading[abs(i - j)] + (mpmath.mpf(noise) if i == j else 0)
        root = mpmath.cholesky(covariance)
        scaled = mpmath.lu_solve(root, mpmath.matrix(residual.tolist()))
        expected = np.array([float(scaled[i] * root[i, i]) for i in range(count)])
        expected_variance = np.array([float(root[i, i] ** 2) for i in range(count)])
    np.testing.assert_allclose(variance[:, 0], expected_variance, rtol=1e-8)
    np.testing.assert_allclose(found[:, 0], expected, rtol=1e-7, atol=1e-7 * np.abs(expected).max())


def test_the_covariance_of_a_record_is_written_out():
    for repeated in (False, True):
        discrepancy, coordinate, sweeps, _, loads, _ = drawn(11, repeated=repeated)
        _, covariance = dense(CELL, discrepancy, coordinate, sweeps, loads, np.ones(3))
        expected = covariance.reshape(N, 3, N, 3) - np.diag(np.tile(CELL.noise**2, N)).reshape(N, 3, N, 3)
        for c in range(3):
            np.testing.assert_allclose(discrepancy.covariance()[..., c], expected[:, c, :, c], atol=1e-15)


def test_draws_have_the_covariance_of_the_likelihood():
    """Variances and covariances of 20000 draws are within 5 standard errors: a false alarm in one of 1000 runs."""
    discrepancy, coordinate, sweeps, _, loads, _ = drawn(7)
    many = replace(discrepancy, deviation=np.broadcast_to(discrepancy.deviation, (20_000, N, 3)))
    draws = many.draw(np.random.default_rng(1))
    for c in range(3):
        _, covariance = dense(CELL, discrepancy, coordinate, sweeps, loads, np.ones(3))
        expected = covariance.reshape(N, 3, N, 3)[:, c, :, c] - CELL.noise[c] ** 2 * np.eye(N)
        error = np.sqrt((expected**2 + np.outer(np.diag(expected), np.diag(expected))) / len(draws))
        assert np.all(np.abs(np.cov(draws[..., c].T) - expected) <= 5.0 * error + 1e-15)
        assert np.all(np.abs(draws[..., c].mean(axis=0)) <= 5.0 * np.sqrt(np.diag(expected) / len(draws)) + 1e-15)


def test_readings_are_drawn_with_it_and_without_it_as_before():
    discrepancy, _, _, _, loads, _ = drawn(8)
    plain = CELL.simulate(loads, rng=1)
    smooth = CELL.simulate(loads, rng=1, discrepancy=discrepancy)
    off = smooth - plain
    assert np.all(off[discrepancy.deviation == 0.0] == 0.0)
    assert np.all(off[discrepancy.deviation > 0.0] != 0.0)


@pytest.mark.parametrize(
    ("sheet", "repeated", "reason"),
    [
        (cell(correlation=SHARED), False, "correlated between channels"),
        (cell(degrees_of_freedom=4.0), False, "outliers"),
        (cell(force_range=0.2), False, "range"),
        (cell(drift=WALK), True, "repeated sweeps"),
    ],
)
def test_what_has_no_closed_form_is_refused(sheet, repeated, reason):
    discrepancy, _, _, measured, loads, _ = drawn(9, repeated=repeated)
    with refused(ParameterError, "discrepancy", reason):
        sheet.log_likelihood(np.clip(measured, -0.2, 0.2), loads, discrepancy=discrepancy)


def test_it_is_compiled_once_whatever_arrays_come():
    for residual in (np.zeros((4, 3)), np.broadcast_to(0.0, (2, 4, 3)), np.zeros((2, 3, 4)).swapaxes(1, 2)):
        residual.flags.writeable = False
        kalman.given_others(residual, np.ones((4, 3)), Zero(np.ones(3), np.full(3, 0.1), np.zeros(3), 1.0))
    assert len(kalman._filter_all.signatures) == 1
