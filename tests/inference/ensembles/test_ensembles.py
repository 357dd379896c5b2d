"""The emcee driver against targets whose answer is known: convergence, modes, and the steps that are kept."""

import json

import numpy as np
import pytest
from arviz_stats.base.array import array_stats
from scipy.signal import lfilter

from helpers.interrupts import interrupted_at
from helpers.refusals import refused
from tactile_bayes import SamplerSettings
from tactile_bayes.errors import InferenceError, ParameterError
from tactile_bayes.inference.coordinates import Coordinates, Logarithms
from tactile_bayes.inference.ensembles import Draws, Progress, diagnosis, run_state, sample, scatter_walkers
from tactile_bayes.inference.ensembles.diagnosis import autocorrelation_time, modes_of, walker_major
from tactile_bayes.inference.ensembles.run_state import Block, RunState
from tactile_bayes.inference.result import sample_stats

SMALL = SamplerSettings(ensembles=2, walkers=8, block_steps=20, max_steps=40)


def standard(x):
    return -0.5 * (x**2).sum(axis=-1)


def normal_start(parameters, settings, *, scale=2.0, seed=0):
    shape = (settings.ensembles, settings.walkers_for(parameters), parameters)
    return scale * np.random.default_rng(seed).normal(size=shape)


def draw_from(log_probability, parameters, *, settings=None, seed=1, scale=2.0, **options) -> Draws:
    settings = SamplerSettings() if settings is None else settings
    start = normal_start(parameters, settings, scale=scale)
    names = [f"x{i}" for i in range(parameters)]
    return sample(log_probability, start, names=names, seed=seed, settings=settings, **options)


def with_lost_walkers(count, **options) -> Draws:
    """Draws from 192 walkers, the first of which cannot leave a mode of weight e⁻⁵⁰."""

    def log_probability(x):
        return np.logaddexp(standard(x), standard(x - 1000.0) - 50.0)

    start = normal_start(1, SamplerSettings())
    start[0, :count] += 1000.0
    return sample(log_probability, start, names=["a"], seed=1, **options)


@pytest.mark.parametrize("count", [1, 3])
def test_lost_walkers_are_taken_back(count):
    """R̂ alone would let them pass; the draws kept are those after they came back."""
    draws = with_lost_walkers(count)
    assert draws.converged
    assert draws.samples.max() < 10.0
    assert "1 of 192 walkers" in with_lost_walkers(1, settings=SamplerSettings(max_steps=20)).message


def test_a_run_that_took_walkers_back_resumes_as_if_uninterrupted(tmp_path):
    whole = with_lost_walkers(1, checkpoint=tmp_path / "whole")
    for steps in (25, 60, 6000):
        parts = with_lost_walkers(1, settings=SamplerSettings(max_steps=steps), checkpoint=tmp_path / "parts")
    np.testing.assert_array_equal(parts.samples, whole.samples)


def test_ensembles_are_independent_of_each_other_and_of_numpys_global_state():
    start = normal_start(2, SMALL)
    start[1] = start[0]
    before = np.random.get_state()[1].copy()  # noqa: NPY002
    draws = sample(standard, start, names=["a", "b"], seed=1, settings=SMALL)
    np.testing.assert_array_equal(np.random.get_state()[1], before)  # noqa: NPY002
    assert not np.array_equal(draws.samples[0], draws.samples[1])


@pytest.mark.parametrize("rho", [0.5, 0.95, *(pytest.param(rho, marks=pytest.mark.slow) for rho in (0.0, 0.8))])
def test_walker_major_layout_gives_the_right_effective_sample_size(rho):
    """Walkers with a known autocorrelation ρ^t: τ = (1 + ρ)/(1 − ρ), effective sample size N/τ.

    Sokal's error of an estimated τ with window M is τ √(2 (2M + 1)/N); Geyer's window is below 5 τ. Four of these, plus
    the 2 τ/n that the seams between walkers take away, bound the difference. Laid out step by step, the same draws look
    nearly independent for as long as the number of walkers exceeds the window.
    """
    chains, steps, walkers = 4, 2000, 32
    tau = (1.0 + rho) / (1.0 - rho)
    noise = np.random.default_rng(7).normal(size=(chains, steps + 200, walkers, 1))
    samples = lfilter([1.0], [1.0, -rho], noise, axis=1)[:, 200:]
    draws = chains * steps * walkers
    laid_out = walker_major(samples)
    np.testing.assert_array_equal(laid_out[1, :steps, 0], samples[1, :, 0, 0])
    np.testing.assert_array_equal(laid_out[2, -steps:, 0], samples[2, :, -1, 0])
    ess = array_stats.ess(laid_out, chain_axis=0, draw_axis=1)[0]
    error = 4.0 * np.sqrt(2.0 * (10.0 * tau + 1.0) / draws) + 2.0 * tau / steps
    assert ess == pytest.approx(draws / tau, rel=error)
    assert diagnosis.Diagnosis(samples).ess_bulk[0] == pytest.approx(draws / tau, rel=error)
    assert autocorrelation_time(samples)[0] == pytest.approx(tau, rel=error)
    step_major = array_stats.ess(samples.reshape(chains, -1, 1), chain_axis=0, draw_axis=1)[0]
    assert step_major > 0.5 * tau * ess


