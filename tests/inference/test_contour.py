"""The posterior of a contour, against independent computations, and its layout."""

import re
from dataclasses import replace

import numpy as np
import pytest
import xarray as xr
from scipy import stats

from helpers.contour_posteriors import (
    BRIEF,
    CELL,
    DEVIATIONS,
    MODEST,
    TRUTH,
    assert_near,
    infer_as_stated,
    measured,
    only,
    posterior,
    swept,
    without,
)
from helpers.refusals import refused
from tactile_bayes import Family, LoadCell, Rig, Rod, SamplerSettings, Translation, check, infer_contour, scan
from tactile_bayes.contours import Circle, Ellipse, Parabola
from tactile_bayes.contours.families import family_named
from tactile_bayes.errors import InferenceError, ParameterError, ReachError
from tactile_bayes.inference.contour import contours_of
from tactile_bayes.inference.contour_model import ContourModel
from tactile_bayes.inference.experiment import Experiment
from tactile_bayes.inference.parameters.priors import default_priors
from tactile_bayes.inference.record_likelihood.likelihood import RecordLikelihood
from tactile_bayes.numerics import blocks
from tactile_bayes.record import CHANNELS, loads_of, record_hash, to_si
from tactile_bayes.sweep import scan_many

NAMES = ["a", "q", "x_c", "noise_scale"]


def test_moments_are_those_of_a_grid():
    """Mean within 4 sd/√ESS, variance within 4 √(2/ESS) of a quadrature over the whole posterior: false alarm 6e-5. On
    a grid in whitened coordinates the noise scale is summed for every contour, from the sum of squares."""
    result, record = posterior(), measured()
    likelihood = RecordLikelihood(record, CELL, exact=True)
    draws = np.stack([result["posterior"][name].values.ravel() for name in TRUTH], axis=-1)
    root = np.linalg.cholesky(np.cov(draws.T))
    z = np.linspace(-4.5, 4.5, 11)
    whitened = np.stack(np.meshgrid(z, z, z, indexing="ij"), axis=-1).reshape(-1, 3)
    whitened = whitened[(whitened**2).sum(axis=1) < 25.0]
    points = draws.mean(axis=0) + whitened @ root.T
    loads = np.concatenate([likelihood.predict(Parabola(*part.T))[0] for part in np.array_split(points, 20)])
    values = loads_of(record)
    squares = (((values - loads) / DEVIATIONS) ** 2).sum(axis=(1, 2))
    priors = Experiment(record, Rig(load_cell=CELL)).priors
    log_prior = sum(priors[name].logpdf(points[:, i]) for i, name in enumerate(TRUTH))
    scale = np.linspace(0.8, 1.25, 181)
    logs = -0.5 * squares[:, None] / scale**2 - values.size * np.log(scale) + priors["noise_scale"].logpdf(scale)
    weights = np.exp(logs + log_prior[:, None] - (logs + log_prior[:, None]).max())
    weights /= weights.sum()
    stats_ = result["sample_stats"].to_dataset()
    for i, name in enumerate(NAMES):
        axis = points[:, [i]] if i < 3 else scale
        mean = (weights * axis).sum()
        deviation = np.sqrt((weights * (axis - mean) ** 2).sum())
        sample = result["posterior"][name].values
        ess = float(min(stats_.ess_bulk.sel(parameter=name), stats_.ess_tail.sel(parameter=name)))
        assert abs(sample.mean() - mean) < 4.0 * deviation / np.sqrt(ess), name
        assert abs(sample.var() / deviation**2 - 1.0) < 4.0 * np.sqrt(2.0 / ess), name


