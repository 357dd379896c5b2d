"""Sides of contact: as directions say, unless the moment contradicts them, whatever the zeros."""

import json

import numpy as np
import pytest
import xarray as xr
from scipy import stats

from helpers.load_cells import CELL
from tactile_bayes import LoadCell, Rig, SamplerSettings, infer_contour, reconstruct, scan
from tactile_bayes.calibration.calibrate import experiment_of
from tactile_bayes.calibration.simulation import simulate
from tactile_bayes.contours import Parabola, paper_profile
from tactile_bayes.diagnostics.result_check import doubtful_sides
from tactile_bayes.reconstruction import contact_sides, sides_and_doubts
from tactile_bayes.rig import NOTHING
from tactile_bayes.runs.readings import reconstruction_messages


@pytest.mark.parametrize(("family", "count"), [("parabola", 20), pytest.param("ellipse", 250, marks=pytest.mark.slow)])
def test_biases_do_not_turn_a_side(family, count):
    """A doubt of two standard errors comes up in one of 44 sweeps at most, a wrong side never: it takes six. Of records
    of the default prior, biases having three times its standard deviation."""
    unknown = {"lever": 0.0, "backlash": 0.0, "friction": 0.0, "bias": stats.norm(0.0, 0.3)}
    experiment = experiment_of(family, Rig(load_cell=CELL, unknown=unknown), rng=1)
    doubtful = 0
    for number in range(count):
        measured = simulate(experiment, np.random.default_rng([7, number])).measured
        forward = measured.direction.values == "forward"
        np.testing.assert_array_equal(contact_sides(measured, CELL) > 0.0, forward)
        doubtful += bool(sides_and_doubts(measured, CELL)[1])
    assert doubtful <= 0.05 * count


@pytest.mark.parametrize("bias", [-0.3, 0.0, 0.3])
def test_a_label_that_the_moment_contradicts_is_not_believed(bias):
    record = scan(paper_profile("II", q=0.5), direction="forward").record
    measured = LoadCell(force_noise=0.05, moment_noise=0.02, bias=(bias, 0.0, 0.0)).measure(record, rng=1)
    wrong = measured.assign(direction=("sample", np.full(measured.sizes["sample"], "backward")))
    assert np.all(contact_sides(wrong, CELL) == 1.0)
    assert not sides_and_doubts(wrong, CELL)[1]


@pytest.mark.parametrize("bias", [-2.0, -0.8, 0.8, 2.0])
def test_a_zero_before_and_after_contact_is_one_however_far_off(bias):
    """A load that does not change would not come back to the same level; contact is a third of the record here."""
    record = scan(paper_profile("II", q=0.8), drive_angles=np.radians(np.arange(-30.0, 210.0, 2.0))).record
    measured = LoadCell(force_noise=0.05, moment_noise=0.02, bias=(bias, 0.0, 0.0)).measure(record, rng=1)
    np.testing.assert_array_equal(contact_sides(measured, CELL) > 0.0, measured.direction.values == "forward")
    assert not sides_and_doubts(measured, CELL)[1]


def test_a_drive_that_turns_back_in_contact_stays_on_its_side():
    """Also where the way back begins with load, and ends without."""
    record = scan(paper_profile("II", q=0.5), direction="forward", drive_step=0.02).record
    there = record.isel(sample=slice(0, 100))
    back = there.isel(sample=slice(None, None, -1))
    back = back.assign(sweep=back.sweep + 1, direction=("sample", np.full(100, "backward")))
    measured = CELL.measure(xr.concat([there, back], "sample"), rng=1)
    assert np.all(contact_sides(measured, CELL) == 1.0)


def in_contact_throughout(moment):
    """A short forward sweep that is loaded from beginning to end, its readings shifted as if the zero were off."""
    record = scan(Parabola(0.5, 0.5), direction="forward", drive_step=0.01).record
    loaded = np.flatnonzero(record.holding_moment.values > 0.15)[:40]
    part = record.isel(sample=loaded)
    shift = moment - float(part.holding_moment.mean())
    return LoadCell(force_noise=0.05, moment_noise=0.02, bias=(shift, 0.0, 0.0)).measure(part, rng=1)


def test_without_a_zero_the_prior_of_a_bias_decides():
    """0.1 EI/L is a standard deviation: beyond six of them the label is contradicted, from two on doubted."""
    for moment, turned, doubted in (
        (0.3, False, False),
        (-0.1, False, False),
        (-0.35, False, True),
        (-0.8, True, False),
    ):
        measured = in_contact_throughout(moment)
        assert np.all(contact_sides(measured, CELL) == (-1.0 if turned else 1.0))
        assert bool(sides_and_doubts(measured, CELL)[1]) == doubted


def test_step_2_takes_the_side_that_fits_and_says_so():
    """The moment speaks against the direction; forces and drive angles fit contacts on its side alone."""
    measured = in_contact_throughout(-0.3)
    contacts = reconstruct(measured, method="constrained", rig=Rig(load_cell=CELL))
    assert json.loads(contacts.attrs["doubtful_sides"]) == {"0": "forward"}
    assert "sweep 0 as a forward one" in reconstruction_messages(contacts)[0]
    assert "doubtful_sides" not in reconstruct(in_contact_throughout(0.3), rig=Rig(load_cell=CELL)).attrs


@pytest.mark.slow
def test_in_doubt_evidence_decides_which_side_it_was():
    """A sweep whose moment speaks against its direction by a zero that is off: its angles and forces know better."""
    record = scan(Parabola(0.5, 0.5), direction="forward", drive_step=0.03).record
    start = int(np.argmax(record.holding_moment.values > 0.1))
    part = record.isel(sample=slice(start, None))
    whole = LoadCell(force_noise=0.05, moment_noise=0.02, bias=(-0.9, 0.0, 0.0)).measure(part, rng=1)
    loaded = whole.isel(sample=np.flatnonzero(part.holding_moment.values > 0.0))
    moment = float(loaded.holding_moment.mean())
    shifted = loaded.assign(holding_moment=loaded.holding_moment - moment - 0.3)
    assert sides_and_doubts(shifted, CELL)[1] == (0,)
    found = infer_contour(
        shifted,
        rig=Rig(load_cell=CELL, unknown={**NOTHING, "bias": "default", "moment_bias": stats.norm(0.0, 1.0)}),
        rng=1,
        settings=SamplerSettings(ensembles=2, max_steps=50),
    )
    assert json.loads(found.attrs["doubtful_sides"]) == {"0": "forward"}
    assert found.attrs["sides_probability"] > 0.99
    assert "as a forward one" in doubtful_sides(found.attrs)[0]
    assert found["posterior"]["a"].median() == pytest.approx(0.5, abs=0.2)
