"""Simulated records against scans of the same truths, without noise to speak of."""

from dataclasses import replace

import numpy as np
import pytest
from scipy import stats

import tactile_bayes as tb
from helpers.load_cells import CELL
from helpers.refusals import refused
from tactile_bayes.calibration.calibrate import experiment_of
from tactile_bayes.calibration.simulated_experiment import Misspecification
from tactile_bayes.calibration.simulation import simulate
from tactile_bayes.contours import Parabola
from tactile_bayes.errors import ParameterError, ReachError
from tactile_bayes.inference.experiment import Experiment
from tactile_bayes.record import loads_of
from tactile_bayes.rig import NOTHING
from tactile_bayes.rig.parameters import GROUPS
from tactile_bayes.rig.rig_prior import RigPrior

QUIET = tb.LoadCell(force_noise=1e-12, moment_noise=1e-12)
ANGLES = np.radians(np.arange(-30.0, 211.0, 5.0))
DRIVE = tb.Rotation(drive_angles=ANGLES)
PRIORS = {"a": stats.lognorm(s=0.4, scale=0.6), "q": stats.uniform(0.3, 0.4), "x_c": stats.norm(0.0, 0.1)}
FAMILY = tb.Family("parabola", **PRIORS)
SI = tb.Rod(length=0.1, flexural_rigidity=1e-5)


def experiment(family=FAMILY, *, unknown="nothing", load_cell=QUIET, rod=None, drive=DRIVE, truth=None):
    return experiment_of(family, tb.Rig(rod=rod, load_cell=load_cell, unknown=unknown), rng=1, drive=drive, truth=truth)


def simulated(seed=0, **options):
    return simulate(experiment(**options), np.random.default_rng(seed))


def among(*names):
    """Unknowns of a rig of which these are unknown, and all else is as stated."""
    return {**NOTHING, **dict.fromkeys(names, "default")}


def real(load_cell=None, **known):
    """A rig that is as stated, but for this."""
    return tb.Rig(load_cell=load_cell, unknown={**NOTHING, **known})


def same_loads(made, scan):
    np.testing.assert_allclose(loads_of(made.measured), loads_of(scan.record), atol=1e-8)


def contour_of(made, left=0.0, up=0.0):
    """The parabola that was drawn, as seen from a pivot that is moved."""
    return Parabola(a=made.truth["a"], q=made.truth["q"] + up, x_c=made.truth["x_c"] - left)


def scanned(made, *, friction=0.0, **options):
    """A scan of the same contour, at the angles at which the rod was."""
    rig = tb.Rig(unknown={"friction": friction})
    return tb.scan(contour_of(made), rig, drive_angles=ANGLES, **options)


def agree(made, scan, *, rigidity=1.0, zeros=0.0):
    """What was measured and what was scanned, to 1e-8 of the unit of each channel.

    The truths are such that the rod feels some ten of these; where it is pressed harder less can be asked.
    """
    rod = SI if made.measured.attrs["units"] == "SI" else tb.Rod()
    unit = rod.load_units
    expected = rigidity * loads_of(scan.record) + zeros
    np.testing.assert_allclose(loads_of(made.measured) / unit, expected / unit, atol=1e-8, rtol=0.0)
    for name in ("sweep", "base_x", "base_y"):
        np.testing.assert_array_equal(made.measured[name], scan.record[name])
    np.testing.assert_array_equal(made.measured.direction, scan.record.direction)


@pytest.mark.parametrize("direction", ["both", "forward", "backward"])
def test_what_is_measured_is_what_a_scan_feels(direction):
    made = simulated(drive=replace(DRIVE, direction=direction))
    scan = scanned(made, direction=direction)
    np.testing.assert_array_equal(made.measured.drive_angle, scan.record.drive_angle)
    agree(made, scan)
    assert set(made.truth) == {"a", "q", "x_c", "noise_scale"}


