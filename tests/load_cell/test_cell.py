"""The load cell and records: what it makes of them, what it keeps, and what of it can be taken out again."""

import numpy as np
import pytest
from scipy import stats

from helpers.load_cells import CELL, GAIN, NORMAL, SHARED, UNKNOWN, WALK, cell, ideal
from helpers.refusals import refused
from tactile_bayes import scan
from tactile_bayes.contours import Parabola, paper_profile
from tactile_bayes.errors import ParameterError, RecordError
from tactile_bayes.load_cell import LoadCell
from tactile_bayes.mechanics.rods.rod import Rod
from tactile_bayes.reconstruction import reconstruct
from tactile_bayes.record import CHANNELS, frame_of, in_frame, loads_of, present_channels, to_si
from tactile_bayes.rig import Rig

# --- Measuring --------------------------------------------------------------------------------------------------


def test_the_same_seed_gives_the_same_noise():
    record = ideal()
    first = CELL.measure(record, rng=3)
    assert CELL.measure(record, rng=3).identical(first)
    assert not CELL.measure(record, rng=4).identical(first)
    rng = np.random.default_rng(3)
    assert CELL.measure(record, rng=rng).identical(first)
    assert not CELL.measure(record, rng=rng).identical(first)


def test_truth_is_kept_and_the_argument_is_not_changed():
    record = ideal(note=["a"] * 5)
    before = record.copy(deep=True)
    measured = CELL.measure(record, rng=1)
    assert record.identical(before)
    for name in CHANNELS:
        np.testing.assert_array_equal(measured[f"truth_{name}"], record[name])
        assert (measured[name] != record[name]).all()
        assert measured[f"truth_{name}"].attrs["units"] == record[name].attrs["units"]
        assert measured[name].attrs == record[name].attrs
    for name in set(record) - set(CHANNELS):
        assert measured[name].identical(record[name])
    assert "truth_drive_angle" not in measured  # the encoder is ideal
    measured["truth_force_x"][:] = 7
    assert record.identical(before)


def test_measuring_twice_keeps_the_first_truth_and_adds_variances():
    once = CELL.measure(ideal(), rng=1)
    twice = LoadCell(force_noise=0.12).measure(once, rng=2)
    for name in CHANNELS:
        assert twice[f"truth_{name}"].identical(once[f"truth_{name}"])
    assert twice.attrs["load_cell_force_noise"] == pytest.approx(0.13, rel=1e-15)
    assert twice.attrs["load_cell_moment_noise"] == 0.02
    np.testing.assert_array_equal(twice["holding_moment"], once["holding_moment"])


def test_a_missing_channel_stays_missing_and_the_others_have_the_same_noise():
    every = cell(drift=WALK, bias_uncertainty=UNKNOWN, correlation=SHARED, relative_noise=0.1, force_resolution=0.01)
    measured, whole = (every.measure(ideal(missing=missing), rng=1) for missing in (("force_x",), ()))
    assert present_channels(measured) == ("holding_moment", "force_y")
    assert "truth_force_x" not in measured
    for name in ("holding_moment", "force_y"):
        assert measured[name].identical(whole[name])


@pytest.mark.parametrize("further", [{"bias": (0.1, 0.0, 0.0)}, {"degrees_of_freedom": 3.0}, {"drift": WALK}])
def test_measuring_twice_is_refused_where_it_makes_no_load_cell(further):
    for first, second in ((cell(**further), CELL), (CELL, cell(**further))):
        with refused(ParameterError, "two load cells", "remove"):
            second.measure(first.measure(ideal(), rng=1), rng=2)


def test_an_ideal_cell_measures_what_was_measured_and_takes_nothing_out():
    once = cell(bias=(0.1, 0.0, 0.0), drift=WALK).measure(ideal(), rng=1)
    assert LoadCell().measure(once, rng=2).identical(once)
    assert cell(drift=WALK).corrected(once) is once


@pytest.mark.parametrize("name", NORMAL)
def test_a_record_is_measured_as_arrays_are(name):
    record = ideal(30)
    measured = NORMAL[name].measure(record, rng=5)
    loads = loads_of(record)
    made = loads_of(measured)
    np.testing.assert_array_equal(made, NORMAL[name].simulate(loads, rng=5))


