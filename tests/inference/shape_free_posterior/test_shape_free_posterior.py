"""Contours of any shape: their prior, the coordinates that walkers walk in, and posteriors."""

import numpy as np
import pytest
from scipy import stats
from scipy.special import gamma, kv

from helpers.contour_posteriors import CELL, only, swept, without
from tactile_bayes import Family, LoadCell, Rig, Rod, SamplerSettings, contour_band, infer_contour, scan
from tactile_bayes.contours import Parabola, Smooth, paper_profile
from tactile_bayes.contours.random_radius import RandomRadius
from tactile_bayes.diagnostics.predictive_check import predictive_check
from tactile_bayes.inference.coordinates import in_coordinates
from tactile_bayes.inference.ensembles.run_state import Block, RunState
from tactile_bayes.inference.ensembles.walkers import first_random_state
from tactile_bayes.inference.experiment import Experiment
from tactile_bayes.inference.shape_free_posterior.normal_approximation import Anchor
from tactile_bayes.inference.shape_free_posterior.observations import Observer, linear_names
from tactile_bayes.inference.shape_free_posterior.whitening import _cross_validated, _linear_prior, whitening_at
from tactile_bayes.inference.starts.contour_optimum import contact_fit
from tactile_bayes.inference.starts.residuals import mean_square_left
from tactile_bayes.load_cell.discrepancy import Discrepancy
from tactile_bayes.rig import NOTHING
from tactile_bayes.rig.rig_prior import RigPrior

SI = Rod(length=0.1, flexural_rigidity=2e-4)
SI_CELL = LoadCell(force_noise=0.05 * SI.force_unit, moment_noise=0.02 * SI.moment_unit)
ALL: dict[str, float] = {}  # all that is unknown of a real rig
SMOOTH = {"friction": 0.0}
RADIUS = RandomRadius(shortest=0.4, longest=4.0, tolerance=0.01)


def matern(distance, length, nu=2.5):
    """Of Rasmussen and Williams 2006, equation 4.14."""
    scaled = np.sqrt(2.0 * nu) * np.maximum(distance, 1e-12) / length
    return 2.0 ** (1.0 - nu) / gamma(nu) * scaled**nu * kv(nu, scaled)


@pytest.mark.parametrize("length", [0.5, 1.0, 2.0])
def test_directions_add_up_to_the_covariance_less_its_means(length):
    at = Smooth.nodes(RADIUS.nodes)
    shapes = RADIUS.shapes(np.array([length]))[0]
    places = np.pi * ((np.arange(600) + 0.5) / 600 - 0.5)
    means = matern(np.abs(at[:, None] - places), length).mean(axis=1)
    overall = matern(np.abs(places[::2, None] - places), length).mean()
    exact = matern(np.abs(at[:, None] - at), length) - means[:, None] - means + overall
    # What further directions would add is 1 % of the variance at a length of 0.4, on average.
    assert np.abs(np.diag(shapes @ shapes.T - exact)).mean() < 0.01
    assert np.abs(shapes @ shapes.T - exact).max() < 0.06


def test_their_number_follows_from_the_tolerance():
    counts = [RandomRadius(0.4, 4.0, tolerance).count for tolerance in (0.1, 0.01, 0.001)]
    assert counts == sorted(set(counts))
    assert RandomRadius(0.8, 4.0, 0.01).count < RADIUS.count


def test_the_radius_is_a_geometric_mean():
    rng = np.random.default_rng(1)
    one = np.ones(50)
    log_radius = RADIUS.log_radius(np.log(0.4) * one, 0.8 * one, 0.6 * one, rng.normal(size=(50, RADIUS.count)))
    contours = Smooth(log_radius, q=0.3 * one)
    slopes = np.pi * ((np.arange(500) + 0.5) / 500 - 0.5)
    radii = np.array([contours.radius_of_curvature(np.full(50, slope)) for slope in slopes])
    np.testing.assert_allclose(np.log(radii).mean(axis=0), np.log(0.4), atol=2e-3)


