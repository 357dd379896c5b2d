"""Models that are built again from a stored posterior, against the density that was sampled."""

import numpy as np
import pytest
from scipy import stats

from helpers.contour_posteriors import BRIEF, CELL, infer_as_stated, measured, only, posterior
from tactile_bayes.diagnostics.result_check import check
from tactile_bayes.errors import ParameterError
from tactile_bayes.inference.contour import infer_contour
from tactile_bayes.inference.experiment import experiment_of, points_of
from tactile_bayes.inference.family import Family
from tactile_bayes.rig import Rig
from tactile_bayes.runs.demonstration import CONTOUR, LOAD_CELL, ROD
from tactile_bayes.sweep import scan


def assert_same_density(tree, **given):
    model = experiment_of(tree, **given).model
    points = points_of(tree, model.names)
    stored = tree["sample_stats"]["lp"].values
    assert model.log_probability(points.reshape(-1, points.shape[-1])) == pytest.approx(stored.ravel(), abs=1e-9)


def test_the_model_has_the_density_that_was_sampled():
    assert_same_density(posterior())


@pytest.mark.slow
@pytest.mark.parametrize("unknown", ["nothing", only("bias", "friction")])
def test_also_with_unknowns_a_rod_in_metres_and_unknown_noise(unknown):
    record = LOAD_CELL.measure(scan(CONTOUR, rig=Rig(rod=ROD), drive_step=0.1).record, rng=1)
    if unknown == "nothing":
        record.attrs = {name: value for name, value in record.attrs.items() if not name.startswith("load_cell_")}
    assert_same_density(infer_contour(record, rng=1, rig=Rig(unknown=unknown), settings=BRIEF))


def test_priors_and_known_numbers_follow_from_the_tree():
    family = Family("parabola", q=stats.uniform(0.4, 0.2), a=stats.lognorm(s=0.5, scale=0.7), x_c=0.01)
    unknown = {"noise_scale": stats.lognorm(s=1 / 3), "suspension_compliance": 0.01}
    tree = infer_as_stated(measured(), family=family, load_cell=CELL, unknown=unknown, rng=1, settings=BRIEF)
    assert_same_density(tree)
    assert experiment_of(tree).own_family == family


def test_priors_that_are_no_text_must_be_given_and_be_the_same():
    own = stats.rv_histogram((np.ones(4), np.linspace(0.3, 0.7, 5)))()
    rubbing = stats.rv_histogram((np.ones(4), np.linspace(0.0, 0.4, 5)))()
    family, rig = Family("parabola", q=own), Rig(load_cell=CELL, unknown=only(friction=rubbing))
    of_family = infer_as_stated(measured(), family=family, load_cell=CELL, rng=1, settings=BRIEF)
    with pytest.raises(ParameterError, match="does not state its family"):
        experiment_of(of_family)
    assert_same_density(of_family, family=family)
    with pytest.raises(ParameterError, match="the prior of q was histogram"):
        experiment_of(of_family, family=Family("parabola", q=stats.uniform(0.3, 0.4)))
    of_rig = infer_contour(measured(), rig=rig, rng=1, settings=BRIEF)
    with pytest.raises(ParameterError, match="does not state its rig"):
        experiment_of(of_rig)
    assert_same_density(of_rig, rig=rig)
    assert check(of_family).messages
    assert check(of_rig).messages


@pytest.mark.parametrize("name", ["rig", "family_parameters"])
def test_a_tree_that_does_not_state_what_it_assumes_is_refused(name):
    tree = posterior().copy()
    tree.attrs = {each: value for each, value in tree.attrs.items() if each != name}
    with pytest.raises(ParameterError, match="does not state"):
        experiment_of(tree)
