"""The likelihood of records in which loads depend on the history of the drive: carried bases, and turns in contact."""

from dataclasses import replace

import numpy as np
import pytest
from scipy import stats

import tactile_bayes as tb
from helpers.contour_posteriors import CELL
from tactile_bayes import Rig
from tactile_bayes.inference.experiment import Experiment
from tactile_bayes.inference.parameters.unknowns import RigValues
from tactile_bayes.inference.record_likelihood.likelihood import RecordLikelihood
from tactile_bayes.record import CHANNELS, loads_of

CIRCLE = tb.contours.Circle(0.3, 0.8)
SHIFTS = [tb.Translation((0.8, 0.0), np.pi, 1.1, 1.6), tb.Translation((-0.8, 0.0), 0.0, np.pi - 1.1, 1.6)]
WAY = np.linspace(0.0, 1.0, 500)
CURVED = tb.Motion(0.9 - 1.8 * WAY, 0.1 * np.sin(3.0 * WAY), 0.7 + 1.2 * WAY)
TURNS = [tb.Motion([0.8, -0.8], 0.0, [1.2, 1.9]), tb.Rotation()]


def model(drive, family="circle"):
    measured = CELL.measure(tb.scan(CIRCLE, drive=drive).record, rng=1)
    return Experiment(measured, Rig(load_cell=CELL), family).model


@pytest.mark.parametrize("drive", [SHIFTS, TURNS, CURVED])
def test_the_fast_mode_agrees_with_the_exact_one(drive):
    """For contours and rigs drawn from the default priors: events, and loads to a small share of the noise."""
    of_record = model(drive)
    points, _ = of_record.draw_prior(np.random.default_rng(4), 50)
    contours, rig, likelihood = of_record.contours(points), of_record.rig(points), of_record.likelihood
    loads, reached, events = likelihood.predict_with_events(contours, rig)
    likelihood.exact = True
    exact, also, their_events = likelihood.predict_with_events(contours, rig)
    assert reached.all()
    assert also.all()
    assert np.nanmax(np.abs(events - their_events)) < 1e-6
    assert np.all(np.abs(loads - exact) < 5e-3 * np.array([0.02, 0.05, 0.05]))


ONE = tb.contours.Circle(np.array([0.3]), np.array([0.8]))


def assert_predicted(true, contour, rig=None, *, read=None, cell=CELL, friction=0.0, exact=True, rubs=False):
    """Of a record, as it was read, the true loads are predicted."""
    likelihood = RecordLikelihood(true if read is None else read, cell, friction, exact, rubs=rubs)
    loads, reached = likelihood.predict(contour, rig)
    assert reached.all()
    np.testing.assert_allclose(loads[0], loads_of(true), atol=1e-7 if exact else 1e-4)


@pytest.mark.parametrize("drive", [SHIFTS, TURNS, CURVED])
def test_predicted_loads_are_those_of_a_scan(drive):
    assert_predicted(tb.scan(CIRCLE, drive=drive).record, ONE)


@pytest.mark.parametrize("friction", [0.0, 0.3])
@pytest.mark.parametrize("exact", [True, False])
def test_a_drive_that_begins_in_contact_was_turned_in(friction, exact):
    """Against a scan of both motions, of whose record the second is left."""
    x, angle = np.linspace(0.2, -0.1, 40), np.linspace(0.7, 1.65, 40)
    drive = tb.Motion(np.r_[np.full(40, 0.2), x[1:]], 0.0, np.r_[angle, np.full(39, 1.65)])
    record = tb.scan(CIRCLE, tb.Rig(unknown={"friction": friction}), drive=drive).record
    moved = record.isel(sample=record.base_x.values < 0.2)
    assert moved.holding_moment.values[0] > 0.1
    assert_predicted(moved, ONE, RigValues(friction=friction), friction=friction, exact=exact)


@pytest.mark.parametrize("angle", [1.7, 1.3714, 1.36])
def test_what_sticks_as_it_is_turned_in_has_the_loads_of_a_path_that_is_followed(angle):
    """It sticks for 4e-3 rad, from 1.3694 on: long before the record begins, where it begins, and later."""
    x = np.linspace(0.0, -0.3, 20)
    columns = {"sweep": 0, "direction": "forward", "base_x": x, "drive_angle": np.full(20, angle)}
    rod = tb.Rod(rest_curvature=lambda s: 0.5 - 4.0 * s**4)
    record = tb.make_record(columns | dict.fromkeys(CHANNELS, 0.1 + 0.0 * x), Rig(rod=rod))
    contour = tb.contours.Circle(np.array([0.02]), np.array([0.5]), np.array([0.1]))
    cell = tb.LoadCell(force_noise=5e-4, moment_noise=2e-4)
    (exact, _), (fast, reached) = (
        RecordLikelihood(record, cell, 0.4, exact=mode).predict(contour, RigValues(friction=0.4))
        for mode in (True, False)
    )
    assert reached.all()
    assert np.all(exact[0, :, 0] > 0.1)
    np.testing.assert_allclose(fast, exact, atol=1e-6)


