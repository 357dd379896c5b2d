"""Simulated records against scans of the same truths, without noise to speak of."""

from dataclasses import replace

import numpy as np
import pytest
from scipy import stats

import tactile_bayes as tb
from helpers.refusals import refused
from tactile_bayes.calibration import simulation
from tactile_bayes.calibration.calibrate import experiment_of
from tactile_bayes.calibration.misspecification import Misspecification
from tactile_bayes.calibration.simulation import simulate
from tactile_bayes.contours import Parabola
from tactile_bayes.errors import ReachError
from tactile_bayes.inference.experiment import Experiment
from tactile_bayes.load_cell import LoadCell
from tactile_bayes.mechanics.rods.rod import Rod
from tactile_bayes.record import CHANNELS

QUIET = LoadCell(force_noise=1e-12, moment_noise=1e-12)
NOISY = LoadCell(force_noise=0.05, moment_noise=0.02)
ANGLES = np.radians(np.arange(-30.0, 211.0, 5.0))
PRIORS = {"a": stats.lognorm(s=0.4, scale=0.6), "q": stats.uniform(0.3, 0.4), "x_c": stats.norm(0.0, 0.1)}
SI = Rod(length=0.1, flexural_rigidity=1e-5)


def experiment(*, nuisances=(), priors=PRIORS, load_cell=QUIET, drive_angles=ANGLES, friction=0.0, **options):
    return experiment_of(
        seed=1,
        nuisances=nuisances,
        priors=priors,
        load_cell=load_cell,
        drive_angles=drive_angles,
        friction=friction,
        **options,
    )


def simulated(seed=0, **options):
    return simulate(experiment(**options), np.random.default_rng(seed))


def loads_of(record):
    return np.stack([record[name].values for name in CHANNELS], axis=-1)


def scanned(made, *, offset=0.0, **options):
    """A scan of the same contour, at the angles at which the rod was."""
    contour = Parabola(a=made.truth["a"], q=made.truth["q"], x_c=made.truth["x_c"])
    return tb.scan(contour, drive_angles=ANGLES - offset, **options)


def agree(made, scan, *, rigidity=1.0, zeros=0.0):
    """What was measured and what was scanned, to 1e-8 of the unit of each channel.

    The truths are such that the rod feels some ten of these; where it is pressed harder less can be asked.
    """
    rod = SI if made.measured.attrs["units"] == "SI" else Rod()
    unit = rod.load_units
    expected = rigidity * loads_of(scan.record) + zeros
    np.testing.assert_allclose(loads_of(made.measured) / unit, expected / unit, atol=1e-8, rtol=0.0)
    for name in ("sweep", "base_x", "base_y"):
        np.testing.assert_array_equal(made.measured[name], scan.record[name])
    np.testing.assert_array_equal(made.measured.direction, scan.record.direction)


# ---- loads


@pytest.mark.parametrize("seed", [0, 1])
def test_what_is_measured_is_what_a_scan_feels(seed):
    made = simulated(seed)
    scan = scanned(made)
    np.testing.assert_array_equal(made.measured.drive_angle, scan.record.drive_angle)
    agree(made, scan)
    assert set(made.truth) == {"a", "q", "x_c", "noise_scale"}


@pytest.mark.parametrize("direction", ["forward", "backward"])
def test_of_one_direction(direction):
    made = simulated(direction=direction)
    agree(made, scanned(made, direction=direction))


def test_what_is_drawn_of_the_rig():
    """Rigidity, the encoder's offset and biases; the angles read are those of the truth and the offset."""
    made = simulated(nuisances=("rigidity_scale", "drive_angle_offset", "bias", "drift"))
    truth = made.truth
    biases, drifts = (
        np.array([truth[f"{name}_{what}"] for name in ("moment", "force_x", "force_y")]) for what in ("bias", "drift")
    )
    way = np.linspace(-0.5, 0.5, made.measured.sizes["sample"])[:, None]
    scan = scanned(made, offset=truth["drive_angle_offset"])
    agree(made, scan, rigidity=truth["rigidity_scale"], zeros=biases + drifts * way)
    np.testing.assert_allclose(
        made.measured.drive_angle, scan.record.drive_angle + truth["drive_angle_offset"], atol=1e-12
    )


def read_with(made, lever, backlash):
    """What a cell with these flaws would read of the same truth, at the angles at which the rod was."""
    contour = Parabola(a=made.truth["a"], q=made.truth["q"], x_c=made.truth["x_c"])
    parts = [
        tb.scan(contour, direction=direction, drive_angles=ANGLES - sense * backlash).record
        for direction, sense in (("forward", 0.5), ("backward", -0.5))
    ]
    loads = np.concatenate([loads_of(part) for part in parts])
    loads[:, 0] += lever[1] * loads[:, 1] - lever[0] * loads[:, 2]
    return loads


