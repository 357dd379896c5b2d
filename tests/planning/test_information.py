"""What a record tells: against the curvature of the likelihood, dense algebra, exact scaling, and a posterior."""

import itertools
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scipy import integrate, stats

import tactile_bayes as tb
from helpers.load_cells import CELL
from tactile_bayes.contours import Parabola, paper_profile
from tactile_bayes.load_cell import OrnsteinUhlenbeck, RandomWalk
from tactile_bayes.planning.information import information
from tactile_bayes.planning.plan import Plan
from tactile_bayes.planning.record_information import prior_precision, reading_slopes, record_information
from tactile_bayes.record import loads_of
from tactile_bayes.rig import NOTHING, Rig
from tactile_bayes.rig.parameters import GROUPS
from tactile_bayes.rig.rig_prior import RigPrior
from tactile_bayes.rig.unknown import expanded

PROFILE = paper_profile("II", q=0.5)
told = cache(information)
DOUBLE = Plan(PROFILE, Rig(load_cell=CELL), drive=tb.Rotation(drive_step=np.radians(2.0)))

# Drive angles clear of first contacts and snap-offs of both sweeps, the last one unloaded.
BETWEEN = np.concatenate([np.linspace(0.9, 2.2, 14), np.linspace(2.5, 3.05, 5), [3.3]])
CELLS = {
    "white": CELL,
    "correlated": replace(CELL, correlation=(0.3, -0.2, 0.6)),
    "bias": replace(CELL, bias_uncertainty=(0.03, 0.1, 0.0)),
    "random walk": replace(CELL, drift=RandomWalk(moment=0.004, force=0.01)),
    "wandering": replace(CELL, drift=OrnsteinUhlenbeck(moment=0.02, force=0.03, time=5.0)),
    "bias and walk": replace(CELL, bias_uncertainty=(0.02, 0.0, 0.1), drift=RandomWalk(force=0.01)),
}


def only(*names, cell=CELL):
    """The rig of which these parameters are unknown."""
    return Rig(load_cell=cell, unknown={**NOTHING, **dict.fromkeys(names, "default")})


def between(*unknown, cell=CELL, **options):
    rig = only(*(unknown or ("rigidity_scale", "drive_angle_offset")), cell=cell)
    return Plan(PROFILE, rig, drive=tb.Rotation(drive_angles=BETWEEN), **options)


def located(plan):
    return plan.point[: len(plan.model.forward_parameters)]


@cache
def swept(a, q, x_c, less, direction):
    """Loads by `scan` at angles that are less than those of BETWEEN, shape (samples, 3)."""
    record = tb.scan(Parabola(a, q, x_c), drive_angles=BETWEEN - less, direction=direction).record
    return loads_of(record), record.drive_angle.values


def readings(plan, values, by_angle=0.0):
    """What the plan's cell would read, by `scan`: shape (samples, 3)."""
    of = dict(zip(plan.model.forward_parameters, map(float, values), strict=True))
    less = of.get("drive_angle_offset", 0.0) - by_angle
    loads, angles = swept(of["a"], of["q"], of["x_c"], less, plan.drive.direction)
    if plan.cell.frame == "turning":
        cos, sin = np.cos(angles), np.sin(angles)
        moment, x, y = loads.T
        loads = np.stack([moment, cos * x + sin * y, cos * y - sin * x], axis=-1)
    loads = loads * of.get("rigidity_scale", 1.0)
    return loads + [of.get(f"{name}_bias", 0.0) for name in ("moment", "force_x", "force_y")]


def scan_slopes(plan):
    """Of the readings by parameters, shape (samples, 3, d), and by the drive angle; steps of 1e-5 leave some 1e-10."""
    centre = located(plan)
    moves = 1e-5 * np.eye(centre.size)
    every = [(readings(plan, centre + move) - readings(plan, centre - move)) / 2e-5 for move in moves]
    by_angle = (readings(plan, centre, 1e-5) - readings(plan, centre, -1e-5)) / 2e-5
    return np.stack(every, axis=-1), by_angle


def assert_matrices_agree(found, right, tolerance):
    """In standard deviations of the right one."""
    scale = np.sqrt(np.diag(right))
    np.testing.assert_allclose(found / np.outer(scale, scale), right / np.outer(scale, scale), rtol=0.0, atol=tolerance)