def test_a_run_out_of_steps_says_so():
    seen: list[Progress] = []
    draws = draw_from(standard, 2, settings=SMALL, progress=seen.append)
    assert not draws.converged
    assert "not converged" in draws.message
    assert any(name in draws.message for name in draws.names)
    assert (draws.steps_run, draws.steps_kept, draws.walkers) == (40, 20, 8)
    assert draws.evaluations == 2 * 8 * (1 + 40)
    assert [p.steps for p in seen] == [20, 25, 32, 40]
    assert all(p.max_steps == 40 and p.r_hat > 0.0 and p.ess > 0.0 and p.seconds >= 0.0 for p in seen)
    assert np.all((draws.acceptance > 0.0) & (draws.acceptance < 1.0))
    np.testing.assert_allclose(draws.log_probability, standard(draws.samples), rtol=1e-12)


def test_a_run_out_of_time_says_so():
    draws = draw_from(standard, 2, settings=SamplerSettings(max_seconds=1e-9, min_ess=1e5))
    assert not draws.converged
    assert "time" in draws.message
    assert draws.steps_run == 1  # what it was making


def test_a_common_drift_is_not_declared_converged():
    """All ensembles still on their way to the target, side by side: only early against late steps can tell."""
    settings = SamplerSettings(ensembles=4, walkers=16, block_steps=40, max_steps=40, min_ess=1.0)
    start = normal_start(2, settings, scale=1e-3) + 100.0
    draws = sample(standard, start, names=["a", "b"], seed=1, settings=settings)
    assert not draws.converged
    assert np.all(draws.r_hat > 1.05)


def test_the_mean_walker_has_to_give_three_effective_draws():
    settings = SamplerSettings(ensembles=2, walkers=64, block_steps=10, max_steps=4000, min_ess=1.0, max_r_hat=10.0)
    draws = draw_from(standard, 2, settings=settings)
    assert draws.converged
    assert np.all(np.minimum(draws.ess_bulk, draws.ess_tail) >= 3 * 2 * 64)


def test_stuck_walkers_are_reported():
    def log_probability(x):
        far = np.abs(x[:, 0] - 1e6) < 1e-8
        return np.where(far, 1e3, standard(x))

    settings = SamplerSettings(ensembles=2, walkers=8, block_steps=100, max_steps=100)
    start = normal_start(2, settings)
    start[0, 3, 0] = 1e6
    draws = sample(log_probability, start, names=["a", "b"], seed=1, settings=settings)
    assert draws.stuck == 1
    assert "1 of 16 walkers" in draws.message
    assert np.all(np.isinf(draws.autocorrelation_time))


@pytest.mark.parametrize(("steps", "least"), [(4, 200), (14, 10)])
def test_walkers_that_few_steps_leave_where_they_were_are_not_called_stuck(steps, least):
    settings = SamplerSettings(ensembles=2, walkers=64, block_steps=steps, max_steps=steps)
    runs = [draw_from(standard, 2, settings=settings, seed=seed) for seed in range(20)]
    assert sum(draws.stuck for draws in runs) > least
    assert not any("did not move" in draws.message for draws in runs)


@pytest.mark.parametrize("calls", [10, 60])
def test_an_interrupt_leaves_what_has_been_drawn(calls):
    """The draws are those of a run that was planned to end after as many steps."""
    draws = draw_from(interrupted_at(calls, standard), 2, settings=SMALL)
    assert not draws.converged
    assert "interrupted" in draws.message
    steps = draws.steps_run
    assert 1 <= steps < 40
    assert draws.samples.shape == (2, 8 * draws.steps_kept, 2)
    planned = SamplerSettings(ensembles=2, walkers=8, block_steps=steps, max_steps=steps)
    np.testing.assert_array_equal(draws.samples, draw_from(standard, 2, settings=planned).samples)


