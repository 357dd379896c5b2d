"""Designs: what is expected of the next record, by two routes, and which is the best."""

from dataclasses import replace

import numpy as np
import pytest
import xarray as xr
from scipy import stats

import tactile_bayes as tb
from helpers.load_cells import CELL
from helpers.refusals import refused
from tactile_bayes.contours import Parabola
from tactile_bayes.errors import InferenceError, ParameterError, ReachError, StudyError
from tactile_bayes.planning.candidate import Candidate, Question, _band_widths, expected_of
from tactile_bayes.planning.design import Criterion, usual_drives
from tactile_bayes.planning.information import information
from tactile_bayes.planning.knowledge import known_from_posterior, known_from_prior
from tactile_bayes.planning.plan import Plan
from tactile_bayes.rig import NOTHING
from tactile_bayes.rig.rig_prior import RigPrior
from tactile_bayes.tasks import Workers

FAMILY = tb.Family("parabola", a=stats.lognorm(0.3, scale=0.6), q=stats.uniform(0.4, 0.2), x_c=stats.norm(0.0, 0.05))
AS_STATED = tb.Rig(unknown="nothing")
QUICK = tb.SamplerSettings(ensembles=2, walkers=26, max_r_hat=1.05, min_ess=200.0, max_steps=400)
STEP = float(np.radians(4.0))
TRANSLATION = tb.Translation((0.8, 0.0), np.pi, 1.2, 1.5)


def pivots(*bases, step=2.5 * STEP):
    return [tb.Rotation(base, drive_step=step) for base in bases]


def designed(known=FAMILY, **options):
    asked = {"drives": pivots((0.0, 0.0), (0.2, 0.0)), "draws": 3, "rng": 1}
    own = {} if isinstance(known, xr.DataTree) else {"rig": AS_STATED}
    return tb.design(known, **(asked | own | options))


@pytest.fixture(scope="module")
def measured():
    return CELL.measure(tb.scan(Parabola(0.5, q=0.5), drive_step=STEP).record, rng=1)


@pytest.fixture(scope="module")
def posterior(measured):
    return tb.infer_contour(measured, rig=tb.Rig(load_cell=CELL, unknown="nothing"), rng=1, settings=QUICK)


def test_with_one_truth_it_is_the_information_of_its_record():
    """The same bounds as of a plan, whose loads are exact; these are interpolated, and their differences rougher.

    A load cell of twice the noise leaves twice the band, where priors say little.
    """
    told = known_from_prior(AS_STATED, FAMILY, draws=3, rng=np.random.default_rng(1))
    x, candidates = np.linspace(-0.5, 0.5, 11), (Candidate((tb.Rotation(drive_step=STEP),)),)
    truths = [replace(told, points=np.array([[0.5, 0.5, 0.0, k]]), precision=1e-9 * np.eye(4)) for k in (1.0, 2.0)]
    found, noisier = (expected_of((Question(truth, candidates, x, 0.95, 0, 1), 0)) for truth in truths)
    angles = np.arange(np.radians(-30.0), np.radians(210.0), STEP)
    rig = tb.Rig(load_cell=told.experiment.rig.load_cell, unknown="nothing")
    bounds = information(Plan(Parabola(0.5, q=0.5), rig, drive=tb.Rotation(drive_angles=angles)))
    slopes = np.stack([x**2, np.ones_like(x), -x * 2.0 * 0.5], axis=1)  # of a (x − x_c)² + q
    # Bounds are those without priors, of four parameters of which the noise is independent.
    deviation = bounds.bound.values[:3]
    covariance = bounds.correlation.values[:3, :3] * np.outer(deviation, deviation)
    width = 2.0 * stats.norm.ppf(0.975) * np.sqrt(np.einsum("xi,ij,xj->x", slopes, covariance, slopes))
    assert found.width[0] == pytest.approx(width.mean(), rel=1e-3)
    assert found.reached == 1.0
    assert noisier.width[0] == pytest.approx(2.0 * found.width[0], rel=1e-6)


@pytest.mark.slow
def test_laplace_and_nested_monte_carlo_agree(posterior):
    """Within 4 standard errors of the nested means, and these within a fifth of the expected width."""
    found = designed(posterior, draws=12, nested=True)
    for name in ("width", "information"):
        off = np.abs(found[f"nested_{name}"].values - found[name].values)
        error = np.hypot(found[f"nested_{name}_error"].values, found[f"{name}_error"].values)
        assert np.all(off < 4.0 * error + 0.03 * np.abs(found[name].values)), name
    assert np.all(found.nested_width_error.values < 0.2 * found.width.values)
    assert np.all(found.nested_draws.values > 20.0)


@pytest.mark.slow
def test_from_the_same_pivot_the_gap_stays_and_from_beside_it_closes(posterior):
    found = designed(posterior, drives=pivots((0.0, 0.0), (0.3, 0.0)))
    forward, backward = (sweep.snap_off.contact_x for sweep in tb.scan(Parabola(0.5, q=0.5)).sweeps)
    assert found.gap.values[0] == pytest.approx(forward - backward, abs=0.02)
    assert found.gap.values[1] == pytest.approx(0.0, abs=1e-6)