def test_a_lever_and_a_backlash_that_are_drawn():
    made = simulated(nuisances=("lever", "backlash"))
    lever, backlash = (made.truth["lever_x"], made.truth["lever_y"]), made.truth["backlash"]
    assert min(map(abs, (*lever, backlash))) > 1e-4
    np.testing.assert_allclose(loads_of(made.measured), read_with(made, lever, backlash), atol=1e-7)


@pytest.mark.parametrize("told", [0.0, 0.5])
def test_a_lever_and_a_backlash_of_the_cell_that_measures(told):
    """The readings are the same, whatever is told of them; what the encoder reads is known where it is told."""
    true, known = (
        replace(QUIET, lever=(0.03 * share, -0.02 * share), drive_angle_backlash=0.02 * share) for share in (1.0, told)
    )
    made = simulated(load_cell=known, world=Misspecification(load_cell=true))
    way = np.where(made.measured.direction == "forward", 0.5, -0.5)
    np.testing.assert_allclose(made.measured.drive_angle - 0.02 * told * way, np.r_[ANGLES, ANGLES[::-1]], atol=1e-12)
    np.testing.assert_allclose(loads_of(made.measured), read_with(made, (0.03, -0.02), 0.02 * (1.0 - told)), atol=1e-7)


def test_the_world_has_the_same_on_top():
    world = Misspecification(
        rigidity_scale=1.1,
        drive_angle_offset=0.05,
        bias=(0.1, 0.2, 0.3),
        drift=(-0.1, 0.0, 0.4),
        base_shift=(0.03, -0.02),
    )
    made = simulated(world=world)
    way = np.linspace(-0.5, 0.5, made.measured.sizes["sample"])[:, None]
    contour = Parabola(a=made.truth["a"], q=made.truth["q"] + 0.02, x_c=made.truth["x_c"] - 0.03)
    scan = tb.scan(contour, drive_angles=ANGLES - 0.05)  # as seen from the pivot where it is
    agree(made, scan, rigidity=1.1, zeros=np.array(world.bias) + np.array(world.drift) * way)


@pytest.mark.parametrize(
    ("told", "further"),
    [pytest.param(0.0, 0.3, marks=pytest.mark.slow), (0.1, 0.2), pytest.param(0.3, 0.0, marks=pytest.mark.slow)],
)
def test_friction(told, further):
    made = simulated(friction=told, world=Misspecification(friction=further))
    agree(made, scanned(made, friction=0.3))


def test_pivots_are_shifted():
    """All by the same, and those after the first besides."""
    stated = [(0.0, 0.0), (0.2, 0.0), (-0.2, 0.05)]
    shift, further = np.array([0.03, -0.02]), np.array([0.01, 0.02])
    made = simulated(base=stated, world=Misspecification(base_shift=tuple(shift), further_base_shift=tuple(further)))
    moved = np.array(stated) + shift + further * np.array([[0.0], [1.0], [1.0]])
    scan = scanned(made, base=[tuple(pivot) for pivot in moved])
    assert made.measured.sizes["sample"] == scan.record.sizes["sample"]
    np.testing.assert_allclose(loads_of(made.measured), loads_of(scan.record), atol=1e-8)
    np.testing.assert_array_equal(np.unique(made.measured.base_x), [-0.2, 0.0, 0.2])


def test_of_an_si_rod():
    cell = LoadCell(force_noise=1e-12 * SI.force_unit, moment_noise=1e-12 * SI.moment_unit)
    priors = {"a": stats.uniform(4.0, 4.0), "q": stats.uniform(0.03, 0.04), "x_c": stats.norm(0.0, 0.01)}
    biases = (1e-5, 2e-4, -1e-4)
    made = simulated(
        rod=SI,
        load_cell=cell,
        priors=priors,
        nuisances=("rigidity_scale", "bias"),
        world=Misspecification(bias=biases, base_shift=(0.003, 0.0)),
    )
    found = [made.truth[f"{name}_bias"] for name in ("moment", "force_x", "force_y")]
    contour = Parabola(a=made.truth["a"], q=made.truth["q"], x_c=made.truth["x_c"] - 0.003)
    scan = tb.scan(contour, drive_angles=ANGLES, rod=SI)
    agree(made, scan, rigidity=made.truth["rigidity_scale"], zeros=np.array(found))
    assert made.measured.attrs["units"] == "SI"


