import numpy as np
import pytest

from tactile_bayes.record import means_of_positions, positions_of
from tactile_bayes.record.positions import end_of_rest


@pytest.mark.parametrize("sense", [1.0, -1.0])
@pytest.mark.parametrize("noise", [0.0, 1e-9, 0.02, 0.05])
@pytest.mark.parametrize("readings", [2, 3, 10, 200])
def test_a_drive_that_stops_has_positions(readings, noise, sense):
    travel = sense * np.repeat(np.arange(40.0), readings)
    travel += noise * np.random.default_rng(readings).standard_normal(travel.size)
    np.testing.assert_array_equal(positions_of(travel), np.repeat(np.arange(40), readings))


def test_steps_may_differ_from_position_to_position():
    rng = np.random.default_rng(1)
    travel = np.repeat(np.cumsum(rng.uniform(1.0, 5.0, size=30)), 8)
    travel += 0.02 * rng.standard_normal(travel.size)
    np.testing.assert_array_equal(positions_of(travel), np.repeat(np.arange(30), 8))


@pytest.mark.parametrize("noise", [0.0, 0.1, 1.0, 3.0])
def test_a_drive_that_moves_on_has_one_position_a_sample(noise):
    travel = np.arange(300.0) + noise * np.random.default_rng(2).standard_normal(300)
    np.testing.assert_array_equal(positions_of(travel), np.arange(300))


def test_lost_samples_are_no_stops():
    travel = np.delete(np.arange(200.0), [*range(20, 30), *range(80, 120), *range(150, 155)])
    assert positions_of(travel)[-1] + 1 == travel.size


@pytest.mark.parametrize("travel", [[1.0], [1.0, 2.0], [1.0, 1.0, 1.0]])
def test_few_samples_have_one_position_each(travel):
    assert positions_of(np.array(travel)).tolist() == list(range(len(travel)))


def test_means_are_those_of_each_position():
    values = np.array([[1.0, 0.0], [3.0, 0.0], [5.0, 1.0]])
    assert means_of_positions(values, np.array([0, 0, 1])).tolist() == [[2.0, 0.0], [5.0, 1.0]]


def test_a_sweep_ends_after_all_readings_at_its_last_position():
    travel = np.repeat([0.0, 1.0, 2.0, 3.0, 1.5, 0.5], 10)
    travel += 0.02 * np.random.default_rng(3).standard_normal(60)
    assert [end_of_rest(travel, 0, end) for end in (32, 36, 40)] == [40, 40, 40]
    assert end_of_rest(np.append(np.arange(9.0), 8.4), 0, 9) == 9
