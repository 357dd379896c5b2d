"""Samples looked at by themselves: against the dense covariance, of which a sample keeps its own block."""

import numpy as np
import pytest
from scipy import stats

from helpers.load_cells import CELL, GAIN, NORMAL, SHARED, UNKNOWN, WALK, WANDER, cell, moments
from helpers.refusals import refused
from tactile_bayes.errors import ParameterError
from tactile_bayes.load_cell import LoneSamples

N = 6


def drawn(seed, batch=(4,)):
    rng = np.random.default_rng(seed)
    return 0.2 * rng.normal(size=(N, 3)), 0.5 * rng.normal(size=(*batch, N, 3))


def blocks(sheet, readings, loads):
    """Log-density of every sample from its block of the covariance of all."""
    mean, covariance = moments(sheet, loads)
    parts = [slice(3 * i, 3 * i + 3) for i in range(N)]
    return [stats.multivariate_normal(mean[p], covariance[p, p]).logpdf(readings.ravel()[p]) for p in parts]


FURTHER = {
    "everything that is normal": cell(
        correlation=SHARED, drift=WANDER, bias_uncertainty=UNKNOWN, relative_noise=0.2, gain=GAIN, bias=(0.1, -0.2, 0.3)
    ),
    "steps beside drift": cell(drift=WALK, force_resolution=0.05, moment_resolution=0.02),
    "steps beside correlation": cell(correlation=SHARED, force_resolution=0.05),
    "steps, correlation and drift": cell(correlation=SHARED, drift=WALK, force_resolution=0.05, relative_noise=0.1),
}
SHEETS = NORMAL | FURTHER


@pytest.mark.parametrize("name", SHEETS)
def test_a_sample_has_its_own_block_of_the_covariance(name):
    sheet = SHEETS[name]
    readings, loads = drawn(1)
    found = LoneSamples(sheet, readings).log_density(loads)
    assert found.shape == (4, N)
    np.testing.assert_allclose(found, [blocks(sheet, readings, load) for load in loads], rtol=1e-11)


@pytest.mark.parametrize("name", SHEETS)
@pytest.mark.parametrize("batch", [(), (1,), (2, 3)])
def test_batches_of_every_shape_are_one_by_one(name, batch):
    readings, loads = drawn(2, batch)
    lone = LoneSamples(SHEETS[name], readings)
    flat = [lone.log_density(load) for load in loads.reshape(-1, N, 3)]
    np.testing.assert_allclose(lone.log_density(loads), np.reshape(flat, (*batch, N)), rtol=1e-12)


@pytest.mark.parametrize("name", [name for name in SHEETS if name != "steps, correlation and drift"])
def test_some_samples_keep_their_place_in_the_record(name):
    readings, loads = drawn(3)
    whole = LoneSamples(SHEETS[name], readings)
    for where in ([4, 1], [2], [5, 5, 3]):
        part = whole.take(np.array(where))
        np.testing.assert_allclose(part.log_density(loads[:, where]), whole.log_density(loads)[:, where], rtol=1e-12)


WHITE = {
    "white": CELL,
    "outliers": cell(degrees_of_freedom=4.0),
    "outliers without a variance": cell(degrees_of_freedom=1.5),
    "steps": cell(force_resolution=0.1, moment_resolution=0.05),
    "range": cell(force_range=0.2, moment_range=0.1),
    "outliers, steps, range": cell(degrees_of_freedom=3.0, force_resolution=0.1, force_range=0.3, relative_noise=0.1),
    "gain": cell(gain=GAIN, bias=(0.1, -0.2, 0.3), relative_noise=0.2),
}


@pytest.mark.parametrize("name", WHITE)
def test_where_noise_is_white_it_is_the_likelihood_of_the_load_cell(name):
    sheet = WHITE[name]
    _, loads = drawn(4)
    readings = sheet.simulate(loads[0], rng=4)
    expected = sheet.log_likelihood(readings, loads, pointwise=True)
    np.testing.assert_array_equal(LoneSamples(sheet, readings).log_density(loads), expected)


def test_outliers_and_ends_of_the_range_by_scipy():
    sheet = cell(degrees_of_freedom=4.0, moment_range=0.1)
    readings = np.array([[0.1, 0.3, -0.2], [0.05, -0.1, 0.4]])
    loads = np.array([[0.12, 0.25, 0.0], [0.0, 0.0, 0.3]])
    forces = stats.t(4.0, loads[:, 1:], 0.05).logpdf(readings[:, 1:]).sum(axis=1)
    moment = [stats.t(4.0, 0.12, 0.02).logsf(0.1), stats.t(4.0, 0.0, 0.02).logpdf(0.05)]
    np.testing.assert_allclose(LoneSamples(sheet, readings).log_density(loads), forces + moment, rtol=1e-12)


@pytest.mark.parametrize("name", SHEETS)
def test_a_load_without_a_value_has_no_density(name):
    readings, loads = drawn(5)
    expected = LoneSamples(SHEETS[name], readings).log_density(loads)
    loads[2, 3] = np.nan
    found = LoneSamples(SHEETS[name], readings).log_density(loads)
    assert np.argwhere(np.isnan(found)).tolist() == [[2, 3]]
    there = ~np.isnan(found)
    np.testing.assert_allclose(found[there], expected[there], rtol=1e-12)


def test_the_arguments_are_not_changed():
    for sheet in (CELL, FURTHER["everything that is normal"]):
        readings, loads = drawn(6)
        kept = readings.copy(), loads.copy()
        LoneSamples(sheet, readings).log_density(loads)
        np.testing.assert_array_equal(readings, kept[0])
        np.testing.assert_array_equal(loads, kept[1])


# --- What is refused --------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("noise", "channel", "cure"),
    [({"force_noise": 0.0}, "force_x", "force_noise"), ({"moment_noise": 0.0}, "holding_moment", "moment_noise")],
)
@pytest.mark.parametrize("further", [{}, {"drift": WALK}, {"relative_noise": 0.1}, {"force_resolution": 0.1}])
def test_a_channel_without_noise_is_refused(noise, channel, cure, further):
    with refused(ParameterError, channel, f"LoadCell({cure}="):
        LoneSamples(cell(**noise, **further), np.zeros((N, 3)))


@pytest.mark.parametrize("further", [{"drift": WALK}, {"drift": WANDER}, {"bias_uncertainty": UNKNOWN}])
def test_what_wanders_goes_neither_with_outliers_nor_with_ends_of_the_range(further):
    with refused(ParameterError, "drift or an unknown bias", "outliers"):
        LoneSamples(cell(degrees_of_freedom=4.0, **further), np.zeros((N, 3)))
    readings = np.zeros((N, 3))
    sheet = cell(force_range=1.0, **further)
    assert np.isfinite(LoneSamples(sheet, readings).log_density(readings)).all()
    readings[2, 1] = -1.0
    with refused(ParameterError, "sample 2", "force_x", "range"):
        LoneSamples(sheet, readings)
