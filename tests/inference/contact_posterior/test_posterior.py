"""Posteriors of single contacts: density against sums over all contacts, layout, chances, and refusals."""

from dataclasses import replace

import numpy as np
import pytest
from arviz_stats.base.array import array_stats
from scipy import stats

from helpers.contact_posteriors import (
    CELL,
    EXACT_ANGLE,
    NAMES,
    ROD,
    SI_CELL,
    Sample,
    density_of,
    measured,
    posterior,
    posterior_at_exact_angle,
    weighed_moments,
)
from helpers.refusals import refused
from tactile_bayes import LoadCell, Rig, infer_contacts, reconstruct, scan, to_arviz
from tactile_bayes.contours import paper_profile
from tactile_bayes.errors import InferenceError, ParameterError, RecordError
from tactile_bayes.load_cell import RandomWalk
from tactile_bayes.mechanics.phases import TANGENTIAL, TIP
from tactile_bayes.record import CHANNELS, record_hash

# No contact; tip or tangential; clearly tangential; before snap-off; backward ones.
SOME = np.array([2, 20, 21, 30, 61, 99, 120])


def some(kind="plain", which=SOME):
    return measured(kind).isel(sample=which)


def infer(kind="plain", which=SOME, **options):
    rig = Rig(load_cell=options.pop("load_cell", SI_CELL if kind == "SI" else CELL))
    return infer_contacts(some(kind, which), rig, **{"rng": 1, **options})


@pytest.fixture(scope="module")
def contacts():
    return infer(draws=2000)


def stats_of(tree):
    return tree["sample_stats"].to_dataset()


def draws_of(tree, i):
    return tree["posterior"].to_dataset().isel(sample=i)


def test_chains_agree_where_one_phase_is_certain(contacts):
    """No two chains have a draw in common, and R̂ is that of independent draws."""
    certain = np.flatnonzero(stats_of(contacts).tangential_probability > 0.9999)
    assert certain.size >= 2
    for i in certain:
        x = draws_of(contacts, i).contact_x.values
        assert np.unique(x).size == sum(np.unique(chain).size for chain in x)
        for name in NAMES:
            assert array_stats.rhat(draws_of(contacts, i)[name].values, chain_axis=0, draw_axis=1) < 1.02


@pytest.mark.slow
@pytest.mark.parametrize("angle_noise", [0.0, 5e-4])
def test_small_errors_leave_the_normal_distribution_of_the_constrained_estimate(angle_noise):
    """Mean, standard deviation and correlation within 4.5 standard errors of 4000 draws, and 1 % for curvature."""
    cell = LoadCell(force_noise=1e-3, moment_noise=4e-4, drive_angle_noise=angle_noise)
    record = cell.measure(scan(paper_profile("II", q=0.5), drive_step=0.3).record, rng=4)
    found = infer_contacts(record, rig=Rig(load_cell=cell), rng=2, draws=4000)
    normal = reconstruct(record, method="constrained", rig=Rig(load_cell=cell))
    stats_ = stats_of(found)
    clear = np.flatnonzero((normal.status == "ok") & (normal.edge_distance > 6.0) & (stats_.converged == 1))
    assert clear.size >= 8
    for i in clear:
        assert bool(stats_.converged[i])
        draws = draws_of(found, i)
        error = 4.5 / np.sqrt(1.0 / (1.0 / float(stats_.effective_draws[i]) + 1.0 / 4000.0))
        for name in NAMES:
            spread = float(normal[f"{name}_sd"][i])
            assert abs(float(draws[name].mean() - normal[name][i])) < (error + 0.01) * spread, (i, name)
            assert float(draws[name].std()) == pytest.approx(spread, rel=error + 0.01), (i, name)
        rho = np.corrcoef(draws.contact_x.values.ravel(), draws.contact_y.values.ravel())[0, 1]
        expected = float(normal.contact_xy_correlation[i])
        assert abs(rho - expected) < (error + 0.02) * (1.0 - expected**2) + 1e-3
        tangential = normal.contact_phase.values[i] == "tangential"
        assert float(draws.tangential.mean()) == float(tangential)