def model_of(unknown=SMOOTH, rod=None, cell=CELL, family="shape-free"):
    contour = paper_profile("II", q=0.5) if rod is None else Parabola(0.5 / rod.length, 0.5 * rod.length)
    measured = cell.measure(scan(contour, rig=Rig(rod=rod), drive_step=np.radians(5.0)).record, rng=1)
    return model_of_record(measured, unknown, cell, family)


def model_of_record(measured, unknown=SMOOTH, cell=CELL, family="shape-free"):
    return Experiment(measured, Rig(load_cell=cell, unknown=unknown), family).model


def whitened(model, discrepancy=()):
    stated = [float(model.priors[name].median()) for name in model.unknowns.names]
    point = np.concatenate([contact_fit(model), stated, [1.0], discrepancy])
    return whitening_at(model, point, np.random.default_rng(1))


# With those that may vanish, between others.
RUBBING = only("friction", "bias", "suspension_compliance", "rigidity_scale")


@pytest.mark.parametrize(
    ("rod", "family"),
    [
        pytest.param(None, "shape-free", marks=pytest.mark.slow, id="dimensionless"),
        pytest.param(SI, "shape-free", id="SI"),
        pytest.param(SI, "flat-sided", id="flat-sided"),
    ],
)
def test_coordinates_lead_back_and_a_volume_grows_as_they_say(rod, family):
    """Log-determinant of the derivatives, by differences."""
    whitening = whitened(model_of(rod=rod, cell=CELL if rod is None else SI_CELL, family=family))
    rng = np.random.default_rng(2)
    size = whitening.mean.size
    whitening = whitening.standardised(0.1 * np.arange(size), np.eye(size) + 0.02 * rng.normal(size=(size, size)))
    point = np.append(np.log(whitening.scales) + 0.2 * rng.normal(size=3), rng.normal(size=whitening.middle.size - 3))
    steps = 1e-5 * np.eye(point.size)
    ahead, behind = (whitening.parameters(point + sign * steps)[0] for sign in (1.0, -1.0))
    sign, determinant = np.linalg.slogdet((ahead - behind) / 2e-5)
    there, growth = whitening.parameters(point[None])
    assert growth[0] == pytest.approx(determinant, abs=1e-4)
    assert sign != 0.0
    np.testing.assert_allclose(whitening.of(there)[0], point, atol=1e-6)


@pytest.mark.parametrize("width", [3.0, 0.4])
def test_mean_and_covariance_of_what_is_not_standard_normal_are_found(width):
    """One direction of twelve has another width, all are shifted: afterwards they are standardised. Means within five
    standard errors of as many draws as walkers; eleven widths of one change by less than a tenth, where those of as
    many draws would be off by a third."""
    size, walkers = 12, 100
    axis = np.ones(size) / np.sqrt(size)
    mean, root = np.linspace(-1.0, 1.0, size), np.eye(size) + (width - 1.0) * np.outer(axis, axis)
    found = _cross_validated(mean + np.random.default_rng(1).normal(size=(walkers, 4, size)) @ root.T)
    left = np.linalg.solve(root, found.mean - mean)
    assert np.all(np.abs(left) < 5.0 / np.sqrt(walkers))
    sizes = np.linalg.svd(np.linalg.solve(root, found.root), compute_uv=False)
    assert np.all(np.abs(sizes - 1.0) < 0.25)
    assert np.sum(np.abs(sizes - 1.0) < 0.1) >= size - 1