def test_layout():
    result = posterior()
    assert result.attrs["converged"], result.attrs["message"]
    groups = {"posterior", "sample_stats", "log_prior", "prior", "posterior_predictive", "log_likelihood", "events"}
    assert set(result.children) == groups | {"observed_data", "constant_data"}
    assert list(result["posterior"].data_vars) == NAMES
    chains, draws = 2, 24 * result["sample_stats"].attrs["steps_kept"]
    assert dict(result["posterior"].sizes) == {"chain": chains, "draw": draws}
    assert all(result["posterior"][name].dims == ("chain", "draw") for name in NAMES)
    samples = measured().sizes["sample"]
    kept = result["events"].sizes["draw"]
    by_sample = {"chain": chains, "draw": kept, "sample": samples}
    assert dict(result["log_likelihood"].sizes) == {**by_sample, "channel": 3}
    assert dict(result["posterior_predictive"].sizes) == by_sample
    assert result["events"].segment.values.tolist() == ["forward", "backward"]
    assert dict(result["prior"].sizes) == {"chain": 1, "draw": 1000}
    assert 0.0 < result["prior"].attrs["share_within_reach"] < 1.0
    assert result.attrs["data_sha256"] == record_hash(measured())
    assert result.attrs["family"] == "parabola"
    assert result.attrs["units"] == "dimensionless"
    assert result.attrs["seed"] == "1"
    for name in CHANNELS:
        xr.testing.assert_identical(result["observed_data"][name], measured()[name])
    for group in ("posterior", "events"):
        assert all(np.isfinite(values).all() for values in result[group].data_vars.values())


def test_predictions_scatter_about_what_was_measured():
    """Standardised differences of two draws of one noise: mean square 2, standard error √(8/n) ≈ 0.12; 5 of them."""
    result = posterior()
    for name, deviation in zip(CHANNELS, DEVIATIONS, strict=True):
        off = (result["posterior_predictive"][name] - result["observed_data"][name]) / deviation
        samples = off.sizes["sample"]
        scale = float(result["posterior"].noise_scale.mean())
        assert abs(float((off**2).mean()) / scale**2 - 2.0) < 5.0 * np.sqrt(8.0 / samples)


def test_events_are_those_of_the_drawn_contours():
    """Roughly: to 1e-6 rad, and to 1e-5 of the rod's length."""
    result = posterior()
    draw = result["posterior"].to_dataset().sel(draw=result["events"].draw).isel(chain=0, draw=3)
    contour = Parabola(*(float(draw[name]) for name in TRUTH))
    events = scan(contour).events
    for segment, direction in enumerate(("forward", "backward")):
        found = result["events"].isel(chain=0, draw=3, segment=segment)
        for label, event in (("first", events[direction].first_contact), ("snap_off", events[direction].snap_off)):
            for name in ("drive_angle", "contact_x", "contact_y"):
                off = 1e-6 if name == "drive_angle" else 1e-5
                assert float(found[f"{label}_{name}"]) == pytest.approx(getattr(event, name), abs=off)


def coarse(contour=None, cell=CELL, seed=3, **options):
    """A small record."""
    return cell.measure(swept(contour or Parabola(**TRUTH), step=np.radians(8.0), **options), rng=seed)


@pytest.mark.slow
def test_units_do_not_matter():
    """SI and dimensionless records of one measurement: the same draws, up to rounding that the optimiser amplifies."""
    rod = Rod(length=0.25, flexural_rigidity=2.4e-3)
    plain = coarse(Circle(1.0, 0.4, 0.05))
    in_si = to_si(plain, rod)
    expected, found = (
        infer_as_stated(record, family="circle", rng=1, settings=BRIEF)["posterior"].to_dataset()
        for record in (plain, in_si)
    )
    for name in expected.data_vars:
        factor, unit = (rod.length, "m") if name in ("r", "q", "x_c") else (1.0, "1")
        assert found[name].attrs["units"] == unit
        scatter = float(expected[name].std())
        np.testing.assert_allclose(found[name].values / factor, expected[name].values, rtol=0, atol=1e-5 * scatter)


def by_an_unknown_load_cell():
    wire = Rod.circular(length=0.2, diameter=0.7e-3, youngs_modulus=206e9)
    record = coarse(Parabola(2.5, 0.1), LoadCell(force_noise=3e-3, moment_noise=0.25e-3), rod=wire)
    return without(record, "load_cell_force_noise", "load_cell_moment_noise")


EXACT = LoadCell(force_noise=1e-4, moment_noise=1e-4)
UNKNOWN = {"a": 2.5, "q": 0.1, "x_c": 0.0, "moment_noise": 0.25e-3, "force_noise": 3e-3}
FOUND = {
    "moment only": (lambda: without(coarse(), "force_x", "force_y"), {**TRUTH, "noise_scale": 1.0}),
    "forces only": (lambda: without(coarse(), "holding_moment"), {**TRUTH, "noise_scale": 1.0}),
    "small noise": (lambda: coarse(Circle(1.0, 0.3), EXACT), {"r": 1.0, "q": 0.3, "x_c": 0.0, "noise_scale": 1.0}),
    "no load cell": (by_an_unknown_load_cell, UNKNOWN),
}