def test_the_truth_has_what_is_known_of_it():
    """The truth of what is inferred is drawn no more."""
    biases, drifts = (0.1, 0.2, 0.3), (-0.1, 0.0, 0.4)
    known = dict(zip(GROUPS["bias"] + GROUPS["drift"], biases + drifts, strict=True))
    known |= {"rigidity_scale": 1.1, "drive_angle_offset": 0.05}
    truth = Misspecification(real(**known), base_shift=(0.03, -0.02))
    made = simulated(unknown=among("rigidity_scale", "bias", "drift", "taper"), truth=truth)
    way = np.linspace(-0.5, 0.5, made.measured.sizes["sample"])[:, None]
    scan = tb.scan(contour_of(made, left=0.03, up=0.02), drive_angles=ANGLES - 0.05)  # seen from where the pivot is
    agree(made, scan, rigidity=1.1, zeros=np.array(biases) + np.array(drifts) * way)
    inferred = {name: value for name, value in known.items() if name != "drive_angle_offset"}
    assert {name: made.truth[name] for name in inferred} == pytest.approx(inferred, abs=1e-12)
    assert made.truth["taper"] == 0.0  # as stated


def test_the_modes_of_a_trace_have_no_true_value_if_the_rod_is_not_what_it_says():
    s = np.linspace(0.0, 1.0, 25)
    shaken = 1e-3 * np.random.default_rng(1).normal(size=(2, s.size))
    traced = tb.Rod.from_shape(s + shaken[0], shaken[1])
    of_trace = set(GROUPS["rest_shape"])
    unknown = {**NOTHING, "rest_shape": "default"}
    made = simulated(rod=traced, unknown=unknown, truth=replace(real(), rod=tb.Rod()))
    assert not of_trace & set(made.truth)
    assert of_trace & set(simulated(rod=traced, unknown=unknown).truth)


def test_a_truth_of_which_nothing_is_said_is_a_real_rig():
    """All that is unknown of one is drawn; the load cell is that which inference assumes."""
    asked = experiment(truth=tb.Rig())
    assert asked.simulated.unknowns.names == Experiment(asked.assumed.record, tb.Rig(load_cell=QUIET)).unknowns.names
    made = simulate(asked, np.random.default_rng(1))
    assert asked.problem_of(made.measured).model.names == ("a", "q", "x_c", "noise_scale")
    assert abs(made.truth["lever_x"]) > 1e-6
    assert made.truth["friction"] > 0.0
    assert not asked.is_as_assumed
    assert asked.is_of_family


def test_pivots_are_shifted():
    """All by the same, and those after the first besides."""
    stated = [(0.0, 0.0), (0.2, 0.0), (-0.2, 0.05)]
    shift, further = np.array([0.03, -0.02]), np.array([0.01, 0.02])
    truth = Misspecification(real(base_x=further[0], base_y=further[1]), base_shift=tuple(shift))
    made = simulated(drive=[replace(DRIVE, base=pivot) for pivot in stated], truth=truth)
    moved = np.array(stated) + shift + further * np.array([[0.0], [1.0], [1.0]])
    scan = scanned(made, base=[tuple(pivot) for pivot in moved])
    assert made.measured.sizes["sample"] == scan.record.sizes["sample"]
    same_loads(made, scan)
    np.testing.assert_array_equal(np.unique(made.measured.base_x), [-0.2, 0.0, 0.2])


