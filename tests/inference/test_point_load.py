"""A clamped rod under a point load: closed form against integration, recovery of a made-up rig, and a real whisker."""

import os
from pathlib import Path

import arviz_stats
import numpy as np
import pytest
import xarray as xr
from scipy import stats
from scipy.integrate import solve_ivp

from helpers.refusals import refused
from tactile_bayes import SamplerSettings
from tactile_bayes.errors import InferenceError, ParameterError
from tactile_bayes.inference.point_load import PointLoadModel, default_priors, infer_point_load, predictive_p_value
from tactile_bayes.mechanics.clamped_rod import base_curvature

ROOT = Path(__file__).resolve().parents[2]
MEASURED = Path(os.environ.get("TACTILE_BAYES_MEASURED", ROOT.parent / "shared" / "data"))
WHISKER = MEASURED / "whisker-calibration" / "in_plane.csv"
QUICK = SamplerSettings(walkers=24, min_ess=400)
ROUGH = SamplerSettings(ensembles=2, walkers=32, min_ess=300, max_r_hat=1.02)


def integrated(force, arclength, compliance):
    """Probe point in the clamp's frame, and base curvature, of a rod integrated from the contact back to the clamp. At
    the contact the rod points along x, its curvature is zero, and a unit-stiffness rod obeys κ' = f cos φ backwards."""

    def rod(_, state):
        slope, curvature = state[2:]
        return -np.cos(slope), -np.sin(slope), curvature, force * np.cos(slope)

    end = solve_ivp(rod, (0.0, arclength), np.zeros(4), method="DOP853", rtol=1e-12, atol=1e-14).y[:, -1]
    x, y, slope, curvature = end
    clamp = slope + compliance * curvature  # the suspension yields towards the load, back to the base's slope
    along = -x * np.cos(clamp) - y * np.sin(clamp)
    across = x * np.sin(clamp) - y * np.cos(clamp)
    return along, across, curvature


@pytest.mark.parametrize("compliance", [0.0, 0.1, 0.5])
@pytest.mark.parametrize("arclength", [0.3, 0.8, 1.2, 1.6])
@pytest.mark.parametrize("force", [0.2, 1.0])
def test_the_closed_form_agrees_with_integration(force, arclength, compliance):
    """Turns of the rod from 0.01 to 1.2 rad. Seen from the clamp it bends to the right here."""
    along, across, curvature = integrated(force, arclength, compliance)
    assert base_curvature(along, across, compliance) == pytest.approx(-curvature, rel=1e-9)
    assert base_curvature(along, -across, compliance) == pytest.approx(curvature, rel=1e-9)
    assert base_curvature(1e3 * along, -1e3 * across, 1e3 * compliance) == pytest.approx(curvature / 1e3, rel=1e-9)


def test_small_deflections_are_those_of_the_linear_beam():
    """The relative difference vanishes as the square of the deflection."""
    across = np.array([1e-3, 1e-2])
    rod = base_curvature(1.0, across, 0.2)
    beam = base_curvature(1.0, across, 0.2, small_deflection=True)
    np.testing.assert_allclose(beam, 3.0 * across / 1.6, rtol=1e-14)
    difference = rod / beam - 1.0
    assert abs(difference[1]) < 1e-3
    assert difference[1] / difference[0] == pytest.approx(100.0, rel=0.02)


def test_the_curvature_broadcasts_and_knows_its_limits():
    values = base_curvature(np.ones((3, 1)), [0.0, 0.5], 0.1)
    assert values.shape == (3, 2)
    assert np.all(values[:, 0] == 0.0)
    outside = base_curvature([0.0, -1.0, 0.01, 1.0, 1.0], [0.0, 0.1, 1.0, np.nan, 0.1], [0.0, 0.0, 0.0, 0.0, -0.1])
    assert np.all(np.isnan(outside))
    assert np.isnan(base_curvature(0.1, 1.0, 0.0)) == (np.arctan2(1.0, 0.1) > 1.5)