def test_layout(contacts):
    posterior = contacts["posterior"].to_dataset()
    assert list(posterior.data_vars) == [*NAMES, "contact_arclength", "drive_angle", "tangential"]
    assert dict(posterior.sizes) == {"chain": 4, "draw": 500, "sample": SOME.size}
    unloaded = np.isnan(stats_of(contacts).effective_draws.values)
    assert unloaded.tolist() == [True] + [False] * 6
    for name in posterior.data_vars:
        assert (np.isnan(posterior[name].values).all(axis=(0, 1)) == unloaded).all()
        assert (np.isfinite(posterior[name].values).all(axis=(0, 1)) == ~unloaded).all()
    assert (stats_of(contacts).converged.values == ~unloaded).all()
    assert set(contacts.children) == {"posterior", "sample_stats", "observed_data", "constant_data"}
    for name in ("drive_angle", *CHANNELS):
        np.testing.assert_array_equal(contacts["observed_data"][name], some()[name])
    assert contacts.attrs["data_sha256"] == record_hash(some())
    wanted = {"seed": "1", "prior": "flat", "draws": 2000, "converged": 1, "friction": 0.0}
    assert {name: contacts.attrs[name] for name in wanted} == wanted
    assert contacts.attrs["message"] == "6 contacts"
    np.testing.assert_array_equal(to_arviz(contacts).posterior["contact_x"], posterior.contact_x)


def test_draws_are_contacts(contacts):
    posterior = contacts["posterior"].to_dataset().isel(sample=slice(1, None))
    tip = posterior.tangential == 0.0
    assert (posterior.contact_arclength.where(tip, 1.0) == 1.0).all()
    assert ((posterior.contact_arclength > 0.0) & (posterior.contact_arclength <= 1.0)).all()
    assert (posterior.contact_arclength.where(~tip, 0.5) < 1.0).all()
    assert (np.abs(posterior.slope_angle) < 0.5 * np.pi).all()
    assert (np.hypot(posterior.contact_x, posterior.contact_y) < 1.0).all()


def test_an_exact_encoder_has_no_drive_angle_to_draw():
    tree = infer_contacts(some("exact angle", [20, 61]), rig=Rig(load_cell=EXACT_ANGLE), rng=1)
    assert "drive_angle" not in tree["posterior"]


def test_few_draws_will_do_and_say_their_seed_and_progress():
    calls, seeds = [], np.random.SeedSequence(5).spawn(2)
    trees = [infer(which=[21, 61], draws=4, rng=seed, progress=lambda *call: calls.append(call)) for seed in seeds]
    assert trees[0]["posterior"].sizes["draw"] == 1
    assert trees[0].attrs["message"] == "2 contacts"
    assert [tree.attrs["seed"] for tree in trees] == ["5, spawn key (0,)", "5, spawn key (1,)"]
    assert calls[-1] == (2, 2)


def test_si_is_the_dimensionless_record_in_other_units():
    """The same random numbers: to 1e-6."""
    record = measured("SI").isel(sample=[25, 62, 105])
    found = infer_contacts(record, rig=Rig(load_cell=SI_CELL), rng=3)
    length, thin = ROD.length_unit, replace(ROD, diameter=0.0)
    line = infer_contacts(record, rig=Rig(rod=thin, load_cell=SI_CELL), rng=3)
    slope = found["posterior"].slope_angle
    for name, shift in (("contact_x", -0.5 * np.sin(slope)), ("contact_y", 0.5 * np.cos(slope))):
        expected = line["posterior"][name] + ROD.diameter * shift
        np.testing.assert_allclose(found["posterior"][name], expected, rtol=0.0, atol=1e-6 * length)
    assert found["posterior"].contact_x.attrs["units"] == "m"
    assert float(found["posterior"].contact_arclength.max()) <= length