def test_a_run_goes_on_at_the_same_places_in_coordinates_fitted_to_its_steps():
    model = model_of(cell=CELL)
    whitening = whitened(model)
    density, rng = in_coordinates(model.log_probability, whitening), np.random.default_rng(3)
    walks = whitening.middle + 0.1 * rng.normal(size=(2, 6, 40, whitening.middle.size))
    values = density(walks.reshape(-1, walks.shape[-1])).reshape(walks.shape[:-1])
    random = tuple(first_random_state(each) for each in np.random.SeedSequence(1).spawn(2))
    begun = RunState.begin(whitening, Block(walks[:, :1], values[:, :1], random))
    before = begun.append(Block(walks[:, 1:], values[:, 1:], random)).halved()
    after = before.adapted()
    assert np.abs(after.coordinates.root - whitening.root).max() > 0.1
    there = after.last.samples[:, -1].reshape(-1, walks.shape[-1])
    points, _ = after.coordinates.parameters(there)
    right, _ = whitening.parameters(walks[:, -1].reshape(-1, walks.shape[-1]))
    np.testing.assert_allclose(points, right, rtol=1e-9)
    again = in_coordinates(model.log_probability, after.coordinates)(there)
    np.testing.assert_allclose(after.last.log_probability[:, -1].ravel(), again, atol=1e-6)


def test_observations_have_the_covariance_that_a_discrepancy_gives_the_readings():
    """Their information, Uᵀ V⁻¹ U, against the covariance V of all readings, between and at the nodes of tables."""
    smooth = {"discrepancy_scale": stats.lognorm(s=0.5, scale=0.05), "discrepancy_length": stats.lognorm(s=0.5)}
    model = model_of({**SMOOTH, **smooth})
    whitening = whitened(model, [0.05, 1.0])
    seen, course = whitening.approximation.observations, model.likelihood.segments.course
    largest = model.largest_in_contact(whitening.centre) / Observer(model).noise
    _, _, noise, scale, usual = whitening.scales
    for share, length in (
        (scale / noise, usual),
        (2.2 * scale / noise, 0.4 * usual),
        (0.4 * scale / noise, 2.7 * usual),
    ):
        white, known = np.array([[1.3]]), np.array([[1.3 * share, length]])
        every = np.eye(len(seen.kinds))[None]
        root = whitening.approximation._seen(np.hstack([[[1.0, 1.0]], white, known]), every)[0]
        size = len(seen.axes[0])
        information = np.zeros((size, size))
        for axes, deviation in zip(np.moveaxis(seen.axes[0], 2, 0), (share * largest).T, strict=True):
            alike = Discrepancy(course, deviation[:, None], np.asarray(length)).covariance()[..., 0]
            covariance = (np.eye(len(alike)) + alike)[np.ix_(seen.used, seen.used)]
            information += axes @ np.linalg.solve(covariance, axes.T)
        found = 1.3**2 * (root.T @ root)[:size, :size]
        np.testing.assert_allclose(found, information, atol=0.01 * np.abs(information).max())


def test_the_prior_of_a_calibrated_rig_keeps_its_correlations():
    """Along both axes of two parameters the normal prior falls as the model's does; 4,000 draws leave 10 %."""
    priors = {"drive_angle_offset": stats.norm(0.01, 0.02), "backlash": stats.norm(0.0, 0.01)}
    calibration = RigPrior(priors, np.array([[1.0, 0.99], [0.99, 1.0]]), 0.0, "")
    measured = CELL.measure(scan(paper_profile("II", q=0.5), drive_step=np.radians(5.0)).record, rng=1)
    unknown = {name: value for name, value in NOTHING.items() if name not in priors}
    rig = Rig(load_cell=CELL, unknown=unknown, calibration=calibration)
    model = Experiment(measured, rig, "shape-free").model
    prior = _linear_prior(model, np.random.default_rng(1))
    names = linear_names(model)
    point = np.array([float(model.priors[name].median()) for name in model.names])
    for signs in ((1.0, 1.0), (1.0, -1.0)):
        steps = {name: 0.1 * sign * priors[name].std() for name, sign in zip(priors, signs, strict=True)}
        moved, change = point.copy(), np.zeros(len(names))
        for name, step in steps.items():
            moved[model.names.index(name)] += step
            change[names.index(name)] = step
        falls = -np.diff(model.log_prior(np.stack([point, moved])))[0]
        assert 0.5 * np.sum(np.square(prior.root @ change)) == pytest.approx(falls, rel=0.1)


