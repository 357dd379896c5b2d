"""Encoders that are not exact: the likelihood against a fine integral over their errors, and posteriors."""

from dataclasses import replace

import numpy as np
import pytest

from helpers.contour_posteriors import CELL, TRUTH, infer_as_stated, swept
from tactile_bayes import LoadCell, SamplerSettings
from tactile_bayes.contours import Parabola
from tactile_bayes.inference.record_likelihood.likelihood import EncoderErrors, RecordLikelihood
from tactile_bayes.record import in_frame

ROUGH = replace(CELL, drive_angle_noise=0.01)
IDEAL = swept(Parabola(**TRUTH), step=0.05)


@pytest.mark.parametrize(("noise", "step"), [(0.0, 0.0), (0.01, 0.0), (0.0, 0.02), (0.002, 0.004), (0.03, 0.001)])
def test_errors_have_the_moments_of_the_encoder(noise, step):
    errors = EncoderErrors(replace(CELL, drive_angle_noise=noise, drive_angle_resolution=step))
    weights = np.exp(errors.log_weights)
    assert weights.sum() == pytest.approx(1.0, abs=1e-12)
    assert weights @ errors.errors == pytest.approx(0.0, abs=1e-12)
    assert weights @ errors.errors**2 == pytest.approx(noise**2 + step**2 / 12.0, rel=0.02)
    drawn = errors.errors[errors.draw(np.random.default_rng(1), (4000,))]
    assert drawn.std() == pytest.approx(np.sqrt(weights @ errors.errors**2), rel=0.05)


def some_contours():
    return Parabola(*(np.array([value, value + 0.004]) for value in TRUTH.values()))


def finely(likelihood, count=1501):
    """The same with the errors of the encoder summed over much more closely."""
    noise = likelihood.load_cell.drive_angle_noise
    fine = RecordLikelihood.__new__(RecordLikelihood)
    fine.__dict__.update(likelihood.__dict__)
    fine.encoder = EncoderErrors(likelihood.load_cell)
    z = np.linspace(-6.0, 6.0, count)
    fine.encoder.errors = noise * z
    fine.encoder.log_weights = -0.5 * z**2 - np.log(np.exp(-0.5 * z**2).sum())
    return fine


@pytest.mark.parametrize(
    "cell",
    [
        ROUGH,
        replace(ROUGH, drive_angle_noise=0.002),
        replace(ROUGH, drive_angle_noise=0.03),
        replace(ROUGH, degrees_of_freedom=4.0),
        replace(ROUGH, correlation=(0.5, 0.0, -0.3)),
    ],
    ids=["normal", "good", "bad", "outliers", "correlated"],
)
def test_the_likelihood_is_that_of_an_integral_over_the_errors(cell):
    likelihood = RecordLikelihood(cell.measure(IDEAL, rng=2), cell)
    by_sample = likelihood.log_likelihood(some_contours(), pointwise=True)
    exact = finely(likelihood).log_likelihood(some_contours(), pointwise=True)
    off = np.abs(by_sample - exact)
    assert np.median(off) < 1e-3
    assert np.mean(off > 0.02) < 0.1  # beside first contact and snap-off
    assert off[exact > -30.0].max() < 1.0
    np.testing.assert_allclose(likelihood.log_likelihood(some_contours()), by_sample.sum(axis=1), rtol=1e-12)


def test_a_load_cell_that_turns_with_the_drive_turns_by_the_true_angle():
    """Seen from a true angle that differs from the reading, forces of the world are turned by that angle."""
    cell = replace(ROUGH, frame="turning")
    plain = in_frame(IDEAL, "turning")
    likelihood = RecordLikelihood(plain, cell)
    loads, _ = likelihood.predict_with_errors(some_contours())
    fixed, _ = RecordLikelihood(IDEAL, ROUGH).predict_with_errors(some_contours())
    true = plain.drive_angle.values - likelihood.encoder.errors[:, None]
    along = np.cos(true) * fixed[..., 1] + np.sin(true) * fixed[..., 2]
    np.testing.assert_allclose(loads[..., 1], along, rtol=0.0, atol=1e-12)


def test_a_sample_beside_the_snap_off_may_be_loaded_or_not():
    """The drive may have stood on either side: neither reading is impossible."""
    ideal = swept(Parabola(**TRUTH), step=0.002)
    force = ideal.force_y.values * (ideal.direction == "forward").values
    last = int(np.flatnonzero(force)[-1])
    beside = ideal.isel(sample=[last, last + 1])
    crossed = beside.assign(drive_angle=("sample", beside.drive_angle.values[::-1]))
    contour = some_contours().take(np.array([0]))
    rough, exact = (
        [RecordLikelihood(record, cell).log_likelihood(contour)[0] for record in (beside, crossed)]
        for cell in (ROUGH, CELL)
    )
    assert abs(rough[1] - rough[0]) < 3.0
    assert exact[1] < exact[0] - 20.0


@pytest.mark.slow
def test_predictions_have_the_errors_of_the_encoder():
    """Where loads change with the drive angle they scatter by more than the noise of the load cell."""
    cell = LoadCell(force_noise=0.002, moment_noise=0.002, drive_angle_noise=0.01)
    record = cell.measure(swept(Parabola(**TRUTH), step=0.1), rng=3)
    settings = SamplerSettings(ensembles=2, walkers=8, block_steps=20, max_steps=60)
    predictive = infer_as_stated(record, load_cell=cell, rng=1, settings=settings)["posterior_predictive"]
    moment = predictive["holding_moment"].values.reshape(-1, record.sizes["sample"])
    loaded = record.truth_holding_moment.values != 0.0
    assert np.median(moment.std(axis=0)[loaded]) > 3.0 * np.median(moment.std(axis=0)[~loaded])
