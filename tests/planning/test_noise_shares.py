"""Whose noise it is: first order at small noise, and what is refused."""

from dataclasses import replace

import numpy as np
import pytest
from scipy import stats

import tactile_bayes as tb
from helpers.refusals import refused
from tactile_bayes.contours import paper_profile
from tactile_bayes.errors import ParameterError
from tactile_bayes.planning.amplification import SOURCES, amplification
from tactile_bayes.planning.noise_shares import noise_shares
from tactile_bayes.planning.plan import Plan
from tactile_bayes.rig import Rig

PROFILE = paper_profile("II", q=0.5)
QUIET = Plan(PROFILE, Rig(load_cell=tb.LoadCell(force_noise=5e-6, moment_noise=2e-6, drive_angle_noise=2e-6)))


def test_shares_at_small_noise_are_those_of_first_order():
    """Of a linear function with the gains for slopes, by the same random numbers: bends are of the order of 1e-5."""
    found = noise_shares(QUIET, rng=1, samples=64, states=3)
    grown = amplification(QUIET.at_angles(found.drive_angle.values))
    keys = list(zip(grown.sweep.values, grown.drive_angle.values, strict=True))
    where = [keys.index(key) for key in zip(found.sweep.values, found.drive_angle.values, strict=True)]
    sizes = np.array([*QUIET.cell.standard_deviations.values(), QUIET.cell.drive_angle_noise])
    assert list(found.source.values) == list(SOURCES)
    for error in ("along", "across"):
        gains = grown[f"gain_{error}"].values[:, where]
        noises = [stats.norm(0.0, size) for size in sizes]
        right = stats.sobol_indices(
            func=gains.reshape(-1, 4).__matmul__, n=64, dists=noises, rng=np.random.default_rng(1)
        )
        for name, indices in (("share", right.first_order), ("total_share", right.total_order)):
            made = found[name].sel(error=error).values
            np.testing.assert_allclose(made, indices.reshape(made.shape), rtol=0.0, atol=1e-3)
        # Root mean squares of 384 numbers of a scrambled sequence: within 4.5 standard errors of as many random ones.
        sd = np.sqrt(np.sum((gains * sizes) ** 2, axis=-1))
        np.testing.assert_allclose(found.rms_error.sel(error=error).values, sd, rtol=4.5 / np.sqrt(2.0 * 384))
    assert not found.without_answer.values.any()


def test_first_order_fails_at_large_noise_and_this_says_so():
    found = noise_shares(Plan(PROFILE).with_noise(10.0), rng=1, samples=64, states=4, methods=("raw",))
    assert found.without_answer.values.max() > 0.05
    lost = found.without_answer.values > 0.0
    assert np.isnan(found.share.values[lost]).all()
    assert np.isfinite(found.share.values[~lost]).all()


def test_a_noise_of_zero_is_left_out():
    cell = replace(QUIET.cell, drive_angle_noise=0.0)
    found = noise_shares(replace(QUIET, rig=Rig(load_cell=cell)), rng=1, samples=128, states=2, methods=("raw",))
    assert list(found.source.values) == ["holding_moment", "force_x", "force_y"]
    # Of additive noises, shares sum to one: but for the estimators' scatter, three times 0.02.
    np.testing.assert_allclose(found.share.sum("source").values, 1.0, atol=0.06)


def test_places_are_evenly_within_the_sweeps():
    found = noise_shares(QUIET, rng=1, samples=4, states=6, methods=("raw",))
    assert found.sizes["sample"] == 12
    for k, sweep in enumerate(QUIET.scan.sweeps):
        of = found.sweep.values == k
        length = abs(sweep.snap_off.drive_angle - sweep.first_contact.drive_angle)
        np.testing.assert_allclose(np.sort(found.after_first_contact.values[of]), length * (np.arange(6) + 0.5) / 6)
        np.testing.assert_allclose((found.after_first_contact + found.before_snap_off).values[of], length)
    same, other = (noise_shares(QUIET, rng=seed, samples=4, states=6, methods=("raw",)).share for seed in (1, 2))
    np.testing.assert_array_equal(same.values, found.share.values)
    assert np.any(other.values != found.share.values)


def test_shares_are_of_either_kind_of_drive():
    shifts = [tb.Translation((0.8, 0.0), np.pi, 1.1, 1.6), tb.Translation((-0.8, 0.0), 0.0, np.pi - 1.1, 1.6)]
    plan = Plan(tb.contours.Circle(0.3, 0.8), Rig(load_cell=tb.LoadCell(force_noise=0.005, moment_noise=0.002)), shifts)
    shares = noise_shares(plan, rng=1, samples=16, states=4, methods=("raw",))
    assert shares.sizes["sample"] == 8
    assert np.all(shares.after_first_contact >= 0.0)
    assert shares.after_first_contact.attrs["units"] == "1"
    with refused(ParameterError, "noise_shares"):
        noise_shares(replace(plan, drive=[tb.Rotation(), shifts[0]]), rng=1, samples=16)


@pytest.mark.parametrize("samples", [1000, 1, 0, -4, 64.0, True, "64"])
def test_samples_that_are_no_power_of_two_are_refused(samples):
    with refused(ParameterError, samples=samples):
        noise_shares(QUIET, rng=1, samples=samples)