def test_scales_that_lie_far_apart_leave_the_approximation_a_distribution():
    """As a corner asks for them: readings then tell 1e16 times as much of one direction as the prior of another."""
    approximation = whitened(model_of("nothing")).approximation
    scales = np.array([[amplitude, 0.3, noise] for amplitude in (1.0, 1e4, 1e8) for noise in (1.0, 1e-4, 1e-8)])
    pulled, root = approximation.conditional(scales)
    assert np.all(np.isfinite(pulled))
    assert np.all(np.diagonal(root, axis1=1, axis2=2) > 0.0)


@pytest.mark.slow
def test_a_start_out_of_reach_leads_somewhere():
    """Where the rod touches nothing there is no snap-off to be made linear."""
    model = model_of("nothing")
    point = np.concatenate([contact_fit(model), [1.0]])
    point[model.names.index("q")] = 1.5
    centre = whitening_at(model, point, np.random.default_rng(1)).centre
    assert np.all(np.isfinite(centre))


@pytest.mark.parametrize(("noise", "spread"), [(1.0, 1.0), pytest.param(1e-3, 3.0, marks=pytest.mark.slow)])
def test_in_its_coordinates_the_posterior_is_nearly_standard_normal(noise, spread):
    """At one noise, amplitude and length scale: what is left of the log-probability varies by less than 1. With loads
    100,000 times their noise, even three times as far out: slopes that rounding errors leave would narrow directions of
    which the record says nothing."""
    model = model_of(cell=LoadCell(force_noise=noise * CELL.force_noise, moment_noise=noise * CELL.moment_noise))
    whitening = whitened(model)
    normal = spread * np.random.default_rng(3).normal(size=(200, whitening.middle.size - whitening.bent))
    points, growth = whitening.parameters(np.hstack([np.tile(np.log(whitening.scales), (200, 1)), normal]))
    left = model.log_probability(points) + growth + 0.5 * np.sum(normal**2, axis=1)
    assert np.std(left) < 1.0


def assert_in_band(result, truth, width, scale=1.0):
    """Of nine places at most one is outside of the 95 % band, and the record is described."""
    x = scale * np.linspace(-0.6, 0.6, 9)
    band = contour_band(result, x)
    inside = (band.lower <= truth.height(x)) & (truth.height(x) <= band.upper)
    assert inside.sum() >= 8, band
    assert float((band.upper - band.lower).max()) < width * scale
    assert predictive_check(result).passed


@pytest.mark.slow
@pytest.mark.parametrize(
    ("profile", "unknown", "evaluations"),
    [("I", ALL, 50_000), ("II", ALL, 50_000), ("II", "nothing", 40_000), ("III", ALL, 50_000)],
)
def test_a_smooth_contour_is_within_its_band(profile, unknown, evaluations):
    """Converged in some 100 steps. With the unknowns there are 43 parameters in place of 34, and as a step moves two
    walkers for each parameter in each of four ensembles, it makes 344 evaluations in place of 272."""
    truth = paper_profile(profile, q=0.5)
    measured = CELL.measure(scan(truth, drive_step=np.radians(1.0)).record, rng=1)
    result = infer_contour(measured, family="shape-free", rig=Rig(load_cell=CELL, unknown=unknown), rng=1)
    assert result.attrs["converged"], result.attrs["message"]
    assert result["sample_stats"].attrs["evaluations"] < evaluations
    assert_in_band(result, truth, 0.02)


OTHERS = {
    "moment alone": "nothing",
    "friction": only("friction"),
    "drift": only("bias", "drift"),
    "two pivots": only("base"),
    "without events": ALL,
    "SI": ALL,
}


