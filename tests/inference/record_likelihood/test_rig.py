"""A rig inferred on a gauge, and its posterior as prior: against the truth and other priors, and what is refused."""

import json
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
import xarray as xr
from scipy import stats

from helpers.contour_posteriors import CELL, QUICK, SOUND, assert_near, only, swept, without
from helpers.refusals import refused
from tactile_bayes import LoadCell, Rig, Stream, calibrate_rig, contour_band, infer_contour
from tactile_bayes.contours import Circle, Parabola, from_function
from tactile_bayes.errors import InferenceError, ParameterError
from tactile_bayes.inference.experiment import Experiment, experiment_of
from tactile_bayes.inference.family import Gauge
from tactile_bayes.inference.parameters.priors import rig_prior
from tactile_bayes.rig.parameters import GROUPS
from tactile_bayes.rig.rig_prior import RigPrior
from tactile_bayes.rig.unknown import expanded

PIN, OBJECT = Circle(r=0.2, q=0.5), Parabola(0.7, 0.45)
UNKNOWN = only("rigidity_scale", "drive_angle_offset", "lever")
TRUE = {"rigidity_scale": 1.04, "drive_angle_offset": 0.01, "lever_x": 0.004, "lever_y": -0.003}
NAMES = tuple(TRUE)


def read(contour, seed, **options):
    """A record with the true rig, whose header states an ideal one."""
    lever = TRUE["lever_x"], TRUE["lever_y"]
    gain = tuple(map(tuple, TRUE["rigidity_scale"] * np.eye(3)))
    cell = replace(CELL, drive_angle_offset=TRUE["drive_angle_offset"], gain=gain, lever=lever)
    return read_by(cell, contour, seed, **options)


def read_by(cell, contour, seed, **options):
    """A record whose header does not state the load cell."""
    record = cell.measure(swept(contour, step=0.05, **options), rng=seed)
    record.attrs = {name: v for name, v in record.attrs.items() if not name.startswith("load_cell_")}
    return record