def test_cross_talk_from_a_channel_that_is_missing_is_refused():
    partial = ideal(missing=("force_x",))
    alone = cell(gain=np.diag([1.1, 1.2, 1.3])).measure(partial, rng=1)
    assert present_channels(alone) == ("holding_moment", "force_y")
    assert cell(lever=(0.1, 0.0)).corrected(partial).holding_moment[-1] == partial.holding_moment[-1] + 0.1 * 2.0
    with refused(ParameterError, "cross-talk", "holding_moment"):
        cell(gain=GAIN).measure(partial, rng=1)
    for sheet in (cell(gain=GAIN), cell(lever=(0.0, 0.1))):
        with refused(ParameterError, "cross-talk", "gain"):
            sheet.corrected(partial)


# --- The frame --------------------------------------------------------------------------------------------------


def test_a_cell_that_turns_has_its_noise_on_what_it_measures():
    """The same numbers on axial and transversal force as on horizontal and vertical, in whatever frame a record is."""
    record, turned = ideal(), in_frame(ideal(), "turning")
    fixed, turning = CELL.measure(record, rng=1), CELL.measure(turned, rng=1)
    assert frame_of(turning) == "turning"
    for name in CHANNELS:
        np.testing.assert_allclose(turning[name] - turned[name], fixed[name] - record[name], rtol=0, atol=1e-15)
        np.testing.assert_array_equal(turning[f"truth_{name}"], turned[name])
    assert turning["truth_force_x"].attrs["long_name"] == "true axial support reaction"
    flaws = {"bias": (0.1, -0.2, 0.3), "force_range": 1.0, "correlation": SHARED}
    of_turning = cell(frame="turning", **flaws)
    measured = of_turning.measure(record, rng=1)
    assert measured.identical(cell(**flaws).measure(turned, rng=1))
    assert frame_of(cell(frame="fixed").measure(turned, rng=1)) == "fixed"
    np.testing.assert_allclose(in_frame(turning, "fixed")["truth_force_y"], record["force_y"], rtol=0, atol=1e-15)
    with refused(RecordError, "force_x"):
        of_turning.measure(ideal(missing=("force_x",)), rng=1)
    with refused(ParameterError, "fixed", "turning"):
        cell(frame="fixed", bias=(0.1, 0.0, 0.0)).corrected(measured)


# --- The encoder ------------------------------------------------------------------------------------------------


def test_readings_of_the_encoder_go_back_but_the_rod_does_not():
    sheet = cell(drive_angle_offset=0.01, drive_angle_noise=0.005, drive_angle_resolution=0.0015)
    record = scan(paper_profile("II", q=0.5), drive_step=0.004).record
    measured = sheet.measure(record, rng=1)
    for sweep, sense in ((0, 1), (1, -1)):
        own = record.sweep.values == sweep
        assert (sense * np.diff(measured.truth_drive_angle.values[own]) > 0).all()
        assert (sense * np.diff(measured.drive_angle.values[own]) < 0).sum() > 10
        # Loads end once, and where they would have ended with a perfect encoder.
        loaded = measured.truth_force_y.values[own] != 0
        assert np.count_nonzero(np.diff(loaded.astype(int)) == -1) == 1
    np.testing.assert_array_equal(measured.truth_drive_angle, record.drive_angle)
    np.testing.assert_array_equal(measured.truth_force_y, record.force_y)
    np.testing.assert_array_equal(measured.force_y, CELL.measure(record, rng=1).force_y)
    off = measured.drive_angle - record.drive_angle - 0.01
    # Noise and rounding: a normal number and a uniform one; the test fails for one seed in a million.
    steps = np.linspace(-0.5, 0.5, 201)[:, None] * 0.0015
    assert stats.kstest(off, lambda x: stats.norm.cdf((x - steps) / 0.005).mean(axis=0)).pvalue > 1e-6
    assert abs(np.corrcoef(off[1:], off[:-1])[0, 1]) < 5.0 / np.sqrt(off.size)
    whole = measured.drive_angle / 0.0015
    np.testing.assert_allclose(whole, np.round(whole), rtol=0, atol=1e-9)


def test_an_encoder_that_shows_no_sweep_is_refused():
    with refused(RecordError, "sweep 0", "'forward'"):
        LoadCell(drive_angle_noise=1.0).measure(ideal(2), rng=13)