@pytest.mark.slow
@pytest.mark.parametrize("what", OTHERS)
def test_other_rigs(what):
    rod, cell, scale = (SI, SI_CELL, SI.length) if what == "SI" else (Rod(), CELL, 1.0)
    is_parabola = what in ("friction", "SI")
    truth = Parabola(0.5 / scale, 0.5 * scale) if is_parabola else paper_profile("II", q=0.5)
    bases = ((0.0, 0.0), (0.25, 0.0)) if what == "two pivots" else ((0.0, 0.0),)
    friction = 0.2 if what == "friction" else 0.0
    record = swept(truth, bases=bases, rod=rod, friction=friction)
    measured = cell.measure(record, rng=2 if what == "without events" else 1)
    if what == "moment alone":
        measured = without(measured, "force_x", "force_y")
    settings = SamplerSettings(events=what != "without events", max_steps=150 if what == "friction" else 20_000)
    rig = Rig(load_cell=cell, unknown=OTHERS[what])
    assert_in_band(infer_contour(measured, family="shape-free", rig=rig, rng=1, settings=settings), truth, 0.1, scale)


@pytest.mark.slow
def test_what_goes_on_from_a_checkpoint_is_the_same_and_has_units(tmp_path):
    measured = SI_CELL.measure(scan(Parabola(5.0, 0.05), rig=Rig(rod=SI), drive_step=0.05).record, rng=1)

    def run(steps, **options):
        settings = SamplerSettings(ensembles=2, block_steps=10, max_steps=steps)
        return infer_contour(measured, family="shape-free", rng=1, settings=settings, **options)["posterior"]

    run(10, checkpoint=tmp_path / "run")
    resumed, whole = run(20, checkpoint=tmp_path / "run"), run(20)
    for name, draws in whole.data_vars.items():
        np.testing.assert_array_equal(draws, resumed[name])
    units = {name: whole[name].attrs["units"] for name in ("r", "amplitude", "length_scale", "z_1", "q")}
    assert units == {"r": "m", "amplitude": "1", "length_scale": "rad", "z_1": "1", "q": "m"}


def test_what_may_vanish_does_not_end_the_coordinates():
    """Their volume is that of the map, and the centre is possible, though the record was made without friction."""
    model = model_of(RUBBING)
    whitening = whitened(model)
    vanishing = np.flatnonzero(model.may_vanish)
    assert vanishing.size == 2
    assert np.isfinite(model.log_probability(whitening.centre[None]))
    normal = np.random.default_rng(3).normal(size=(200, whitening.middle.size - whitening.bent))
    normal[:3, -2:] = [[-8.0, 8.0], [-40.0, 0.0], [30.0, -30.0]]
    there = np.hstack([np.tile(np.log(whitening.scales), (200, 1)), normal])
    points, growth = whitening.parameters(there)
    assert np.all(points[3:, vanishing] > 0.0)
    assert not np.isnan(growth).any()
    np.testing.assert_allclose(whitening.of(points[3:]), there[3:], atol=1e-5)
    steps = 1e-5 * np.eye(there.shape[1])
    ahead, behind = (whitening.parameters(there[3] + sign * steps)[0] for sign in (1.0, -1.0))
    _, determinant = np.linalg.slogdet((ahead - behind) / 2e-5)
    assert growth[3] == pytest.approx(determinant, abs=1e-4)


def test_the_record_is_seen_where_friction_has_all_but_vanished():
    """From there a step to less leads below zero, where there are no loads."""
    model = model_of(RUBBING)
    point = whitened(model).centre
    point[np.flatnonzero(model.may_vanish)] = 1e-9
    found = whitening_at(model, point, np.random.default_rng(1)).centre
    assert model.log_probability(found[None]) > model.log_probability(point[None]) - 1.0
    assert mean_square_left(model, found) < 1.2


