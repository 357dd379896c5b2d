"""Steps of a run that are kept: which, whatever blocks they come in."""

import numpy as np
import pytest

from tactile_bayes.inference.coordinates import Coordinates, Logarithms
from tactile_bayes.inference.ensembles import run_state
from tactile_bayes.inference.ensembles.run_state import Block, RunState


def walked(steps):
    """Coordinates of walkers before the first and after each of these steps, some of which do not move them."""
    rng = np.random.default_rng(1)
    moves = rng.normal(size=(2, steps + 1, 4, 3)) * (rng.random((2, steps + 1, 4, 1)) < 0.5)
    return np.cumsum(moves, axis=1)


def as_block(samples):
    return Block(samples, samples.sum(axis=-1), ())


def second_half(state):
    """Samples and log-probability at a diagnosis, whether walkers moved, and the thinning."""
    state = state.halved()
    return state.half.samples, state.half.values, state.half.moved[:, 1:], state.every


def appended(samples, ends, coordinates):
    state = RunState.begin(coordinates, as_block(samples[:, :1]))
    for begin, end in zip([0, *ends], ends, strict=False):
        state = state.append(as_block(samples[:, begin + 1 : end + 1]))
    return state


@pytest.fixture
def little_memory(monkeypatch):
    """No more than ten steps are kept."""
    monkeypatch.setattr(run_state, "_MAX_STORED", 10 * 24)


@pytest.mark.parametrize(("steps", "every"), [(1, 1), (2, 1), (7, 1), (20, 1), (21, 2), (22, 2), (43, 4), (100, 8)])
@pytest.mark.usefixtures("little_memory")
def test_the_second_half_is_kept_and_of_many_steps_every_so_manieth(steps, every):
    """And whether walkers moved is known of all of them."""
    samples = walked(steps)
    points, values, moved, thinning = second_half(appended(samples, [steps], Coordinates()))
    assert thinning == every
    assert points.shape[1] <= 11
    number = np.arange(steps + 1)
    np.testing.assert_array_equal(points, samples[:, (number > steps // 2) & (number % every == 0)])
    np.testing.assert_array_equal(values, points.sum(axis=-1))
    np.testing.assert_array_equal(moved, np.any(np.diff(samples[:, steps // 2 + 1 :], axis=1) != 0.0, axis=-1))


@pytest.mark.usefixtures("little_memory")
def test_blocks_and_looks_make_no_difference():
    steps, positive = 90, Logarithms(np.array([True, False, True]))
    samples = 0.01 * walked(steps)
    whole = appended(samples, [steps], positive)
    parts = appended(samples, [3, 10, 11, 40], positive).halved()
    for begin, end in ((40, 47), (47, 80), (80, 90)):
        parts = parts.append(as_block(samples[:, begin + 1 : end + 1]))
    resumed = RunState(positive, as_block(samples[:, :41]), 40, appended(samples, [40], positive).halved().parts)
    resumed = resumed.append(as_block(samples[:, 41:]))
    for other in (parts, resumed):
        for one, another in zip(second_half(whole), second_half(other), strict=True):
            np.testing.assert_array_equal(one, another)
        assert second_half(other)[-1] > 1


@pytest.mark.parametrize(("count", "stay"), [(4, 0), (5, 5)])
def test_few_lost_walkers_are_taken_back_and_many_stay(count, stay):
    """An ensemble has 48 walkers, of which a tenth counts as few; the others are where they were."""
    rng = np.random.default_rng(1)
    samples = rng.normal(size=(2, 20, 48, 1))
    samples[0, :, :count] += 1000.0
    values = np.where(samples[..., 0] > 500.0, -50.0, -0.5 * samples[..., 0] ** 2)
    start = Block(samples[:, :1], values[:, :1], ())
    state = RunState.begin(Coordinates(), start).append(Block(samples, values, ())).halved()
    last = state.recovered().last
    assert np.count_nonzero(last.samples[:, -1] > 500.0) == stay
    np.testing.assert_array_equal(last.samples[:, -1, count:], samples[:, -1, count:])
    np.testing.assert_array_equal(last.samples[:, :-1], samples[:, :-1])
    if not stay:
        np.testing.assert_array_equal(last.log_probability[0, -1], -0.5 * last.samples[0, -1, :, 0] ** 2)
