"""Experiments: what is refused, what their models are made from, and those behind stored posteriors."""

import copy
from dataclasses import fields, replace

import numpy as np
import pytest
from scipy import stats

from helpers.contour_posteriors import BRIEF, CELL, infer_as_stated, measured, only, posterior
from helpers.refusals import refused
from tactile_bayes import Family, Rig, Rod, check, infer_contour, scan
from tactile_bayes.contours import Parabola
from tactile_bayes.distributions import in_words
from tactile_bayes.errors import ParameterError, RecordError
from tactile_bayes.inference.experiment import Experiment, experiment_of, points_of, usual_load_cell
from tactile_bayes.runs.demonstration import CONTOUR, LOAD_CELL, ROD

RECORD = scan(Parabola(0.5, q=0.5), drive_step=0.1).record


@pytest.mark.parametrize(
    ("record", "wrong", "kind", "named"),
    [
        (RECORD, {"family": "cube"}, ParameterError, ["family", "'cube'"]),
        (RECORD, {"rig": 0.05}, ParameterError, ["rig is 0.05"]),
        (RECORD, {"rig": None}, ParameterError, ["rig is None"]),
        (RECORD, {"events": 1}, ParameterError, ["events is 1"]),
        (RECORD.holding_moment, {}, RecordError, ["record", "xarray.Dataset"]),
    ],
)
def test_arguments_are_checked_when_it_is_made(record, wrong, kind, named):
    with refused(kind, *named):
        Experiment(record, **wrong)


def test_the_model_is_built_once_and_anew_of_another_record():
    one = Experiment(RECORD, Rig(load_cell=CELL, unknown=only("bias")), "circle")
    assert one.model is one.model
    other = replace(one, record=RECORD.isel(sample=slice(0, 20)))
    assert other.model is not one.model
    assert other.model.names == one.model.names
    assert other.model.measured.sizes["sample"] == 20


def test_priors_of_its_own_take_the_place_of_default_ones():
    own = {"q": stats.norm(0.5, 0.1), "friction": stats.halfnorm(scale=0.1)}
    rig = Rig(load_cell=CELL, unknown=only(friction=own["friction"]))
    experiment = Experiment(RECORD, rig, Family("parabola", q=own["q"]))
    assert experiment.model.names == ("a", "q", "x_c", "friction", "noise_scale")
    assert {name: experiment.model.priors[name] for name in own} == own
    usual = Experiment(RECORD, rig).priors
    assert in_words(experiment.model.priors["a"]) == in_words(usual["a"])


def test_the_model_does_not_travel_and_is_the_same_there():
    here = Experiment(RECORD, rig=Rig(load_cell=CELL, unknown="nothing"))
    point = np.array([[0.5, 0.5, 0.0, 1.0]])
    density = here.model.log_probability(point)
    there = copy.deepcopy(here)  # of what __getstate__ returns, as on the way to another process
    assert list(vars(there)) == [each.name for each in fields(Experiment)]
    np.testing.assert_array_equal(there.model.log_probability(point), density)


def test_a_rod_takes_the_place_of_that_of_the_record():
    rod = Rod(length=0.1, flexural_rigidity=1e-5)
    cell = usual_load_cell(rod)
    record = scan(Parabola(5.0, q=0.05), drive_step=0.1, rig=Rig(rod=rod)).record
    stiffer = replace(rod, flexural_rigidity=2e-5)
    experiment = Experiment(record, rig=Rig(rod=stiffer, load_cell=cell, unknown="nothing"))
    assert experiment.model.likelihood.rod == stiffer
    assert experiment.about["rod_flexural_rigidity"] == 2e-5
    assert Experiment(record, rig=Rig(load_cell=cell, unknown="nothing")).about["rod_flexural_rigidity"] == 1e-5


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