def test_forces_in_the_frame_of_a_cell_that_turns():
    made = simulated(load_cell=replace(QUIET, frame="turning"))
    expected = loads_of(scanned(made).record)
    angle = made.measured.drive_angle.values
    turned = np.exp(-1j * angle) * (expected[:, 1] + 1j * expected[:, 2])
    np.testing.assert_allclose(made.measured.force_x, turned.real, atol=1e-8)
    np.testing.assert_allclose(made.measured.force_y, turned.imag, atol=1e-8)


def test_a_flat_spot_is_felt():
    """The object is what the simulation says it is."""
    made = simulated(world=Misspecification(flat_spot=(0.3, 2.0)))
    scan = tb.scan(made.contour.take(np.array(0)), drive_angles=ANGLES)
    np.testing.assert_allclose(loads_of(made.measured), loads_of(scan.record), atol=1e-8)
    assert np.max(np.abs(loads_of(made.measured) - loads_of(scanned(made).record))) > 1e-3


def test_contours_of_another_family():
    """With priors of its own; what is inferred is of the family that it is taken for."""
    asked = experiment(priors={}, world=Misspecification(family="circle"))
    made = simulate(asked, np.random.default_rng(2))
    scan = tb.scan(made.contour.take(np.array(0)), drive_angles=ANGLES)
    np.testing.assert_allclose(loads_of(made.measured), loads_of(scan.record), atol=1e-8)
    assert "r" in made.truth
    assert "a" in asked.problem_of(made.measured).model.names
    assert not asked.is_of_family
    assert experiment().is_of_family


# ---- events


@pytest.mark.parametrize("friction", [pytest.param(0.0, marks=pytest.mark.slow), 0.3])
def test_events_are_those_of_a_scan(friction):
    made = simulated(world=Misspecification(friction=friction))
    scan = scanned(made, friction=friction)
    for segment, direction in enumerate(("forward", "backward")):
        sweep = scan.events[direction]
        for label, event in (("first", sweep.first_contact), ("snap_off", sweep.snap_off)):
            for mine, theirs in (
                (f"{label}_drive_angle", event.drive_angle),
                (f"{label}_contact_x", event.contact_x),
                (f"{label}_contact_y", event.contact_y),
            ):
                np.testing.assert_allclose(made.events[mine][segment], theirs, atol=1e-7, err_msg=mine)


# ---- the load cell


def noise_of(made):
    return loads_of(made.measured) - loads_of(scanned(made).record)


def test_noise_is_what_the_load_cell_that_measures_makes():
    """Of the same random numbers twice the noise is twice the noise; the scale that is inferred is on top of both."""
    told = noise_of(simulated(load_cell=NOISY))
    other = LoadCell(force_noise=0.1, moment_noise=0.04)
    made = simulated(load_cell=NOISY, world=Misspecification(load_cell=other))
    np.testing.assert_allclose(noise_of(made), 2.0 * told, atol=1e-8)
    fixed = simulated(load_cell=NOISY, world=Misspecification(priors={"noise_scale": stats.lognorm(s=1e-9, scale=3.0)}))
    deviations = noise_of(fixed) / (3.0 * np.array([0.02, 0.05, 0.05]))
    assert abs(np.mean(deviations**2) - 1.0) < 5.0 * np.sqrt(2.0 / deviations.size)  # false alarm 1e-6


def test_bias_and_gain_of_the_cell_that_measures():
    gain = ((1.1, 0.0, 0.0), (0.0, 1.0, 0.02), (0.0, 0.0, 0.9))
    made = simulated(world=Misspecification(load_cell=replace(QUIET, bias=(0.1, 0.0, -0.2), gain=gain)))
    expected = loads_of(scanned(made).record) @ np.array(gain).T + [0.1, 0.0, -0.2]
    np.testing.assert_allclose(loads_of(made.measured), expected, atol=1e-8)


def test_the_encoder_of_a_cell_that_is_told():
    """Its offset is read and known of; its noise is read, and the rod knows nothing of it."""
    cell = replace(QUIET, drive_angle_offset=0.05)
    made = simulated(load_cell=cell)
    scan = scanned(made)
    np.testing.assert_allclose(made.measured.drive_angle, scan.record.drive_angle + 0.05, atol=1e-12)
    agree(made, scan)
    made = simulated(load_cell=replace(QUIET, drive_angle_noise=0.01))
    scan = scanned(made)
    agree(made, scan)
    errors = (made.measured.drive_angle.values - scan.record.drive_angle.values) / 0.01
    assert abs(np.mean(errors**2) - 1.0) < 5.0 * np.sqrt(2.0 / errors.size)  # false alarm 1e-6


