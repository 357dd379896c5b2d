"""The contour posterior of records with errors that are known, unknown, and not told."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from helpers.contour_posteriors import CELL, TRUTH, infer_as_stated, swept
from helpers.load_cells import GAIN, WALK, cell
from helpers.refusals import refused
from tactile_bayes.contours import Parabola
from tactile_bayes.errors import ParameterError
from tactile_bayes.inference.ensembles import SamplerSettings
from tactile_bayes.inference.record_likelihood.likelihood import RecordLikelihood
from tactile_bayes.load_cell import LoadCell
from tactile_bayes.record import CHANNELS, loads_of

FLAWED = replace(CELL, bias=(0.05, 0.1, -0.1), gain=GAIN, drive_angle_offset=0.01)
UNKNOWN_BIAS = replace(
    FLAWED, bias=(0.0, 0.0, 0.0), bias_uncertainty=(0.1, 0.1, 0.1), force_resolution=0.02, moment_resolution=0.01
)
QUICK = SamplerSettings(ensembles=2, walkers=12, min_ess=80, max_r_hat=1.15)


@cache
def posterior_of(told: LoadCell | None):
    """Of loaded samples only, because unloaded ones tell the bias; the record is rounded where the cell says so."""
    ideal = swept(Parabola(**TRUTH), step=float(np.radians(6.0)))
    loaded = ideal.isel(sample=np.flatnonzero(ideal.force_y.values))
    steps = {"force_resolution": 0.02, "moment_resolution": 0.01} if told is UNKNOWN_BIAS else {}
    measured = replace(FLAWED, **steps).measure(loaded, rng=7)
    return measured, infer_as_stated(measured, load_cell=told, rng=1, settings=QUICK)


def off_by(result):
    """How far every parameter is from the truth, in standard deviations."""
    draws = result["posterior"].ds
    return {name: abs(float(draws[name].mean()) - value) / float(draws[name].std()) for name, value in TRUTH.items()}


@pytest.mark.slow
def test_known_errors_are_accounted_for():
    """Within 4 standard deviations, of which 80 effective draws have one right to 8 %."""
    measured, known = posterior_of(None)
    assert max(off_by(known).values()) < 4.0
    assert float(known["posterior"].noise_scale.mean()) == pytest.approx(1.0, abs=0.3)
    stated = {name.removeprefix("load_cell_"): v for name, v in known.attrs.items() if name.startswith("load_cell_")}
    assert LoadCell.from_entries({**stated, "frame": None}) == LoadCell.from_record(measured) == FLAWED
    assert known.attrs["approximations"] == ""


@pytest.mark.slow
def test_errors_that_are_not_told_mislead():
    """The posterior of the height alone, on a grid of heights and factors on the noise with a flat prior."""
    measured, _ = posterior_of(None)
    heights, factors = np.linspace(0.48, 0.52, 801), np.geomspace(0.5, 10.0, 60)
    contours = Parabola(np.full(801, 0.5), heights, np.zeros(801))

    def off_by(told):
        likelihood = RecordLikelihood(measured, told)
        loads, reached = likelihood.predict_with_errors(contours)
        logs = np.array([likelihood.score(loads, reached, factor) for factor in factors])
        weight = np.exp(logs - logs.max()).sum(axis=0)
        weight /= weight.sum()
        mean = weight @ heights
        return abs(mean - TRUTH["q"]) / np.sqrt(weight @ (heights - mean) ** 2)

    assert off_by(FLAWED) < 4.0
    assert off_by(CELL) > 8.0


@pytest.mark.slow
def test_a_bias_that_is_not_known_widens_the_posterior():
    _, known = posterior_of(None)
    _, unknown = posterior_of(UNKNOWN_BIAS)
    assert max(off_by(unknown).values()) < 4.0
    # Each spread is right to 8 %; in truth the ratio is 1.4.
    assert float(unknown["posterior"].q.std() / known["posterior"].q.std()) > 1.15
    assert "of the reading" in unknown.attrs["approximations"]


@pytest.mark.slow
def test_what_is_predicted_has_the_law_of_the_load_cell():
    """Steps, a bias for each draw, and white noise on it."""
    _, unknown = posterior_of(UNKNOWN_BIAS)
    predicted = unknown["posterior_predictive"].ds
    scale = unknown["posterior"].noise_scale
    for name, step, white in zip(CHANNELS, (0.01, 0.02, 0.02), (0.02, 0.05, 0.05), strict=True):
        whole = predicted[name].values / step
        np.testing.assert_allclose(whole, np.round(whole), rtol=0, atol=1e-9)
        # Draws of the contour differ by little in what they predict: the rest is bias, and white noise and rounding.
        off = (predicted[name] - predicted[name].mean(("chain", "draw"))).values.reshape(-1, predicted.sizes["sample"])
        count, samples = off.shape
        noise = np.sqrt((white * float((scale**2).mean()) ** 0.5) ** 2 + step**2 / 12)
        within = (off - off.mean(axis=1, keepdims=True)).std() * np.sqrt(samples / (samples - 1))
        assert within == pytest.approx(noise, rel=0.1)
        between = np.hypot(0.1, noise / np.sqrt(samples))
        assert off.mean(axis=1).std() == pytest.approx(between, rel=5.0 / np.sqrt(2 * count))


def test_an_encoder_that_is_not_exact_beside_a_drift_is_refused():
    record = CELL.measure(swept(Parabola(**TRUTH), step=0.2), rng=1)
    for further in ({"drift": WALK}, {"bias_uncertainty": (0.1, 0.0, 0.0)}):
        with refused(ParameterError, "drift", "bias_uncertainty"):
            RecordLikelihood(record, cell(drive_angle_noise=0.001, **further))


def test_a_drift_goes_on_through_all_sweeps():
    """The likelihood of a record is that of its samples in their order, whatever the sweep segments."""
    record = cell(drift=WALK).measure(swept(Parabola(**TRUTH), step=0.1), rng=1)
    likelihood = RecordLikelihood(record, cell(drift=WALK))
    contour = Parabola(*(np.array([value]) for value in TRUTH.values()))
    predicted, _ = likelihood.predict(contour)
    readings = loads_of(record)
    expected = cell(drift=WALK).log_likelihood(readings, predicted)
    np.testing.assert_allclose(likelihood.log_likelihood(contour), expected, rtol=1e-13)
    flat = CELL.log_likelihood(readings, predicted)
    assert expected[0] > flat[0] + 50.0