def test_what_is_drawn_of_an_si_rod():
    """Rigidity, the encoder's offset and biases; the angles read are those of the truth and the offset."""
    cell = tb.LoadCell(force_noise=1e-12 * SI.force_unit, moment_noise=1e-12 * SI.moment_unit)
    family = tb.Family("parabola", a=stats.uniform(4.0, 4.0), q=stats.uniform(0.03, 0.04), x_c=stats.norm(0.0, 0.01))
    unknown = among("rigidity_scale", "drive_angle_offset", "bias", "drift")
    truth = Misspecification(base_shift=(0.003, 0.0))
    made = simulated(family=family, rod=SI, load_cell=cell, unknown=unknown, truth=truth)
    offset = made.truth["drive_angle_offset"]
    way = np.linspace(-0.5, 0.5, made.measured.sizes["sample"])[:, None]
    scan = tb.scan(contour_of(made, left=0.003), drive_angles=ANGLES - offset, rig=tb.Rig(rod=SI))
    bias, drift = (np.array([made.truth[name] for name in GROUPS[group]]) for group in ("bias", "drift"))
    zeros = bias + drift * way
    agree(made, scan, rigidity=made.truth["rigidity_scale"], zeros=zeros)
    np.testing.assert_allclose(made.measured.drive_angle, scan.record.drive_angle + offset, atol=1e-12)
    assert made.measured.attrs["units"] == "SI"


def test_a_flat_spot_is_felt():
    """The object is what the simulation says it is."""
    made = simulated(truth=Misspecification(flat_spot=(0.3, 2.0)))
    same_loads(made, tb.scan(made.contour.take(np.array(0)), drive_angles=ANGLES))
    assert np.max(np.abs(loads_of(made.measured) - loads_of(scanned(made).record))) > 1e-3


def test_contours_of_another_family():
    """With priors of its own; what is inferred is of the family that it is taken for."""
    asked = experiment("parabola", truth=Misspecification(family="circle"))
    made = simulate(asked, np.random.default_rng(2))
    same_loads(made, tb.scan(made.contour.take(np.array(0)), drive_angles=ANGLES))
    assert "r" in made.truth
    assert "a" in asked.problem_of(made.measured).model.names
    assert not asked.is_of_family


def test_friction_and_the_events_of_a_scan():
    made = simulated(unknown={**NOTHING, "friction": 0.1}, truth=real(friction=0.3))
    scan = scanned(made, friction=0.3)
    agree(made, scan)
    for segment, sweep in enumerate(scan.sweeps):
        for label, event in (("first", sweep.first_contact), ("snap_off", sweep.snap_off)):
            for name in ("drive_angle", "contact_x", "contact_y"):
                mine = made.events[f"{label}_{name}"][segment]
                np.testing.assert_allclose(mine, getattr(event, name), atol=1e-7, err_msg=name)


def noise_of(made):
    return loads_of(made.measured) - loads_of(scanned(made).record)


def test_noise_is_what_the_load_cell_that_measures_makes():
    """Of the same random numbers twice the noise is twice the noise; the scale that is inferred is on top of both."""
    told = noise_of(simulated(load_cell=CELL))
    other = tb.LoadCell(force_noise=0.1, moment_noise=0.04)
    made = simulated(load_cell=CELL, truth=tb.Rig(load_cell=other, unknown="nothing"))
    np.testing.assert_allclose(noise_of(made), 2.0 * told, atol=1e-8)
    assert made.truth["noise_scale"] == pytest.approx(2.0 * simulated(load_cell=CELL).truth["noise_scale"])
    fixed = simulated(load_cell=CELL, truth=real(noise_scale=3.0))
    assert fixed.truth["noise_scale"] == pytest.approx(3.0)
    unlike = simulated(load_cell=CELL, truth=real(replace(CELL, force_noise=0.1)))
    assert "noise_scale" not in unlike.truth  # channels differ in it
    deviations = noise_of(fixed) / (3.0 * np.array([0.02, 0.05, 0.05]))
    assert abs(np.mean(deviations**2) - 1.0) < 5.0 * np.sqrt(2.0 / deviations.size)  # false alarm 1e-6


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


def test_truths_come_from_the_other_family_and_inference_takes_its_own():
    other = tb.Family("parabola", a=0.7, q=stats.uniform(0.45, 0.01))
    asked = experiment(truth=Misspecification(family=other))
    made = simulate(asked, np.random.default_rng(1))
    assert made.truth["a"] == 0.7
    assert 0.45 < made.truth["q"] < 0.46
    assert asked.is_of_family
    assert asked.problem_of(made.measured).model.priors["a"] is PRIORS["a"]
    assert not experiment(other, truth=Misspecification(family="parabola")).is_of_family


