import numpy as np
import pytest
from scipy import stats

from helpers.contour_posteriors import only, posterior, swept
from tactile_bayes import Family, LoadCell, Rig, Rod
from tactile_bayes.assessment import assumptions as module
from tactile_bayes.assessment.assumptions import alternatives_by_channel, alternatives_of, band_by_assumption
from tactile_bayes.contours import Parabola
from tactile_bayes.errors import InferenceError
from tactile_bayes.inference.experiment import Experiment, experiment_of
from tactile_bayes.rig import NOTHING
from tactile_bayes.rig.parameters import MEMORY
from tactile_bayes.rig.rig_prior import RigPrior
from tactile_bayes.rig.unknown import expanded


def names_of(*unknown, bases=((0.0, 0.0),), rig=None, **options):
    """Alternatives by name, of a rig of which these parameters are unknown, or of another one."""
    record = swept(Parabola(0.5, 0.5), step=0.1, bases=bases)
    rig = rig or Rig(unknown=only(*unknown))
    return {each.name: each for each in alternatives_of(Experiment(record, rig, **options))}


def unknown_of(alternative):
    return alternative.experiment.unknowns.names


TWO_PIVOTS = ((0.0, 0.0), (0.2, 0.0))


def test_each_unknown_is_added_or_fixed_and_each_other_family_tried():
    found = names_of("bias", "friction")
    assert unknown_of(found["bias as stated"]) == ("friction",)
    assert found["friction as stated"].experiment.unknowns.friction == 0.0
    assert found["lever inferred"].kind == "added"
    assert found["family circle"].experiment.own_family == Family("circle")
    assert "family parabola" not in found
    assert "base inferred" not in found  # there is one pivot
    assert "base inferred" in names_of(bases=TWO_PIVOTS)
    assert "friction inferred" in names_of()
    assert "friction inferred" in names_of(rig=Rig(unknown=only(friction=0.2)))  # what is known may be wrong
    said = names_of(rig=Rig(unknown=only("bias", lever=0.1, force_y_bias=0.2)))
    assert {"lever inferred", "bias as stated", "force_y_bias inferred"} < set(said)
    assert not {"lever_x inferred", "bias inferred", "moment_bias inferred"} & set(said)
    # Gains take the place of the rigidity, which has the same effect.
    gains = names_of("rigidity_scale")["gain inferred for rigidity_scale"]
    assert unknown_of(gains) == ("moment_gain", "force_x_gain", "force_y_gain")


@pytest.mark.parametrize(("lag", "other"), [("lag", "lag_seconds"), ("lag_seconds", "lag")])
def test_a_lag_is_tried_in_seconds_where_the_record_has_times_and_by_channel_on_demand(lag, other):
    record = swept(Parabola(0.5, 0.5), step=0.1)
    if lag == "lag_seconds":
        record["time_s"] = ("sample", 0.1 * np.arange(record.sizes["sample"]))
    experiment = Experiment(record, Rig(unknown=only("friction")))
    names = {each.name for each in alternatives_of(experiment)}
    assert {f"{lag} inferred", "play inferred"} < names
    assert not any(other in name.split() or "_lag" in name or "_play" in name for name in names)
    found = alternatives_by_channel(experiment, names)
    assert [each.name for each in found] == [f"{name} inferred" for what in (lag, "play") for name in MEMORY[what]]
    assert alternatives_by_channel(experiment, ["friction inferred"]) == []
    experiment = Experiment(record, Rig(unknown=only(f"moment_{lag}")))
    assert not any("lag" in each.name for each in alternatives_of(experiment) if each.kind == "added")


def test_a_lag_as_stated_is_that_of_each_channel():
    cell = LoadCell(force_noise=0.05, moment_noise=0.02, lag=(0.1, 0.2, 0.3))
    found = names_of(rig=Rig(load_cell=cell, unknown=only("lag")))["lag as stated"].experiment
    assert found.unknowns.names == () == tuple(found.unknowns.known)
    assert [found.unknowns.sensor[name] for name in MEMORY["lag"]] == [0.1, 0.2, 0.3]


