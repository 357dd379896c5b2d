"""A discrepancy beside a contour: its size, its likelihood against dense covariances, posteriors with it, refusals."""

import json
from dataclasses import replace

import numpy as np
import pytest
import xarray as xr
from scipy import stats

from helpers.contour_posteriors import BRIEF, CELL, MODEST, TRUTH, infer_as_stated, only, swept
from helpers.refusals import refused
from tactile_bayes import (
    Family,
    LoadCell,
    Rig,
    Rotation,
    Translation,
    calibrate,
    check,
    contour_band,
    infer_contour,
    scan,
)
from tactile_bayes.calibration.calibrate import experiment_of
from tactile_bayes.calibration.simulation import simulate
from tactile_bayes.contours import Circle, Parabola
from tactile_bayes.diagnostics.predictive_check import predictive_check
from tactile_bayes.errors import ParameterError
from tactile_bayes.inference.experiment import Experiment
from tactile_bayes.load_cell import RandomWalk
from tactile_bayes.record import CHANNELS
from tactile_bayes.rig import NOTHING
from tactile_bayes.rig.parameters import GROUPS

SMOOTH = ("discrepancy",)
CONTOUR = Parabola(TRUTH["a"], TRUTH["q"], TRUTH["x_c"])


def measured(cell=CELL, seed=1, **options):
    return cell.measure(swept(CONTOUR, **options), rng=seed)


def disturbed(size, seed=1, cell=CELL):
    """Readings with smooth deviations of a share of the largest load in contact, as of no parabola."""
    ideal = swept(CONTOUR)
    angle = ideal.drive_angle.values
    shapes = (np.sin(7.0 * angle), np.cos(9.0 * angle), np.sin(5.0 * angle + 1.0))
    for name, shape in zip(CHANNELS, shapes, strict=True):
        values = ideal[name].values
        ideal[name].values = values + size * np.abs(values).max() * shape * (values != 0.0)
    return cell.measure(ideal, rng=seed)


def model_of(record, unknowns=SMOOTH, cell=CELL, family="parabola"):
    return Experiment(record, Rig(load_cell=cell, unknown=only(*unknowns)), family).model


def points_of(model, **values):
    every = {**TRUTH, "noise_scale": 1.1, "discrepancy_scale": 0.01, "discrepancy_length": 0.3, **values}
    return np.array([[every[name] for name in model.names]])


def test_it_is_asked_for_by_name_or_by_a_prior_beside_all_that_is_standard():
    record, own = measured(), stats.halfnorm(scale=0.02)
    usual = Experiment(record, Rig(load_cell=CELL)).model.names
    assert not set(GROUPS["discrepancy"]) & set(usual)
    for asked in (["discrepancy"], ["discrepancy_scale"], list(GROUPS["discrepancy"])):
        given = Experiment(
            record, Rig(load_cell=CELL, unknown=dict.fromkeys(asked, "default") | {"discrepancy_scale": own})
        )
        assert given.model.names == (*usual, *GROUPS["discrepancy"])
        assert given.priors["discrepancy_scale"] is own
        assert model_of(record, asked).names[-2:] == GROUPS["discrepancy"]
    assert json.loads(given.about["nuisances"])[-2:] == list(GROUPS["discrepancy"])
    without_noise = model_of(swept(CONTOUR), cell=None)
    assert without_noise.names[-4:] == ("moment_noise", "force_noise", *GROUPS["discrepancy"])


@pytest.mark.parametrize("frame", ["fixed", "turning"])
def test_the_likelihood_is_dense(frame):
    """Readings of a sweep in each direction from two pivots."""
    record = measured(replace(CELL, frame=frame), bases=((0.0, 0.0), (0.2, 0.0)), step=0.1)
    model = model_of(record)
    (point,) = points_of(model)
    loads = model.loads(point[None])[0]
    scale, length, n = 0.01, 0.3, record.sizes["sample"]
    sweep, angle = record.sweep.values, record.drive_angle.values
    a = np.sqrt(3.0) * np.abs(np.subtract.outer(angle, angle)) / length
    together = (1.0 + a) * np.exp(-a) * np.equal.outer(sweep, sweep)
    size = np.stack([np.abs(loads[:, 0]), *[np.hypot(loads[:, 1], loads[:, 2])] * 2], axis=1)
    largest = np.array([size[sweep == s].max(axis=0) for s in range(4)])[sweep] * (size > 0.0)
    expected = 0.0
    for c, noise in enumerate(1.1 * CELL.noise):
        covariance = np.outer(scale * largest[:, c], scale * largest[:, c]) * together + noise**2 * np.eye(n)
        expected += stats.multivariate_normal(loads[:, c], covariance).logpdf(model.likelihood.measured[:, c])
    assert model.log_likelihood(point[None])[0] == pytest.approx(expected, rel=1e-9)
    assert model.log_likelihood(point[None], pointwise=True).sum() == pytest.approx(expected, rel=1e-9)


def test_repeated_sweeps_have_it_in_common():
    """The likelihood of two equal sweeps depends on how much the second agrees with the first."""
    one = measured(step=0.1)
    again = one.assign(sweep=one.sweep + 2)
    both = xr.concat([one, again], "sample", combine_attrs="override")
    model = model_of(both)
    course = model.likelihood.segments.course
    assert np.count_nonzero(np.isinf(course.step)) == 2
    assert np.count_nonzero(course.step == 0.0) == one.sizes["sample"]
    drifting = replace(CELL, drift=RandomWalk(force=0.01))
    with refused(ParameterError, "repeated sweeps"):
        model_of(both, cell=drifting).log_likelihood(points_of(model))
    assert np.isfinite(model_of(one, cell=drifting).log_likelihood(points_of(model))).all()


