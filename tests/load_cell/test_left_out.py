"""How likely each sample is given all the others: against dense covariances with and without it."""

import mpmath
import numpy as np
import pytest
from scipy import stats

from helpers.load_cells import NORMAL, WALK, WANDER, cell, moments

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


@pytest.mark.parametrize(
    ("samples", "missing", "tolerance"),
    [
        *((N, missing, 1e-10) for missing in ((), (0,), (2,), (0, 1))),
        (1, (), 1e-10),  # given nothing
        (2, (), 1e-10),
        pytest.param(40, (), 1e-8, marks=pytest.mark.slow),  # the dense density is a difference of numbers in thousands
    ],
)
@pytest.mark.parametrize("name", NORMAL)
def test_it_is_the_ratio_of_dense_densities_with_and_without_a_sample(name, samples, missing, tolerance):
    measured, loads, scale = drawn(1, (4,), missing, samples)
    result = NORMAL[name].log_density_left_out(measured, loads, noise_scale=scale)
    expected = [dense(NORMAL[name], measured, *pair) for pair in zip(loads, scale, strict=True)]
    np.testing.assert_allclose(result, expected, rtol=min(tolerance, 1e-9), atol=tolerance)


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
    "sheet", [cell(degrees_of_freedom=4.0), cell(force_resolution=0.1, moment_resolution=0.1, force_range=0.2)]
)
def test_independent_samples_know_nothing_of_one_another(sheet):
    measured, loads, scale = drawn(8, (4,))
    measured = np.clip(np.round(measured / 0.1) * 0.1, -0.2, 0.2)
    np.testing.assert_array_equal(
        sheet.log_density_left_out(measured, loads, noise_scale=scale),
        sheet.log_likelihood(measured, loads, noise_scale=scale, pointwise=True),
    )
