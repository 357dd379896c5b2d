"""The surprise of readings without load: as rare as it says, for every kind of load cell."""

import numpy as np
import pytest
from scipy import stats

from helpers.load_cells import CELL, NORMAL, SHARED, UNKNOWN, WALK, WANDER, cell, ideal, moments
from tactile_bayes.load_cell import LoadCell
from tactile_bayes.reconstruction import FALSE_ALARM, loaded_samples

SAMPLES = 10


def alarms(sheet, missing=()):
    """Which samples of 10 000 records without load look loaded."""
    made = sheet.simulate(np.zeros((10_000, SAMPLES, 3)), rng=51)
    made[..., list(missing)] = np.nan
    distance = sheet.squared_mahalanobis_distance(made.reshape(-1, 3)).reshape(made.shape[:2])
    return distance > stats.chi2(3 - len(missing)).isf(FALSE_ALARM)


@pytest.mark.parametrize("missing", [(), (1,)])
@pytest.mark.parametrize(
    "sheet", [cell(degrees_of_freedom=3.0, bias=(0.1, 0.2, 0.3)), NORMAL["correlated drift that forgets"]]
)
def test_one_unloaded_sample_in_a_thousand_looks_loaded(sheet, missing):
    """Counted sample by sample, because those of a record know of one another; fails for one seed in 100 000."""
    seen = alarms(sheet, missing)
    counts, chance, tail = seen.sum(axis=0), stats.binom(len(seen), FALSE_ALARM), 1e-5 / SAMPLES / 2
    assert ((chance.cdf(counts) > tail) & (chance.sf(counts - 1) > tail)).all()


@pytest.mark.parametrize(
    ("sheet", "least"),
    [
        (cell(force_resolution=0.1, moment_resolution=0.04), 1 / 3),
        pytest.param(
            cell(force_resolution=0.1, moment_resolution=0.04, bias=(0.02, 0.05, 0.05)), 1 / 4, marks=pytest.mark.slow
        ),
        (cell(force_resolution=0.025, moment_resolution=0.01, correlation=SHARED), 0.8),
        (cell(degrees_of_freedom=3.0, bias_uncertainty=(0.02, 0.05, 0.05)), 1 / 5),
        pytest.param(cell(degrees_of_freedom=3.0, bias_uncertainty=(0.06, 0.15, 0.15)), 0.0, marks=pytest.mark.slow),
    ],
)
def test_steps_and_outliers_that_wander_are_rarer_by_what_is_stated(sheet, least):
    seen = alarms(sheet)
    share, error = seen.mean(), 5.0 * np.sqrt(FALSE_ALARM / len(seen))  # the samples of a record at most count as one
    assert least * FALSE_ALARM - error < share < FALSE_ALARM + error


@pytest.mark.parametrize("name", NORMAL)
def test_it_is_mahalanobis_distance(name):
    """From the bias, with the covariance of the sample, whatever the samples before it were."""
    sheet = NORMAL[name]
    readings = np.random.default_rng(52).normal(size=(6, 3))
    mean, covariance = moments(sheet, np.zeros((6, 3)))
    for missing in ((), (1,), (0, 2)):
        there = np.setdiff1d(range(3), missing)
        seen = readings.copy()
        seen[:, list(missing)] = np.nan
        expected = []
        for i in range(6):
            off, rows = readings[i, there] - mean[3 * i + there], 3 * i + there
            expected.append(off @ np.linalg.solve(covariance[np.ix_(rows, rows)], off))
        np.testing.assert_allclose(sheet.squared_mahalanobis_distance(seen), expected, rtol=1e-12)


def test_loads_beyond_all_bounds_are_far():
    for sheet in (CELL, cell(degrees_of_freedom=3.0), cell(drift=WALK), cell(correlation=SHARED)):
        assert (
            sheet.squared_mahalanobis_distance([[1e30, 0.0, 0.0], [0.0, -1e200, 0.0], [1e200, 1e200, -1e200]]) > 100.0
        ).all()


# --- Loaded samples of a record ---------------------------------------------------------------------------------


@pytest.mark.parametrize("sheet", [cell(bias=(0.1, 0.2, 0.3)), cell(drift=WANDER), cell(bias_uncertainty=UNKNOWN)])
def test_loaded_samples_of_a_record(sheet):
    record = ideal(40, holding_moment=[0.0] * 30 + [1.0] * 10, force_x=0.0, force_y=[0.0] * 30 + [2.0] * 10)
    for given in (None, sheet):
        loaded = loaded_samples(sheet.measure(record, rng=53), given)
        assert loaded[30:].all()
        assert loaded[:30].sum() <= 2


def test_a_channel_that_never_moves_is_loaded_where_it_differs_from_its_bias():
    record = ideal(5, holding_moment=[0, 0, 1, 0, 0], force_x=0.0, force_y=0.0)
    for sheet in (LoadCell(bias=(0.1, 0.2, 0.3)), LoadCell(force_noise=0.05, bias=(0.1, 0.2, 0.3))):
        assert loaded_samples(sheet.measure(record, rng=54)).tolist() == [False, False, True, False, False]