@pytest.mark.parametrize("name", CELLS)
def test_information_is_the_curvature_of_the_log_likelihood(name):
    """At readings without noise, where curvature is information; second differences over a tenth of a deviation.

    What fourth derivatives leave is of the order of the square of the deviations, about 1e-3 of parameters, beside one.
    """
    unknown = ["rigidity_scale"] + ["bias"] * (name in ("white", "correlated"))
    plan = between(*unknown, cell=CELLS[name])
    centre = located(plan)
    data = readings(plan, centre)
    found = record_information(plan.model, plan.point).matrix[: centre.size, : centre.size]
    # About a tenth of a deviation, and the same for all cells.
    step = np.array([1e-4, 1.5e-5, 5e-5, 1e-4, 3e-4, 1e-3, 1e-3])[: centre.size]
    moves, right = np.diag(step), np.empty((centre.size, centre.size))

    def log_likelihood(move):
        return float(plan.cell.log_likelihood(data, readings(plan, centre + move)))

    for i, j in itertools.combinations_with_replacement(range(centre.size), 2):
        signs = itertools.product((1, -1), repeat=2)
        mixed = sum(one * other * log_likelihood(one * moves[i] + other * moves[j]) for one, other in signs)
        right[i, j] = right[j, i] = -mixed / (4.0 * step[i] * step[j])
    assert_matrices_agree(found, right, 1e-4)


@pytest.mark.parametrize(("name", "frame"), [("white", "fixed"), ("correlated", "turning")])
def test_information_of_an_encoder_is_that_of_dense_algebra(name, frame):
    """From slopes of scans, with which those of the model agree."""
    cell, encoder = replace(CELLS[name], drive_angle_noise=0.004, frame=frame), 0.004
    plan = between("rigidity_scale", "drive_angle_offset", "bias", cell=cell)
    slopes, by_angle = scan_slopes(plan)
    found = reading_slopes(plan.model, plan.point)
    scale = np.abs(slopes).max(axis=(0, 1))
    np.testing.assert_allclose(found.by_parameters / scale, slopes / scale, rtol=0.0, atol=1e-6)
    np.testing.assert_allclose(found.by_angle, by_angle, rtol=0.0, atol=1e-6 * np.abs(by_angle).max())
    np.testing.assert_allclose(found.loads, readings(plan, located(plan)), rtol=0.0, atol=1e-6)
    white = np.outer(cell.noise, cell.noise) * cell.correlation_matrix
    each = [np.linalg.inv(white + encoder**2 * np.outer(turned, turned)) for turned in by_angle]
    right = np.einsum("nci,ncd,ndj->ij", slopes, each, slopes)
    size = len(plan.model.forward_parameters)
    assert_matrices_agree(record_information(plan.model, plan.point).matrix[:size, :size], right, 1e-6)


def test_gains_of_a_point_multiply_the_slopes_by_the_drive_angle():
    plan = between("gain", cell=replace(CELL, drive_angle_noise=0.004))
    gains = np.array([1.1, 0.9, 1.3])
    stated, other = plan.point.copy(), plan.point.copy()
    columns = [plan.model.names.index(name) for name in GROUPS["gain"]]
    stated[columns], other[columns] = 1.0, gains
    one, many = (reading_slopes(plan.model, point).by_angle for point in (stated, other))
    np.testing.assert_allclose(many, gains * one, rtol=1e-9, atol=1e-9 * np.abs(one).max())


def test_information_beside_a_discrepancy_is_that_of_dense_algebra():
    plan = between("rigidity_scale", "drive_angle_offset", "bias", "discrepancy")
    slopes, _ = scan_slopes(plan)
    discrepancy = plan.model.discrepancy_at(plan.point)
    assert np.sum(np.isinf(discrepancy.course.step)) == 2
    size, right = len(plan.model.forward_parameters), 0.0
    for c, noise in enumerate(CELL.noise):
        covariance = discrepancy.covariance()[..., c] + noise**2 * np.eye(len(slopes))
        right = right + slopes[:, c].T @ np.linalg.solve(covariance, slopes[:, c])
    found = record_information(plan.model, plan.point).matrix
    assert_matrices_agree(found[:size, :size], right, 1e-6)
    assert np.all(found[-2:] == 0.0)


