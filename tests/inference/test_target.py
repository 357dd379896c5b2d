"""The posterior as a target of other samplers, against the one that is sampled here, and what comes back of it."""

import functools
import itertools
import pickle

import numpy as np
import pytest
import xarray as xr
from scipy import stats
from scipy.special import logsumexp

import tactile_bayes as tb
from helpers.contour_posteriors import CELL, SOUND, measured, only, posterior
from helpers.refusals import refused
from tactile_bayes import Family, Rig, result, target
from tactile_bayes.errors import InferenceError, ParameterError
from tactile_bayes.inference.contour import sampled
from tactile_bayes.inference.evidence import contour_evidence
from tactile_bayes.inference.experiment import points_of
from tactile_bayes.inference.target import Target
from tactile_bayes.record import CHANNELS
from tactile_bayes.report.background import hindrances
from tactile_bayes.rig import NOTHING
from tactile_bayes.rig.rig_prior import RigPrior

STATED = Rig(load_cell=CELL, unknown="nothing")


@functools.cache
def parabola() -> Target:
    """The target of which `posterior` has the draws."""
    return target(measured(), rig=Rig(load_cell=CELL, unknown=only()))


def calibrated() -> Rig:
    priors = {"rigidity_scale": stats.lognorm(s=0.05), "friction": stats.truncnorm(-1.0, np.inf, 0.1, 0.1)}
    return Rig(
        load_cell=CELL,
        unknown={name: value for name, value in NOTHING.items() if name not in priors},
        calibration=RigPrior(priors, np.array([[1.0, 0.8], [0.8, 1.0]]), 0.0, "0"),
    )


class OwnPrior:
    """An exponential distribution with what inference needs."""

    def logpdf(self, x):
        return np.where(np.asarray(x) > 0.0, -np.asarray(x), -np.inf)

    def rvs(self, size, random_state):
        return random_state.exponential(size=size)

    def std(self):
        return 1.0


SAID = Family("circle", r=stats.gamma(4.0, scale=0.25), x_c=stats.t(5.0, 0.0, 0.1), q=stats.loguniform(0.1, 0.8))
TARGETS = {
    "a real rig": lambda: target(measured(), rig=Rig(load_cell=CELL)),
    "distributions of all kinds": lambda: target(measured(), family=SAID, rig=STATED),
    "two flanks": lambda: target(measured(), family="ellipse/power-law", rig=STATED),
    "any shape": lambda: target(measured(), family="shape-free", rig=STATED),
    "a calibrated rig": lambda: target(measured(), rig=calibrated()),
}


# ---- densities


def test_densities_are_those_of_the_draws():
    draws, found = points_of(posterior(), parabola().names), posterior()
    log_prior = parabola().log_prior(draws)
    np.testing.assert_allclose(log_prior, found["log_prior"]["prior"], rtol=1e-12)
    np.testing.assert_allclose(parabola().log_probability(draws), found["sample_stats"]["lp"], rtol=1e-9)
    of_likelihood = log_prior[:, :50] + parabola().log_likelihood(draws[:, :50])
    np.testing.assert_allclose(of_likelihood, found["sample_stats"]["lp"][:, :50], rtol=1e-9)
    assert list(parabola().units) == list(found["posterior"].data_vars)
    assert all(found["posterior"][name].attrs["units"] == unit for name, unit in parabola().units.items())


def test_points_of_any_leading_shape():
    right = np.array([0.5, 0.5, 0.0, 1.0])
    points = np.broadcast_to(right, (2, 0, 3, 4)), np.broadcast_to(right, (2, 3, 4)), right
    for density in (parabola().log_prior, parabola().log_likelihood, parabola().log_probability):
        none, several, one = map(density, points)
        assert (none.shape, several.shape, type(one)) == ((2, 0, 3), (2, 3), np.float64)
        np.testing.assert_array_equal(several, one)
        assert density(right.tolist()) == one


