"""The check of a result: the cause comes first, and what is right is said to be."""

import copy
import pickle

import numpy as np
import pytest
import xarray as xr

import tactile_bayes as tb
from helpers.contour_posteriors import QUICK, posterior
from helpers.predicted_records import ideal, predicted, taken_for_a_parabola, with_readings
from helpers.refusals import refused
from tactile_bayes.contours import Parabola
from tactile_bayes.diagnostics import reach_edge
from tactile_bayes.diagnostics.reach_edge import cut_off_parameters
from tactile_bayes.errors import InferenceError
from tactile_bayes.inference.misfit import what_to_try
from tactile_bayes.inference.record_likelihood.likelihood import RecordLikelihood
from tactile_bayes.load_cell import RandomWalk
from tactile_bayes.record import CHANNELS
from tactile_bayes.rig import NOTHING
from tactile_bayes.uncertainty.band import normal_band


def changed(tree, group, **values):
    """The tree with other draws of parameters in a group."""
    other = tree.copy()
    draws = {name: (("chain", "draw"), np.atleast_2d(v)) for name, v in values.items()}
    other[group] = xr.DataTree(xr.Dataset(draws))
    return other


def readings(tree):
    return {name: tree["observed_data"].to_dataset()[name].values for name in CHANNELS}


def kinds(found):
    return [message.kind for message in found.messages]


def test_of_a_good_result_all_is_well():
    found = tb.check(predicted(), xr.Dataset(attrs={"misfit_probability": 0.3}))
    assert kinds(found) == ["all is well"]
    assert found.is_well
    message = found.messages[0]
    assert float(message.details["p_value"]) == pytest.approx(float(found.predictive.overall_p_value), rel=0.1)
    for other in (copy.deepcopy(message), pickle.loads(pickle.dumps(message))):
        assert (str(other), other.kind, other.details) == (str(message), message.kind, message.details)


@pytest.mark.slow
def test_a_family_that_does_not_hold_the_contour_is_the_first_thing_said():
    found = tb.check(taken_for_a_parabola("IV"))
    assert kinds(found)[:3] == ["not described", "not converged", "misfit as noise"]
    values = found.messages[0].details
    assert values["like"] == "none"
    assert values["channel"] in CHANNELS
    assert values["advice"] == what_to_try(["parabola"])
    assert found.messages[2].details["alike"] == "as stated"


def test_a_forgotten_tare_is_told_with_its_size():
    tree = predicted()
    found = tb.check(with_readings(tree, force_y=readings(tree)["force_y"] + 0.3))
    assert kinds(found)[:2] == ["zero off", "not described"]
    assert found.messages[0].details["off"].startswith("force_y is off by 0.3")


def test_forces_in_another_unit_and_a_flipped_moment_come_first():
    tree = predicted()
    thousandfold = {name: 1e3 * readings(tree)[name] for name in ("force_x", "force_y")}
    assert kinds(tb.check(with_readings(tree, **thousandfold)))[:2] == ["large loads", "not described"]
    assert kinds(tb.check(with_readings(tree, holding_moment=-readings(tree)["holding_moment"])))[0] == "moment sign"


def test_what_has_not_converged_is_said_even_where_there_is_nothing_to_compare_with():
    tree = predicted(chains=1, draws=20)
    tree.attrs |= {"converged": 0, "message": "not converged, the steps allowed ran out"}
    assert kinds(tb.check(tree)) == ["not converged"]


def with_noise(factor, scatter):
    """A result of so many times the noise as predicted, and of so many as measured."""
    tree = changed(predicted(), "posterior", noise_scale=np.full((4, 250), factor))
    predictive = tree["posterior_predictive"].to_dataset()
    for name in CHANNELS:
        predictive[name] = ideal(name) + factor * (predictive[name] - ideal(name))
    tree["posterior_predictive"] = xr.DataTree(predictive)
    return with_readings(tree, **{n: ideal(n) + scatter * (v - ideal(n)) for n, v in readings(tree).items()})


@pytest.mark.parametrize(
    ("factor", "scatter", "kind"),
    [(4.0, 4.0, "larger noise"), (0.25, 0.25, "larger noise"), (4.0, 1.0, "misfit as noise")],
)
def test_noise_that_is_not_as_stated(factor, scatter, kind):
    found = tb.check(with_noise(factor, scatter))
    assert kinds(found) == [kind]
    assert float(found.messages[0].details["factor"]) == factor