def test_gain_that_is_known_changes_nothing_where_noise_goes_with_it():
    """Readings twice as large with noise twice as large."""
    double = tuple(map(tuple, 2.0 * np.eye(3)))
    louder = tb.LoadCell(force_noise=0.1, moment_noise=0.04, gain=double)
    plain, doubled = (record_information(p.model, p.point).matrix for p in (between(), between(cell=louder)))
    assert_matrices_agree(doubled, plain, 1e-9)


@pytest.mark.parametrize("nu", [3.0, pytest.param(10.0, marks=pytest.mark.slow)])
def test_students_t_tells_less_by_a_known_factor(nu):
    """Fisher's information of place and scale by numerical integration."""
    law = stats.t(nu)

    def mean(score):
        return 2.0 * integrate.quad(lambda z: score(z) ** 2 * law.pdf(z), 0.0, np.inf)[0]

    of_place = mean(lambda z: (nu + 1.0) * z / (nu + z * z))
    of_scale = mean(lambda z: (nu + 1.0) * z * z / (nu + z * z) - 1.0)
    cells = (CELL, replace(CELL, degrees_of_freedom=nu))
    normal, outlying = (record_information(p.model, p.point).matrix for p in (between(cell=cell) for cell in cells))
    np.testing.assert_allclose(outlying[:-1, :-1], of_place * normal[:-1, :-1], rtol=1e-6, atol=1e-6)
    assert outlying[-1, -1] == pytest.approx(of_scale * 3 * 2 * BETWEEN.size, rel=1e-8)
    assert normal[-1, -1] == pytest.approx(2.0 * 3 * 2 * BETWEEN.size)


def test_what_cannot_be_negative_is_looked_at_from_inside():
    """Friction and compliance of the suspension, against differences of scans with some of it."""
    plan = between("friction", "suspension_compliance")
    found = reading_slopes(plan.model, plan.point).by_parameters

    def read(friction):
        record = tb.scan(PROFILE, drive_angles=BETWEEN, rig=Rig(unknown={"friction": friction})).record
        return loads_of(record)

    right = (4.0 * read(1e-4) - read(2e-4) - 3.0 * read(0.0)) / 2e-4
    np.testing.assert_allclose(found[..., 3], right, rtol=0.0, atol=1e-3 * np.abs(right).max())
    # The pivot turns by compliance times moment, to first order: as if the drive angle were less by that.
    _, by_angle = scan_slopes(between())
    moment = readings(between(), located(between()))[:, :1]
    right = -by_angle * moment
    np.testing.assert_allclose(found[..., 4], right, rtol=0.0, atol=1e-3 * np.abs(right).max())


def test_a_calibrated_rig_knows_its_parameters_together():
    """With the covariance of a normal copula, by inversion of the whole matrix."""
    sds, correlation = [0.02, 0.01], -0.995
    priors = {"rigidity_scale": stats.lognorm(s=sds[0]), "drive_angle_offset": stats.norm(0.0, sds[1])}
    joint = RigPrior(priors, np.array([[1.0, correlation], [correlation, 1.0]]), 0.0, "0")
    unknown = {name: value for name, value in expanded(NOTHING).items() if name not in priors}
    rig = Rig(load_cell=CELL, unknown=unknown, calibration=joint)
    plan = Plan(PROFILE, rig, drive=tb.Rotation(drive_angles=BETWEEN))
    names = [plan.model.names.index(name) for name in priors]
    found = np.linalg.inv(prior_precision(plan.model)[np.ix_(names, names)])
    right = [float(plan.model.priors[name].std()) for name in priors]
    np.testing.assert_allclose(found, np.outer(right, right) * joint.correlation, rtol=1e-9)
    matrix = record_information(plan.model, plan.point).matrix
    prior = np.diag([float(plan.model.priors[name].std()) ** -2.0 for name in plan.model.names])
    prior[np.ix_(names, names)] = np.linalg.inv(np.outer(right, right) * joint.correlation)
    whole = np.sqrt(np.diag(np.linalg.inv(matrix + prior)))
    np.testing.assert_allclose(information(plan).bound_with_priors.values, whole, rtol=1e-6)