def test_out_of_bounds_all_but_the_prior_transform_is_impossible():
    """Beyond the ends of a parameter, of a prior, or where a number is none; and a contour out of reach."""
    low, high = parabola().bounds.T
    np.testing.assert_array_equal(low, [0.0, -1.0, -1.0, 0.0])
    np.testing.assert_array_equal(high, [np.inf, 1.0, 1.0, np.inf])
    right = np.array([0.5, 0.5, 0.0, 1.0])
    for i, value in itertools.product(range(4), (np.nan, np.inf, -np.inf)):
        wrong = np.where(np.arange(4) == i, value, right)
        assert np.isneginf([parabola().log_likelihood(wrong), parabola().log_probability(wrong)]).all()
        assert np.isneginf(parabola().log_prior(wrong))
    far = np.array([0.5, 0.99, 0.9, 1.0])
    assert np.isfinite(parabola().log_prior(far))
    assert np.isneginf(parabola().log_likelihood(far))


@pytest.mark.parametrize("wrong", [0.5, [0.5, 0.5], np.ones((4, 3)), "a", None, [None] * 4])
def test_points_of_another_size_are_refused(wrong):
    for call in (parabola().log_prior, parabola().log_likelihood, parabola().log_probability, parabola().seconds):
        with refused(ParameterError, "points"):
            call(wrong)
    with refused(ParameterError, "cube"):
        parabola().prior_transform(wrong)


# ---- the prior as a map


@pytest.mark.parametrize("name", [pytest.param(n, marks=pytest.mark.slow) if "any" in n else n for n in TARGETS])
def test_the_transform_of_uniform_numbers_is_a_draw_of_the_prior(name):
    """By Kolmogorov and Smirnov, of each parameter within reach: false alarm of all together below 0.001."""
    one, count = TARGETS[name](), 2000
    points = one.prior_transform(np.random.default_rng(1).random((count, len(one.names))))
    reached = points[np.isfinite(one.log_likelihood(points))]
    drawn, share = one.model.draw_prior(np.random.default_rng(2), count)
    p_values = [stats.ks_2samp(a, b).pvalue for a, b in zip(reached.T, drawn.T, strict=True)]
    assert min(p_values) > 0.001 / len(p_values), dict(zip(one.names, p_values, strict=True))
    assert abs(len(reached) / count - share) < 3.3 * np.sqrt(share * (1.0 - share) * 2.0 / count)


@pytest.mark.parametrize("name", TARGETS)
def test_the_density_is_one_over_the_volume_of_the_transform(name):
    """log π(T(u)) + log |det ∂T/∂u| = 0, exactly, for dependent parameters too."""
    one, step = TARGETS[name](), 1e-6
    size = len(one.names)
    for cube in np.random.default_rng(3).uniform(0.05, 0.95, (20, size)):
        ends = one.prior_transform(cube + step * np.stack([np.eye(size), -np.eye(size)]))
        _, log_volume = np.linalg.slogdet((ends[0] - ends[1]) / (2.0 * step))
        if np.isfinite(log_prior := one.log_prior(one.prior_transform(cube))):
            assert abs(log_prior + log_volume) < 1e-6 * size


def test_ends_of_the_cube_are_finite_points():
    for name in ("a real rig", "a calibrated rig"):
        one = TARGETS[name]()
        assert np.isfinite(one.prior_transform(np.array([np.zeros(len(one.names)), np.ones(len(one.names))]))).all()


def test_what_has_no_transform_is_refused():
    for wrong in (-0.1, 1.1, np.nan):
        with refused(ParameterError, "cube"):
            parabola().prior_transform([0.5, wrong, 0.5, 0.5])
    one = target(measured(), family=Family("parabola", a=OwnPrior()), rig=STATED)
    assert np.isfinite(one.log_probability([0.5, 0.5, 0.0, 1.0]))
    with refused(ParameterError, "prior of a", "ppf"):
        one.prior_transform([0.5] * 4)


# ---- targets as objects


def test_it_travels_to_other_processes_as_its_parts():
    one = TARGETS["a real rig"]()
    start = one.start(1, 5)
    there = pickle.dumps(one)
    assert len(there) < 10 * measured().nbytes
    again = pickle.loads(there)
    assert again.names == one.names
    np.testing.assert_array_equal(again.log_probability(start), one.log_probability(start))