def test_its_coordinate_is_the_travel_where_the_base_is_carried():
    drive = Translation(base=(0.8, 0.0), heading=np.pi, drive_angle=1.2, travel=1.6, drive_step=0.04)
    record = CELL.measure(scan(Circle(0.5, 0.5), drive=drive).record, rng=1)
    model = model_of(record, family="circle")
    course = model.likelihood.segments.course
    assert course.is_measured_order
    ways = np.hypot(np.diff(record.base_x.values), np.diff(record.base_y.values))
    np.testing.assert_allclose(course.step[1:], ways, rtol=1e-9)
    assert np.isfinite(model.log_likelihood(points_of(model, r=0.5))).all()


@pytest.mark.parametrize(
    ("flaw", "unknown", "named"),
    [
        ({"drive_angle_noise": 0.01}, only(*SMOOTH), ["drive_angle_resolution", "discrepancy"]),
        ({"degrees_of_freedom": 4.0}, only(*SMOOTH), ["outliers"]),
        ({"correlation": (0.5, 0.0, 0.0)}, only(*SMOOTH), ["correlated"]),
        ({}, {"discrepancy_scale": 0.01}, ["discrepancy_scale", "distribution"]),
        ({}, {"discrepancy": 0.01}, ["discrepancy_scale", "distribution"]),
    ],
)
def test_what_has_no_closed_form_is_refused(flaw, unknown, named):
    with refused(ParameterError, *named):
        infer_contour(measured(), rig=Rig(load_cell=replace(CELL, **flaw), unknown=unknown), rng=1, settings=BRIEF)


@pytest.mark.slow
def test_smooth_residuals_suggest_it_and_with_it_the_record_is_described():
    """With less noise, and a band that holds the contour at three of five places or more."""
    record = disturbed(0.02, cell=LoadCell(force_noise=0.01, moment_noise=0.004))
    x = np.linspace(-0.2, 0.2, 5)
    draw = {"rng": 1, "settings": MODEST}
    blind, smooth = (infer_as_stated(record, unknown=only(*asked), **draw) for asked in ((), SMOOTH))
    before, after = check(blind), check(smooth)
    assert not before.predictive.passed
    assert "smooth misfit" in [message.kind for message in before.messages]
    assert after.predictive.passed
    assert "smooth misfit" not in [message.kind for message in after.messages]
    assert json.loads(smooth.attrs["nuisances"]) == list(GROUPS["discrepancy"])
    scale, length = (smooth["posterior"][name] for name in GROUPS["discrepancy"])
    assert 0.005 < float(scale.median()) < 0.05
    assert (scale.attrs["units"], length.attrs["units"]) == ("1", "rad")
    band, height = contour_band(smooth, x), np.asarray(CONTOUR.height(x))
    assert np.mean((band.lower.values <= height) & (height <= band.upper.values)) >= 0.6
    assert float(smooth["posterior"].noise_scale.median()) < float(blind["posterior"].noise_scale.median())


@pytest.mark.slow
def test_a_good_record_suggests_nothing():
    found = predictive_check(infer_contour(measured(), rig=Rig(unknown="nothing"), rng=1, settings=MODEST))
    assert np.isnan(found.smooth).all()


@pytest.mark.slow
def test_simulated_readings_have_the_density_of_the_likelihood():
    """The mean of minus twice the quadratic form is the number of readings: 5 standard errors of 40 records."""
    family = Family("parabola", a=0.5, q=0.5, x_c=stats.norm(0.0, 1e-12))
    scales = {"noise_scale": 1.0, "discrepancy_scale": 0.03, "discrepancy_length": 0.3}
    unknown = NOTHING | {name: stats.lognorm(s=1e-9, scale=scale) for name, scale in scales.items()}
    drive = Rotation(drive_angles=np.radians(np.arange(-30.0, 211.0, 4.0)))
    experiment = experiment_of(family, Rig(load_cell=CELL, unknown=unknown), rng=1, drive=drive)
    squares = []
    for seed in range(40):
        made = simulate(experiment, np.random.default_rng(seed))
        model = model_of(made.measured)
        points = points_of(model, **scales)
        discrepancy = model.discrepancy_at(points[0])
        off = model.likelihood.measured - model.loads(points)[0]
        for c in range(3):
            covariance = discrepancy.covariance()[..., c] + CELL.noise[c] ** 2 * np.eye(len(off))
            squares.append(off[:, c] @ np.linalg.solve(covariance, off[:, c]))
    count = len(squares) * len(off)
    assert abs(np.sum(squares) - count) < 5.0 * np.sqrt(2.0 * count)


@pytest.mark.slow
@pytest.mark.parametrize("family", ["parabola", "circle"])
def test_posteriors_with_it_are_calibrated(family):
    rig = Rig(unknown={**NOTHING, "discrepancy": "default"})
    found = calibrate(family, rig, rng=1, replicates=50, workers=1)
    assert found.attrs["calibrated"] == 1, found.attrs["verdict"]


def test_it_is_in_the_unit_of_the_readings():
    """Of a cell that counts, a discrepancy of 1 % is one of counts."""
    record, gain = swept(Parabola(0.5, 0.5), step=0.1), 900.0 * np.eye(3)
    counting = LoadCell(force_noise=45.0, moment_noise=18.0, gain=tuple(map(tuple, gain)))
    counted = record.assign({name: record[name] * 900.0 for name in CHANNELS})
    models = [model_of(one, cell=cell) for one, cell in ((record, CELL), (counted, counting))]
    values = []
    for model in models:
        points = points_of(model, noise_scale=1.0, discrepancy_scale=0.03, discrepancy_length=0.3)
        values.append(model.log_likelihood(points)[0])
    np.testing.assert_allclose(values[1], values[0] - 3 * record.sizes["sample"] * np.log(900.0), rtol=1e-10)