@pytest.mark.slow
@pytest.mark.parametrize(("record", "truth"), FOUND.values(), ids=FOUND)
def test_the_truth_is_found(record, truth):
    """Within 4 standard deviations: false alarm 6e-5 a number."""
    measured = record()
    result = infer_as_stated(measured, family="circle" if "r" in truth else "parabola", rng=1, settings=MODEST)
    assert_near(result, truth)
    assert list(result["posterior"].data_vars) == list(truth)
    units = {name: result["posterior"][name].attrs["units"] for name in truth if name.endswith("_noise")}
    assert units in ({}, {"moment_noise": "N m", "force_noise": "N"})
    assert set(result["posterior_predictive"].data_vars) == {c for c in CHANNELS if not np.isnan(measured[c]).any()}


@pytest.mark.slow
@pytest.mark.parametrize("seed", [1, 2])
def test_no_walker_lives_on_noise(seed):
    """Walkers that start beyond a snap-off can hold out for thousands of steps where the noise is ten times too great.
    The standard deviation of noise_scale is 1/√(2 n), n numbers; four times that would be a walker that holds out."""
    record = CELL.measure(swept(Parabola(0.5, 0.7)), rng=seed)
    result = infer_as_stated(record, rng=seed, settings=MODEST)
    numbers = 3 * record.sizes["sample"]
    assert float(result["posterior"].noise_scale.std()) < 4.0 / np.sqrt(2.0 * numbers)


def test_priors_that_allow_the_impossible_are_cut_off():
    """Normal priors reach below zero, where there is neither a contour nor a noise."""
    family = Family("parabola", a=stats.norm(0.3, 0.3), x_c=stats.cauchy(0.0, 0.1))
    unknown = {"noise_scale": stats.norm(0.5, 0.5)}
    result = infer_as_stated(coarse(), family=family, unknown=unknown, rng=1, settings=BRIEF)
    assert float(result["posterior"].a.min()) > 0.0
    assert float(result["prior"].a.min()) > 0.0
    assert float(result["prior"].noise_scale.min()) > 0.0


def test_one_draw_is_found_where_one_in_a_hundred_is_within_reach():
    model = Experiment(coarse(), family=Family("parabola", q=stats.uniform(0.0, 75.0))).model
    shares = [model.draw_prior(np.random.default_rng(seed), 1)[1] for seed in range(5)]
    assert 0.001 <= np.mean(shares) < 0.1
    assert min(shares) < 1 / 50


def unloaded():
    """A record of nothing but a hundredth of a load."""
    return coarse().assign({name: 0.01 * coarse()[name] / abs(coarse()[name]).max() for name in CHANNELS})


@pytest.mark.parametrize(
    ("record", "given", "kind", "named"),
    [
        (coarse, {"family": Family("parabola", q=stats.uniform(2.0, 1.0))}, ReachError, ["base", "rod length"]),
        (coarse, {"load_cell": LoadCell(moment_noise=0.02)}, ParameterError, ["force_x", "noise"]),
        (unloaded, {}, InferenceError, ["no sample", "load"]),
    ],
    ids=["out of reach", "no noise", "no load"],
)
def test_what_cannot_be_is_refused(record, given, kind, named):
    with refused(kind, *named):
        infer_as_stated(record(), rng=1, **given)


@pytest.mark.slow
def test_samples_without_load_tell_where_contact_begins_and_ends():
    """Left out, the posterior is wider, and still right."""
    whole = posterior()["posterior"]
    result = infer_as_stated(measured(), load_cell=CELL, rng=1, settings=replace(MODEST, events=False))
    assert result["observed_data"].sizes["sample"] < measured().sizes["sample"]
    assert result.attrs["events"] == 0
    assert result.attrs["data_sha256"] == posterior().attrs["data_sha256"]
    for name, value in TRUTH.items():
        draws = result["posterior"][name]
        assert abs(draws.mean() - value) < 4.5 * draws.std(), name
        assert draws.std() > 0.8 * whole[name].std()


