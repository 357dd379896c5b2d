"""The likelihood of records in which the drive carries the base."""

from __future__ import annotations

import numpy as np
import pytest

import tactile_bayes as tb
from tactile_bayes.inference.experiment import Experiment
from tactile_bayes.inference.record_likelihood.likelihood import RecordLikelihood
from tactile_bayes.inference.record_likelihood.rig_values import RigValues
from tactile_bayes.rig import Rig

CELL = tb.LoadCell(force_noise=0.05, moment_noise=0.02)
CIRCLE = tb.contours.Circle(0.3, 0.8)
SHIFTS = [
    tb.Translation((0.8, 0.0), np.pi, 1.1, 1.6),
    tb.Translation((-0.8, 0.0), 0.0, np.pi - 1.1, 1.6),
]
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


@pytest.mark.parametrize("drive", [SHIFTS, TURNS, CURVED])
def test_predicted_loads_are_those_of_a_scan(drive):
    record = tb.scan(CIRCLE, drive=drive).record
    likelihood = RecordLikelihood(record, CELL, exact=True)
    loads, reached = likelihood.predict(tb.contours.Circle(np.array([0.3]), np.array([0.8])))
    assert reached.all()
    measured = np.stack([record[name].values for name in ("holding_moment", "force_x", "force_y")], axis=-1)
    np.testing.assert_allclose(loads[0], measured, atol=1e-7)


def test_an_encoder_offset_is_that_of_the_clamp():
    """A rod that is clamped otherwise than its reading says gives the loads of a drive at that angle."""
    offset = 0.02
    stated, true = tb.Translation((0.8, 0.0), np.pi, 1.1, 1.6), tb.Translation((0.8, 0.0), np.pi, 1.1 - offset, 1.6)
    likelihood = RecordLikelihood(tb.scan(CIRCLE, drive=stated).record, CELL, exact=True)
    loads, _ = likelihood.predict(
        tb.contours.Circle(np.array([0.3]), np.array([0.8])), RigValues(drive_angle_offset=offset)
    )
    other = tb.scan(CIRCLE, drive=true).record
    np.testing.assert_allclose(loads[0, :, 0], other.holding_moment, atol=1e-7)
    np.testing.assert_allclose(loads[0, :, 2], other.force_y, atol=1e-7)


def test_what_a_drive_does_not_tell_is_left_out():
    assert "backlash" not in model(SHIFTS[0]).names
    assert "drive_angle_offset" in model(SHIFTS[0]).names
    assert "backlash" in model(TURNS).names


@pytest.mark.slow
def test_a_posterior_of_a_carried_rod_finds_the_circle():
    measured = CELL.measure(tb.scan(CIRCLE, drive=SHIFTS).record, rng=3)
    posterior = tb.infer_contour(
        measured,
        family="circle",
        rig=Rig(load_cell=CELL, unknown={"friction": 0.0}),
        rng=1,
        settings=tb.SamplerSettings(ensembles=2, walkers=32, min_ess=400, max_r_hat=1.05),
    )
    for name, true in (("r", 0.3), ("q", 0.8), ("x_c", 0.0)):
        draws = posterior["posterior"][name].values
        assert abs(draws.mean() - true) < 4.0 * draws.std()
    travel = posterior["events"]["snap_off_travel"].values
    stated = [sweep.snap_off.travel for sweep in tb.scan(CIRCLE, drive=SHIFTS).sweeps]
    assert np.sort(travel.mean(axis=(0, 1))) == pytest.approx(np.sort(stated), abs=0.02)
    band = tb.contour_band(posterior, np.linspace(-0.1, 0.1, 5))
    assert np.all(band.upper - band.lower < 0.05)