# --- What is known, taken out again -----------------------------------------------------------------------------


@pytest.mark.parametrize("rod", [Rod(), Rod(0.1, 1.2e-5)])
@pytest.mark.parametrize("frame", ["fixed", "turning"])
def test_a_cell_beside_the_pivot_takes_the_moment_of_the_contact_force_there(frame, rod):
    """By equilibrium of the rod between the contact and the lever's end."""
    record = scan(Parabola(0.5 / rod.length, 0.5 * rod.length), drive_step=0.1, rig=Rig(rod=rod)).record
    lever = np.array([0.03, -0.02]) * rod.length
    measured = LoadCell(lever=tuple(lever), frame=frame).measure(record, rng=1)
    cos, sin = np.cos(record.drive_angle.values), np.sin(record.drive_angle.values)
    x, y = lever if frame == "fixed" else (lever[0] * cos - lever[1] * sin, lever[0] * sin + lever[1] * cos)
    along, across = record.truth_contact_x - record.base_x - x, record.truth_contact_y - record.base_y - y
    expected = (along * record.force_y - across * record.force_x).fillna(0.0)
    np.testing.assert_allclose(measured.holding_moment / rod.moment_unit, expected / rod.moment_unit, atol=1e-9)


@pytest.mark.parametrize("rod", [Rod(), Rod(0.1, 1.2e-5)])
@pytest.mark.parametrize("frame", ["fixed", "turning"])
def test_step_2_of_a_record_with_known_errors_is_that_of_the_ideal_one(frame, rod):
    ideally = scan(paper_profile("II", q=0.5), drive_step=0.02).record
    record = ideally if rod == Rod() else to_si(ideally, rod)
    unit, length = (rod.moment_unit, rod.force_unit), rod.length
    gain = np.array(GAIN) * [[1.0, length, length], [1 / length, 1.0, 1.0], [1 / length, 1.0, 1.0]]
    bias = np.array([0.1, -0.2, 0.3]) * [unit[0], unit[1], unit[1]]
    further = {"lever": (0.03 * length, -0.02 * length), "drive_angle_offset": 0.02, "drive_angle_backlash": 0.01}
    further["moment_curve"] = (0.05 / unit[0], 0.02 / unit[0] ** 2)
    sheet = LoadCell(bias=bias, gain=gain, **further, frame=frame)
    clean = reconstruct(record)
    measured = sheet.measure(record, rng=1)
    for given in (None, sheet):
        contacts = reconstruct(measured, rig=Rig(load_cell=given))
        # A sample whose load is rounding has no contact to speak of.
        firm = np.abs(record.holding_moment.values) > 1e-6 * unit[0]
        np.testing.assert_array_equal(contacts.status[firm], clean.status[firm])
        for name in ("contact_x", "contact_y", "contact_arclength"):
            np.testing.assert_allclose(contacts[name][firm], clean[name][firm], rtol=0, atol=1e-7 * length)
        np.testing.assert_allclose(contacts.drive_angle, record.drive_angle, rtol=1e-15)
    wrong = reconstruct(measured, rig=Rig(load_cell=LoadCell(frame=frame)))
    assert np.abs(wrong.contact_y - clean.contact_y).max() > 1e-3 * length


def test_taking_out_leaves_noise_and_what_is_unknown():
    known = {"lever": (0.1, 0.2), "drive_angle_offset": 0.02, "drive_angle_backlash": 0.01}
    sheet = cell(bias=(0.1, -0.2, 0.3), gain=GAIN, bias_uncertainty=UNKNOWN, **known)
    measured = sheet.measure(ideal(20), rng=1)
    before = measured.copy(deep=True)
    back = sheet.corrected(measured)
    assert measured.identical(before)
    assert LoadCell.from_record(back) == cell(bias_uncertainty=UNKNOWN)
    readings, loads = (loads_of(r) for r in (measured, back))
    loads[:, 0] += 0.2 * loads[:, 1] - 0.1 * loads[:, 2]
    np.testing.assert_allclose(loads @ np.array(GAIN).T + [0.1, -0.2, 0.3], readings, rtol=0, atol=1e-14)
    np.testing.assert_allclose(back.drive_angle, ideal(20).drive_angle, rtol=1e-15)
