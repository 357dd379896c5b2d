import numpy as np
import pytest

from helpers.contour_posteriors import posterior, swept
from tactile_bayes.assessment import assumptions as module
from tactile_bayes.assessment.assumptions import alternatives_of, band_by_assumption
from tactile_bayes.contours import Parabola
from tactile_bayes.inference.experiment import Experiment
from tactile_bayes.inference.stored_experiment import experiment_of


def names_of(nuisances, bases=((0.0, 0.0),), **options):
    record = swept(Parabola(0.5, 0.5), step=0.1, bases=bases)
    return {each.name: each for each in alternatives_of(Experiment(record, nuisances=nuisances, **options))}


def test_each_nuisance_is_added_or_fixed_and_each_other_family_tried():
    found = names_of(["bias", "friction"])
    assert found["bias as stated"].experiment.rig.names == ("friction",)
    assert found["friction as stated"].experiment.rig.friction == 0.0
    assert found["lever inferred"].kind == "added"
    assert found["family circle"].experiment.family == "circle"
    assert "family parabola" not in found
    assert "base inferred" not in found  # there is one pivot
    assert "base inferred" in names_of([], bases=((0.0, 0.0), (0.2, 0.0)))


def test_gains_take_the_place_of_the_rigidity_which_has_the_same_effect():
    found = names_of(["rigidity_scale"])["gain inferred for rigidity_scale"].experiment
    assert found.rig.names == ("moment_gain", "force_x_gain", "force_y_gain")


def test_a_calibrated_rig_does_not_add_what_is_fixed():
    from scipy import stats

    from tactile_bayes.inference.parameters.rig_prior import RigPrior

    priors = {"rigidity_scale": stats.lognorm(s=0.01), "lever_x": stats.norm(0.0, 0.01)}
    joint = RigPrior(priors, np.array([[1.0, 0.8], [0.8, 1.0]]), 0.1, "0")
    found = names_of([], joint=joint)
    assert found["rigidity_scale as stated"].experiment.rig.names == ("lever_x",)
    assert found["lever as stated"].experiment.rig.names == ("rigidity_scale",)
    added = found["backlash inferred"].experiment.rig
    assert set(added.names) == {"rigidity_scale", "lever_x", "backlash"}
    assert added.joint is not None
    assert set(found["family circle"].experiment.rig.names) == set(priors)
    gains = found["gain inferred for rigidity_scale"].experiment.rig.names
    assert set(gains) == {"lever_x", "moment_gain", "force_x_gain", "force_y_gain"}


def test_friction_that_is_known_is_not_inferred():
    assert "friction inferred" not in names_of([], friction=0.2)


def test_priors_of_what_remains_are_kept():
    from scipy import stats

    priors = {"q": stats.uniform(0.4, 0.2), "friction": stats.halfnorm(scale=0.1)}
    found = names_of(["friction"], priors=priors)
    assert set(found["friction as stated"].experiment.priors) == {"q"}
    assert set(found["family circle"].experiment.priors) == {"friction"}


@pytest.mark.slow
def test_bands_are_compared_and_errors_are_outcomes(monkeypatch, tmp_path):
    experiment = experiment_of(posterior())
    several = {each.name: each for each in alternatives_of(experiment)}
    chosen = [several["bias inferred"], several["family circle"]]
    monkeypatch.setattr(module, "alternatives_of", lambda experiment: chosen)
    x = np.linspace(-0.5, 0.5, 5)
    found = band_by_assumption(posterior(), experiment, x, seed=1, out=tmp_path, workers=1)
    assert found["kind"].values.tolist() == ["added", "family"]
    assert found["fits"].values.tolist() == [1, 0]
    assert float(np.abs(found["moved"].isel(assumption=0)).max()) < 0.5
    assert float(np.abs(found["moved"].isel(assumption=1)).max()) > 0.5
    monkeypatch.setattr(module, "sampled", lambda *given, **options: pytest.fail("it must resume"))
    assert band_by_assumption(posterior(), experiment, x, seed=1, out=tmp_path, workers=1).equals(found)


@pytest.mark.slow
def test_an_alternative_without_a_posterior_is_named(monkeypatch):
    from tactile_bayes.errors import InferenceError

    def fail(*given, **options):
        raise InferenceError("no contour")

    experiment = experiment_of(posterior())
    monkeypatch.setattr(module, "sampled", fail)
    found = band_by_assumption(posterior(), experiment, np.zeros(2), seed=1, workers=1)
    assert set(found["message"].values) == {"InferenceError: no contour"}
    assert not found["fits"].any()
    assert np.isnan(found["moved"]).all()