@pytest.mark.slow
@pytest.mark.parametrize(
    "further",
    [
        {"degrees_of_freedom": 4.0},
        {"force_resolution": 0.1, "moment_resolution": 0.05},
        {"bias": (0.1, -0.2, 0.3), "gain": ((1.02, 0.01, 0.0), (-0.02, 0.97, 0.03), (0.0, 0.02, 1.05))},
        {"bias_uncertainty": (0.02, 0.05, 0.05)},
        {"drift": RandomWalk(moment=1e-3, force=2e-3), "relative_noise": 0.05},
        {"correlation": (0.6, -0.3, 0.2), "drive_angle_offset": 0.1},
        {"drive_angle_resolution": 0.01},
    ],
    ids=lambda further: " ".join(further),
)
def test_the_truth_is_within_reach_of_the_posterior(further):
    """Squared distances of the truth, in standard deviations, of 20 contacts and more; not a calibration."""
    cell = LoadCell(force_noise=0.05, moment_noise=0.02, **further)
    record = cell.measure(scan(paper_profile("II", q=0.5), drive_step=0.1).record, rng=6)
    tree = infer_contacts(record, rig=Rig(load_cell=cell), rng=1)
    certain = stats_of(tree).tangential_probability.values > 0.999  # else the slope is far from normal
    on = certain & (stats_of(tree).converged.values == 1) & (record.truth_contact_phase.values != "none")
    assert on.sum() > 20
    posterior = tree["posterior"].to_dataset()
    for name in ("contact_x", "slope_angle"):
        draws = posterior[name].values[:, :, on]
        off = (draws.mean(axis=(0, 1)) - record[f"truth_{name}"].values[on]) / draws.std(axis=(0, 1))
        assert np.abs(off).max() < 5.0
        # One bias shifts all contacts alike, and is in the spread of each.
        assert 0.2 < np.mean(off**2) < (8.0 if "bias_uncertainty" in further else 2.0)


@pytest.mark.slow
@pytest.mark.parametrize("degrees_of_freedom", [1.5, 2.0, 3.0])
def test_outliers_of_every_kind_have_posteriors(degrees_of_freedom):
    tree = infer(which=[21, 61, 99], load_cell=replace(CELL, degrees_of_freedom=degrees_of_freedom))
    assert stats_of(tree).converged.all()


def test_what_samples_share_is_called_an_approximation():
    cell = replace(CELL, bias_uncertainty=(0.01, 0.01, 0.01), drive_angle_resolution=0.01)
    words = infer(which=[61], load_cell=cell).attrs["approximations"]
    assert "bias and drift" in words
    assert "the drive angle" in words
    assert infer(which=[61]).attrs["approximations"] == ""


def test_draws_have_the_phases_of_the_weights():
    tree = infer(draws=4000, which=[20, 21, 99])
    for i in range(3):
        share = float(stats_of(tree).tangential_probability[i])
        by_chain = draws_of(tree, i).tangential.values.mean(axis=1)
        assert abs(by_chain.mean() - share) < 4.0 * np.sqrt(share * (1.0 - share) / 4000)
        assert np.abs(by_chain - share).max() < 4.5 * np.sqrt(share * (1.0 - share) / 700)


def test_a_sample_that_no_contact_explains_leaves_the_others_alone():
    bad = some(which=[20, 21, 61])
    bad.force_y[1] = -50.0
    tree = infer_contacts(bad, rig=Rig(load_cell=CELL), rng=1)
    assert stats_of(tree).converged.values[[0, 2]].all()
    assert stats_of(tree).converged[1] == 0
    assert np.isfinite(tree["posterior"].contact_x.values[..., [0, 2]]).all()
    assert "not converged: 1" in tree.attrs["message"]


def test_cut_off_samples_are_left_out():
    strong = some(which=[61, 99, 120])
    cell = replace(CELL, force_range=1.001 * float(np.abs(strong.force_y).min()))
    cut = strong.copy(deep=True)
    for name in ("force_x", "force_y"):
        cut[name] = cut[name].clip(-cell.force_range, cell.force_range)
    left = (np.abs(strong.force_y.values) < cell.force_range) & (np.abs(strong.force_x.values) < cell.force_range)
    assert 0 < np.count_nonzero(left) < 3
    tree = infer_contacts(cut, rig=Rig(load_cell=cell), rng=1)
    assert (np.isfinite(tree["posterior"].contact_x.values).all(axis=(0, 1)) == left).all()
    assert (stats_of(tree).converged.values == left).all()