def test_it_starts_within_the_posterior_and_wider():
    start = parabola().start(1)
    assert start.shape == (48, 4)
    np.testing.assert_array_equal(start, parabola().start(1))
    assert not np.any(start == parabola().start(2))
    assert parabola().start(1, 3).shape == (3, 4)
    assert parabola().start(1, 101).shape == (101, 4)
    found = points_of(posterior(), parabola().names).reshape(-1, 4)
    assert np.isfinite(parabola().log_probability(start)).all()
    assert np.all(np.abs(start.mean(axis=0) - found.mean(axis=0)) < start.std(axis=0))
    assert np.all(start.std(axis=0) > found.std(axis=0))


@pytest.mark.slow
def test_a_start_beyond_the_priors_is_refused():
    one = target(measured(), family=Family("parabola", q=stats.uniform(0.55, 0.2)), rig=STATED)
    with refused(InferenceError, "outside the priors", "q"):
        one.start(1)


def test_it_says_what_it_is_and_costs():
    assert "parabola" in repr(parabola())
    assert f"{measured().sizes['sample']} samples" in repr(parabola())
    assert parabola().seconds([[0.5, 0.5, 0.0, 1.0]] * 20) > 0.0


def test_a_side_in_doubt_is_refused():
    forward = measured().isel(sample=measured().sweep.values == 0)
    loaded = forward.isel(sample=np.flatnonzero(forward.holding_moment.values > 0.15)[:40])
    doubtful = loaded.assign(holding_moment=loaded.holding_moment - float(loaded.holding_moment.mean()) - 0.3)
    with refused(ParameterError, "in doubt", "contact_sides"):
        target(doubtful, rig=STATED)
    stated = doubtful.assign_attrs(contact_sides='{"0": "forward"}')
    assert target(stated, rig=STATED).model.names == parabola().names


# ---- draws come back


@functools.cache
def returned() -> xr.DataTree:
    return result(parabola(), points_of(posterior(), parabola().names), rng=1, sampler="a peer", settings=SOUND)


def test_draws_come_back_as_a_result():
    """Of the draws of `infer_contour`, all that does not depend on its run is the same."""
    own, back = posterior(), returned()
    assert set(back.children) == set(own.children)
    for group in ("posterior", "observed_data", "constant_data"):
        assert back[group].to_dataset().identical(own[group].to_dataset()), group
    for group in ("log_prior", "log_likelihood", "events"):
        xr.testing.assert_allclose(back[group].to_dataset(), own[group].to_dataset(), rtol=1e-9)
    xr.testing.assert_allclose(back["sample_stats"]["lp"], own["sample_stats"]["lp"], rtol=1e-9)
    of_run = {"seed", "sampler", "message", "settings"}
    assert set(back.attrs) == set(own.attrs)
    assert all(back.attrs[name] == value for name, value in own.attrs.items() if name not in of_run)
    assert (back.attrs["sampler"], back.attrs["converged"]) == ("another sampler, a peer", 1)
    assert len(hindrances(back.attrs)) == 1
    again = result(parabola(), own["posterior"].to_dataset(), rng=1)["posterior_predictive"]
    assert again.to_dataset().identical(back["posterior_predictive"].to_dataset())


def test_a_result_of_other_draws_is_taken_everywhere():
    back, own = returned(), posterior()
    x = np.linspace(-0.4, 0.4, 9)
    xr.testing.assert_allclose(tb.contour_band(back, x), tb.contour_band(own, x))
    assert float(tb.gap(back).width.sel(bound="median")) == float(tb.gap(own).width.sel(bound="median"))
    assert tb.check(back).is_well


@pytest.mark.slow
def test_a_report_of_other_draws_says_whose_they_are(tmp_path):
    back = returned()
    tb.write_result(back, tmp_path / "posterior.nc")
    assert tb.read_result(tmp_path / "posterior.nc")["posterior"].identical(back["posterior"])
    report = tb.write_report(tmp_path, tmp_path / "report.html").read_text(encoding="utf-8")
    assert "a peer" in report
    assert "nan" not in report


def test_a_few_draws_have_not_converged():
    back = result(parabola(), points_of(posterior(), parabola().names)[:1, :40], rng=1)
    assert back.attrs["converged"] == 0
    assert tb.check(back).messages[0].kind != "all is well"