def test_an_encoder_offset_is_that_of_the_clamp():
    """A rod that is clamped otherwise than its reading says gives the loads of a drive at that angle."""
    offset = 0.02
    read, true = (
        tb.scan(CIRCLE, drive=tb.Translation((0.8, 0.0), np.pi, angle, 1.6)).record for angle in (1.1, 1.1 - offset)
    )
    assert_predicted(true, ONE, RigValues(drive_angle_offset=offset), read=read)


def test_what_a_drive_does_not_tell_is_left_out():
    assert "backlash" not in model(SHIFTS[0]).names
    assert "drive_angle_offset" in model(SHIFTS[0]).names
    assert "backlash" in model(TURNS).names


# ---- turns in contact

QUIET = tb.LoadCell(force_noise=0.005, moment_noise=0.002)
PARABOLA = tb.contours.Parabola(0.6, 0.45, 0.1)
STACK = tb.contours.Parabola(np.array([0.6]), np.array([0.45]), np.array([0.1]))
DRIVES = {
    "once": tb.Motion(0.0, 0.0, [0.4, 2.2, 0.4], drive_step=0.05),
    "from the other side": tb.Motion(0.0, 0.0, [2.9, 1.2, 2.9], drive_step=0.05),
    "twice": tb.Motion(0.0, 0.0, [0.4, 2.0, 1.5, 2.5], drive_step=0.05),
}


def turned_back(drive, friction=0.3):
    return tb.scan(PARABOLA, Rig(unknown={"friction": friction}), drive=drive).record


def in_parts(record):
    """The record with a sweep for each way of its drive, as a laboratory numbers them."""
    steps = np.sign(np.diff(record.drive_angle.values))
    sweep = np.append(0, np.cumsum(np.append(False, steps[1:] != steps[:-1])))
    direction = np.where(np.append(steps[0], steps) > 0.0, "forward", "backward")
    return record.assign(sweep=("sample", sweep), direction=("sample", direction))


@pytest.mark.parametrize("exact", [True, False])
@pytest.mark.parametrize("numbered", [lambda record: record, in_parts], ids=["one sweep", "a sweep for each way"])
@pytest.mark.parametrize("drive", DRIVES.values(), ids=DRIVES)
def test_the_likelihood_is_that_of_the_noise_about_the_scan(drive, numbered, exact):
    record = numbered(turned_back(drive))
    measured = QUIET.measure(record, rng=1)
    likelihood = RecordLikelihood(measured, QUIET, 0.3, exact)
    deviation = np.array([QUIET.moment_noise, QUIET.force_noise, QUIET.force_noise])
    expected = stats.norm.logpdf(loads_of(measured), loads_of(record), deviation).sum()
    np.testing.assert_allclose(likelihood.log_likelihood(STACK), expected, atol=1e-4 if exact else 0.05)


@pytest.mark.parametrize("exact", [True, False])
def test_a_friction_of_the_rig_has_the_same_history(exact):
    record = in_parts(turned_back(DRIVES["once"]))
    assert_predicted(record, STACK, RigValues(friction=0.3), cell=QUIET, exact=exact, rubs=True)


def test_without_friction_or_if_it_goes_one_way_a_drive_has_no_history():
    record = in_parts(turned_back(DRIVES["once"], 0.0))
    likelihood = RecordLikelihood(record, QUIET, exact=True)
    assert not likelihood.segments.has_history
    np.testing.assert_allclose(likelihood.predict(STACK)[0][0], loads_of(record), atol=1e-7)
    record = QUIET.measure(tb.scan(PARABOLA, Rig(unknown={"friction": 0.3}), drive_step=0.05).record, rng=1)
    jitter = record.drive_angle + np.random.default_rng(1).normal(0.0, 0.01, record.sizes["sample"])
    assert not RecordLikelihood(record, QUIET, 0.3).segments.has_history
    encoder = replace(QUIET, drive_angle_noise=0.01)
    assert not RecordLikelihood(record.assign(drive_angle=jitter), encoder, 0.3).segments.has_history


def test_errors_of_the_encoder_move_samples_along_their_way():
    record = in_parts(turned_back(DRIVES["once"]))
    likelihood = RecordLikelihood(record, replace(QUIET, drive_angle_noise=1e-4), 0.3, True)
    moments, errors = likelihood.predict_with_errors(STACK)[0][0, ..., 0], likelihood.encoder.errors
    rates = np.gradient(record.holding_moment.values, record.drive_angle.values)
    slope = (moments[-1] - moments[0]) / (errors[-1] - errors[0])
    for way in (slice(24, 33), slice(44, 52)):  # forth and back
        np.testing.assert_allclose(slope[way], -rates[way], rtol=0.05)


def test_an_offset_of_the_encoder_is_that_of_the_whole_way():
    record = in_parts(turned_back(DRIVES["once"]))
    read = record.assign(drive_angle=record.drive_angle + 0.02)
    assert_predicted(record, STACK, RigValues(friction=0.3, drive_angle_offset=0.02), read=read, rubs=True)