def bare(*missing):
    """Some samples without a load cell in the header, and without these channels."""
    record = some().copy(deep=True)
    for name in missing:
        record[name][:] = np.nan
    record.attrs = {name: value for name, value in record.attrs.items() if not name.startswith("load_cell_")}
    return record


BIASED = replace(CELL, bias_uncertainty=(0.01, 0.01, 0.01))
CUT_OFF = replace(BIASED, moment_range=0.9)


@pytest.mark.parametrize(
    ("record", "cell", "kind", "named"),
    [
        (lambda: bare("force_y"), CELL, RecordError, ["force_y"]),
        (bare, None, ParameterError, ["load_cell="]),
        (bare, LoadCell(), ParameterError, ["load cell", "noise"]),
        (bare, LoadCell(moment_noise=0.02), ParameterError, ["load cell", "noise"]),
        (bare, LoadCell(force_noise=0.05), ParameterError, ["load cell", "noise"]),
        (lambda: some(which=[0, 1, 2]), CELL, InferenceError, ["no sample", "load"]),
        (some, replace(BIASED, degrees_of_freedom=4.0), ParameterError, ["outliers"]),
        (
            lambda: CUT_OFF.measure(scan(paper_profile("II", q=0.5), drive_step=0.1).record, rng=1),
            CUT_OFF,
            ParameterError,
            ["end of the load cell's range"],
        ),
    ],
)
def test_records_and_load_cells_that_do_not_go_together_are_refused(record, cell, kind, named):
    with refused(kind, *named):
        infer_contacts(record(), rig=Rig(load_cell=cell), rng=1)


CELLS = {"plain": CELL, "turning": CELL, "SI": SI_CELL, "exact angle": EXACT_ANGLE}

# The first loaded sample of a sweep, in tip contact, in between, in tangential contact, and the last before snap-off.
SAMPLES = {
    "plain": [16, 17, 18, 19, 21, 24, 39, 61, 62, 96, 98, 99, 101, 119, 140, 141],
    "turning": [17, 19, 20, 22, 40, 61, 62, 95, 97, 98, 100, 118, 140, 141],
    "SI": [17, 19, 20, 22, 40, 62, 63, 97, 99, 100, 102, 120, 141, 142],
    "exact angle": [17, 18, 19, 20, 22, 25, 40, 61, 62, 96, 97, 98, 99, 101, 104, 119, 140, 141],
}


def assert_agrees(density, exact):
    """Within 4 standard errors of proposals and sum together; shares of a phase no nearer than a draw can tell."""
    (found,), weights = weighed_moments(density)
    draws = float(weights.effective_draws[0])
    error = np.sqrt(exact.spread**2 / draws + exact.error**2 + np.append(np.full(9, 1e-12), 1.0 / draws) ** 2)
    np.testing.assert_array_less(np.abs(found - exact.numbers) / error, 4.0)
    return weights


# Ten numbers a sample, normal errors: false alarm 6e-4 a sample.
@pytest.mark.slow
@pytest.mark.parametrize(
    ("kind", "i", "friction"),
    [("plain", 141, 0.3), *((kind, i, 0.0) for kind, numbers in SAMPLES.items() for i in numbers)],
)
def test_the_posterior_is_that_of_a_sum_over_all_contacts(kind, i, friction):
    sample = Sample(measured(kind), i, CELLS[kind], friction)
    exact = posterior_at_exact_angle(sample, cells=300) if kind == "exact angle" else posterior(sample, cells=44)
    density = density_of(measured(kind), CELLS[kind], i, friction=friction)
    assert assert_agrees(density, exact).certified.all()