def test_misfit_that_wide_predictions_hide_is_the_first_thing_said_with_its_cause():
    tree = with_noise(4.0, 1.0)
    tree.attrs |= {"converged": 0, "message": "not converged, the steps allowed ran out"}
    columns = {"log_evidence": 50.0, "describes": 1, "sought": 1, "remedy": 'friction = "default"'}
    causes = xr.Dataset({name: ("cause", [value]) for name, value in columns.items()}, {"cause": ["friction"]})
    tree["causes"] = xr.DataTree(causes)
    found = tb.check(tree)
    assert kinds(found)[:2] == ["misfit as noise", "not converged"]
    assert 'friction, which describes it: infer with friction = "default"' in found.messages[0]


def test_a_zero_that_is_inferred_is_not_called_a_forgotten_tare_where_a_wrong_model_moves_it():
    tree = predicted()
    off = with_readings(tree, force_y=readings(tree)["force_y"] + 0.3)
    off.attrs |= {"nuisances": '["force_y_bias"]'}
    assert kinds(tb.check(off))[0] == "not described"


def test_loads_that_contradict_one_another_unless_noise_does_it():
    (first, *_) = tb.check(predicted(), xr.Dataset(attrs={"misfit_probability": 0.0})).messages
    assert (first.kind, first.details) == ("contradiction", {"chance": "below 1e-99", "dragging": ""})
    sought = predicted()
    sought.attrs |= {"nuisances": '["friction"]'}
    for tree, words in ((predicted(), 'friction = "default" under [unknown]'), (sought, "more friction than")):
        dragged = tb.check(tree, xr.Dataset(attrs={"misfit_probability": 0.0, "axial_score": -20.0})).messages[0]
        assert "too small by 20 standard errors" in dragged.details["dragging"]
        assert words in dragged.details["dragging"]


def test_a_prior_that_is_largest_at_its_end_allows_what_is_there():
    rng = np.random.default_rng(5)
    tree = changed(predicted(), "posterior", friction=np.abs(rng.normal(0.0003, 0.0001, (4, 250))))
    assert tb.check(changed(tree, "prior", friction=np.abs(rng.normal(0.0, 0.3, (1, 1000))))).is_well


def test_what_the_prior_forbids_and_what_it_says_alone():
    rng = np.random.default_rng(1)
    prior = {"noise_scale": rng.lognormal(size=(1, 1000)), "rigidity_scale": rng.lognormal(0.0, 0.05, (1, 1000))}
    tree = changed(predicted(), "prior", **prior, x_c=rng.normal(size=(1, 1000)))
    noise = np.ones((4, 250))
    far = {"rigidity_scale": rng.normal(1.3, 0.01, (4, 250)), "x_c": rng.normal(0.0, 0.9, (4, 250))}
    found = tb.check(changed(tree, "posterior", noise_scale=noise, **far))
    assert kinds(found) == ["beyond the prior", "set by the prior"]
    assert found.messages[0].details["values"].startswith("rigidity_scale = 1.3 (prior: 0.8")
    assert found.messages[1].details["names"] == "x_c"
    near = {**far, "rigidity_scale": rng.normal(1.0, 0.01, (4, 250))}
    assert kinds(tb.check(changed(tree, "posterior", noise_scale=noise, **near))) == ["all is well", "set by the prior"]


def test_a_zero_that_was_not_tared_is_ordinary_where_the_record_determines_it():
    rng = np.random.default_rng(1)
    prior = {"noise_scale": rng.lognormal(size=(1, 1000)), "force_y_bias": rng.normal(0.0, 0.01, (1, 1000))}
    tree = changed(predicted(), "prior", **prior)
    for width, wrong in ((2e-4, []), (4e-3, ["beyond the prior"])):
        drawn = {"noise_scale": np.ones((4, 250)), "force_y_bias": rng.normal(0.08, width, (4, 250))}
        found = kinds(tb.check(changed(tree, "posterior", **drawn)))
        assert [kind for kind in found if kind == "beyond the prior"] == wrong


def test_a_zero_that_moved_is_told_unless_that_is_inferred_or_stated():
    tree = predicted()
    for name, wander in zip(CHANNELS, (0.0, 0.2, 0.0), strict=True):
        column = readings(tree)[name]
        tree = with_readings(tree, **{name: column + wander * np.linspace(-0.5, 0.5, column.size)})
    (moved,) = (message for message in tb.check(tree).messages if message.kind == "zero moved")
    assert moved.details["moved"].startswith("force_x (p = ")
    assert moved.details["entry"] == 'drift = "default" under [unknown] of rig.toml'
    cell = tb.LoadCell(force_noise=0.05, moment_noise=0.02, drift=RandomWalk(force=0.01))
    stated = {f"load_cell_{name}": value for name, value in cell.entries().items()}
    for attrs in ({"nuisances": '["force_x_drift"]'}, stated):
        other = tree.copy()
        other.attrs = tree.attrs | attrs
        assert "zero moved" not in kinds(tb.check(other))