def test_a_soft_suspension_may_have_no_stable_equilibrium():
    """Far around the corner the moment falls with the turn; a suspension softer than 1/|g'| springs back."""
    angle = 1.45
    assert np.isfinite(base_curvature(np.cos(angle), np.sin(angle), 0.1))
    turn = np.linspace(0.0, 1.5, 3001)
    moment = base_curvature(np.cos(turn), np.sin(turn))
    soft = 2.0
    total = turn + soft * moment  # angle that the clamp has to be turned by
    most = total.argmax()
    assert most < turn.size - 1
    reachable = total[:most:100][total[:most:100] < 0.5 * np.pi]
    found = base_curvature(np.cos(reachable), np.sin(reachable), soft)
    np.testing.assert_allclose(found, np.interp(reachable, total[:most], moment[:most]), atol=1e-6)


RIG = {"clamp_axial": -3.0, "clamp_lateral": 0.4, "clamp_angle": 0.05, "compliance": 4.0}
CURVE = np.array([-200.0, 4e4, 2e5, 8e6])
NOISE = 2.0


def probe_points():
    axial = np.repeat([8.0, 16.0, 24.0, 32.0], 8)
    return axial, axial * np.tile(np.linspace(0.1, 0.9, 8), 4)


def rig_curvature(axial, lateral, rig):
    dx, dy = axial - rig["clamp_axial"], lateral - rig["clamp_lateral"]
    cos, sin = np.cos(rig["clamp_angle"]), np.sin(rig["clamp_angle"])
    return base_curvature(dx * cos + dy * sin, dy * cos - dx * sin, rig["compliance"])


def made_up_readings(seed):
    axial, lateral = probe_points()
    clean = np.polynomial.polynomial.polyval(rig_curvature(axial, lateral, RIG), CURVE)
    return axial, lateral, clean + np.random.default_rng(seed).normal(scale=NOISE, size=axial.size)


# Enough for the layout of a result.
BRIEF = SamplerSettings(ensembles=2, walkers=20, block_steps=20, max_steps=40)


@pytest.fixture(scope="module")
def in_brief():
    return infer_point_load(*made_up_readings(1), rng=2, settings=BRIEF)


def test_the_result_is_laid_out_for_arviz_and_survives_a_file(in_brief, tmp_path):
    drawn = ("posterior", "posterior_predictive", "log_likelihood")
    assert set(in_brief.children) == {*drawn, "sample_stats", "observed_data", "constant_data"}
    for group in drawn:
        for variable in in_brief[group].data_vars.values():
            assert variable.dims[:2] == ("chain", "draw")
            assert np.all(np.isfinite(variable))
    assert in_brief.attrs["seed"] == "2"
    assert len(in_brief.attrs["data_sha256"]) == 64
    summary = arviz_stats.summary(in_brief, ci_prob=0.95, ci_kind="eti")
    assert len(summary) == 9
    assert in_brief.log_likelihood.reading.sizes["point"] == 32
    path = tmp_path / "whisker.nc"
    in_brief.to_netcdf(path, engine="h5netcdf")
    with xr.open_datatree(path, engine="h5netcdf") as back:
        xr.testing.assert_identical(back.load().posterior.to_dataset(), in_brief.posterior.to_dataset())
        assert back.attrs["message"] == in_brief.attrs["message"]


def test_predictions_and_likelihood_belong_to_the_draws(in_brief):
    """Redo the model for a few draws from what the tree holds; the readings predicted scatter by the noise."""
    axial, lateral = (in_brief.constant_data[name].values for name in ("axial", "lateral"))
    for draw in (0, 77):
        one = in_brief.posterior.to_dataset().isel(chain=1, draw=draw)
        curvature = rig_curvature(axial, lateral, {name: float(one[name]) for name in RIG})
        expected = np.polynomial.polynomial.polyval(curvature, one.sensor_coefficient.values)
        predictive = in_brief.posterior_predictive.to_dataset().isel(chain=1, draw=draw)
        np.testing.assert_allclose(predictive.expected_reading, expected, rtol=1e-9)
        likelihood = stats.norm(expected, float(one.noise_sd)).logpdf(in_brief.observed_data.reading)
        np.testing.assert_allclose(in_brief.log_likelihood.reading.isel(chain=1, draw=draw), likelihood, rtol=1e-9)
    predictive = in_brief.posterior_predictive.to_dataset()
    scatter = ((predictive.reading - predictive.expected_reading) / in_brief.posterior.noise_sd).values
    assert scatter.std() == pytest.approx(1.0, abs=4.0 / np.sqrt(2.0 * scatter.size))
    assert abs(scatter.mean()) < 4.0 / np.sqrt(scatter.size)


