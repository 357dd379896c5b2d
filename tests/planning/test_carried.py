"""Plans of sweeps in which the drive carries the base."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy import stats

import tactile_bayes as tb
from helpers.refusals import refused
from tactile_bayes.errors import ParameterError
from tactile_bayes.planning.amplification import amplification
from tactile_bayes.planning.design import Criterion
from tactile_bayes.planning.noise_shares import noise_shares
from tactile_bayes.planning.plan import Plan
from tactile_bayes.rig import Rig

CIRCLE = tb.contours.Circle(0.3, 0.8)
SHIFTS = [
    tb.Translation((0.8, 0.0), np.pi, 1.1, 1.6),
    tb.Translation((-0.8, 0.0), 0.0, np.pi - 1.1, 1.6),
]
CELL = tb.LoadCell(force_noise=0.005, moment_noise=0.002)


def test_amplification_is_the_change_of_a_contact_by_a_reading():
    """Against finite differences of raw Step 2."""
    plan = Plan(CIRCLE, Rig(load_cell=CELL), drive=SHIFTS)
    found = amplification(plan)
    record = plan.scan.record
    loaded = np.flatnonzero(record.truth_contact_phase.values != "none")
    assert found.sizes["sample"] == loaded.size
    step = 1e-7
    pushed = record.assign(force_y=record.force_y + step)
    before, after = (tb.reconstruct(one) for one in (record, pushed))
    change = np.stack([(after[name] - before[name]).values[loaded] / step for name in ("contact_x", "contact_y")])
    slope = record.truth_slope_angle.values[loaded]
    along = change[0] * np.cos(slope) + change[1] * np.sin(slope)
    gain = found.gain_along.sel(reconstruction="raw", source="force_y").values
    strong = np.hypot(record.force_x, record.force_y).values[loaded] > 0.2
    assert strong.sum() > 10
    np.testing.assert_allclose(along[strong], gain[strong], rtol=1e-3, atol=1e-4)


def test_distances_are_along_the_drive():
    plan = Plan(CIRCLE, Rig(load_cell=CELL), drive=replace(SHIFTS[0], drive_step=0.05))
    found, (sweep,) = amplification(plan), plan.scan.sweeps
    travel = 0.8 - found.base_x.values
    np.testing.assert_allclose(found.after_first_contact, travel - sweep.first_contact.travel, atol=1e-12)
    np.testing.assert_allclose(found.before_snap_off, sweep.snap_off.travel - travel, atol=1e-12)
    assert {found[name].attrs["units"] for name in ("after_first_contact", "before_snap_off")} == {"1"}
    both = amplification(Plan(CIRCLE, Rig(load_cell=CELL), drive=[tb.Rotation(), SHIFTS[0]]))
    assert both.before_snap_off.attrs["units"] == "rad, 1"


def test_noise_shares_are_of_either_kind_of_drive():
    shares = noise_shares(Plan(CIRCLE, Rig(load_cell=CELL), drive=SHIFTS), rng=1, samples=16, states=4)
    assert shares.sizes["sample"] == 8
    assert np.all(shares.after_first_contact >= 0.0)
    assert shares.after_first_contact.attrs["units"] == "1"
    with refused(ParameterError, "noise_shares"):
        noise_shares(Plan(CIRCLE, Rig(load_cell=CELL), drive=[tb.Rotation(), SHIFTS[0]]), rng=1, samples=16, states=4)


@pytest.mark.parametrize("drive", [SHIFTS, [tb.Rotation(), SHIFTS[0]]])
def test_sensitivity_tells_what_a_band_would_be(drive):
    found = tb.sensitivity(CIRCLE, rng=1, drive=drive, parts=["information", "required_noise"])
    bounds = found["information"].bound
    assert np.all(np.isfinite(bounds.sel(parameter=["r", "q", "x_c"])))
    both = tb.sensitivity(CIRCLE, rng=1, drive=[*drive, SHIFTS[1]], parts=["information"])["information"].bound
    assert np.all(both.sel(parameter=["r", "q", "x_c"]) <= bounds.sel(parameter=["r", "q", "x_c"]) + 1e-12)


@pytest.mark.slow
def test_drives_are_candidates_of_a_design():
    """Two translations tell more than one of them, and a pivot among drives is what it is among pivots."""
    known = tb.Family("circle", r=stats.uniform(0.25, 0.1), q=stats.uniform(0.75, 0.1), x_c=stats.norm(0.0, 0.02))
    options = {"draws": 4, "rng": 1, "criterion": Criterion(span=(-0.2, 0.2))}
    found = tb.design(known, drives=[SHIFTS[0], SHIFTS, tb.Rotation()], **options)
    assert found.drive.values[0] == "carried from (0.8, 0) to (-0.8, 0) at 63°"
    assert found.width[1] < found.width[0]
    assert np.all(found.reached > 0.0)
    pivot = tb.design(known, drives=[tb.Rotation()], **options)
    assert float(pivot.width[0]) == pytest.approx(float(found.width[2]), rel=1e-12)
    with refused(ParameterError, "drive"):
        tb.design(known, drives=["left"], **options)


@pytest.mark.slow
def test_a_posterior_of_a_carried_rod_is_what_is_known():
    """Its drive is none of the pivots so far, and what it touched leaves no gap."""
    measured = CELL.measure(tb.scan(CIRCLE, drive=replace(SHIFTS[0], drive_step=0.04)).record, rng=1)
    settings = tb.SamplerSettings(walkers=32, ensembles=2)
    posterior = tb.infer_contour(
        measured, family="circle", rig=Rig(load_cell=CELL, unknown="nothing"), rng=1, settings=settings
    )
    found = tb.design(posterior, drives=[tb.Rotation(), SHIFTS[1]], draws=4, rng=1)
    assert found.sizes["pivot"] == 0
    assert np.all(found.width < found.present_width)
    assert np.all(found.gap == 0.0)


def test_candidates_that_begin_alike_are_told_apart():
    turns = [tb.Rotation(), tb.Rotation((0.1, 0.0))], [tb.Rotation(), tb.Rotation((0.2, 0.0))]
    one, other = ([drive.description for drive in drives] for drives in turns)
    assert one != other
