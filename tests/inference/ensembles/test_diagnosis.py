"""Ensembles at rest in different modes, and slow ensembles."""

import json

import numpy as np
import pytest

from tactile_bayes.inference.ensembles import Draws, SamplerSettings, sample
from tactile_bayes.inference.ensembles.diagnosis import modes_of
from tactile_bayes.inference.result import sample_stats

MODES = np.array([[-50.0, 3.0], [50.0, 3.0]])


def two_modes(x):
    """Normal distributions of sd 1 around (±50, 3), one of twice the weight; no proposal finds the other."""
    near = -0.5 * ((x[:, None] - MODES) ** 2).sum(axis=-1)
    return np.logaddexp(near[:, 0], near[:, 1] + np.log(2.0))


def run(log_probability, centres, *, scale, steps, parameters=2, seed=1, walkers=16) -> Draws:
    settings = SamplerSettings(ensembles=4, walkers=walkers, block_steps=steps, max_steps=steps)
    numbers = np.random.default_rng(seed).normal(size=(4, walkers, parameters))
    names = [f"x{i}" for i in range(parameters)]
    start = scale * numbers + np.asarray(centres)
    return sample(log_probability, start, names=names, seed=seed, settings=settings)


def test_modes_that_no_proposal_crosses_are_reported():
    centres = MODES[[0, 1, 1, 0]][:, None]
    draws = run(two_modes, centres, scale=1.0, steps=400)
    assert not draws.converged
    first, second = draws.modes
    assert (first.ensembles, second.ensembles) == ((0, 3), (1, 2))
    assert list(first.values) == list(second.values) == ["x0"]  # and not x1, which is 3 in both
    assert first.values["x0"] == pytest.approx(-50.0, abs=0.5)
    assert second.values["x0"] == pytest.approx(50.0, abs=0.5)
    assert second.log_probability - first.log_probability == pytest.approx(np.log(2.0), abs=0.5)
    assert "ensembles sit in 2 modes" in draws.message
    stored = json.loads(sample_stats(draws).attrs["places"])
    assert [mode["ensembles"] for mode in stored] == [list(mode.ensembles) for mode in draws.modes]
    assert "ensembles 0, 3 near x0 = -" in draws.message


def test_three_modes_in_two_directions():
    rng = np.random.default_rng(1)
    centres = np.array([[0.0, 0.0], [9.0, 0.0], [0.0, 20.0], [0.0, 0.0]])
    samples = rng.normal(size=(4, 100, 8, 2)) + centres[:, None, None]
    modes = modes_of(samples, np.zeros((4, 100, 8)), ["a", "b"])
    assert [mode.ensembles for mode in modes] == [(0, 3), (1,), (2,)]
    assert list(modes[0].values) == ["b", "a"]


def test_ensembles_that_overlap_by_way_of_others_are_one_place():
    rng = np.random.default_rng(1)
    samples = rng.normal(size=(4, 100, 8, 1)) + 4.0 * np.arange(4)[:, None, None, None]
    assert modes_of(samples, np.zeros((4, 100, 8)), ["a"]) == ()


def test_ensembles_on_their_way_are_in_no_place():
    """Far apart, but drifting; then at the same distance, but each walker still where it was; then too few steps."""
    rng = np.random.default_rng(1)
    apart = 50.0 * np.arange(4)[:, None, None, None]
    drift = np.linspace(0.0, 3.0, 100)[:, None, None]
    still = rng.normal(size=(4, 1, 8, 1)) + 0.01 * rng.normal(size=(4, 100, 8, 1))
    walking = rng.normal(size=(4, 100, 8, 1))

    def are_told(samples):
        return bool(modes_of(samples + apart, np.zeros(samples.shape[:3]), ["a"]))

    assert are_told(walking)
    for samples in (walking + drift, still, np.repeat(still[:, :1], 100, axis=1), walking[:, :7]):
        assert not are_told(samples)


def banana(x):
    across = (x[:, 1] - x[:, 0] ** 2) / 0.05
    return -0.5 * ((x[:, 0] / 3.0) ** 2 + across**2 + (x[:, 2:] ** 2).sum(axis=1))


def uneven(x):
    return -0.5 * ((x * np.logspace(0.0, 3.0, x.shape[1])) ** 2).sum(axis=1)


def funnel(x):
    others = x.shape[1] - 1
    return -0.5 * ((x[:, 0] / 3.0) ** 2 + (x[:, 1:] ** 2).sum(axis=1) * np.exp(-x[:, 0]) + others * x[:, 0])


@pytest.mark.slow
@pytest.mark.parametrize(
    ("log_probability", "steps"),  # a funnel is walked through in 250
    [(banana, 60), (banana, 250), (uneven, 60), (uneven, 250), (funnel, 60), (funnel, 150)],
)
def test_a_slow_run_is_not_taken_for_several_modes(log_probability, steps):
    """One mode each, hard to walk through, and ensembles that start as small clusters far from one another."""
    centres = 3.0 * np.random.default_rng(2).normal(size=(4, 1, 6))
    draws = run(log_probability, centres, scale=1e-3, steps=steps, parameters=6)
    assert not draws.converged
    assert np.all(draws.r_hat > 1.05)
    assert draws.modes == ()