def test_the_same_numbers_again():
    one, other, third = (simulated(seed, load_cell=CELL) for seed in (3, 3, 4))
    np.testing.assert_array_equal(loads_of(one.measured), loads_of(other.measured))
    assert one.truth == other.truth != third.truth


def test_a_rig_out_of_reach_is_refused():
    with refused(ReachError, "200 contours"):
        simulated(truth=Misspecification(base_shift=(0.0, -5.0)))


@pytest.mark.parametrize(
    ("truth", "named"), [({"load_cell": tb.LoadCell()}, ["truth", "no noise"]), ({"rod": SI}, ["dimensionless"])]
)
def test_a_truth_that_does_not_fit_is_refused(truth, named):
    with refused(ParameterError, *named):
        experiment(truth=tb.Rig(**truth))


def test_the_true_value_of_what_is_inferred_is_that_of_the_simulated_rig():
    """With it the model of inference explains the record, whatever differs of its parameters."""
    encoder = {"drive_angle_backlash": 0.02, "drive_angle_offset": -0.01}
    gain = ((1.05, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
    cell = replace(QUIET, **encoder, bias=(0.0, 2e-5, 0.0), lever=(1e-4, -2e-4), gain=gain, moment_curve=(30.0, 0.0))
    rod = tb.Rod(length=0.1005, flexural_rigidity=1.1e-5, rest_curvature=0.2, taper=0.01)
    known = {"friction": 0.3, "rigidity_scale": 1.2, "drive_angle_offset": 0.05, "taper": 0.02, "moment_bias": 1e-6}
    known |= {"force_y_bias": -2e-5, "force_x_drift": 1e-5, "base_2_x": 1e-3, "base_2_y": -2e-3}
    of_cell = ("drive_angle_offset", "backlash", "bias", "drift", "lever", "moment_gain", "moment_curve")
    names = ("friction", "rigidity_scale", *of_cell, "rest_curvature", "taper", "length", "base")
    a = stats.lognorm(s=0.4, scale=6.0)
    family = tb.Family("parabola", a=a, q=stats.uniform(0.03, 0.04), x_c=stats.norm(0.0, 0.01))
    truth = tb.Rig(rod=rod, load_cell=cell, unknown={**NOTHING, **known})
    drive = [DRIVE, replace(DRIVE, base=(0.02, 0.0))]
    made = simulated(family=family, rod=SI, drive=drive, unknown=among(*names), truth=truth)
    model = Experiment(made.measured, tb.Rig(load_cell=QUIET, unknown=among(*names))).model
    model.likelihood.exact = True
    assert set(model.names) <= set(made.truth)
    point = np.array([[made.truth[name] for name in model.names]])
    loads = model.loads_and_discrepancy(point)[0][0]
    off = np.abs(loads * SI.load_units - loads_of(made.measured))
    assert off.max() < 1e-7 * np.abs(loads_of(made.measured)).max()
    assert made.truth["rigidity_scale"] == pytest.approx(1.2 * 1.1)
    assert made.truth["length"] == pytest.approx(0.1005)


def test_records_are_simulated_from_a_calibrated_rig():
    """What its calibration has found is drawn jointly."""
    levers = {"lever_x": stats.norm(0.01, 1e-3), "lever_y": stats.norm(-0.01, 1e-3)}
    joint = RigPrior(levers, np.array([[1.0, 0.999], [0.999, 1.0]]), 0.0, "")
    unknown = {name: value for name, value in NOTHING.items() if name != "lever"}
    made = simulated(unknown=among("lever"), truth=tb.Rig(unknown=unknown, calibration=joint))
    scores = [(made.truth[name] - mean) / 1e-3 for name, mean in zip(levers, (0.01, -0.01), strict=True)]
    assert abs(scores[0] - scores[1]) < 0.3  # 6 standard deviations
