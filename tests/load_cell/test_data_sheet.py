"""The data sheet of a load cell: what it refuses, its units, and its way through records and files."""

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from helpers.load_cells import cell, ideal, load_cells
from helpers.refusals import refused
from tactile_bayes.errors import ParameterError
from tactile_bayes.load_cell import LoadCell, OrnsteinUhlenbeck, RandomWalk
from tactile_bayes.load_cell.data_sheet import MEMORY
from tactile_bayes.mechanics.rods.rod import Rod
from tactile_bayes.record import CHANNELS, LOAD_CELL_UNITS, to_dimensionless, write_record
from tactile_bayes.rig import read_record

rods = st.builds(Rod, st.floats(0.3, 3.0), st.floats(0.3, 3.0))


@pytest.mark.parametrize(
    ("sheet", "has_them"),
    [
        ({}, False),
        ({"force_noise": 0.1}, False),
        ({"moment_noise": 0.1, "force_resolution": 0.1}, False),
        ({"force_noise": 0.1, "moment_noise": 0.1}, True),
        ({"force_noise": 0.1, "moment_noise": 0.1, "degrees_of_freedom": 2.1}, True),
        ({"force_noise": 0.1, "moment_noise": 0.1, "degrees_of_freedom": 2.0}, False),
    ],
)
def test_variances_are_of_every_channel_and_finite(sheet, has_them):
    cell = LoadCell(**sheet)
    assert cell.has_variances is has_them
    assert all(0.0 < deviation < np.inf for deviation in cell.standard_deviations.values()) is has_them


# --- What is refused --------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "values"),
    [
        *((name, [0.1, (0.1, 0.2), (0.1, 0.2, np.nan), (0.1, 0.2, "3")]) for name in ("bias", "correlation")),
        ("bias_uncertainty", [0.1, None, (0.0, -0.1, 0.0)]),
        ("gain", [1.01, (1.0, 1.0, 1.0), np.eye(2), [[1, 0, 0], [0, 1, 0], 1], np.diag([1.0, 0.0, np.nan])]),
        ("gain", [((0.0, 0.0, 0.0),) * 3, ((1.0, 0.0, 0.0), (0.0, 1.0, 1.0), (0.0, 1.0, 1.0))]),
        ("correlation", [(1.0, 0.0, 0.0), (0.9, 0.9, -0.9), (-0.6, -0.6, -0.6), (0.0, 1.5, 0.0)]),
        ("drift", [0.1, "random_walk", RandomWalk, (0.1, 0.1)]),
        ("frame", ["rotating", "", 1, ["fixed"], np.array(["fixed"])]),
        ("moment_curve", [(1.0,), (np.nan, 0.0), "bent"]),
        *((name, [-0.1, np.nan, np.inf, "1", (0.1,), (0, 1, -1)]) for name in MEMORY),
    ],
)
def test_what_no_load_cell_has_is_refused(name, values):
    for value in values:
        with refused(ParameterError, "load cell", **{name: value}):
            LoadCell(**{name: value})


def test_an_impossible_drift_is_refused():
    of_size = [-1.0, np.nan, np.inf, "0.1", None, (0.1,)]
    for law, name, values in (
        *((law, name, of_size) for law in (RandomWalk, OrnsteinUhlenbeck) for name in ("moment", "force")),
        (OrnsteinUhlenbeck, "time", [0, -1.0, np.nan, np.inf, "3"]),
    ):
        for value in values:
            with refused(ParameterError, law.__name__, **{name: value}):
                law(**{"moment": 0.1, name: value})


BOTH_DRIFTS = {"random_walk_force": 0.1, "ornstein_uhlenbeck_force": 0.1}


@pytest.mark.parametrize(
    ("make", "named"),
    [
        (lambda: LoadCell(force_resolution=2.0, force_range=1.0), ["force_resolution", 2.0, "force_range", 1.0]),
        (lambda: LoadCell(degrees_of_freedom=4.0, correlation=(0, 0.1, 0)), ["degrees_of_freedom", "correlated"]),
        (lambda: LoadCell.from_entries({"Force_noize": 0.1}), ["'Force_noize'", "'force_noise'"]),
        (lambda: LoadCell.from_entries({"q": 0.1}), ["'q'", "frame, force_noise"]),
        (lambda: LoadCell.from_entries(BOTH_DRIFTS), ["random walk", "Ornstein-Uhlenbeck"]),
        (lambda: LoadCell.from_entries({"force_noise": "much"}), ["force_noise", "'much'"]),
        (lambda: LoadCell(drive_angle_noise=1e3).measure(ideal(), rng=1), ["encoder", "radians"]),
        (lambda: LoadCell(drive_angle_offset=57.3).measure(ideal(), rng=1), ["encoder", "radians"]),
    ],
)
def test_what_contradicts_itself_or_means_nothing_is_refused(make, named):
    with refused(ParameterError, *named):
        make()