@pytest.mark.slow
def test_the_way_to_the_optimum_may_lead_where_the_prior_is_nothing():
    """A stiff rod, close to the least height that the prior allows: searches that stopped there ended far off."""
    truth = Circle(0.66, 0.313, -0.126)
    record = scan(truth, drive_angles=np.radians(np.arange(0.0, 200.0, 2.0))).record
    stiff = record.assign({name: 1.108 * record[name] for name in CHANNELS})
    cell = LoadCell(force_noise=0.05, moment_noise=0.02, bias=(0.03, 0.02, -0.14))
    priors = {"r": stats.lognorm(s=0.4, scale=0.7), "q": stats.uniform(0.3, 0.4), "x_c": stats.norm(0.0, 0.1)}
    for seed in range(4):
        noisy = cell.measure(stiff, rng=seed)
        result = infer_contour(noisy, family=Family("circle", **priors), rig=Rig(load_cell=CELL), rng=seed)
        assert result.attrs["converged"], result.attrs["message"]
        assert abs(result["posterior"].q.mean() - 0.313) < 0.01


@pytest.mark.slow
@pytest.mark.parametrize(("a", "b", "q"), [(2.55, 0.63, 0.318), (1.23, 0.435, 0.635), (2.45, 0.94, 0.327)])
def test_flat_ellipses_mix_although_only_a_ratio_is_told(a, b, q):
    """Radius a²/b at the vertex is told, a and b hardly: in less than 60,000 evaluations, where it took 200,000."""
    record = scan(Ellipse(a, b, q, -0.05), drive_angles=np.radians(np.arange(0.0, 200.0, 2.0))).record
    size = stats.lognorm(s=0.4, scale=0.7)
    result = infer_contour(
        CELL.measure(record, rng=1), family=Family("ellipse", a=size, b=size), rig=Rig(load_cell=CELL), rng=1
    )
    assert result.attrs["converged"], result.attrs["message"]
    assert result["sample_stats"].attrs["evaluations"] < 60_000


@pytest.mark.slow
def test_a_prior_that_ends_before_what_the_record_wants_is_named():
    """Far beyond it that is a mistake, and near its end the posterior lies there."""
    record, deviation = coarse(), 3e-4  # by Fisher information
    narrow = Family("parabola", q=stats.uniform(TRUTH["q"] - 0.2, 0.15))
    with pytest.raises(InferenceError, match=r"q = 0\.\d+ .*0\.\d+ to 0\.\d+"):
        infer_as_stated(measured(), family=narrow, rng=1, settings=BRIEF)
    edged = Family("parabola", q=stats.uniform(TRUTH["q"] - 0.2, 0.2 - deviation))
    found = infer_as_stated(record, family=edged, rng=1, settings=BRIEF)
    assert float(found["posterior"].q.max()) < TRUTH["q"] - deviation
    assert float(found["posterior"].q.mean()) == pytest.approx(TRUTH["q"] - deviation, abs=3.0 * deviation)


@pytest.mark.parametrize(
    "cell",
    [CELL, pytest.param(replace(CELL, drive_angle_noise=0.01), marks=pytest.mark.slow)],
    ids=["plain", "encoder"],
)
def test_blocks_of_points_make_no_difference(cell, monkeypatch):
    """To the log-probability, and to all that is predicted: readings, densities, events."""
    draw = {"load_cell": cell, "rng": 1, "settings": replace(BRIEF, max_steps=2, block_steps=2)}
    whole = infer_as_stated(measured(), **draw)
    sizes = []

    def few(model, points):
        sizes.append(len(points))
        return together(model, points)

    together = ContourModel.felt
    monkeypatch.setattr(ContourModel, "felt", few)
    monkeypatch.setattr(blocks, "_MOST", 3 * 3 * measured().sizes["sample"])
    parts = infer_as_stated(measured(), **draw)
    assert max(sizes) <= 3
    for name, group in whole.children.items():
        for variable, values in group.data_vars.items():
            if values.dtype.kind == "f":
                np.testing.assert_allclose(parts[name][variable], values, rtol=1e-9, atol=1e-12, err_msg=variable)