def test_the_sensor_is_integrated_out_exactly():
    """Differences of log-probability against the density of a multivariate normal."""
    axial, lateral, reading = made_up_readings(3)
    priors = default_priors(axial, lateral, full_scale=1e3)
    model = PointLoadModel(axial, lateral, reading, 0.075, 50.0, priors, {}, False)
    points = np.array([[-3.0, 0.4, 0.05, 4.0, 3.0], [-2.0, 0.5, 0.02, 5.0, 30.0], [-2.5, 0.5, 0.03, 4.5, 10.0]])
    expected = []
    for point in points:
        powers = (rig_curvature(axial, lateral, dict(zip(RIG, point, strict=False))) / 0.075)[:, None] ** np.arange(4)
        covariance = point[4] ** 2 * np.eye(reading.size) + 50.0**2 * powers @ powers.T
        prior = sum(float(p.logpdf(value)) for p, value in zip(priors.values(), point, strict=True))
        expected.append(prior + stats.multivariate_normal(np.zeros(reading.size), covariance).logpdf(reading))
    np.testing.assert_allclose(model.log_probability(points), expected, rtol=1e-8)
    bad = points.copy()
    bad[:, 0], bad[1, 3], bad[2, 4] = (100.0, -3.0, -3.0), -1.0, -1.0
    assert np.all(np.isneginf(model.log_probability(bad)))


@pytest.mark.slow
def test_known_parameters_are_left_out_and_seeds_count():
    known, data = {"compliance": RIG["compliance"], "noise_sd": NOISE}, made_up_readings(4)
    first, again, other = (infer_point_load(*data, rng=seed, priors=known, settings=BRIEF) for seed in (1, 1, 2))
    assert set(first.posterior.data_vars) == {"clamp_axial", "clamp_lateral", "clamp_angle", "sensor_coefficient"}
    xr.testing.assert_identical(first.posterior.to_dataset(), again.posterior.to_dataset())
    assert not np.array_equal(first.posterior.clamp_axial, other.posterior.clamp_axial)
    assert 0.0 <= predictive_p_value(first) <= 1.0
    only_noise = infer_point_load(*data, rng=1, priors=RIG, settings=BRIEF)
    assert set(only_noise.posterior.data_vars) == {"noise_sd", "sensor_coefficient"}


@pytest.mark.parametrize(
    ("wrong", "kind", "named"),
    [
        ({"axial": np.zeros(31)}, ParameterError, ["length"]),
        ({"lateral": np.where(np.arange(32) == 3, np.nan, probe_points()[1])}, ParameterError, ["lateral[3]"]),
        ({name: np.ones(9) for name in ("axial", "lateral", "reading")}, ParameterError, [10]),
        ({"reading": np.ones(32)}, ParameterError, ["readings", "same"]),
        ({"priors": {"clamp_axail": 1.0}}, ParameterError, ["clamp_axail"]),
        ({"priors": {"compliance": -1.0}}, ParameterError, ["negative"]),
        ({"priors": {"noise_sd": 0.0}}, ParameterError, ["noise_sd", 0]),
        ({"priors": RIG | {"noise_sd": 1.0}}, ParameterError, ["at least one"]),
        ({"full_scale": 0.0}, ParameterError, ["full_scale", 0.0]),
        ({"rng": -1}, ParameterError, ["rng", -1]),
        ({"priors": {"clamp_axial": 100.0, "clamp_angle": 0.0}}, InferenceError, ["clamp"]),
    ],
)
def test_bad_input_is_refused(wrong, kind, named):
    right = dict(zip(("axial", "lateral", "reading"), made_up_readings(5), strict=True)) | {"rng": 1}
    with refused(kind, *named):
        infer_point_load(**(right | wrong))


