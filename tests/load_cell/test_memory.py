"""Lag and play of a sensor, against what is known of both in closed form."""

import numpy as np
import pytest
from scipy import signal

from helpers.load_cells import ideal
from helpers.refusals import refused
from tactile_bayes.errors import ParameterError
from tactile_bayes.load_cell import LoadCell
from tactile_bayes.load_cell.memory import delays_of, remembered
from tactile_bayes.record import CHANNELS
from tactile_bayes.rig.corrected import corrected


def of(values):
    """Loads of a single record of which all channels have these values."""
    return np.repeat(np.asarray(values, dtype=float)[:, None], 3, axis=1)[None]


@pytest.mark.parametrize("lag", [0.2, 1.5, 20.0])
def test_a_step_decays_and_a_ramp_is_late(lag):
    after = remembered(of([0.0] + [1.0] * 30), (lag, 0.0, 0.0))[0, :, 1]
    np.testing.assert_allclose(after, 1.0 - np.exp(-np.arange(31) / lag), atol=1e-14)
    ramp = np.arange(600.0)
    late = ramp[-1] - remembered(of(ramp), (lag, 0.0, 0.0))[0, -1, 2]
    assert late == pytest.approx(delays_of(lag, 0.0, ramp)[-1, 2], rel=1e-9)


def test_play_makes_a_loop_as_wide_as_it_says_which_does_not_depend_on_the_steps():
    up_and_down = np.concatenate([np.linspace(0.0, 2.0, 201), np.linspace(2.0, -2.0, 401), np.linspace(-2.0, 2.0, 401)])
    read = remembered(of(up_and_down), (0.0, 0.0, 0.05))[0, :, 0]
    half = 0.1
    np.testing.assert_allclose(read[:201], np.maximum(up_and_down[:201] - half, 0.0), atol=1e-14)
    np.testing.assert_allclose(read[201 + 25 : 602], up_and_down[201 + 25 : 602] + half, atol=1e-14)
    np.testing.assert_allclose(read[-201:], up_and_down[-201:] - half, atol=1e-14)
    np.testing.assert_array_equal(read[:1003:2], remembered(of(up_and_down[:1003:2]), (0.0, 0.0, 0.05))[0, :, 0])


def test_points_have_memories_of_their_own():
    loads = np.random.default_rng(2).normal(size=(3, 2, 15, 3))
    lags, plays = np.array([0.0, 1.0, 2.0]), np.array([0.1, 0.0, 0.3])
    together = remembered(loads, (lags[:, None, None, None], 0.0, plays[:, None, None, None]))
    for k in range(3):
        alone = remembered(loads[k : k + 1], (lags[k], 0.0, plays[k]))
        np.testing.assert_allclose(together[k : k + 1], alone, atol=1e-15)
    np.testing.assert_array_equal(remembered(loads, (0.0, 0.0, 0.0)), loads)


def test_channels_have_memories_of_their_own():
    loads = np.random.default_rng(3).normal(size=(2, 15, 3))
    lags, plays = (0.0, 1.0, 2.0), (0.1, 0.0, 0.3)
    for channel, memory in enumerate(zip(lags, (0.0,) * 3, plays, strict=True)):
        np.testing.assert_array_equal(
            remembered(loads, (lags, 0.0, plays))[..., channel], remembered(loads, memory)[..., channel]
        )


def test_a_lag_in_seconds_is_the_filter_of_scipy_whose_input_is_held_between_uneven_times():
    """dy/dt = (x − y)/τ, integrated from each reading to the next by lsim of finely held inputs."""
    rng = np.random.default_rng(4)
    fine, values = np.arange(0, 401), np.concatenate([[0.0], rng.normal(size=40)])
    at = np.concatenate([[0], np.sort(rng.choice(np.arange(1, 401), 40, replace=False))])
    held = values[np.searchsorted(at, fine)[1:].clip(max=40)]  # of each step, the value at the reading that ends it
    for tau in (0.02, 0.3, 2.0):
        left = np.exp(-0.01 / tau)
        after = signal.lfilter([1.0 - left], [1.0, -left], held)
        read = remembered(of(values), (0.0, tau, 0.0), at * 0.01)[0, :, 0]
        np.testing.assert_allclose(read[1:], after[at[1:] - 1], rtol=0, atol=1e-13)
    even = remembered(of(values), (0.0, 0.3, 0.0), 0.2 * np.arange(41.0))
    np.testing.assert_allclose(even, remembered(of(values), (1.5, 0.0, 0.0)), rtol=0, atol=1e-14)
    both = remembered(of(values), (0.5, 0.2, 0.0), 0.2 * np.arange(41.0))
    np.testing.assert_allclose(both, even, rtol=0, atol=1e-14)


def test_two_readings_at_a_time_are_the_same_and_without_times_there_is_none():
    read = remembered(of([0.0, 1.0, 5.0, 1.0]), (0.0, 0.3, 0.0), np.array([0.0, 0.1, 0.1, 0.2]))[0, :, 0]
    np.testing.assert_allclose(read[1:3], -np.expm1(-1.0 / 3.0), rtol=1e-14)
    with refused(ParameterError, "lag_seconds"):
        LoadCell(lag_seconds=0.1).simulate(np.zeros((3, 3)), rng=1)


@pytest.mark.parametrize("cell", [LoadCell(lag=2.0), LoadCell(lag=(0.0, 1.0, 2.0)), LoadCell(lag_seconds=0.02)])
def test_step_2_takes_a_lag_out_of_steady_loads(cell):
    record = ideal(samples=60, time_ms=10.0 * np.arange(60.0))
    measured = cell.measure(record, rng=1)
    assert float(np.abs(measured.force_y - record.force_y).max()) > 0.05
    back = corrected(measured, cell, {}).record
    for name in CHANNELS:
        np.testing.assert_allclose(back[name][20:-3], record[name][20:-3], atol=1e-4)