class Clock:
    """Time that passes by calls alone: a second for every prediction of loads."""

    def __init__(self, monkeypatch) -> None:
        self.now = 0.0
        predict = RecordLikelihood._predict

        def slow(likelihood, *arguments):
            self.now += 1.0
            return predict(likelihood, *arguments)

        monkeypatch.setattr(RecordLikelihood, "_predict", slow)
        for module in ("deadline", "ensembles.sampling"):
            monkeypatch.setattr(f"tactile_bayes.inference.{module}.time.monotonic", lambda: self.now)


@pytest.mark.parametrize("family", ["parabola", pytest.param("shape-free", marks=pytest.mark.slow)])
@pytest.mark.parametrize(
    "seconds", [pytest.param(0.5, marks=pytest.mark.slow), 3.5, pytest.param(8.5, marks=pytest.mark.slow)]
)
def test_the_time_bounds_the_search_too(family, seconds, monkeypatch):
    """Past it, only the step that is under way ends, a cloud is found, and walkers start and make one step."""
    clock, drawn = Clock(monkeypatch), []
    settings = SamplerSettings(ensembles=2, walkers=90, max_seconds=seconds, min_ess=1e9)
    draw = {"family": family, "rig": Rig(load_cell=CELL), "rng": 1, "keep": lambda tree: drawn.append(clock.now)}
    result = infer_contour(measured(), settings=settings, **draw)
    assert result["sample_stats"].attrs["steps_run"] == 1
    assert result.attrs["converged"] == 0
    assert re.search("time allowed .* 1 step: too few", result.attrs["message"])
    assert drawn[0] < seconds + 25.0
    clock.now = 0.0
    infer_contour(measured(), settings=replace(settings, max_steps=1, max_seconds=None), **draw)
    assert drawn[0] <= drawn[1] - (seconds < 1.0)  # with all the time it wants


@pytest.mark.parametrize("family", ["parabola", pytest.param("shape-free", marks=pytest.mark.slow)])
def test_of_what_is_not_described_no_more_is_sampled_than_a_verdict_needs(family):
    real = Rig(load_cell=CELL, unknown={"friction": 0.5})
    record = real.measure(scan(Parabola(**TRUTH), real, drive_step=0.05).record, rng=1)
    result = infer_contour(record, family=family, rig=Rig(load_cell=CELL, unknown="nothing"), rng=1)
    assert result["sample_stats"].attrs["steps_run"] == 25
    assert result.attrs["converged"] == 0
    assert [one.kind for one in check(result).messages[:1]] == ["not described"]


def test_a_posterior_is_kept_before_anything_is_made_of_it(monkeypatch):
    def fail(*arguments):
        raise MemoryError

    monkeypatch.setattr("tactile_bayes.inference.contour.predicted_groups", fail)
    kept = []
    with pytest.raises(MemoryError):
        infer_as_stated(measured(), load_cell=CELL, rng=1, settings=BRIEF, keep=kept.append)
    (tree,) = kept
    assert set(tree.children) == {"posterior", "sample_stats", "log_prior", "observed_data", "constant_data"}
    assert tree["posterior"].sizes["draw"] == 240
    assert tree.attrs["message"].startswith("not converged")