def random_coordinates(rng, count):
    """Force, ψ1, arc length and drive angle on both sheets, and the phases."""
    phase = rng.choice([TIP, TANGENTIAL], count).astype(np.int8)
    tip = phase == TIP
    psi1 = np.where(tip, rng.uniform(0.05, 1.2, count), 0.0)
    arclength = np.where(tip, 1.0, rng.uniform(0.4, 0.95, count))
    return np.stack([rng.uniform(0.2, 2.0, count), psi1, arclength, rng.uniform(1.2, 2.2, count)], -1), phase


@pytest.mark.parametrize("i", [21, 101])
def test_the_density_is_likelihood_times_prior_times_volume(i):
    """The volume from differences of contact points, which have half of the digits."""
    rng, record = np.random.default_rng(4), measured()
    density, sample = density_of(record, CELL, i), Sample(record, i, CELL)
    z, phase = random_coordinates(rng, 200)
    logs, places = density.log_density(z[:, None], phase[:, None])[:, 0], density.contacts(z[:, None])[:3, :, 0].T
    expected, phases = sample.log_likelihood(places)
    use = np.isfinite(logs) & (logs > -1e4)
    assert use.sum() > 40
    assert {TIP, TANGENTIAL} <= set(phases[use])
    assert (phases[use] == phase[use]).all()
    columns = []
    for step in range(4):
        moved = (density.contacts((z + move * np.eye(4)[step])[:, None]) for move in (1e-6, -1e-6))
        ahead, behind = (each[:3, :, 0].T for each in moved)
        columns.append((ahead - behind) / 2e-6)
    slopes = np.stack(columns, axis=-1)
    free = np.where((phase == TIP)[:, None], [[0, 1, 3]], [[0, 2, 3]])
    volume = np.abs(np.linalg.det(np.take_along_axis(slopes, free[:, None, :], axis=2)))
    np.testing.assert_allclose(logs[use], (expected + np.log(volume))[use], rtol=0.0, atol=2e-5)


def test_what_no_rod_can_do_has_no_density():
    density = density_of(measured(), CELL, 21)
    z = np.array([[0.5, 0.3, 1.0, 1.5]] * 6)
    phase = np.array([TIP] * 6, dtype=np.int8)
    z[1, 0] = -0.1  # it pulls
    z[2, 1] = -0.1  # beyond the tangent
    z[3, 1] = 1.6  # pushed back along itself
    z[4, 2] = 1.1  # beyond the tip
    z[5, 3] = 3.4  # on a slope that looks down
    assert np.isfinite(density.log_density(z[:, None], phase[:, None])[:, 0]).tolist() == [True] + [False] * 5


@pytest.mark.slow
@pytest.mark.parametrize("i", [16, 101])
def test_polar_is_flat_over_distance(i):
    exact = posterior(Sample(measured(), i, CELL), log_prior=lambda x, y, slope: -0.5 * np.log(x**2 + y**2))
    assert_agrees(density_of(measured(), CELL, i, prior="polar"), exact)


@pytest.mark.parametrize(("kind", "i"), [pytest.param("plain", 21, marks=pytest.mark.slow), ("SI", 102)])
def test_a_prior_of_ones_own_is_in_the_record_s_units_and_axes(kind, i):
    record, cell = measured(kind), CELLS[kind]
    about = posterior(Sample(record, i, cell), cells=16)
    middle = about.mean + about.sd

    def prior(x, y, slope):
        return stats.norm.logpdf(x, middle[0], about.sd[0]) + stats.norm.logpdf(slope, middle[2], 2.0 * about.sd[2])

    exact = posterior(Sample(record, i, cell), log_prior=prior, cells=16)
    assert_agrees(density_of(record, cell, i, prior=prior), exact)


@pytest.mark.parametrize(
    ("prior", "named"),
    [
        ("round", ["prior", "'round'"]),
        (lambda x, y, slope: 0.0, ["prior", "shape"]),
        (lambda x, y, slope: x[0], ["prior", "shape"]),
        (lambda x, y, slope: np.where(x > 0.0, np.nan, 0.0 * slope), ["prior", "not a number"]),
    ],
)
def test_a_prior_that_is_none_is_refused(prior, named):
    with refused(ParameterError, *named):
        weighed_moments(density_of(measured(), CELL, [21, 61], prior=prior))