# --- One form ---------------------------------------------------------------------------------------------------


def test_lists_arrays_and_whole_numbers_are_the_same_as_tuples():
    lists = LoadCell(force_noise=np.float64(1), bias=[1, 2, 3], gain=np.eye(3), drift=RandomWalk(force=np.int64(1)))
    tuples = LoadCell(force_noise=1.0, bias=(1.0, 2.0, 3.0), drift=RandomWalk(force=1.0))
    assert lists == tuples
    assert hash(lists) == hash(tuples)
    assert type(lists.force_noise) is float


def test_a_drift_of_no_size_is_none_and_a_step_may_be_as_wide_as_the_range():
    assert LoadCell(drift=RandomWalk()) == LoadCell(drift=OrnsteinUhlenbeck(time=7.0)) == LoadCell()
    assert LoadCell(force_resolution=1.0, force_range=1.0).limit[1] == 1.0


@given(load_cells())
def test_entries_say_everything(sheet):
    assert LoadCell.from_entries(sheet.entries()) == sheet
    assert set(sheet.entries()) <= {*LOAD_CELL_UNITS, "frame"}
    assert LoadCell().entries() == {}


# --- Records and files ------------------------------------------------------------------------------------------


def test_the_data_sheet_goes_with_the_record():
    assert LoadCell.from_record(ideal()) is None
    assert LoadCell.from_record(cell().measure(ideal(), rng=1)) == cell()
    half = ideal()
    half.attrs["load_cell_force_noise"] = 0.5
    assert LoadCell.from_record(half) == LoadCell(force_noise=0.5)


def test_a_lever_and_a_backlash_are_kept_with_their_units(tmp_path):
    sheet, path = LoadCell(lever=(0.001, -0.002), drive_angle_backlash=-0.003), tmp_path / "record.csv"
    write_record(sheet.measure(ideal(20, rod=Rod(0.2, 2.4e-3)), rng=1), path)
    assert LoadCell.from_record(read_record(path)) == sheet
    header = path.read_text(encoding="utf-8")
    assert "# load_cell_lever_y: -0.002 [m]" in header
    assert "# load_cell_drive_angle_backlash: -0.003 [rad]" in header
    path.write_text(header.replace("lever_y: -0.002 [m]", "lever_y: -2.0 [mm]"), encoding="utf-8")
    assert LoadCell.from_record(read_record(path)) == sheet


# --- Units ------------------------------------------------------------------------------------------------------


@settings(max_examples=15, deadline=None)
@given(load_cells(), rods, st.integers(0, 2**31))
def test_what_it_does_is_the_same_in_all_units(sheet, rod, seed):
    record = ideal(20, rod=rod)
    converted = to_dimensionless(sheet.measure(record, rng=seed))
    dimensionless = sheet.dimensionless(rod).measure(to_dimensionless(record), rng=seed)
    assert set(converted.data_vars) == set(dimensionless.data_vars)
    for name in (*CHANNELS, "drive_angle"):
        np.testing.assert_allclose(converted[name], dimensionless[name], rtol=1e-9, atol=1e-9)
    found, expected = (
        {name: value for name, value in LoadCell.from_record(each).entries().items() if value != 0.0}
        for each in (converted, dimensionless)
    )
    assert found == pytest.approx(expected, rel=1e-13)


@settings(max_examples=15, deadline=None)
@given(load_cells(frames=(None,)), rods, st.integers(0, 2**31))
def test_the_likelihood_is_the_same_in_all_units_but_for_their_jacobian(sheet, rod, seed):
    loads = np.random.default_rng(seed).normal(size=(4, 6, 3))
    measured = sheet.simulate(loads[0], rng=seed)
    units = rod.load_units
    try:
        si = sheet.log_likelihood(measured, loads, pointwise=True)
    except ParameterError:
        with pytest.raises(ParameterError):
            sheet.dimensionless(rod).log_likelihood(measured / units, loads / units, pointwise=True)
        assume(False)
    dimensionless = sheet.dimensionless(rod).log_likelihood(measured / units, loads / units, pointwise=True)
    steps = (sheet.resolution > 0.0) & (not sheet.approximations)
    density = ~steps & (np.abs(measured) < sheet.limit * (1 - 1e-9))
    shift = np.sum(density * np.log(units), axis=-1)
    np.testing.assert_allclose(dimensionless, si + shift, rtol=1e-7, atol=1e-7)


def test_a_rod_without_size_changes_nothing():
    sheet = cell(gain=np.eye(3) + 0.01, lever=(0.1, 0.2), drift=RandomWalk(force=0.1), force_range=1.0, frame="turning")
    assert sheet.dimensionless(Rod()) == sheet
