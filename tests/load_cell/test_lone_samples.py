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
SHEETS = {name: sheet for name, sheet in NORMAL.items() if not sheet.lag} | FURTHER  # alone, a sample has no memory


@pytest.mark.parametrize("name", SHEETS)
@pytest.mark.parametrize("batch", [(), (1,), (2, 3)])
def test_a_sample_has_its_own_block_of_the_covariance(name, batch):
    sheet = SHEETS[name]
    readings, loads = drawn(1, batch)
    given = readings.copy(), loads.copy()
    found = LoneSamples(sheet, readings).log_density(loads)
    flat = [blocks(sheet, readings, load) for load in loads.reshape(-1, N, 3)]
    np.testing.assert_allclose(found, np.reshape(flat, (*batch, N)), rtol=1e-11)
    np.testing.assert_array_equal(readings, given[0])
    np.testing.assert_array_equal(loads, given[1])


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


@pytest.mark.parametrize("name", SHEETS)
def test_a_load_without_a_value_has_no_density(name):
    readings, loads = drawn(5)
    expected = LoneSamples(SHEETS[name], readings).log_density(loads)
    loads[2, 3] = np.nan
    found = LoneSamples(SHEETS[name], readings).log_density(loads)
    assert np.argwhere(np.isnan(found)).tolist() == [[2, 3]]
    there = ~np.isnan(found)
    np.testing.assert_allclose(found[there], expected[there], rtol=1e-12)


# --- What is refused --------------------------------------------------------------------------------------------


WANDERING = [{"drift": WALK}, {"drift": WANDER}, {"bias_uncertainty": UNKNOWN}]
READINGS = np.zeros((N, 3))
AT_END = READINGS.copy()
AT_END[2, 1] = -1.0


@pytest.mark.parametrize(
    ("options", "readings", "named"),
    [
        *(
            ({f"{name}_noise": 0.0, **more}, READINGS, [channel, f"LoadCell({name}_noise="])
            for name, channel in (("force", "force_x"), ("moment", "holding_moment"))
            for more in ({}, {"drift": WALK}, {"relative_noise": 0.1}, {"force_resolution": 0.1})
        ),
        *(
            ({"degrees_of_freedom": 4.0, **more}, READINGS, ["drift or an unknown bias", "outliers"])
            for more in WANDERING
        ),
        *(({"force_range": 1.0, **more}, AT_END, ["sample 2", "force_x", "range"]) for more in WANDERING),
    ],
)
def test_what_has_no_density_is_refused(options, readings, named):
    with refused(ParameterError, *named):
        LoneSamples(cell(**options), readings)


@pytest.mark.parametrize("further", WANDERING)
def test_within_the_range_nothing_is_refused(further):
    assert np.isfinite(LoneSamples(cell(force_range=1.0, **further), READINGS).log_density(READINGS)).all()
