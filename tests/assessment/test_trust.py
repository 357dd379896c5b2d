"""Trust in a posterior and what it rests on: parts of the record, prior, sampling, and their linear fits."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
import xarray as xr
from scipy import stats

import tactile_bayes as tb
from helpers.contour_posteriors import CELL, SOUND, TRUTH, infer_as_stated, measured, posterior, swept
from helpers.refusals import refused
from tactile_bayes import Family, Rig, infer_contour, trust, write_result
from tactile_bayes.assessment import posterior_calibration as module
from tactile_bayes.assessment.posterior_calibration import JointModel, posterior_calibration
from tactile_bayes.assessment.prior_sensitivity import prior_sensitivity
from tactile_bayes.assessment.sampling_error import sampling_error
from tactile_bayes.assessment.split_prediction import LinearFit, Linearisation, parts_of, split_prediction
from tactile_bayes.assessment.trust import _corrected, draws_digest
from tactile_bayes.contours import Parabola
from tactile_bayes.errors import CalibrationError, InferenceError, ParameterError
from tactile_bayes.inference.experiment import Experiment, experiment_of, points_of
from tactile_bayes.load_cell import RandomWalk
from tactile_bayes.rig import NOTHING


@cache
def right():
    return trust(posterior(), rng=1, replicates=0, assumptions=False)


def test_a_record_of_the_model_holds_and_says_so():
    found = right()
    assert found.attrs["conclusion"] == "holds"
    assert found.attrs["summary"].startswith("The band of probability 0.95 holds")
    words = found.attrs["words"].splitlines()
    assert f" agree (p = {float(found.split_p_value):.2g}" in words[0]
    assert found.set_by.sel(quantity=["band in_gap", "band beside"]).values.tolist() == ["record", "record"]
    assert [line.rpartition(" by ")[2] for line in words[1:3]] == ["the record."] * 2
    assert "% of its width (" in words[-1]
    assert found.attrs["draws_sha256"] == draws_digest(posterior())
    np.testing.assert_allclose(found["lower"], tb.contour_band(posterior(), found.x.values)["lower"])


def test_a_posterior_that_has_not_converged_is_judged_without_replicates_and_assumptions(monkeypatch, tmp_path):
    for name in ("posterior_calibration", "band_by_assumption"):
        monkeypatch.setattr(f"tactile_bayes.assessment.trust.{name}", None)
    found = trust(with_attrs(converged=0), rng=1, out=tmp_path)
    assert found.attrs["conclusion"] == "do not rely on it"
    assert "the ensembles have not converged" in found.attrs["summary"]
    assert "left out" in found.attrs["words"].splitlines()[-1]
    assert found.attrs["replicates"] == 0
    assert not {"assumption", "claim"} & set(found.dims)


@pytest.mark.slow
def test_a_wrong_family_is_not_to_be_relied_on():
    record = CELL.measure(swept(tb.contours.paper_profile("III", q=0.5)), rng=2)
    tree = infer_as_stated(record, load_cell=CELL, rng=1, settings=SOUND)
    found = trust(tree, rng=1, replicates=0, assumptions=False)
    assert found.attrs["conclusion"] == "do not rely on it"
    assert f"(p = {float(found.split_p_value):.2g} for all parts)" in found.attrs["summary"]


@pytest.mark.slow
def test_a_narrow_prior_of_the_vertex_sets_the_gap():
    deviation = float(posterior()["posterior"]["q"].std())
    family = tb.Family("parabola", q=stats.norm(0.5, 0.2 * deviation))
    tree = infer_as_stated(measured(), load_cell=CELL, family=family, rng=1, settings=SOUND)
    found = trust(tree, rng=1, replicates=0, assumptions=False)
    assert found.attrs["conclusion"] == "holds, but the prior sets the gap"
    assert found.set_by.sel(quantity="band in_gap") == "prior"
    (line,) = [line for line in found.attrs["words"].splitlines() if line.startswith("The band in")]
    assert line.endswith("of the contour.")
    (said,) = [message for message in tb.check(tree, trust=found).messages if message.kind == "reservation"]
    assert said.details == {"summary": found.attrs["summary"]}
    assert "0.95 holds beside" in said


@pytest.mark.slow
def test_replicates_give_ranks_coverage_and_factors():
    found = trust(posterior(), rng=1, replicates=2, assumptions=False, workers=1)
    assert found.attrs["calibration"] == "too few"
    assert {"rank_p_value", "coverage", "factor", "corrected"} <= set(found.data_vars)
    assert "corrected_lower" not in found


def test_the_check_uses_it():
    found = right()
    assert tb.check(posterior(), trust=found).messages == tb.check(posterior()).messages
    against = found.assign_attrs(conclusion="do not rely on it", summary="Because of this.")
    first, *_ = tb.check(posterior(), trust=against).messages
    assert (first.kind, first.details) == ("not reliable", {"summary": "Because of this."})


def test_a_band_is_corrected_about_its_median_where_it_is_too_narrow():
    x = np.linspace(-1.0, 1.0, 5)
    band = {name: ("x", np.full(5, value)) for name, value in (("lower", -1.0), ("median", 0.0), ("upper", 2.0))}
    regions = {"factor": ("region", [1.5, 3.0]), "corrected": ("region", [1, 0])}
    found = xr.Dataset({**band, **regions}, coords={"x": x, "region": ["in_gap", "beside"]})
    regions = {"in_gap": np.array([-0.6, 0.6])}
    wider = _corrected(found, regions)
    assert wider["corrected_lower"].values.tolist() == [-1.0, -1.5, -1.5, -1.5, -1.0]
    assert wider["corrected_upper"].values.tolist() == [2.0, 3.0, 3.0, 3.0, 2.0]
    assert _corrected(found.assign(corrected=("region", [0, 0])), regions) == {}


@pytest.mark.slow
def test_a_run_and_its_file_are_taken(tmp_path):
    write_result(posterior(), tmp_path / "posterior.nc")
    assert trust(tmp_path, rng=1, replicates=0, assumptions=False).equals(right())


def with_attrs(**attrs):
    tree = posterior().copy()
    tree.attrs = {**tree.attrs, **attrs}
    return tree


def of_few_loaded_samples():
    tree = posterior().copy()
    events = tree["events"].to_dataset()
    tree["events"] = xr.DataTree(events.assign(snap_off_drive_angle=events["first_drive_angle"]))
    return tree


@pytest.mark.parametrize(
    ("run", "options", "error", "named"),
    [
        (lambda: "no such folder", {}, InferenceError, "no such folder"),
        (lambda: 3, {}, ParameterError, "run_or_posterior is 3"),
        (posterior, {"replicates": -1}, ParameterError, "replicates"),
        (lambda: with_attrs(events=0), {}, InferenceError, "events=False"),
        pytest.param(of_few_loaded_samples, {}, InferenceError, "too few to judge", marks=pytest.mark.slow),
    ],
)
def test_what_cannot_be_judged_is_refused(run, options, error, named):
    with pytest.raises(error, match=named):
        trust(run(), rng=1, **({"replicates": 0, "assumptions": False} | options))


@pytest.mark.slow
def test_a_distribution_that_is_none_of_scipys_has_to_be_given_again():
    """A histogram of q: the posterior states that it was one, and not its numbers."""
    heights = stats.rv_histogram(np.histogram(np.linspace(0.3, 0.7, 50), bins=5), density=True)()
    family = tb.Family("parabola", q=heights)
    tree = infer_as_stated(measured(), load_cell=CELL, family=family, rng=1, settings=SOUND)
    with pytest.raises(ParameterError, match="does not state its family"):
        trust(tree, rng=1, replicates=0, assumptions=False)
    assert trust(tree, rng=1, family=family, replicates=0, assumptions=False).attrs["conclusion"] == "holds"


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


def flat(q, x_c=0.0, family="parabola"):
    values = {"a": np.full_like(q, 0.5), "q": q, "x_c": np.full_like(q, x_c)}
    tree = xr.DataTree.from_dict({"posterior": xr.Dataset({k: (("chain", "draw"), v) for k, v in values.items()})})
    tree.attrs = {"family": family, "units": "dimensionless"}
    return tree


def test_error_of_independent_normal_draws_is_that_of_order_statistics():
    """The standard error of a quantile is √(p(1 − p)/n)/density; an estimate scatters by a fifth, their mean by 4 %."""
    rng = np.random.default_rng(3)
    found = [sampling_error(flat(rng.normal(size=(4, 1000))), [0.0], 0.9) for _ in range(30)]
    level = stats.norm.ppf(0.05)
    exact = np.sqrt(0.05 * 0.95 / 4000) / stats.norm.pdf(level)
    assert np.mean([float(each.lower_error[0]) for each in found]) == pytest.approx(exact, rel=0.16)
    assert np.mean([float(each.upper_error[0]) for each in found]) == pytest.approx(exact, rel=0.16)
    larger = [float(max(each.lower_error[0], each.upper_error[0])) / (-2.0 * level) for each in found]
    assert [float(each.share[0]) for each in found] == pytest.approx(larger, rel=0.1)  # the band's width to some 2 %


def test_walkers_that_repeat_themselves_need_more_draws():
    rng = np.random.default_rng(4)
    independent = rng.normal(size=(4, 1000))
    repeated = np.repeat(rng.normal(size=(4, 50)), 20, axis=1)
    few, many = (sampling_error(flat(q), [0.0]) for q in (repeated, independent))
    assert float(few.share[0]) > 2.0 * float(many.share[0])  # √20 on the mean, each to a quarter
    assert int(few.draws_needed) > 4 * int(many.draws_needed)
    assert float(few.effective_draws) < 0.3 * float(many.effective_draws)


def test_draws_needed_follow_from_the_square_of_the_share():
    found = sampling_error(flat(np.random.default_rng(5).normal(size=(2, 30))), [0.0])
    assert int(found.draws_needed) == int(np.ceil(60 * (float(found.share.max()) / 0.1) ** 2))


def test_where_contours_end_there_is_no_error():
    r = np.random.default_rng(6).uniform(0.5, 0.6, (4, 50))
    tree = flat(np.full_like(r, 0.3))
    tree["posterior"] = tree["posterior"].to_dataset().rename(a="r").assign(r=(("chain", "draw"), r))
    tree.attrs["family"] = "circle"
    found = sampling_error(tree, [0.0, 0.55])
    assert np.isfinite(found.lower_error[0])
    assert np.isnan(found.lower_error[1])
    with pytest.raises(InferenceError, match="no grid point"):
        sampling_error(tree, [2.0])


def found_of(tree):
    return split_prediction(tree, experiment_of(tree).model)


def test_parts_of_a_record_of_the_model_agree():
    found = found_of(posterior())
    assert found.attrs["passed"] == 1  # a false alarm has a probability of 1 %; the seed is fixed
    assert found["part"].values.tolist() == ["sweep 1", "sweep 2", "earlier half", "later half", "noise"]
    assert (np.abs(found["moves"].values[:-1]) < 4.0).all()


@pytest.mark.slow
def test_friction_shows_as_a_disagreement_of_early_and_late_contacts():
    record = CELL.measure(swept(Parabola(0.5, 0.5), friction=0.007), rng=3)
    found = found_of(infer_as_stated(record, load_cell=CELL, rng=1, settings=SOUND))
    assert found.attrs["passed"] == 0
    assert float(found["sd"].sel(part="earlier half")) > 5.0


@pytest.mark.slow
def test_a_zero_that_moves_between_sweeps_shows_though_zeros_are_not_inferred():
    record = measured().copy(deep=True)
    course = np.linspace(-1.0, 1.0, record.sizes["sample"])
    record["force_x"] = record.force_x + xr.DataArray(0.05 * course, dims="sample")
    assert found_of(infer_as_stated(record, load_cell=CELL, rng=1, settings=SOUND)).attrs["passed"] == 0


@pytest.mark.slow
def test_noise_that_is_known_and_larger_than_stated_shows():
    louder = type(CELL)(force_noise=1.25 * CELL.force_noise, moment_noise=1.25 * CELL.moment_noise)
    record = louder.measure(swept(Parabola(0.5, 0.5)), rng=4)
    rig = Rig(load_cell=CELL, unknown={**NOTHING, "noise_scale": 1.0})
    found = found_of(infer_contour(record, rig=rig, rng=1, settings=SOUND))
    assert found.attrs["passed"] == 0
    assert float(found["sd"].sel(part="noise")) > 4.0


def test_parts_are_sweeps_pivots_and_halves():
    record = swept(Parabola(0.5, 0.5), bases=((0.0, 0.0), (0.2, 0.0)), step=0.1)
    rig = Rig(load_cell=CELL, unknown="nothing")
    parts = parts_of(Experiment(record, rig=rig).model)
    sweeps = [f"sweep {number}" for number in (1, 2, 3, 4)]
    assert list(parts) == [*sweeps, "pivot 1", "pivot 2", "earlier half", "later half"]
    assert (parts["pivot 1"] == (record.base_x.values == 0.0)).all()
    assert (parts["earlier half"] == ~parts["later half"]).all()
    one = record.isel(sample=record.sweep.values == record.sweep.values[0])
    assert list(parts_of(Experiment(one, rig=rig).model)) == ["earlier half", "later half"]


def test_too_few_predictions_are_refused():
    tree = posterior().copy()
    tree["posterior_predictive"] = tree["posterior_predictive"].to_dataset().isel(draw=slice(0, 10))
    with refused(InferenceError, "20 predictions"):
        found_of(tree)


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