def test_known_parameters_come_back():
    one = target(measured(), family=Family("parabola", x_c=0.0), rig=STATED)
    back = result(one, np.random.default_rng(1).normal([0.5, 0.5, 1.0], 1e-3, (2, 60, 3)), rng=1)
    assert np.all(back["posterior"]["x_c"] == 0.0)


@pytest.mark.parametrize(
    ("wrong", "error", "named"),
    [
        (np.ones((10, 4)), ParameterError, "shape"),
        (np.ones((2, 10, 3)), ParameterError, "shape"),
        (np.ones((2, 0, 4)), ParameterError, "shape"),
        ("draws", ParameterError, "draws"),
        (xr.Dataset({"a": (("chain", "draw"), np.ones((2, 5)))}), ParameterError, "q, x_c, noise_scale"),
        (np.full((2, 10, 4), np.nan), InferenceError, "20 of 20"),
        (np.full((2, 10, 4), [1.0, 0.5, 0.5, 0.0]), InferenceError, "20 of 20"),
    ],
)
def test_what_is_no_draw_is_refused(wrong, error, named):
    with refused(error, named):
        result(parabola(), wrong, rng=1)


# ---- other methods find the same posterior, and the same evidence


@functools.cache
def two_unknowns():
    """A target of two parameters, its draws by `infer_contour`, and its evidence."""
    family, rig = Family("parabola", x_c=0.0), Rig(load_cell=CELL, unknown=only(noise_scale=1.0))
    one = target(measured(), family=family, rig=rig)
    drawn = sampled(one.problem, seed=1, settings=SOUND)
    evidence = contour_evidence(one.model, drawn, np.random.default_rng(1))
    return one, points_of(drawn.tree, one.names).reshape(-1, 2), evidence


def assert_same_mean(found, own, effective):
    """Within 4.5 standard errors of the draws, of which so many are independent: false alarm 1e-5 a parameter."""
    error = own.std(axis=0) * np.sqrt(2.0 / effective)
    np.testing.assert_array_less(np.abs(found - own.mean(axis=0)), 4.5 * error)


def test_a_grid_has_the_same_posterior_and_evidence():
    """A grid of ± 6 standard deviations has the integral to many digits."""
    one, own, evidence = two_unknowns()
    axes = [np.linspace(m - 6.0 * s, m + 6.0 * s, 61) for m, s in zip(own.mean(axis=0), own.std(axis=0), strict=True)]
    grid = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)
    logs = one.log_probability(grid)
    cell = np.prod([axis[1] - axis[0] for axis in axes])
    log_evidence = float(logsumexp(logs) + np.log(cell))
    weights = np.exp(logs - logsumexp(logs))
    assert_same_mean((weights[..., None] * grid).sum(axis=(0, 1)), own, 2.0 * SOUND.min_ess)
    _, share = one.model.draw_prior(np.random.default_rng(3), 20_000)
    assert share < 0.9
    error = np.hypot(evidence.standard_error, np.sqrt((1.0 - share) / (share * 20_000)))
    assert abs(log_evidence - np.log(share) - evidence.log_evidence[1]) < 4.5 * error


def test_readings_have_densities_of_their_own():
    """Their sum is the log-likelihood, and each is that of the channel's noise, given those before."""
    group, draws = posterior()["log_likelihood"]["record"], posterior()["posterior"].to_dataset()
    points = points_of(posterior(), parabola().names)[:, group.draw.values]
    np.testing.assert_allclose(group.sum(("sample", "channel")), parabola().log_likelihood(points), rtol=1e-9)
    assert group.channel.values.tolist() == list(CHANNELS)
    model, one = parabola().model, points[0, :1]
    for i, deviation in enumerate((0.02, 0.05, 0.05)):
        scale = deviation * float(draws.noise_scale[0, 0])
        expected = stats.norm(model.loads(one)[0, :, i], scale).logpdf(model.likelihood.measured[:, i])
        np.testing.assert_allclose(group[0, 0, :, i], expected, rtol=1e-9, atol=1e-9)