FAMILIES = {
    "ellipse": (0.7, 0.5, 0.5, 0.05),
    "power-law": (1.0, 3.0, 0.5, 0.02),
    "parabola/power-law": (0.5, 1.0, 4.0, 0.4, 0.0),
    "circle/ellipse": (0.7, 0.8, 0.4, 0.5, 0.0),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", FAMILIES)
def test_posteriors_lie_about_the_truth(name):
    """Within 4.5 posterior standard deviations: false alarm 7e-6 a number, if the posterior is right."""
    family = family_named(name)
    record = scan(family.build(*FAMILIES[name]), drive_step=np.radians(3.0)).record
    brief = {"ensembles": 2, "walkers": 32, "min_ess": 150.0, "max_r_hat": 1.05}
    settings = SamplerSettings(**brief if name == "ellipse" else {"min_ess": 300.0, "max_r_hat": 1.02})
    result = infer_as_stated(CELL.measure(record, rng=3), family=name, rng=1, settings=settings)
    assert_near(result, dict(zip(family.parameters, FAMILIES[name], strict=True)), 4.5)
    contours = contours_of(result["posterior"].to_dataset().isel(draw=slice(None, None, 40)), name)
    many = scan_many(contours, np.full((contours.shape[0], 1), 1.5))
    assert many.clear.all()


@pytest.mark.slow
def test_contours_that_the_rod_would_cut_after_snap_off_are_not_usable():
    """The same as `scan_many` says, of ellipses of which some are not clear."""
    rng = np.random.default_rng(5)
    count = 20_000
    family = family_named("ellipse")
    priors = default_priors(family, (0.0, 0.0), 1.0)
    points = [priors[name].rvs(count, random_state=rng) for name in family.parameters]
    contours = family.build(*points)
    swept = [scan_many(contours, np.full((count, 1), 1.5), direction=way) for way in ("forward", "backward")]
    wanted = np.all([(many.status == "ok").values & many.clear.values.astype(bool) for many in swept], axis=0)
    record = CELL.measure(scan(family.build(*FAMILIES["ellipse"])).record, rng=1)
    usable = RecordLikelihood(record, CELL, is_always_clear=False).usable(contours)
    assert np.count_nonzero(usable != wanted) <= 1  # where snap-off is approximate
    reached = RecordLikelihood(record, CELL).usable(contours)
    assert np.count_nonzero(reached & ~usable) >= 1


def test_friction_leaves_paths_of_an_upright_rod_that_is_carried_both_ways():
    """Within reach are as many draws as without friction, in the accuracy of the likelihood as in the exact one."""
    drives = [
        Translation((side * -0.5, 0.0), 0.0 if side > 0 else np.pi, 0.5 * np.pi, travel=1.0, drive_step=0.05)
        for side in (1, -1)
    ]
    upright = CELL.measure(scan(Circle(0.3, q=0.8), drive=drives).record, rng=1)
    near = {name: stats.uniform(middle - 0.02, 0.04) for name, middle in (("r", 0.3), ("q", 0.8), ("x_c", 0.0))}
    rubbing = Rig(load_cell=CELL, unknown=only("friction"))
    model = Experiment(upright, rubbing, Family("circle", **near)).model
    points = model.prior_points(np.random.default_rng(1), 300)
    contours, rig = model.contours(points), model.rig(points)
    usable = model.likelihood.usable(contours, rig)
    model.likelihood.exact = True
    exactly = model.likelihood.usable(contours, rig)
    without = model.likelihood.usable(contours, rig._replace(friction=0.0))
    assert np.count_nonzero(without) > 50
    assert np.count_nonzero(usable != exactly) <= 0.02 * np.count_nonzero(exactly)
    assert np.count_nonzero(exactly) >= 0.9 * np.count_nonzero(without)


# ---- runs that are stopped and go on

SHORT = SamplerSettings(ensembles=2, walkers=12, block_steps=10, max_steps=30, min_ess=1e9)


def short(checkpoint=None, **options):
    options = {"load_cell": CELL, "rng": 1, "settings": SHORT} | options
    return infer_as_stated(coarse(), checkpoint=checkpoint, **options)


def test_a_run_that_goes_on_gives_the_draws_of_one_that_was_not_stopped(tmp_path):
    whole = short()
    short(tmp_path / "run", settings=replace(SHORT, max_steps=10))
    rest = short(tmp_path / "run")
    assert rest["sample_stats"].attrs["steps_run"] == 30
    for group in ("posterior", "prior", "posterior_predictive", "events"):
        for name, values in whole[group].data_vars.items():
            np.testing.assert_array_equal(rest[group][name].values, values.values)
    with refused(InferenceError, "nuisances"):
        short(tmp_path / "run", unknown={"rigidity_scale": "default"})


@pytest.mark.slow
def test_a_run_out_of_time_goes_on_from_the_same_start(tmp_path):
    """However little time there is, the search for it is not cut short."""
    for steps in (1, 2, 3):
        hasty = short(tmp_path, settings=replace(SHORT, max_seconds=1e-9))
        assert hasty["sample_stats"].attrs["steps_run"] == steps
    whole = short(settings=replace(SHORT, max_steps=3))
    for name, values in whole["posterior"].data_vars.items():
        np.testing.assert_array_equal(hasty["posterior"][name].values, values.values)