def test_an_interrupt_from_the_progress_callable_leaves_what_has_been_drawn():
    draws = draw_from(standard, 2, settings=SMALL, progress=interrupted_at(1, lambda state: None))
    assert draws.steps_run == 20
    assert "interrupted" in draws.message


def test_an_interrupt_before_the_first_step_is_passed_on():
    with pytest.raises(KeyboardInterrupt):
        draw_from(interrupted_at(3, standard), 2, settings=SMALL)


@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_a_log_probability_that_is_no_number_is_refused_with_the_point(bad, capsys):
    def log_probability(x):
        return np.where(x[:, 1] > 1.0, bad, standard(x))

    settings = SamplerSettings(ensembles=2, walkers=8)
    start = np.clip(normal_start(2, settings, scale=0.4), -0.9, 0.9)
    with refused(InferenceError, "x0 =", "x1 = 1."):
        sample(log_probability, start, names=["x0", "x1"], seed=1, settings=settings)
    printed = capsys.readouterr()
    assert printed.out == printed.err == ""


def test_walkers_of_a_target():
    assert SamplerSettings().walkers_for(2) == 48
    assert [SamplerSettings().walkers_for(size) for size in (9, 14, 20, 41)] == [54, 84, 84, 124]
    assert SamplerSettings(walkers=20).walkers_for(10) == 20
    with refused(ParameterError, 22):
        SamplerSettings(walkers=20).walkers_for(11)


def test_scattered_walkers_lie_inside_and_differ():
    def log_probability(x):
        return np.where(np.abs(x[:, 0] - 2.0) < 0.2, 0.0, -np.inf)

    def wide(rng, n):
        return rng.normal(size=(n, 2))

    settings = SamplerSettings(ensembles=3, walkers=10)
    start = scatter_walkers(log_probability, wide, parameters=2, seed=1, settings=settings)
    assert start.shape == (3, 10, 2)
    assert np.all(np.abs(start[..., 0] - 2.0) < 0.2)
    assert np.unique(start).size == start.size
    again = scatter_walkers(log_probability, wide, parameters=2, seed=1, settings=settings)
    np.testing.assert_array_equal(start, again)
    with refused(InferenceError, "0 of 1000"):
        scatter_walkers(lambda x: np.full(len(x), -np.inf), wide, parameters=2, seed=1, settings=settings)


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
    stored = appended(samples, [40], positive).halved()
    resumed = RunState(positive, as_block(samples[:, :41]), 40, stored.parts, stored.taken_back)
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


@pytest.mark.parametrize(("step", "kept", "lost"), [(0, 10, 0), (10, 10, 0), (11, 9, 0), (19, 1, 0), (20, 10, 1)])
def test_steps_before_a_walker_was_taken_back_are_left_out(step, kept, lost):
    """Of 20 steps the second half is kept, and the whole of it if there is nothing after that walker's return."""
    samples = np.random.default_rng(1).normal(size=(2, 20, 48, 1))
    values = -0.5 * samples[..., 0] ** 2
    state = RunState.begin(Coordinates(), Block(samples[:, :1], values[:, :1], ()))
    state = state.append(Block(samples, values, ()))
    state.taken_back[0, 5] = step
    state = state.halved()
    np.testing.assert_array_equal(state.half.samples, samples[:, 20 - kept :])
    assert state.half.moved.shape[1] == kept
    assert np.count_nonzero(state.were_lost()) == lost


def test_walkers_that_are_as_improbable_as_their_number_of_parameters_lets_them_be_are_not_lost():
    """Of 400 places of 50 normal parameters some are ten units below the median; nowhere else is 40 units below."""
    places = np.random.default_rng(1).normal(size=(4, 1, 100, 50))
    values = np.repeat(-0.5 * np.square(places).sum(axis=-1), 20, axis=1)
    assert np.count_nonzero(values[:, 0] < np.median(values) - 10.0) > 2
    assert not diagnosis.lost_walkers(values).any()
    values[0, :, 0] = np.median(values) - 40.0
    assert np.argwhere(diagnosis.lost_walkers(values)).tolist() == [[0, 0]]