@pytest.mark.parametrize("told", [pytest.param(0.0, marks=pytest.mark.slow), 0.02])
def test_the_encoder_of_a_cell_that_measures(told):
    """An offset of 0.05 rad where `told` is known is one of the world's besides."""
    cell = replace(QUIET, drive_angle_offset=told)
    one = simulated(load_cell=cell, world=Misspecification(load_cell=replace(cell, drive_angle_offset=0.05)))
    other = simulated(load_cell=cell, world=Misspecification(drive_angle_offset=0.05 - told))
    np.testing.assert_allclose(one.measured.drive_angle, other.measured.drive_angle, atol=1e-12)
    np.testing.assert_allclose(loads_of(one.measured), loads_of(other.measured), atol=1e-8)


# ---- truths


def test_truths_come_from_the_worlds_priors_and_inference_takes_its_own():
    asked = experiment(world=Misspecification(priors={"a": stats.uniform(2.0, 0.1)}))
    made = simulate(asked, np.random.default_rng(1))
    assert 2.0 < made.truth["a"] < 2.1
    assert asked.problem_of(made.measured).model.priors["a"] is PRIORS["a"]


def test_truths_have_the_distribution_of_the_prior():
    """Where the rod reaches all of it; false alarm 1e-6 each."""
    asked = experiment(priors=PRIORS | {"x_c": stats.uniform(-0.1, 0.2)})
    rng = np.random.default_rng(4)
    truths = [simulate(asked, rng).truth for _ in range(12)]
    for name, prior in asked.assumed.priors.items():
        assert stats.kstest([truth[name] for truth in truths], prior.cdf).pvalue > 1e-6


def test_the_same_numbers_again():
    one, other, third = (simulated(seed, load_cell=NOISY) for seed in (3, 3, 4))
    np.testing.assert_array_equal(loads_of(one.measured), loads_of(other.measured))
    assert one.truth == other.truth != third.truth


def test_a_world_out_of_reach_is_told(monkeypatch):
    monkeypatch.setattr(simulation, "_TRIALS", 3)
    with refused(ReachError, "3 contours"):
        simulated(world=Misspecification(base_shift=(0.0, -5.0)))


def test_friction_beyond_what_a_rod_slides_with_is_drawn_again():
    """Half of what is drawn beside that of the world would be too much; the truth is both together."""
    options = {
        "nuisances": ["friction"],
        "priors": PRIORS | {"friction": stats.uniform(0.1, 0.3)},
        "world": Misspecification(friction=0.6),
    }
    drawn = [simulated(seed, **options).truth["friction"] for seed in range(4)]
    assert all(0.7 <= friction <= np.tan(0.7) for friction in drawn)


def test_the_truth_of_what_is_inferred_is_what_the_misspecified_rig_has():
    """With it the model of inference explains the record, whatever is misspecified of its parameters."""
    world = Misspecification(
        friction=0.3,
        rigidity_scale=1.2,
        drive_angle_offset=0.05,
        rest_curvature=0.1,
        taper=0.02,
        bias=(1e-6, 0.0, -2e-5),
        drift=(0.0, 1e-5, 0.0),
        further_base_shift=(1e-3, -2e-3),
        load_cell=replace(
            QUIET,
            drive_angle_backlash=0.02,
            drive_angle_offset=-0.01,
            bias=(0.0, 2e-5, 0.0),
            lever=(1e-4, -2e-4),
            gain=((1.05, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)),
        ),
    )
    shape = ("rest_curvature", "taper", "base")
    of_cell = ("drive_angle_offset", "backlash", "bias", "drift", "lever", "moment_gain")
    names = ("friction", "rigidity_scale", *of_cell, *shape)
    priors = {"a": stats.lognorm(s=0.4, scale=6.0), "q": stats.uniform(0.03, 0.04), "x_c": stats.norm(0.0, 0.01)}
    options = {"rod": SI, "base": [(0.0, 0.0), (0.02, 0.0)], "nuisances": names, "priors": priors, "friction": None}
    made = simulated(world=world, **options)
    model = Experiment(made.measured, load_cell=QUIET, nuisances=names).model
    model.likelihood.exact = True
    point = np.array([[made.truth.get(name, 1.0) for name in model.names]])
    loads = model.loads_and_discrepancy(point)[0][0]
    off = np.abs(loads * SI.load_units - loads_of(made.measured))
    assert off.max() < 1e-7 * np.abs(loads_of(made.measured)).max()