def test_what_is_fixed_has_the_value_that_rod_and_load_cell_state():
    unknown = only("rest_curvature", "stem", "moment_curve", "base")
    found = names_of(rig=Rig(Rod(rest_curvature=0.1, stem=0.02), unknown=unknown), bases=TWO_PIVOTS)
    every = set(unknown_of(found["family circle"]))
    parameters = {"rest_curvature": {"rest_curvature"}, "stem": {"stem"}, "base": {"base_2_x", "base_2_y"}}
    for group, names in parameters.items():
        fixed = found[f"{group} as stated"].experiment
        assert set(fixed.unknowns.names) == every - names
        assert fixed.unknowns.known == {}  # none deviates from what is stated


def test_a_discrepancy_stays_in_every_alternative():
    found = names_of("bias", "discrepancy")
    for name in ("bias as stated", "lever inferred", "family circle"):
        assert found[name].experiment.noise.of_discrepancy == ("discrepancy_scale", "discrepancy_length"), name


def test_a_calibrated_rig_does_not_add_what_is_fixed():
    priors = {"rigidity_scale": stats.lognorm(s=0.01), "lever_x": stats.norm(0.0, 0.01)}
    joint = RigPrior(priors, np.array([[1.0, 0.8], [0.8, 1.0]]), 0.1, "0")
    known = {name: value for name, value in expanded(NOTHING).items() if name not in priors}
    found = names_of(rig=Rig(unknown=known, calibration=joint))
    assert unknown_of(found["rigidity_scale as stated"]) == ("lever_x",)
    assert unknown_of(found["lever as stated"]) == ("rigidity_scale",)
    added = found["backlash inferred"].experiment.unknowns
    assert set(added.names) == {"rigidity_scale", "lever_x", "backlash"}
    assert added.joint is not None
    assert set(unknown_of(found["family circle"])) == set(priors)
    gains = unknown_of(found["gain inferred for rigidity_scale"])
    assert set(gains) == {"lever_x", "moment_gain", "force_x_gain", "force_y_gain"}


def test_priors_of_what_remains_are_kept():
    of_q, of_friction = stats.uniform(0.4, 0.2), stats.halfnorm(scale=0.1)
    found = names_of(rig=Rig(unknown=only(friction=of_friction)), family=Family("parabola", q=of_q))
    fixed, circle = (found[name].experiment.priors for name in ("friction as stated", "family circle"))
    assert fixed["q"] is of_q
    assert "friction" not in fixed
    assert circle["friction"] is of_friction
    assert circle["q"] is not of_q


@pytest.mark.slow
def test_bands_are_compared_and_errors_are_outcomes(monkeypatch, tmp_path):
    several = {each.name: each for each in alternatives_of(experiment_of(posterior()))}
    chosen = [several["bias inferred"], several["family circle"]]
    x = np.linspace(-0.5, 0.5, 5)
    found = band_by_assumption(posterior(), chosen, x, seed=1, out=tmp_path, workers=1)
    assert found["kind"].values.tolist() == ["added", "family"]
    assert found["fits"].values.tolist() == [1, 0]
    assert float(np.abs(found["moved"].isel(assumption=0)).max()) < 0.5
    assert float(np.abs(found["moved"].isel(assumption=1)).max()) > 0.5
    monkeypatch.setattr(module, "sampled", lambda *given, **options: pytest.fail("it must resume"))
    assert band_by_assumption(posterior(), chosen, x, seed=1, out=tmp_path, workers=1).equals(found)


@pytest.mark.slow
def test_an_alternative_without_a_posterior_is_named(monkeypatch):
    def fail(*given, **options):
        raise InferenceError("no contour")

    monkeypatch.setattr(module, "sampled", fail)
    alternatives = alternatives_of(experiment_of(posterior()))
    found = band_by_assumption(posterior(), alternatives, np.zeros(2), seed=1, workers=1)
    assert set(found["message"].values) == {"InferenceError: no contour"}
    assert not found["fits"].any()
    assert np.isnan(found["moved"]).all()
