"""Lag and play of a sensor, against what is known of both in closed form."""

import numpy as np
import pytest

from helpers.load_cells import ideal
from tactile_bayes.load_cell import LoadCell
from tactile_bayes.load_cell.memory import delay_of, remembered
from tactile_bayes.rig.corrected import corrected


def of(values):
    """Loads of a single record of which all channels have these values."""
    return np.repeat(np.asarray(values, dtype=float)[:, None], 3, axis=1)[None]


@pytest.mark.parametrize("lag", [0.2, 1.5, 20.0])
def test_a_step_decays_and_a_ramp_is_late(lag):
    after = remembered(of([0.0] + [1.0] * 30), lag, 0.0)[0, :, 1]
    np.testing.assert_allclose(after, 1.0 - np.exp(-np.arange(31) / lag), atol=1e-14)
    ramp = np.arange(600.0)
    late = ramp[-1] - remembered(of(ramp), lag, 0.0)[0, -1, 2]
    assert late == pytest.approx(delay_of(lag), rel=1e-9)


def test_play_makes_a_loop_as_wide_as_it_says_which_does_not_depend_on_the_steps():
    up_and_down = np.concatenate([np.linspace(0.0, 2.0, 201), np.linspace(2.0, -2.0, 401), np.linspace(-2.0, 2.0, 401)])
    read = remembered(of(up_and_down), 0.0, 0.05)[0, :, 0]
    half = 0.1
    np.testing.assert_allclose(read[:201], np.maximum(up_and_down[:201] - half, 0.0), atol=1e-14)
    np.testing.assert_allclose(read[201 + 25 : 602], up_and_down[201 + 25 : 602] + half, atol=1e-14)
    np.testing.assert_allclose(read[-201:], up_and_down[-201:] - half, atol=1e-14)
    np.testing.assert_array_equal(read[:1003:2], remembered(of(up_and_down[:1003:2]), 0.0, 0.05)[0, :, 0])


def test_points_have_memories_of_their_own():
    loads = np.random.default_rng(2).normal(size=(3, 2, 15, 3))
    lags, plays = np.array([0.0, 1.0, 2.0]), np.array([0.1, 0.0, 0.3])
    together = remembered(loads, lags, plays)
    for k in range(3):
        alone = remembered(loads[k : k + 1], lags[k], plays[k])
        np.testing.assert_allclose(together[k : k + 1], alone, atol=1e-15)
    np.testing.assert_array_equal(remembered(loads, 0.0, 0.0), loads)


def test_step_2_takes_a_lag_out_of_steady_loads():
    record = ideal(samples=60)
    cell = LoadCell(lag=2.0)
    measured = cell.measure(record, rng=1)
    assert float(np.abs(measured.force_y - record.force_y).max()) > 0.05
    back = corrected(measured, cell, {}).record
    np.testing.assert_allclose(back.force_y[20:-3], record.force_y[20:-3], atol=1e-4)
