import numpy as np
import pytest
from scipy import stats

from helpers.contour_posteriors import BRIEF, CELL, infer_as_stated, measured, posterior
from tactile_bayes.errors import InferenceError
from tactile_bayes.inference.contour import infer_contour
from tactile_bayes.inference.stored_experiment import experiment_of, points_of


def assert_same_density(tree, priors=None):
    model = experiment_of(tree, priors).model
    points = points_of(tree, model.names)
    stored = tree["sample_stats"]["lp"].values
    assert model.log_probability(points.reshape(-1, points.shape[-1])) == pytest.approx(stored.ravel(), abs=1e-9)


def test_the_model_has_the_density_that_was_sampled():
    assert_same_density(posterior())


@pytest.mark.slow
def test_also_with_nuisances_a_rod_in_metres_and_unknown_noise():
    from tactile_bayes.runs.demonstration import CONTOUR, LOAD_CELL, ROD
    from tactile_bayes.sweep import scan

    record = LOAD_CELL.measure(scan(CONTOUR, rod=ROD, drive_step=0.1).record, seed=1)
    assert_same_density(infer_contour(record, seed=1, nuisances=["bias", "friction"], settings=BRIEF))
    record.attrs = {name: value for name, value in record.attrs.items() if not name.startswith("load_cell_")}
    assert_same_density(infer_contour(record, seed=1, nuisances=[], settings=BRIEF))


def test_priors_follow_from_their_text():
    priors = {"q": stats.uniform(0.4, 0.2), "a": stats.lognorm(s=0.5, scale=0.7)}
    assert_same_density(infer_as_stated(measured(), load_cell=CELL, priors=priors, seed=1, settings=BRIEF))


def test_priors_that_are_no_text_must_be_given_and_be_the_same():
    edges = np.linspace(0.3, 0.7, 5)
    priors = {"q": stats.rv_histogram((np.ones(4), edges))()}
    tree = infer_as_stated(measured(), load_cell=CELL, priors=priors, seed=1, settings=BRIEF)
    with pytest.raises(InferenceError, match="give priors="):
        experiment_of(tree)
    assert_same_density(tree, priors)
    with pytest.raises(InferenceError, match="the prior of q was histogram"):
        experiment_of(tree, {"q": stats.uniform(0.3, 0.4)})


def test_a_tree_without_priors_is_refused():
    tree = posterior().copy()
    tree.attrs = {name: value for name, value in tree.attrs.items() if name != "priors"}
    with pytest.raises(InferenceError, match="does not state its priors"):
        experiment_of(tree)
