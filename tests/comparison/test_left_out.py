"""Samples of a record predicted from the others: by inferring again next to events, else by importance sampling."""

import numpy as np
import pytest
from scipy.special import logsumexp

from helpers.contour_posteriors import CELL, swept
from tactile_bayes.comparison.leave_one_out import predicted_samples
from tactile_bayes.contours import Parabola
from tactile_bayes.inference.contour import sampled
from tactile_bayes.inference.ensembles import SamplerSettings
from tactile_bayes.inference.experiment import Experiment, contour_problem
from tactile_bayes.load_cell import LoadCell, RandomWalk
from tactile_bayes.rig import Rig

SETTINGS = SamplerSettings(ensembles=2, walkers=20, min_ess=250, max_r_hat=1.05)


def problem_of(cell=CELL):
    measured = cell.measure(swept(Parabola(0.5, 0.5), step=0.12), rng=4)
    return contour_problem(Experiment(measured, Rig(load_cell=cell, unknown="nothing"), "parabola"))


def inferred_without(problem, sample):
    """Its log-density from a posterior of all the others, and the error of that."""
    model = problem.model
    kept = np.arange(problem.loaded.size) != sample
    rest = problem._replace(model=problem.without(~kept), loaded=problem.loaded[kept])
    draws = sampled(rest, seed=5, settings=SETTINGS).draws.samples
    points = draws[:, :: max(1, draws.shape[1] // 1000)].reshape(-1, draws.shape[-1])
    logs = model.likelihood.score(*model.loads_and_discrepancy(points)[:2], model.noise_scale(points), pointwise=True)
    of_sample = logs[:, sample]
    weights = np.exp(of_sample - of_sample.max())
    return logsumexp(of_sample) - np.log(of_sample.size), 3.0 * np.std(weights) / np.mean(weights) / weights.size**0.5


@pytest.mark.slow
def test_samples_are_predicted_as_if_inferred_without_them():
    """At an event, where importance sampling from the posterior is off, and elsewhere, where it is what is done.

    Three times the error for autocorrelation.
    """
    problem = problem_of()
    predicted = predicted_samples(problem, sampled(problem, seed=1, settings=SETTINGS), seed=2, settings=SETTINGS)
    events = problem.model.likelihood.segments.event_samples(problem.loaded)
    at_event, elsewhere = int(events[0, 3]), int(events[0, 1]) + 5
    assert np.isnan(predicted.pareto_k[at_event])
    assert predicted.pareto_k[elsewhere] < 0.5
    for sample in (at_event, elsewhere):
        exact, error = inferred_without(problem, sample)
        assert abs(predicted.log_density[sample] - exact) < 4.0 * np.hypot(error, predicted.standard_error[sample])
    assert np.isfinite(predicted.standard_error).all()


@pytest.mark.slow
def test_of_a_cell_that_drifts_samples_at_events_are_left_out():
    cell = LoadCell(force_noise=0.05, moment_noise=0.02, drift=RandomWalk(force=0.002, moment=0.001))
    problem = problem_of(cell)
    brief = SamplerSettings(ensembles=2, max_steps=40)
    found = predicted_samples(problem, sampled(problem, seed=1, settings=brief), seed=2, settings=brief)
    events = np.zeros(problem.loaded.size, dtype=bool)
    events[problem.model.likelihood.segments.event_samples(problem.loaded)] = True
    np.testing.assert_array_equal(np.isnan(found.log_density), events)