@pytest.mark.parametrize(
    ("criterion", "name", "best"),
    [("band", "width", np.argmin), ("gap", "gap", np.argmin), ("information", "information", np.argmax)],
)
def test_the_best_is_the_best(posterior, criterion, name, best):
    found = designed(posterior, drives=pivots((0.0, 0.0), (0.1, 0.0), (0.3, 0.0)), criterion=criterion)
    assert int(found.best) == best(found[name].values)


def test_what_cannot_be_reached_tells_nothing(posterior):
    """The band stays as it is."""
    found = designed(posterior, drives=pivots((0.0, 0.0), (0.0, -2.0)))
    assert found.reached.values.tolist() == [1.0, 0.0]
    assert found.width.values[1] == pytest.approx(float(found.present_width), rel=1e-9)
    assert found.information.values[1] == pytest.approx(0.0, abs=1e-9)


@pytest.mark.slow
def test_the_seed_decides_and_not_the_workers():
    one = designed(workers=1)
    assert one.identical(designed(workers=2))
    assert not one.width.identical(designed(rng=2).width)


@pytest.mark.slow
def test_what_is_kept_is_not_made_again(tmp_path):
    steps, asked = [], {"drives": pivots((0.0, 0.0), (0.0, -2.0)), "draws": 2, "out": tmp_path}
    found = designed(**asked)
    by_gap = designed(criterion="gap", workers=Workers(1, steps.append), **asked)  # of the same numbers
    assert steps == []
    assert by_gap.width.identical(found.width)
    with refused(StudyError, "another experiment", "seed is 1 there and 2 here"):
        designed(**asked, rng=2)


CIRCLE, CARRIED = tb.contours.Circle(0.3, 0.8), tb.Translation((0.8, 0.0), np.pi, 1.1, 1.6)
BACK = tb.Translation((-0.8, 0.0), 0.0, np.pi - 1.1, 1.6)


@pytest.mark.slow
def test_drives_that_carry_the_base_are_candidates():
    """Two translations tell more than one of them, and a pivot among drives is what it is among pivots."""
    known = tb.Family("circle", r=stats.uniform(0.25, 0.1), q=stats.uniform(0.75, 0.1), x_c=stats.norm(0.0, 0.02))
    options = {"draws": 4, "criterion": Criterion(span=(-0.2, 0.2)), "rig": tb.Rig()}
    found = designed(known, drives=[CARRIED, [CARRIED, BACK], tb.Rotation()], **options)
    assert found.drive.values[0] == "carried from (0.8, 0) to (-0.8, 0) at 63°"
    assert found.width[1] < found.width[0]
    assert np.all(found.reached > 0.0)
    pivot = designed(known, drives=[tb.Rotation()], **options)
    assert float(pivot.width[0]) == pytest.approx(float(found.width[2]), rel=1e-12)


@pytest.mark.slow
def test_a_posterior_of_a_carried_rod_is_what_is_known():
    """Its drive is none of the pivots so far, and what it touched leaves no gap."""
    cell = tb.LoadCell(force_noise=0.005, moment_noise=0.002)
    record = cell.measure(tb.scan(CIRCLE, drive=replace(CARRIED, drive_step=0.04)).record, rng=1)
    rig = tb.Rig(load_cell=cell, unknown="nothing")
    posterior = tb.infer_contour(record, family="circle", rig=rig, rng=1, settings=QUICK)
    found = designed(posterior, drives=[tb.Rotation(), BACK], draws=4)
    assert found.sizes["pivot"] == 0
    assert np.all(found.width < found.present_width)
    assert np.all(found.gap == 0.0)


def test_a_posterior_is_known_by_its_own_rig(posterior):
    told = known_from_posterior(posterior, draws=5, rng=np.random.default_rng(1))
    assert [drive.base for drive in told.drives] == [(0.0, 0.0)]
    assert told.experiment.noise.cell.force_noise == CELL.force_noise
    samples = posterior["posterior"].to_dataset()
    deviations = [float(samples[name].std()) for name in ("a", "q", "x_c", "noise_scale")]
    np.testing.assert_allclose(np.sqrt(np.diag(np.linalg.inv(told.precision))), deviations, rtol=1e-3)


@pytest.mark.slow
def test_what_a_posterior_knows_of_rig_and_contour_is_known(measured):
    rig = tb.Rig(load_cell=CELL, unknown={**NOTHING, "friction": 0.1, "moment_bias": "default", "noise_scale": 1.0})
    known = tb.Family("parabola", q=0.5, a=stats.norm(0.5, 0.1))
    posterior = tb.infer_contour(measured, family=known, rig=rig, rng=1, settings=QUICK)
    told = known_from_posterior(posterior, draws=5, rng=np.random.default_rng(1))
    assert told.experiment.model.names == ("a", "x_c", "moment_bias")
    assert dict(told.experiment.own_family.known) == {"q": 0.5}
    assert dict(told.experiment.unknowns.known) == {"friction": 0.1}
    assert np.isfinite(designed(posterior).width).all()


