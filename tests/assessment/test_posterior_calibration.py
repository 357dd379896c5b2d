import numpy as np
import pytest

from helpers.contour_posteriors import posterior
from tactile_bayes.assessment import posterior_calibration as module
from tactile_bayes.assessment.posterior_calibration import JointModel, posterior_calibration
from tactile_bayes.errors import CalibrationError, InferenceError
from tactile_bayes.inference.experiment import experiment_of, points_of


def test_the_joint_density_has_the_prior_once_and_both_likelihoods():
    experiment = experiment_of(posterior())
    model, other = experiment.model, experiment_of(posterior()).model
    points = points_of(posterior(), model.names)[0, :5]
    prior = model.log_prior(points)
    joint = JointModel(model, other)
    assert joint.log_probability(points) == pytest.approx(2.0 * model.log_probability(points) - prior)


@pytest.mark.slow
def test_replicates_are_kept_and_resume(tmp_path):
    experiment = experiment_of(posterior())
    two, three = (
        posterior_calibration(posterior(), experiment, seed=1, replicates=n, out=tmp_path, workers=1) for n in (2, 3)
    )
    assert three.attrs["lost"] == 0
    assert three.attrs["conclusion"] == "too few"
    assert {"pointwise_in_gap", "pointwise_beside", "contact_region", "snap_off"} <= set(three.claim.values)
    assert np.isfinite(three.factor).all()
    assert (three.corrected == 0).all()
    with pytest.raises(CalibrationError, match="seed"):
        posterior_calibration(posterior(), experiment, seed=2, replicates=3, out=tmp_path, workers=1)
    again = posterior_calibration(posterior(), experiment, seed=1, replicates=3, out=tmp_path, workers=1)
    assert again.equals(three)
    assert two.ranks.equals(three.ranks.isel(replicate=slice(0, 2)))


def test_more_replicates_than_predictions_are_refused():
    with pytest.raises(InferenceError, match="are needed"):
        posterior_calibration(posterior(), experiment_of(posterior()), seed=1, replicates=10_000, workers=1)


def test_errors_are_outcomes(monkeypatch):
    monkeypatch.setattr(module, "_made", lambda experiment, number: 1 / 0)
    found = posterior_calibration(posterior(), experiment_of(posterior()), seed=1, replicates=2, workers=1)
    assert found.attrs["lost"] == 2


@pytest.mark.slow
@pytest.mark.parametrize(("width", "conclusion"), [(1.0, "calibrated"), (0.6, "not calibrated")])
def test_a_sampler_that_is_too_narrow_is_caught_and_a_right_one_is_not(width, conclusion):
    """The false-alarm rate of a right one is 1 %; the seed is fixed."""
    tree = posterior().copy()
    draws = tree["posterior"].to_dataset()
    narrow = {name: values.mean() + width * (values - values.mean()) for name, values in draws.items()}
    tree["posterior"] = draws.assign({name: narrow[name].assign_attrs(draws[name].attrs) for name in narrow})
    experiment = experiment_of(tree)
    model = experiment.model
    predicted = tree["posterior_predictive"].to_dataset()
    points = points_of(tree, model.names)[:, predicted.draw.values].reshape(-1, len(model.names))
    loads = model.likelihood.load_cell.expected(model.loads(points))
    cell = model.likelihood.load_cell
    readings = cell.simulate(loads, rng=5, noise_scale=model.noise_scale(points))
    shape = predicted.holding_moment.shape
    columns = {
        name: (predicted[name].dims, readings[..., i].reshape(shape))
        for i, name in enumerate(("holding_moment", "force_x", "force_y"))
    }
    tree["posterior_predictive"] = predicted.assign(columns)
    found = posterior_calibration(tree, experiment, seed=1, replicates=100, probability=0.9)
    assert found.attrs["conclusion"] == conclusion