def test_a_check_that_was_not_made_is_not_passed():
    tree = predicted().copy()  # as if its rod touched the object at no sample
    events = tree["events"].to_dataset()
    tree["events"] = xr.DataTree(events.assign(snap_off_drive_angle=events["first_drive_angle"]))
    found = tb.check(tree)
    assert "too few" in found.predictive.attrs["not_checked"]
    assert not found.predictive.attrs["passed"]
    assert not found.is_well
    assert np.isnan(found.predictive.overall_p_value)
    first = found.messages[0]
    assert (first.kind, first.details["reason"]) == ("not checked", found.predictive.attrs["not_checked"])
    found = tb.check(predicted(chains=1, draws=20))
    assert found.messages[0].kind == "not checked"
    assert "20 predictions" in found.messages[0].details["reason"]
    assert found.predictive is None
    assert not found.is_well


READERS = {
    "check": tb.check,
    "contour_band": lambda tree: tb.contour_band(tree, [0.0]),
    "normal_band": lambda tree: normal_band(tree, [0.0]),
    "to_arviz": tb.to_arviz,
    "trust": lambda tree: tb.trust(tree, rng=1, replicates=0, assumptions=False),
}


@pytest.mark.parametrize("value", [np.nan, np.inf])
@pytest.mark.parametrize("read", READERS.values(), ids=READERS)
def test_a_draw_that_is_no_number_is_named(read, value):
    draws = {name: np.full((4, 250), 0.5) for name in ("a", "q", "x_c")}
    draws["q"][1, 7] = value
    with refused(InferenceError, "1 of 1000 draws of q", "chain 1, draw 7"):
        read(changed(predicted(), "posterior", **draws))


def test_a_prediction_that_is_no_number_is_named():
    tree = predicted()
    predictive = tree["posterior_predictive"].to_dataset().copy(deep=True)
    predictive["force_x"][0, 3, 5] = np.nan
    tree["posterior_predictive"] = xr.DataTree(predictive)
    with refused(InferenceError, "predicted force_x", "chain 0, draw 3"):
        tb.check(tree)


@pytest.mark.parametrize("has_way_forth", [False, pytest.param(True, marks=pytest.mark.slow)])
def test_a_sweep_that_goes_back_in_contact_is_named_if_its_way_forth_is_missing(has_way_forth):
    rig = tb.Rig(unknown={**NOTHING, "friction": 0.2})
    drives = [tb.Rotation((0.1, 0.0), "forward", 0.1), tb.Motion(0.0, 0.0, [0.4, 2.2, 0.4], drive_step=0.1)]
    record = tb.scan(Parabola(0.5, 0.5), rig, drive=drives).record
    turned = record.sweep.values == 1
    back = turned & (np.cumsum(turned) > 19)
    columns = {"sweep": record.sweep + back, "direction": ("sample", np.where(back, "backward", "forward"))}
    measured = tb.LoadCell(force_noise=0.05, moment_noise=0.02).measure(record.assign(columns), rng=1)
    measured = measured if has_way_forth else measured.isel(sample=np.flatnonzero(back | ~turned))
    posterior = tb.infer_contour(measured, rig=rig, rng=1, settings=QUICK)
    assert (kinds(tb.check(posterior))[-1] == "no way forth") is not has_way_forth


def test_a_right_posterior_is_not_cut_off():
    assert cut_off_parameters(posterior()) == {}


@pytest.fixture
def walled(monkeypatch):
    """The model has no path along a contour whose lowest point is above the mean of the draws, less one deviation."""
    heights = posterior()["posterior"]["q"].values
    wall = float(np.quantile(heights, 0.9))
    usable = RecordLikelihood.usable

    def below(self, contours, rig=None):
        return usable(self, contours, rig) & (np.asarray(contours.q) <= wall)

    monkeypatch.setattr(RecordLikelihood, "usable", below)


def test_a_wall_among_the_draws_is_found_and_said_first(walled):
    assert cut_off_parameters(posterior())["q"] == "above"
    first = tb.check(posterior()).messages[0]
    assert first.kind == "cut-off posterior"
    assert "q (above " in first.details["ends"]


def test_ends_of_a_prior_are_no_wall(walled, monkeypatch):
    monkeypatch.setattr(reach_edge.ContourModel, "log_prior", lambda self, points: np.full(len(points), -np.inf))
    assert cut_off_parameters(posterior()) == {}
