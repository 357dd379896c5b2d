"""How likely each sample is given all the others: against dense covariances with and without it."""

import mpmath
import numpy as np
import pytest
from scipy import stats

from helpers.load_cells import CELL, NORMAL, SHARED, UNKNOWN, WALK, WANDER, cell, moments
from tactile_bayes.load_cell import LoadCell, OrnsteinUhlenbeck

N = 7


def dense(sheet, measured, loads, noise_scale):
    """log p(y) − log p(y without i), all from the covariance of what was measured."""
    mean, covariance = moments(sheet, loads, noise_scale)
    there = ~np.isnan(measured.ravel())

    def log_density(kept):
        chosen = np.flatnonzero(kept & there)
        if not chosen.size:
            return 0.0
        return stats.multivariate_normal(mean[chosen], covariance[np.ix_(chosen, chosen)]).logpdf(
            measured.ravel()[chosen]
        )

    whole = log_density(np.ones(measured.size, dtype=bool))
    sample = np.arange(measured.size) // 3
    return np.array([whole - log_density(sample != i) for i in range(len(measured))])


def drawn(seed, batch=(), missing=(), samples=N):
    rng = np.random.default_rng(seed)
    measured = 0.2 * rng.normal(size=(samples, 3))
    measured[:, list(missing)] = np.nan
    loads = 0.5 * rng.normal(size=(*batch, samples, 3))
    loads[..., list(missing)] = 0.0
    return measured, loads, rng.uniform(0.5, 2.0, (*batch, 3))


@pytest.mark.parametrize("missing", [(), (0,), (2,), (0, 1)])
@pytest.mark.parametrize("name", NORMAL)
def test_it_is_the_ratio_of_dense_densities_with_and_without_a_sample(name, missing):
    measured, loads, scale = drawn(1, (4,), missing)
    result = NORMAL[name].log_density_left_out(measured, loads, noise_scale=scale)
    expected = [dense(NORMAL[name], measured, *pair) for pair in zip(loads, scale, strict=True)]
    np.testing.assert_allclose(result, expected, rtol=1e-10, atol=1e-10)


@pytest.mark.slow
@pytest.mark.parametrize("name", NORMAL)
def test_it_is_dense_over_many_samples(name):
    """The dense density is a difference of numbers in thousands."""
    measured, loads, scale = drawn(2, samples=40)
    result = NORMAL[name].log_density_left_out(measured, loads, noise_scale=scale)
    np.testing.assert_allclose(result, dense(NORMAL[name], measured, loads, scale), rtol=1e-9, atol=1e-8)


@pytest.mark.parametrize("samples", [1, 2])
@pytest.mark.parametrize("name", NORMAL)
def test_one_sample_is_given_nothing_and_one_of_two_the_other(name, samples):
    measured, loads, scale = drawn(3, samples=samples)
    result = NORMAL[name].log_density_left_out(measured, loads, noise_scale=scale)
    np.testing.assert_allclose(result, dense(NORMAL[name], measured, loads, scale), rtol=1e-9, atol=1e-9)
    if samples == 1:
        np.testing.assert_allclose(
            result, NORMAL[name].log_likelihood(measured, loads, noise_scale=scale, pointwise=True), rtol=1e-11
        )


@pytest.mark.parametrize("drift", [None, WALK, WANDER])
@pytest.mark.parametrize("bias", [1e-6, 100.0, 1e4])
def test_a_bias_that_is_hardly_or_not_at_all_known(drift, bias):
    """The covariance has the condition (bias / noise)²; with 40 digits this is no matter."""
    sheet = cell(bias_uncertainty=(bias, bias, bias), drift=drift)
    measured, loads, _ = drawn(4)
    measured[:, 1:] = np.nan
    chosen = 3 * np.arange(N)
    off = measured[:, 0] - loads[:, 0]
    known = moments(cell(drift=drift), loads)[1][np.ix_(chosen, chosen)]
    with mpmath.workdps(40):
        precision = (mpmath.matrix(known.tolist()) + mpmath.mpf(bias) ** 2 * mpmath.ones(N)) ** -1
        weighed = precision * mpmath.matrix(off.tolist())
        expected = [
            float((mpmath.log(precision[i, i] / (2 * mpmath.pi)) - weighed[i] ** 2 / precision[i, i]) / 2)
            for i in range(N)
        ]
    np.testing.assert_allclose(sheet.log_density_left_out(measured, loads), expected, rtol=1e-11)


@pytest.mark.parametrize(
    "further", [{"drift": WANDER, "bias_uncertainty": UNKNOWN}, {"correlation": SHARED, "drift": WALK}, {"drift": WALK}]
)
def test_steps_beside_what_wanders_are_noise(further):
    sheet = cell(force_resolution=0.05, moment_resolution=0.02, **further)
    measured, loads, scale = drawn(7)
    measured = np.round(measured / 0.1) * 0.1
    result = sheet.log_density_left_out(measured, loads, noise_scale=scale)
    np.testing.assert_allclose(result, dense(sheet, measured, loads, scale), rtol=1e-10, atol=1e-10)


@pytest.mark.parametrize(
    "sheet",
    [
        CELL,
        NORMAL["correlated, relative"],
        cell(degrees_of_freedom=4.0),
        cell(force_resolution=0.1, moment_resolution=0.1, force_range=0.2),
    ],
)
def test_independent_samples_know_nothing_of_one_another(sheet):
    measured, loads, scale = drawn(8, (4,))
    measured = np.clip(np.round(measured / 0.1) * 0.1, -0.2, 0.2)
    np.testing.assert_array_equal(
        sheet.log_density_left_out(measured, loads, noise_scale=scale),
        sheet.log_likelihood(measured, loads, noise_scale=scale, pointwise=True),
    )


def test_with_a_bias_it_is_students_formula():
    """Left-out residuals from the mean of the others, of variance σ² + σ² / (n − 1), where nothing is known of a bias.

    Of a bias of 1e6 σ a share of n⁻¹ 1e-12 is known before.
    """
    rng = np.random.default_rng(9)
    measured = np.full((20, 3), np.nan)
    measured[:, 0] = rng.normal(5.0, 1.0, 20)
    others = (measured[:, 0].sum() - measured[:, 0]) / 19
    expected = stats.norm.logpdf(measured[:, 0], others, np.sqrt(1.0 + 1.0 / 19))
    result = LoadCell(moment_noise=1.0, bias_uncertainty=(1e6, 0.0, 0.0)).log_density_left_out(
        measured, np.zeros((20, 3))
    )
    np.testing.assert_allclose(result, expected, rtol=1e-9)


def test_a_drift_that_hardly_forgets_is_a_bias():
    measured, loads, scale = drawn(10)
    forgets = cell(drift=OrnsteinUhlenbeck(moment=0.03, force=0.02, time=1e14))
    constant = cell(bias_uncertainty=(0.03, 0.02, 0.02))
    np.testing.assert_allclose(
        forgets.log_density_left_out(measured, loads, noise_scale=scale),
        constant.log_density_left_out(measured, loads, noise_scale=scale),
        rtol=1e-9,
    )