def test_shifts_of_pivots_are_left_out():
    """Of a rig as of a posterior, for candidates of two pivots, too."""
    rigs, drives = (AS_STATED.with_unknown(base="default"), AS_STATED), [pivots((0.0, 0.0), (0.2, 0.0))]
    found, right = (designed(rig=rig, drives=drives) for rig in rigs)
    np.testing.assert_array_equal(found.width, right.width)


def test_the_calibration_of_another_rig_is_refused():
    stated = {"units": "dimensionless", "rod_length": 1.0, "rod_flexural_rigidity": 2.0}
    joint = RigPrior({"rigidity_scale": stats.lognorm(s=0.01)}, np.eye(1), 0.0, "0", stated)
    unknown = {name: value for name, value in NOTHING.items() if name != "rigidity_scale"}
    rig = tb.Rig(unknown=unknown, calibration=joint)
    for use in (lambda: designed(rig=rig), lambda: Plan(Parabola(0.5, q=0.5), rig).model):
        with refused(ParameterError, "rig", "match"):
            use()


def test_weighted_bands():
    """Of many draws of a normal distribution, weighted to be another: its quantiles, to 4 standard errors."""
    rng = np.random.default_rng(1)
    draws = rng.normal(0.0, 2.0, (200_000, 1))
    weights = np.exp(stats.norm.logpdf(draws[:, 0]) - stats.norm.logpdf(draws[:, 0], scale=2.0))
    # Contours of which a half, and none, have a height at a second and a third place.
    half, none = np.where(rng.random(draws.shape) < 0.5, draws, np.nan), np.full_like(draws, np.nan)
    widths = _band_widths(np.hstack([draws, half, none]), weights / weights.sum(), 0.9)
    assert widths[:2] == pytest.approx(2.0 * stats.norm.ppf(0.95), abs=0.03)
    assert np.isnan(widths[2])


@pytest.mark.parametrize("nested", [False, True])
def test_circles_that_have_no_height_at_some_places(nested):
    """At the default prior, of radii of which some are smaller than the span."""
    found = tb.design("circle", AS_STATED, drives=pivots((0.0, 0.0), (0.2, 0.0)), draws=4, rng=1, nested=nested)
    assert np.isfinite(found.present_width)
    assert (found.width < found.present_width).all()
    assert np.isfinite(found.nested_width).all() == nested


@pytest.mark.parametrize(
    ("call", "wrong"),
    [
        (designed, {"criterion": "best"}),
        (designed, {"draws": 1}),
        (designed, {"drives": []}),
        (designed, {"drives": pivots((0.0, 0.0), (0.0, 0.0))}),
        (designed, {"drives": tb.Rotation()}),
        (Criterion, {"probability": 1.0}),
        (Criterion, {"span": (1.0, 0.0)}),
        (Criterion, {"span": 0.5}),
    ],
)
def test_what_is_impossible_is_refused(call, wrong):
    with refused(ParameterError, **wrong):
        call(**wrong)


def test_candidates_say_what_they_are(posterior):
    drives = [
        tb.Rotation(direction="forward", drive_step=0.2),
        [tb.Rotation(drive_angles=[0.5, 1.0, 1.5]), TRANSLATION],
    ]
    found = designed(posterior, drives=[*drives, replace(TRANSLATION, drive_step=0.25)], draws=2)
    words = ["turned about (0, 0), forward alone", f"turned about (0, 0) and {found.drive.values[2]}"]
    assert found.drive.values[:2].tolist() == words
    assert found.drive.values[2].startswith("carried from (0.8, 0) to (-0.7, 0)")
    assert found.samples.values.tolist() == [21, 2 * 3 + 121, 7]
    np.testing.assert_allclose(found.drive_step, [0.2, 0.5, np.radians(40.0)])


def test_the_usual_drives_are_about_the_pivot_so_far_in_lengths_of_the_rod(posterior):
    of_prior, so_far = usual_drives(FAMILY, tb.Rig(rod=tb.Rod(0.2, 1.0))), usual_drives(posterior, drive_step=0.1)
    assert len(of_prior) == len(set(of_prior)) == 33
    np.testing.assert_allclose([d.base for d in of_prior], 0.2 * np.array([d.base for d in so_far]), atol=1e-15)
    assert {drive.drive_step for drive in so_far} == {0.1}


@pytest.mark.parametrize(
    ("options", "error", "named"),
    [
        ({"drives": pivots((0.0, -2.0), (0.0, -3.0))}, ReachError, ["x = 0", "y from -3 to -2", "1 L"]),
        ({"drives": ["left"]}, ParameterError, ["drive", "'left'"]),
        ({"rig": AS_STATED}, ParameterError, ["rig", "posterior"]),
        ({"known": "shape-free"}, ParameterError, ["family"]),
        ({"known": xr.DataTree()}, InferenceError, ["infer_contour"]),
    ],
)
def test_what_does_not_go_together_is_refused(posterior, options, error, named):
    with refused(error, *named):
        designed(**({"known": posterior} | options))
