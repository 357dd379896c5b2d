"""The likelihood of records in which a drive turns back while the rod is in contact."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import scipy.stats

import tactile_bayes as tb
from tactile_bayes.inference.record_likelihood.likelihood import RecordLikelihood
from tactile_bayes.inference.record_likelihood.rig_values import RigValues
from tactile_bayes.record import CHANNELS
from tactile_bayes.rig import Rig

CELL = tb.LoadCell(force_noise=0.005, moment_noise=0.002)
PARABOLA = tb.contours.Parabola(0.6, 0.45, 0.1)
STACK = tb.contours.Parabola(np.array([0.6]), np.array([0.45]), np.array([0.1]))
DRIVES = {
    "once": tb.Motion(0.0, 0.0, [0.4, 2.2, 0.4], drive_step=0.05),
    "from the other side": tb.Motion(0.0, 0.0, [2.9, 1.2, 2.9], drive_step=0.05),
    "twice": tb.Motion(0.0, 0.0, [0.4, 2.0, 1.5, 2.5], drive_step=0.05),
}


def swept(drive, friction=0.3):
    return tb.scan(PARABOLA, Rig(unknown={"friction": friction}), drive=drive).record


def in_parts(record):
    """The record with a sweep for each way of its drive, as a laboratory numbers them."""
    steps = np.sign(np.diff(record.drive_angle.values))
    sweep = np.append(0, np.cumsum(np.append(False, steps[1:] != steps[:-1])))
    direction = np.where(np.append(steps[0], steps) > 0.0, "forward", "backward")
    return record.assign(sweep=("sample", sweep), direction=("sample", direction))


def loads_of(record):
    return np.stack([record[name].values for name in CHANNELS], axis=-1)


@pytest.mark.parametrize("exact", [True, False])
@pytest.mark.parametrize("numbered", [lambda record: record, in_parts], ids=["one sweep", "a sweep for each way"])
@pytest.mark.parametrize("drive", DRIVES.values(), ids=DRIVES)
def test_the_likelihood_is_that_of_the_noise_about_the_scan(drive, numbered, exact):
    record = numbered(swept(drive))
    measured = CELL.measure(record, rng=1)
    likelihood = RecordLikelihood(measured, CELL, 0.3, exact)
    deviation = np.array([CELL.moment_noise, CELL.force_noise, CELL.force_noise])
    expected = scipy.stats.norm.logpdf(loads_of(measured), loads_of(record), deviation).sum()
    np.testing.assert_allclose(likelihood.log_likelihood(STACK), expected, atol=1e-4 if exact else 0.05)


@pytest.mark.parametrize("exact", [True, False])
def test_a_friction_of_the_rig_has_the_same_history(exact):
    record = in_parts(swept(DRIVES["once"]))
    loads, usable = RecordLikelihood(record, CELL, exact=exact, rubs=True).predict(STACK, RigValues(friction=0.3))
    assert usable.all()
    np.testing.assert_allclose(loads[0], loads_of(record), atol=1e-7 if exact else 1e-4)


def test_without_friction_or_if_it_goes_one_way_a_drive_has_no_history():
    record = in_parts(swept(DRIVES["once"], 0.0))
    likelihood = RecordLikelihood(record, CELL, exact=True)
    assert not likelihood.segments.has_history
    np.testing.assert_allclose(likelihood.predict(STACK)[0][0], loads_of(record), atol=1e-7)
    record = CELL.measure(tb.scan(PARABOLA, Rig(unknown={"friction": 0.3}), drive_step=0.05).record, rng=1)
    jitter = record.drive_angle + np.random.default_rng(1).normal(0.0, 0.01, record.sizes["sample"])
    assert not RecordLikelihood(record, CELL, 0.3).segments.has_history
    encoder = replace(CELL, drive_angle_noise=0.01)
    assert not RecordLikelihood(record.assign(drive_angle=jitter), encoder, 0.3).segments.has_history


def test_errors_of_the_encoder_move_samples_along_their_way():
    record = in_parts(swept(DRIVES["once"]))
    likelihood = RecordLikelihood(record, replace(CELL, drive_angle_noise=1e-4), 0.3, True)
    moments, errors = likelihood.predict_with_errors(STACK)[0][0, ..., 0], likelihood.encoder.errors
    rates = np.gradient(record.holding_moment.values, record.drive_angle.values)
    slope = (moments[-1] - moments[0]) / (errors[-1] - errors[0])
    for way in (slice(24, 33), slice(44, 52)):  # forth and back
        np.testing.assert_allclose(slope[way], -rates[way], rtol=0.05)


def test_an_offset_of_the_encoder_is_that_of_the_whole_way():
    record = in_parts(swept(DRIVES["once"]))
    read = record.assign(drive_angle=record.drive_angle + 0.02)
    rig = RigValues(friction=0.3, drive_angle_offset=0.02)
    loads, _ = RecordLikelihood(read, CELL, exact=True, rubs=True).predict(STACK, rig)
    np.testing.assert_allclose(loads[0], loads_of(record), atol=1e-7)