@pytest.fixture(scope="module")
def whisker():
    if not WHISKER.is_file():
        pytest.skip(f"the measured whisker is not here: no file {WHISKER} (set TACTILE_BAYES_MEASURED)")
    columns = np.genfromtxt(WHISKER, delimiter=",", names=True)
    return columns["axial_mm"], columns["lateral_mm"], columns["sensor_sy_counts"]


def rms_over_range(tree):
    reading = tree.observed_data.reading.values
    left = reading - tree.posterior_predictive.expected_reading.mean(("chain", "draw")).values
    return np.sqrt(np.mean(left**2)) / np.ptp(reading)


@pytest.mark.slow
def test_a_real_whisker_is_a_large_deflection_rod(whisker):
    """Residual at the posterior mean at most 0.2 % of the sensor's range, and data that the posterior might have made.
    The p-value of the sum of squares lies below 0.001 or above 0.999 in less than 2 of 1000 data sets from the
    model."""
    tree = infer_point_load(*whisker, rng=1)
    assert tree.attrs["converged"], tree.attrs["message"]
    assert rms_over_range(tree) < 0.002
    assert 0.001 < predictive_p_value(tree) < 0.999


def test_a_real_whisker_has_a_soft_suspension_and_no_surprising_residual(whisker):
    """The suspension more than four sd from rigid; the largest residual on one side: false alarm below 1 in 1000."""
    settings = SamplerSettings(ensembles=2, walkers=32, min_ess=150, max_r_hat=1.05)
    tree = infer_point_load(*whisker, rng=1, settings=settings)
    assert predictive_p_value(tree, lambda z: np.abs(z).max(axis=-1)) > 0.001
    assert float(tree.posterior.compliance.mean()) > 4.0 * float(tree.posterior.compliance.std())


@pytest.mark.slow
@pytest.mark.parametrize(
    ("options", "least", "most"),
    [({"small_deflection": True}, 0.01, 0.02), ({"priors": {"compliance": 0.0}}, 0.0025, 0.003)],
    ids=["linear beam", "rigid clamp"],
)
def test_lesser_models_fit_a_real_whisker_worse(whisker, options, least, most):
    tree = infer_point_load(*whisker, rng=1, settings=ROUGH, **options)
    assert tree.attrs["converged"], tree.attrs["message"]
    assert least < rms_over_range(tree) < most


@pytest.mark.slow
def test_posteriors_are_calibrated():
    """Simulation-based calibration: parameters from the prior, ranks in the posterior uniform (Kolmogorov-Smirnov).
    Nine parameters at 1e-4 each: false alarm below 1e-3. What the rod cannot do is drawn again, as the prior has it."""
    axial, lateral = probe_points()
    rng = np.random.default_rng(8)
    priors = {
        "clamp_axial": stats.norm(-3.0, 1.0),
        "clamp_lateral": stats.norm(0.0, 0.5),
        "clamp_angle": stats.norm(0.0, 0.05),
        "compliance": stats.halfnorm(0.0, 5.0),
        "noise_sd": stats.loguniform(0.3, 3.0),
    }
    unit = 3.0 / np.hypot(axial, lateral).max()
    ranks = []
    while len(ranks) < 40:
        truth = {name: float(prior.rvs(random_state=rng)) for name, prior in priors.items()}
        curvature = rig_curvature(axial, lateral, truth)
        coefficients = rng.normal(scale=100.0, size=4) / unit ** np.arange(4)
        if not np.all(np.isfinite(curvature)):
            continue
        reading = np.polynomial.polynomial.polyval(curvature, coefficients)
        reading = reading + rng.normal(scale=truth["noise_sd"], size=reading.size)
        tree = infer_point_load(axial, lateral, reading, rng=len(ranks), priors=priors, full_scale=1.0, settings=QUICK)
        assert tree.attrs["converged"], tree.attrs["message"]
        posterior = tree.posterior.to_dataset()
        rank = [float((posterior[name] < truth[name]).mean()) for name in priors]
        ranks.append(rank + (posterior.sensor_coefficient < coefficients).mean(("chain", "draw")).values.tolist())
    assert len(ranks[0]) == 9
    for column in np.array(ranks).T:
        assert stats.kstest(column, "uniform").pvalue > 1e-4
