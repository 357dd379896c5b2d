"""The likelihood of records in which the drive carries the base."""

from __future__ import annotations

import numpy as np
import pytest

import tactile_bayes as tb
from helpers.contour_posteriors import CELL
from tactile_bayes.inference.experiment import Experiment
from tactile_bayes.inference.record_likelihood.likelihood import RecordLikelihood
from tactile_bayes.inference.record_likelihood.rig_values import RigValues
from tactile_bayes.record import CHANNELS
from tactile_bayes.rig import Rig

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


@pytest.mark.parametrize("drive", [SHIFTS, TURNS, CURVED])
def test_predicted_loads_are_those_of_a_scan(drive):
    record = tb.scan(CIRCLE, drive=drive).record
    loads, reached = RecordLikelihood(record, CELL, exact=True).predict(ONE)
    assert reached.all()
    np.testing.assert_allclose(loads[0], np.stack([record[name] for name in CHANNELS], axis=-1), atol=1e-7)


@pytest.mark.parametrize("friction", [0.0, 0.3])
@pytest.mark.parametrize("exact", [True, False])
def test_a_drive_that_begins_in_contact_was_turned_in(friction, exact):
    """Against a scan of both motions, of whose record the second is left."""
    x, angle = np.linspace(0.2, -0.1, 40), np.linspace(0.7, 1.65, 40)
    drive = tb.Motion(np.r_[np.full(40, 0.2), x[1:]], 0.0, np.r_[angle, np.full(39, 1.65)])
    record = tb.scan(CIRCLE, tb.Rig(unknown={"friction": friction}), drive=drive).record
    moved = record.isel(sample=record.base_x.values < 0.2)
    assert moved.holding_moment.values[0] > 0.1
    likelihood = RecordLikelihood(moved, CELL, friction, exact=exact)
    loads, reached = likelihood.predict(ONE, RigValues(friction=friction))
    assert reached.all()
    known = np.stack([moved[name] for name in CHANNELS], axis=-1)
    np.testing.assert_allclose(loads[0], known, atol=1e-7 if exact else 1e-4)


def test_an_encoder_offset_is_that_of_the_clamp():
    """A rod that is clamped otherwise than its reading says gives the loads of a drive at that angle."""
    offset = 0.02
    read, true = (
        tb.scan(CIRCLE, drive=tb.Translation((0.8, 0.0), np.pi, angle, 1.6)).record for angle in (1.1, 1.1 - offset)
    )
    loads, _ = RecordLikelihood(read, CELL, exact=True).predict(ONE, RigValues(drive_angle_offset=offset))
    np.testing.assert_allclose(loads[0], np.stack([true[name] for name in CHANNELS], axis=-1), atol=1e-7)


def test_what_a_drive_does_not_tell_is_left_out():
    assert "backlash" not in model(SHIFTS[0]).names
    assert "drive_angle_offset" in model(SHIFTS[0]).names
    assert "backlash" in model(TURNS).names