def read_from(*pivots):
    """Sweeps of a record of the pin from some of its pivots."""
    record = read(PIN, 1, bases=((0.0, 0.0), (0.1, 0.15)))
    return record.isel(sample=np.isin(record.sweep.values // 2, pivots))


def calibrated_on(record, rig):
    return calibrate_rig(record, contour=PIN, rig=rig, rng=1, settings=SOUND)


STATED = Rig(load_cell=CELL, unknown=UNKNOWN)


@cache
def rig_from(*pivots):
    return calibrated_on(read_from(*pivots), STATED)


def rig():
    return rig_from(0)


@cache
def rig_of_two():
    """The rig from two records, one after the other."""
    return calibrated_on(read_from(1), rig())


@cache
def found(which):
    given = {"rig": rig, "default": lambda: STATED, "truth": lambda: Rig(load_cell=CELL, unknown=only(**TRUE))}
    return infer_contour(read(OBJECT, 2), rig=given[which](), rng=1, settings=SOUND)


def drawn(priors=("rigidity_scale", "lever_x"), **attrs):
    """A posterior of a rig, as of `calibrate_rig`, with correlated draws."""
    rng = np.random.default_rng(1)
    scores = rng.standard_normal((20_000, len(priors)))
    folded = np.abs(0.03 * rng.standard_normal(len(scores)))
    scores[:, -1] = 0.8 * scores[:, 0] + 0.6 * scores[:, -1]
    values = {"rigidity_scale": np.exp(0.01 * scores[:, 0]), "lever_x": 0.002 * scores[:, -1]}
    values |= {"suspension_compliance": folded, "taper": np.abs(0.03 * scores[:, -1])}
    draws = xr.Dataset({name: (("chain", "draw"), values[name][None]) for name in priors})
    tree = xr.DataTree.from_dict({"posterior": draws})
    stated = {"gauge": "", "converged": 1, "nuisances": json.dumps(list(priors)), "data_sha256": "0"}
    stated |= {"load_cell_frame": "fixed", "rod_length": 1.0, "rod_flexural_rigidity": 1.0, "rod_diameter": 0.0}
    stated |= {"units": "dimensionless", **attrs}
    tree.attrs = {name: value for name, value in stated.items() if value is not None}
    return tree


def calibrated(prior, **said):
    """A rig with a calibration, of which nothing else is unknown."""
    left = {name: value for name, value in expanded(only(**said)).items() if name not in prior.priors}
    return Rig(load_cell=CELL, unknown=left, calibration=prior)


def test_the_rig_is_found_with_its_gauge_and_what_lasts_of_it_is_calibrated():
    found = rig()
    tree = found.calibration.posterior
    assert_near(tree, TRUE)
    assert tree.attrs["gauge"] == repr(PIN)
    assert list(tree["posterior"].data_vars) == [*NAMES, "noise_scale"]
    assert set(found.calibration.priors) == set(NAMES)
    unlike = "backlash", "friction", "taper_error", *GROUPS["bias"], *GROUPS["rest_shape"]
    assert found.known == dict.fromkeys(unlike, 0.0)
    assert Experiment(read(OBJECT, 2), found).model.names == ("a", "q", "x_c", *NAMES, "noise_scale")


@pytest.mark.slow
def test_two_records_tell_as_much_as_one_of_both():
    """Of one pin, touched from two pivots. A mean of 400 effective draws scatters by 0.05 deviations, a deviation by 4
    %: limits are six times those of two posteriors, which leaves room for the error of the density."""
    for name in NAMES:
        both, one, first = (r.calibration.posterior["posterior"][name] for r in (rig_of_two(), rig_from(0, 1), rig()))
        assert abs(float(both.mean() - one.mean())) < 0.42 * float(one.std())
        assert float(both.std()) == pytest.approx(float(one.std()), rel=0.25)
        assert float(both.std()) < 0.9 * float(first.std())
    assert_near(rig_of_two().calibration.posterior, TRUE)


def test_a_record_counts_once():
    first, second = rig_of_two(), read_from(1)
    hashes = [each.calibration.posterior.attrs["data_sha256"] for each in (rig(), first)]
    assert first.calibration.source.split() == hashes
    assert first.calibration.error >= rig().calibration.error
    for record in (read_from(0), second):
        with refused(ParameterError, "twice"):
            calibrate_rig(record, contour=PIN, rig=first, rng=1, settings=QUICK)
    with refused(ParameterError, "twice"):
        infer_contour(second, rig=first, rng=1, settings=QUICK)


def test_the_gauge_predicts_as_its_family():
    """The same density as a family's at the gauge's parameters, up to the prior of these."""
    record = read(PIN, 1)
    known = Experiment(record, STATED, gauge=Gauge(PIN)).model
    free = Experiment(record, STATED, "circle").model
    points = np.array([[*TRUE.values(), 1.0], [1.0, 0.0, 0.0, 0.0, 1.2]])
    contour = np.tile([0.2, 0.5, 0.0], (2, 1))
    expected = free.log_likelihood(np.hstack([contour, points]))
    np.testing.assert_allclose(known.log_likelihood(points), expected, rtol=1e-12)


@pytest.mark.slow
def test_a_band_with_the_rig_lies_between_those_of_no_and_of_full_knowledge():
    x = np.linspace(-0.3, 0.3, 7)
    bands = [contour_band(found(which), x, 0.9) for which in ("truth", "rig", "default")]
    widths = [float((band.upper - band.lower).mean()) for band in bands]
    assert 1.05 * widths[0] < widths[1] < widths[2] / 1.3
    assert_near(found("rig"), {"a": 0.7, "q": 0.45, "x_c": 0.0, **TRUE})


def test_the_density_is_that_of_a_multivariate_normal():
    """Of log-normal and normal parameters: the fit of moments is the likeliest normal of (log x, y)."""
    tree = drawn()
    prior = rig_prior(tree)
    draws = np.stack([tree["posterior"][name].values[0] for name in prior.priors], axis=1)
    flat = np.column_stack([np.log(draws[:, 0]), draws[:, 1]])
    expected = stats.multivariate_normal(flat.mean(axis=0), np.cov(flat.T, bias=True)).logpdf(flat) - flat[:, 0]
    marginals = sum(p.logpdf(x) for p, x in zip(prior.priors.values(), draws.T, strict=True))
    np.testing.assert_allclose(marginals + prior.log_dependence(draws), expected, rtol=1e-6, atol=1e-6)
    assert prior.error < 0.05  # sampling error of a 5 % quantile of 20,000 draws: 0.015


def test_a_parameter_that_may_vanish_has_a_density_at_zero():
    prior = rig_prior(drawn(("rigidity_scale", "suspension_compliance")))
    assert prior.priors["suspension_compliance"].cdf(0.03) == pytest.approx(0.683, abs=0.03)
    assert prior.error < 0.15


def test_the_error_shows_a_dependence_that_is_not_normal():
    """A folded normal parameter, dependent on another but uncorrelated with it."""
    assert rig_prior(drawn(("rigidity_scale", "taper"))).error > 0.2


def test_independent_parameters_are_as_priors_given_by_hand():
    """Without correlations the log-prior is the sum of marginals."""
    prior = rig_prior(drawn())
    alone = RigPrior(prior.priors, np.eye(2), 0.0, "0")
    record = read(OBJECT, 2)
    joint = Experiment(record, calibrated(alone)).model
    by_hand = Experiment(record, Rig(load_cell=CELL, unknown=only(**prior.priors))).model
    assert joint.names == by_hand.names
    points = by_hand.draw_prior(np.random.default_rng(1), 50)[0]
    np.testing.assert_allclose(joint.log_prior(points), by_hand.log_prior(points), rtol=1e-12)


def test_draws_from_the_prior_have_the_correlations():
    model = Experiment(read(OBJECT, 2), calibrated(rig_prior(drawn()))).model
    points = model.draw_prior(np.random.default_rng(1), 2000)[0]
    i, j = model.names.index("rigidity_scale"), model.names.index("lever_x")
    assert np.corrcoef(points[:, i], points[:, j])[0, 1] == pytest.approx(0.8, abs=0.05)


@pytest.mark.slow
def test_a_stored_posterior_has_the_same_prior():
    tree = infer_contour(read(OBJECT, 2), rig=rig(), rng=1, settings=QUICK)
    model = experiment_of(tree).model
    points = np.array([[0.7, 0.45, 0.0, *TRUE.values(), 1.0]])
    given = Experiment(read(OBJECT, 2), rig()).model
    np.testing.assert_allclose(model.log_prior(points), given.log_prior(points), rtol=1e-12)


def test_what_a_record_does_not_show_is_left_out_and_what_it_cannot_tell_is_kept():
    record = read(OBJECT, 2)
    record["holding_moment"] = record.holding_moment * np.nan
    model = Experiment(record, calibrated(rig_prior(drawn()))).model
    assert "rigidity_scale" in model.names
    assert "lever_x" not in model.names
    forward = read(OBJECT, 2).isel(sample=read(OBJECT, 2).direction.values == "forward")
    backlash = RigPrior({"backlash": stats.norm(0.0, 0.002)}, np.eye(1), 0.0, "0")
    assert "backlash" in Experiment(forward, calibrated(backlash)).model.names


@pytest.mark.parametrize(
    ("attrs", "kind", "named"),
    [
        ({"gauge": None}, InferenceError, "calibrate_rig"),
        ({"converged": 0}, InferenceError, "converged"),
        ({"nuisances": '["friction"]'}, InferenceError, "lasts"),
        ({"units": "SI"}, ParameterError, "units"),
        ({"rod_length": 0.1}, ParameterError, "rod_length"),
        ({"load_cell_drive_angle_offset": 0.1}, ParameterError, "load_cell_drive_angle_offset"),
    ],
)
def test_other_posteriors_are_refused(attrs, kind, named):
    with refused(kind, named):
        Experiment(read(OBJECT, 2), calibrated(rig_prior(drawn(**attrs)))).model  # noqa: B018


def test_a_prior_of_what_is_calibrated_is_refused():
    with refused(ParameterError, "lever_x"):
        Rig(unknown={"lever_x": stats.norm(0.0, 0.1)}, calibration=rig_prior(drawn()))


FUNCTION = from_function(lambda x: 0.5 + x * x, (-1.0, 1.0))


@pytest.mark.parametrize(
    ("contour", "unknown", "named"),
    [
        ("circle", {}, "contour"),
        (Circle(r=[0.2, 0.3], q=0.5), {}, "contour"),
        (FUNCTION, {}, "contour"),
        (PIN, "nothing", "nothing of the rig is unknown"),
    ],
)
def test_other_gauges_are_refused(contour, unknown, named):
    with refused(ParameterError, named):
        calibrate_rig(read(PIN, 1), contour=contour, rig=Rig(unknown=unknown), rng=1)


def in_counts(gain, **options):
    return LoadCell(moment_noise=5.0, gain=((gain, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)), **options)


@pytest.mark.slow
def test_a_sensor_in_counts_is_calibrated_on_a_gauge_whose_place_is_uncertain():
    """From the moment alone, whose reading is a curve; the object is then inferred with it."""
    sensor = {"moment_gain": 1.1, "moment_curve_quadratic": 0.06, "moment_curve_cubic": 0.03}
    real = in_counts(900.0 * 1.1, moment_curve=(0.06, 0.03))
    pin, object_ = (
        without(read_by(real, contour, seed), "force_x", "force_y")
        for contour, seed in ((Circle(r=0.2, q=0.5 - 0.006, x_c=0.01), 1), (OBJECT, 2))
    )
    unknown = only("gauge", "moment_curve", "moment_bias", moment_gain=stats.lognorm(s=0.3))
    found = calibrated_on(pin, Rig(load_cell=in_counts(900.0), unknown=unknown))
    assert_near(found.calibration.posterior, {**sensor, "gauge_x": 0.01, "gauge_y": -0.006})
    assert set(found.calibration.priors) == set(sensor)
    posterior = infer_contour(object_, rig=found, rng=1, settings=SOUND)
    assert_near(posterior, {"a": 0.7, "q": 0.45, **sensor})
    assert not {"gauge_x", "gauge_y"} & set(posterior["posterior"].data_vars)


@pytest.mark.slow
def test_a_stream_takes_it_as_prior(tmp_path):
    """Its posterior is that of the whole record, within their Monte-Carlo errors: a quarter of a deviation."""
    record, known = read(OBJECT, 2), {"rng": 1, "rig": rig()}
    stream = Stream(**known, particles=500)
    for block in np.array_split(np.arange(record.sizes["sample"]), 3):
        stream.update(record.isel(sample=block))
    found = stream.posterior()
    whole = infer_contour(record, **known, settings=QUICK)
    assert found.attrs["rig_density_error"] == whole.attrs["rig_density_error"]
    assert list(found["posterior"].data_vars) == list(whole["posterior"].data_vars)
    for name, draws in whole["posterior"].data_vars.items():
        assert abs(float(found["posterior"][name].median() - draws.median())) < 0.5 * float(draws.std()), name
    stream.save(tmp_path / "stream.nc")
    Stream.resume(tmp_path / "stream.nc", **known, particles=500)
    with refused(InferenceError, "rig_parameters"):
        Stream.resume(tmp_path / "stream.nc", **{**known, "rig": Rig(load_cell=CELL, unknown="nothing")}, particles=500)
    with refused(ParameterError, "inferred from this very record"):
        Stream(**known).update(read_from(0))
