"""Experiments: what is refused when one is made, what its model is made from, and what travels to another process."""

import copy
from dataclasses import fields, replace

import numpy as np
import pytest
from scipy import stats

from helpers.contour_posteriors import CELL, only
from helpers.refusals import refused
from tactile_bayes.contours import Parabola
from tactile_bayes.distributions import in_words
from tactile_bayes.errors import ParameterError, RecordError
from tactile_bayes.inference.experiment import Experiment, usual_load_cell
from tactile_bayes.inference.family import Family
from tactile_bayes.mechanics.rods.rod import Rod
from tactile_bayes.rig import Rig
from tactile_bayes.sweep import scan

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