def test_bounds_are_inverses_of_the_matrix_with_and_without_priors():
    plan = between("rigidity_scale", "bias")
    found, matrix = told(plan), record_information(plan.model, plan.point).matrix
    sds = [0.3, 0.05]
    rig = plan.rig.with_unknown(rigidity_scale=stats.norm(1.0, sds[1]))
    plan = replace(plan, rig=rig, family=tb.Family("parabola", a=stats.norm(0.5, sds[0])))
    prior = np.array([plan.model.priors[name].std() ** -2.0 for name in plan.model.names])
    assert prior[0] == pytest.approx(sds[0] ** -2)
    np.testing.assert_allclose(prior_precision(plan.model), np.diag(prior), rtol=1e-12)
    informed = information(plan)
    scale = np.sqrt(np.diag(matrix))
    scaled = np.linalg.inv(matrix / np.outer(scale, scale))
    np.testing.assert_allclose(found.bound.values, np.sqrt(np.diag(scaled)) / scale, rtol=1e-6)
    np.testing.assert_allclose(found.bound_if_rest_known.values, 1.0 / scale, rtol=1e-12)
    whole = np.linalg.inv((matrix + np.diag(prior)) / np.outer(scale, scale)) / np.outer(scale, scale)
    sd = np.sqrt(np.diag(whole))
    np.testing.assert_allclose(informed.bound_with_priors.values, sd, rtol=1e-6)
    np.testing.assert_allclose(informed.correlation.values, whole / np.outer(sd, sd), rtol=0.0, atol=1e-6)


def test_what_a_record_does_not_tell_has_no_bound_but_with_priors():
    """One sweep of one sample has three numbers, for seven parameters."""
    plan = Plan(PROFILE, Rig(load_cell=CELL), drive=tb.Rotation(direction="forward", drive_angles=[1.5, 1.6]))
    found = information(plan)
    assert np.isinf(found.bound.sel(parameter=["a", "q", "x_c"]).values).all()
    assert np.all(np.isfinite(found.bound_with_priors.values))
    assert np.all(found.bound_with_priors.values <= found.prior_sd.values * (1.0 + 1e-9))


def test_a_rod_in_si_tells_the_same():
    rod = tb.Rod(length=0.2, flexural_rigidity=2e-3)
    cell = tb.LoadCell(force_noise=0.05 * rod.force_unit, moment_noise=0.02 * rod.moment_unit)
    plan = Plan(Parabola(2.5, 0.1), Rig(load_cell=cell, rod=rod), drive=tb.Rotation(drive_angles=BETWEEN))
    si, plain = information(plan), told(Plan(PROFILE, Rig(load_cell=CELL), drive=tb.Rotation(drive_angles=BETWEEN)))
    zeros, levers = [rod.moment_unit, rod.force_unit, rod.force_unit], [0.2, 0.2]
    units = np.array([5.0, 0.2, 0.2, 1.0, 1.0, *zeros, *levers, 1.0, 1.0, 1.0])
    for name in ("value", "bound", "bound_with_priors", "bound_if_rest_known"):
        np.testing.assert_allclose(si[name].values, units * plain[name].values, rtol=1e-5, err_msg=name)
    for name in ("correlation", "leverage"):
        np.testing.assert_allclose(si[name].values, plain[name].values, rtol=0.0, atol=1e-5, err_msg=name)
    for name in ("height_sd", "gap_width"):
        np.testing.assert_allclose(si[name].values, 0.2 * plain[name].values, rtol=1e-5, err_msg=name)
    assert si.unit.sel(parameter="a") == "1/m"


def test_channels_alone_and_left_out_are_those_of_a_cell_with_the_others_drowned():
    plan = between("rigidity_scale")
    found = told(plan)
    drowned = {
        "bound_of_channel": tb.LoadCell(force_noise=5e4, moment_noise=0.02),
        "bound_without_channel": tb.LoadCell(force_noise=0.05, moment_noise=2e4),
    }
    for name, cell in drowned.items():
        right = information(replace(plan, rig=only("rigidity_scale", cell=cell))).bound_with_priors.values
        bounds = found[name].sel(channel="holding_moment").values
        np.testing.assert_allclose(bounds[:-1], right[:-1], rtol=1e-5, err_msg=name)


def test_leverage_sums_to_what_is_told():
    found = told(DOUBLE)
    assert np.all((found.leverage.values >= 0.0) & (found.leverage.values <= 1.0))
    assert float(found.leverage.sum()) == pytest.approx(found.attrs["leverage_sum"])
    parameters = found.sizes["parameter"] - 1  # what is said of the noise is not in the readings' slopes
    assert found.attrs["leverage_sum"] <= parameters
    # The trace of M (M + P)⁻¹, of another route.
    matrix = record_information(DOUBLE.model, DOUBLE.point).matrix[:-1, :-1]
    prior = np.diag(prior_precision(DOUBLE.model))[:-1]
    scale = np.sqrt(prior)
    values = np.linalg.eigvalsh(matrix / np.outer(scale, scale))
    assert found.attrs["leverage_sum"] == pytest.approx(np.sum(values / (values + 1.0)), rel=1e-6)
    assert found.attrs["readings"] == found.leverage.size


