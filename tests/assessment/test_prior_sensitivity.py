import numpy as np
from scipy import stats

from helpers.contour_posteriors import CELL, SOUND, infer_as_stated, measured, posterior
from tactile_bayes.assessment.prior_sensitivity import prior_sensitivity
from tactile_bayes.inference.experiment import experiment_of
from tactile_bayes.inference.family import Family

REGIONS = {"in_gap": np.linspace(-0.05, 0.05, 3), "beside": np.array([-0.4, 0.4])}


def test_a_record_sets_the_parabola_and_its_band():
    model = experiment_of(posterior()).model
    found = prior_sensitivity(posterior(), model, REGIONS)
    assert found["quantity"].values.tolist() == [*model.names, "band in_gap", "band beside"]
    assert set(found["set_by"].values) == {"record"}
    assert (found["sensitivity"].sel(component="likelihood") > 0.05).all()


def test_a_prior_as_narrow_as_the_record_is_named_beside_it():
    deviation = float(posterior()["posterior"]["q"].std())
    family = Family("parabola", q=stats.norm(0.5, 0.3 * deviation))
    strong = infer_as_stated(measured(), load_cell=CELL, family=family, rng=1, settings=SOUND)
    model = experiment_of(strong).model
    found = prior_sensitivity(strong, model, REGIONS)["sensitivity"]
    assert float(found.sel(quantity="q", component="contour")) > 0.05
    assert float(found.sel(quantity="q", component="contour")) > float(found.sel(quantity="q", component="likelihood"))
    assert float(found.sel(quantity="a", component="rig")) < 0.05
