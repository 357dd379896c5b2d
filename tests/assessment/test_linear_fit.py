"""The formulas of a linear fit, against predictions that are computed outright."""

from dataclasses import replace

import numpy as np
import pytest
from scipy import stats

from helpers.contour_posteriors import CELL, TRUTH, swept
from tactile_bayes.assessment.linear_fit import LinearFit, Linearisation
from tactile_bayes.contours import Parabola
from tactile_bayes.errors import InferenceError
from tactile_bayes.inference.experiment import Experiment
from tactile_bayes.load_cell import RandomWalk
from tactile_bayes.rig import Rig

SAMPLES, CHANNELS, PARAMETERS = 30, 3, 4


def fit_of(readings, slopes, prior):
    """The joint fit of readings around a prior mean of zero."""
    flat = slopes.reshape(-1, PARAMETERS)
    covariance = np.linalg.inv(flat.T @ flat + prior)
    found = covariance @ flat.T @ readings.ravel()
    return LinearFit(slopes, readings - slopes @ found, covariance, prior, np.zeros((SAMPLES, CHANNELS, 0)))


def example(seed):
    rng = np.random.default_rng(seed)
    slopes, prior = rng.normal(size=(SAMPLES, CHANNELS, PARAMETERS)), np.diag([1.0, 4.0, 0.0, 100.0])
    return rng, slopes, prior


def test_disagreement_is_the_surprise_of_the_rest_under_the_posterior_of_the_part():
    rng, slopes, prior = example(1)
    readings = 3.0 * rng.normal(size=(SAMPLES, CHANNELS))
    rest = np.arange(SAMPLES) % 3 == 0
    fit = fit_of(readings, slopes, prior)
    there, own = (slopes[some].reshape(-1, PARAMETERS) for some in (~rest, rest))
    before = np.linalg.inv(there.T @ there + prior)
    mean = before @ there.T @ readings[~rest].ravel()
    surprise = own.T @ (readings[rest].ravel() - own @ mean)
    information = own.T @ own
    covariance = information + information @ before @ information
    expected = surprise @ np.linalg.solve(covariance, surprise)
    found = fit.disagreement(rest)
    assert found.measured == PARAMETERS
    assert found.ratio * PARAMETERS * fit.scatter == pytest.approx(expected)
    after = np.linalg.inv(there.T @ there + information + prior)
    moved = after @ slopes.reshape(-1, PARAMETERS).T @ readings.ravel() - mean
    assert found.moves * np.sqrt(fit.scatter) == pytest.approx(moved / np.sqrt(np.diag(before - after)))


def test_directions_that_the_rest_does_not_measure_do_not_count():
    rng, slopes, _ = example(2)
    slopes[:10, :, 1] = 0.0
    fit = fit_of(rng.normal(size=(SAMPLES, CHANNELS)), slopes, np.diag([1.0, 4.0, 1.0, 1.0]))
    found = fit.disagreement(np.arange(SAMPLES) < 10)
    assert found.measured == PARAMETERS - 1
    assert found.moves[1] == pytest.approx(0.0, abs=5.0)


def test_zeros_that_are_no_parameters_count_too():
    rng, slopes, prior = example(4)
    fit = fit_of(rng.normal(size=(SAMPLES, CHANNELS)), slopes, prior)
    rest = np.arange(SAMPLES) < 12
    zeros = np.broadcast_to(np.eye(CHANNELS), (SAMPLES, CHANNELS, CHANNELS))
    shifted = fit._replace(residuals=fit.residuals + 3.0 * rest[:, None], zeros=zeros)
    found = shifted.disagreement(rest)
    assert found.measured == PARAMETERS + CHANNELS
    assert stats.f.sf(found.ratio, found.measured, fit.freedom) < 1e-6


def test_the_ratio_has_an_f_distribution_if_the_model_holds():
    """A right test fails in one of a thousand: the threshold is fixed with the seed."""
    rng, slopes, prior = example(3)
    rest = np.arange(SAMPLES) < 12
    p_values = []
    for _ in range(400):
        truth = rng.normal(size=PARAMETERS) / np.sqrt(np.maximum(np.diag(prior), 1e-2))
        readings = slopes @ truth + 2.0 * rng.normal(size=(SAMPLES, CHANNELS))  # the noise is not known
        fit = fit_of(readings, slopes, prior / 4.0)
        found = fit.disagreement(rest)
        p_values.append(stats.f.sf(found.ratio, found.measured, fit.freedom))
    assert stats.kstest(p_values, "uniform").pvalue > 1e-3


SCALES = np.array([0.003, 0.002, 0.003, 0.03])


def model_of(cell, **options):
    record = cell.measure(swept(Parabola(**TRUTH), **options), rng=11)
    return Experiment(record, rig=Rig(load_cell=cell, unknown="nothing")).model


@pytest.mark.parametrize(
    "errors",
    [
        {},
        {"drive_angle_noise": 0.005},
        {"drift": RandomWalk(moment=0.01, force=0.02)},
        {"bias_uncertainty": (0.05, 0.05, 0.05)},
    ],
    ids=["white noise", "encoder", "drift", "unknown bias"],
)
def test_residuals_of_a_record_of_the_model_have_unit_variance(errors):
    """Some 600 residuals: their mean square scatters by 6 %, and the best of a record away from its start as well."""
    model = model_of(replace(CELL, **errors))
    starts = np.array([[*TRUTH.values(), 1.0], [0.51, 0.495, 0.004, 1.0]])
    at, away = Linearisation(model, SCALES).fits(np.stack([model.likelihood.measured] * 2), starts)
    assert at.scatter == pytest.approx(1.0, abs=0.25)
    assert away.scatter == pytest.approx(at.scatter, rel=0.03)
    assert at.freedom == pytest.approx(at.residuals.size - 3, abs=0.1)


def test_too_many_readings_that_share_errors_are_refused():
    cell = replace(CELL, drift=RandomWalk(moment=0.01, force=0.02))
    with pytest.raises(InferenceError, match="2000 are possible"):
        Linearisation(model_of(cell, step=np.radians(0.07)), SCALES)


def test_out_of_reach_there_is_no_fit_and_differences_stay_within_the_bounds_of_parameters():
    """A posterior that is wide over a parameter's size reaches the bound, at which there is no contour."""
    model = model_of(CELL)
    readings = model.likelihood.measured[None]
    assert Linearisation(model, SCALES).fits(readings, np.array([[0.5, 3.0, 0.0, 1.0]])) == [None]
    starts = np.array([[1e-3, TRUTH["q"], TRUTH["x_c"], 1.0]])
    (found,) = Linearisation(model, np.array([10.0, *SCALES[1:]])).fits(readings, starts)
    assert np.isfinite(found.residuals).all()