def test_time_that_ends_before_anything_possible_is_found_gives_what_the_prior_allows():
    """Of a vertex far above where the rod was: no approximation by normal distributions leads there."""
    kept = infer_contour(
        CELL.measure(scan(Parabola(0.5, 0.5), drive_step=0.06).record, rng=1),
        family=Family("shape-free", q=stats.uniform(0.9, 0.05)),
        rig=Rig(load_cell=CELL),
        rng=1,
        settings=SamplerSettings(ensembles=2, max_seconds=1e-3),
    )
    assert kept.attrs["converged"] == 0
    assert "time allowed" in kept.attrs["message"]
    assert ((kept["posterior"].q > 0.9) & (kept["posterior"].q < 0.95)).all()


@pytest.mark.parametrize("bias", [0.0, 0.3])
def test_a_zero_that_is_not_known_hides_no_snap_off(bias):
    """The same samples are loaded, and the snap-offs between the same samples, if all readings are shifted."""
    cell = LoadCell(force_noise=0.05, moment_noise=0.02, bias=(bias, -bias, bias))
    record = scan(paper_profile("II", q=0.5), drive_step=np.radians(2.0)).record
    found = Observer(model_of_record(cell.measure(record, rng=1)))
    assert found.ends.all()
    loaded = (record.holding_moment != 0.0).values
    assert np.count_nonzero(found.loaded != loaded) <= 6  # just after first contact the noise hides the load


_NODES = 32


def _log_radii(count, seed=1):
    """Return logarithms of radii that change by some tens of per cent along a contour, shape (count, nodes)."""
    alpha = Smooth.nodes(_NODES)
    waves = np.stack([np.cos(k * alpha + k) for k in range(4)])
    return -0.5 + np.random.default_rng(seed).normal(scale=0.3, size=(count, 4)) @ waves


def _place(log_radius, slope_angle):
    """Return heights and distances from the vertex at a slope angle, shape (n, 2)."""
    at = Smooth(log_radius, q=np.zeros(len(log_radius))).locate(np.full((1,), slope_angle))
    return np.column_stack([at.y, at.x])


@pytest.mark.parametrize("slope_angle", [-1.2, -0.3, 0.8])
def test_what_is_beyond_a_line_is_the_rest_of_the_contours_place(slope_angle):
    """The line is through differences of the contour's place."""
    centre, others = _log_radii(1)[0], _log_radii(5, seed=2)
    steps = 1e-5 * np.eye(_NODES)
    slopes = (_place(centre + steps, slope_angle) - _place(centre - steps, slope_angle)) / 2e-5
    linear = _place(centre[None], slope_angle) + (others - centre) @ slopes
    beyond = Anchor(slope_angle, centre).beyond_line(others)
    assert np.all(np.abs(beyond) > 1e-4)
    np.testing.assert_allclose(beyond, _place(others, slope_angle) - linear, rtol=1e-4, atol=1e-7)


def test_at_the_centre_and_for_small_changes_there_is_nothing_beyond():
    centre = _log_radii(1)[0]
    anchor = Anchor(0.7, centre)
    np.testing.assert_array_equal(anchor.beyond_line(centre[None]), 0.0)
    assert np.abs(anchor.beyond_line(centre + 1e-4 * np.eye(_NODES))).max() < 1e-8


def test_the_best_anchor_is_where_the_deviations_leave_the_contour():
    """The only deviation changes a radius everywhere, and the vertex so that one place stays."""
    centre = np.full(_NODES, np.log(0.5))
    wider = np.full((1, _NODES), 0.2)
    stays = 0.6
    vertex = -0.2 * 0.5 * np.array([[1.0 - np.cos(stays), np.sin(stays)]])
    assert Anchor.best(centre, wider, vertex).slope_angle == pytest.approx(stays, abs=0.026)


def test_huge_radii_leave_finite_numbers():
    assert np.isfinite(Anchor(1.4, _log_radii(1)[0]).beyond_line(np.full((1, _NODES), 700.0))).all()