def test_leverage_on_a_parameter_is_what_is_lost_without_the_sample():
    """Of a forward sweep, by a plan without that drive angle."""
    plan = replace(between("rigidity_scale"), drive=tb.Rotation(direction="forward", drive_angles=BETWEEN))
    found = told(plan)
    without = information(plan.at_angles(np.delete(BETWEEN, 7))).bound_with_priors.values
    right = 1.0 - (found.bound_with_priors.values / without) ** 2
    np.testing.assert_allclose(found.leverage_on.values[7, :-1], right[:-1], rtol=0.0, atol=2e-5)
    np.testing.assert_allclose(found.leverage_on.values[-1, :3], 0.0, atol=1e-12)  # unloaded


def test_the_band_is_that_of_draws_from_the_bounds():
    """Standard deviations of heights over 20000 draws: 0.5 %; five times that for 75 of them, and what bends."""
    found = told(DOUBLE)
    here = found.sel(parameter=["a", "q", "x_c"], parameter_=["a", "q", "x_c"])
    sd = here.bound_with_priors.values
    covariance = here.correlation.values * np.outer(sd, sd)
    a, q, x_c = np.random.default_rng(1).multivariate_normal(here.value.values, covariance, 20000).T[..., None]
    heights = a * (found.x.values - x_c) ** 2 + q
    np.testing.assert_allclose(found.height_sd.values, heights.std(axis=0), rtol=0.025)
    for kind in ("touched", "gap"):
        sd = found.height_sd.values[found.stretch.values == kind]
        assert float(found[f"{kind}_width"]) == pytest.approx(2.0 * 1.959963985 * sd.mean(), rel=1e-6)
    np.testing.assert_allclose(found.height.values, 0.5 * found.x.values**2 + 0.5, rtol=1e-12)
    narrower = information(DOUBLE, probability=0.5)
    assert float(narrower.gap_width) == pytest.approx(float(found.gap_width) * 0.6744897502 / 1.9599639845)


def test_stretches_are_between_the_events():
    found, sweeps = told(DOUBLE), DOUBLE.scan.sweeps
    left, right = sorted(sweep.snap_off.contact_x for sweep in sweeps)
    gap, touched = (found.x.values[found.stretch.values == kind] for kind in ("gap", "touched"))
    assert np.all((left < gap) & (gap < right))
    assert np.all((touched <= left + 1e-12) | (touched >= right - 1e-12))
    one = told(replace(DOUBLE, drive=replace(DOUBLE.drive, direction="forward")))
    assert np.isnan(float(one.gap_width))
    assert set(one.stretch.values) == {"touched"}


SETTINGS = tb.SamplerSettings(ensembles=4, walkers=32, max_r_hat=1.01, min_ess=2500.0, max_steps=4000)


@pytest.mark.slow
@pytest.mark.parametrize("factor", [0.1, 0.01])
def test_a_posterior_is_as_wide_as_the_bound(factor):
    """Within 5 %, and three standard errors (of 1.5 % each) of standard deviations from 2500 draws.

    Without friction, which lies at the end of its prior: a posterior that is cut off there is narrower than the bound.
    """
    louder = DOUBLE.with_noise(factor)
    plan = replace(louder, rig=louder.rig.with_unknown(friction=0.0))
    measured = plan.cell.measure(plan.scan.record, rng=1)
    draws = tb.infer_contour(measured, rig=plan.rig, rng=1, settings=SETTINGS)["posterior"].to_dataset()
    bounds = information(plan).bound_with_priors
    # The posterior is as wide as the noise that it finds, which is off by some 3 % in a record of 600 readings.
    found = float(draws.noise_scale.mean())
    for name in bounds.parameter.values:
        ratio = float(draws[name].std()) / float(bounds.sel(parameter=name)) / found
        assert abs(ratio - 1.0) < 0.05 + 3.0 / np.sqrt(2.0 * 2500.0), (name, ratio)
