"""The frame of the load cell: fixed in the world, or turning with the drive."""

import hypothesis.strategies as st
import numpy as np
import pytest
import xarray as xr
from hypothesis import given, settings
from hypothesis.extra import numpy as hnp

import tactile_bayes as tb
from helpers.record_tables import WIRE, columns
from helpers.refusals import refused
from tactile_bayes.contours import Circle, Parabola, paper_profile
from tactile_bayes.errors import ParameterError, RecordError
from tactile_bayes.load_cell import LoadCell
from tactile_bayes.record import (
    CHANNELS,
    FRAMES,
    frame_of,
    in_frame,
    record_hash,
    to_dimensionless,
    turned,
    validate,
    write_record,
)
from tactile_bayes.rig import Rig, make_record, read_record

EPS = np.finfo(float).eps
ANGLES = np.array(columns()["drive_angle"])
moderate = st.floats(-1e6, 1e6)


@pytest.fixture(scope="module")
def scanned():
    return tb.scan(paper_profile("II", q=0.5)).record


# --- Turning ----------------------------------------------------------------------------------------------------


def test_a_force_along_the_rod_is_axial_and_one_to_its_left_is_transversal():
    along = make_record(columns(force_x=2.0 * np.cos(ANGLES), force_y=2.0 * np.sin(ANGLES)))
    np.testing.assert_allclose(in_frame(along, "turning")["force_x"], 2.0, rtol=4 * EPS)
    np.testing.assert_allclose(in_frame(along, "turning")["force_y"], 0.0, atol=4 * EPS)
    across = make_record(columns(force_x=-2.0 * np.sin(ANGLES), force_y=2.0 * np.cos(ANGLES)))
    np.testing.assert_allclose(in_frame(across, "turning")["force_x"], 0.0, atol=4 * EPS)
    np.testing.assert_allclose(in_frame(across, "turning")["force_y"], 2.0, rtol=4 * EPS)


@settings(max_examples=20, deadline=None)
@given(hnp.arrays(float, (4, 6), elements=moderate), st.floats(-1.0, 1.0), st.sampled_from(FRAMES))
def test_there_and_back_is_the_same_record(forces, turn, frame):
    names = ("force_x", "force_y", "truth_force_x", "truth_force_y")
    table = columns(**dict(zip(names, forces, strict=True)), drive_angle=ANGLES + turn)
    record = make_record(table, Rig(load_cell=LoadCell(frame=frame)))
    other = in_frame(record, next(name for name in FRAMES if name != frame))
    back = in_frame(other, frame)
    assert back.attrs == record.attrs
    for name in record:
        assert back[name].attrs == record[name].attrs
        if name not in names:
            assert back[name].identical(record[name])
    for pair in (names[:2], names[2:]):
        before = np.array([record[name].values for name in pair])
        size = np.hypot(*before)
        np.testing.assert_allclose(np.hypot(*(other[name].values for name in pair)), size, rtol=8 * EPS, atol=1e-300)
        assert np.all(np.abs(np.array([back[name].values for name in pair]) - before) <= 8 * EPS * size + 1e-300)


@pytest.mark.parametrize(
    ("contour", "base", "rod"),
    [
        (paper_profile("I", q=0.4), (0.0, 0.0), tb.Rod()),
        (paper_profile("II", q=0.5), (0.0, 0.0), tb.Rod()),
        (Circle(0.6, 0.4), (0.2, 0.1), tb.Rod()),
        (Parabola(2.5, 0.1), (0.0, 0.0), WIRE),
    ],
)
def test_the_axial_force_tells_the_phase_in_both_directions(contour, base, rod):
    """D = axial force − m0²/2 is zero in tangential contact, and positive in tip contact (without friction)."""
    record = to_dimensionless(in_frame(tb.scan(contour, base=base, rig=Rig(rod=rod)).record, "turning"))
    excess = record["force_x"].values - 0.5 * record["holding_moment"].values ** 2
    phase = record["truth_contact_phase"].values
    for direction in ("forward", "backward"):
        swept = record["direction"].values == direction
        largest = np.abs(record["force_x"].values[swept]).max()
        assert (swept & (phase == "tangential")).sum() > 10
        np.testing.assert_allclose(excess[swept & (phase == "tangential")], 0.0, atol=1e-11 * largest)
        assert (excess[swept & (phase == "tip")] > 0.0).all()
        assert not record["force_x"].values[swept & (phase == "none")].any()


def test_only_forces_change(scanned):
    before = scanned.copy(deep=True)
    record = in_frame(scanned, "turning")
    assert scanned.identical(before)
    for name in set(scanned) - {"force_x", "force_y"}:
        assert record[name].identical(scanned[name])
    assert record.attrs == {**scanned.attrs, "load_cell_frame": "turning"}
    assert record["force_x"].attrs == {"units": "1", "long_name": "axial support reaction"}
    assert record["force_y"].attrs == {"units": "1", "long_name": "transversal support reaction"}


def test_a_record_in_the_frame_already_is_returned(scanned):
    turning = in_frame(scanned, "turning")
    assert in_frame(scanned, "fixed") is scanned
    assert in_frame(turning, "turning") is turning


def test_truth_turns_by_the_true_angle_where_it_is_known():
    angle, true_angle = ANGLES, ANGLES + 0.01
    truth = {"truth_force_x": columns()["force_x"], "truth_force_y": columns()["force_y"]}
    expected = turned(*truth.values(), true_angle)
    record = in_frame(make_record(columns(**truth, truth_drive_angle=true_angle)), "turning")
    np.testing.assert_array_equal([record[name] for name in truth], expected)
    np.testing.assert_array_equal(record["force_x"], turned(*truth.values(), angle)[0])
    record = in_frame(make_record(columns(**truth)), "turning")
    np.testing.assert_array_equal(record["truth_force_x"], record["force_x"])
    assert record["truth_force_x"].attrs["long_name"] == "true axial support reaction"


def test_truth_that_is_unknown_stays_unknown():
    gap = np.where(np.arange(6) == 2, np.nan, 0.5)
    record = in_frame(make_record(columns(truth_force_x=gap, truth_force_y=gap)), "turning")
    assert np.isnan(record["truth_force_y"]).values.tolist() == np.isnan(gap).tolist()
    empty = in_frame(make_record(columns(truth_force_x=np.full(6, np.nan))), "turning")
    assert np.isnan(empty["truth_force_x"]).all()
    assert "truth_force_y" not in empty


def test_units_and_frame_convert_in_any_order():
    record = make_record(columns(), Rig(rod=WIRE), attrs={"load_cell_force_noise": 0.1})
    one, other = to_dimensionless(in_frame(record, "turning")), in_frame(to_dimensionless(record), "turning")
    xr.testing.assert_allclose(one, other, rtol=4 * EPS, atol=4 * EPS)
    assert one.attrs == other.attrs
    assert one.attrs["load_cell_frame"] == "turning"


# --- Missing channels -------------------------------------------------------------------------------------------


@pytest.mark.parametrize("frame", FRAMES)
@pytest.mark.parametrize(("name", "other"), [("force_x", "force_y"), ("force_y", "force_x")])
def test_one_force_alone_is_refused(name, other, frame):
    wanted = next(other_frame for other_frame in FRAMES if other_frame != frame)
    record = make_record(columns(**{name: None}), Rig(load_cell=LoadCell(frame=frame), file={"missing": (name,)}))
    assert in_frame(record, frame) is record
    with refused(RecordError, f"{name} was not", f"{wanted} frame", f"so {other}"):
        in_frame(record, wanted)


def test_without_any_force_there_is_nothing_to_lose():
    record = make_record(columns(force_x=None, force_y=None), Rig(file={"missing": ("force_x", "force_y")}))
    turning = in_frame(record, "turning")
    assert frame_of(turning) == "turning"
    xr.testing.assert_equal(turning, record)


def test_half_a_truth_is_refused():
    with refused(RecordError, "sample 0", "a truth_force_y", "no truth_force_x", "turning"):
        in_frame(make_record(columns(truth_force_y=np.ones(6))), "turning")
    gap = np.where(np.arange(6) == 2, np.nan, 0.5)
    with refused(RecordError, "sample 2", "a truth_force_x", "no truth_force_y"):
        in_frame(make_record(columns(truth_force_x=np.ones(6), truth_force_y=gap)), "turning")


# --- The attribute ----------------------------------------------------------------------------------------------


def test_a_record_that_states_no_frame_is_fixed():
    assert frame_of(make_record(columns())) == "fixed"
    assert "load_cell_frame" not in make_record(columns()).attrs


@pytest.mark.parametrize("way", ["keyword", "attribute", "later"])
def test_a_record_may_be_said_to_turn(way):
    if way == "keyword":
        record = make_record(columns(), Rig(load_cell=LoadCell(frame="turning")))
    elif way == "attribute":
        record = make_record(columns(), attrs={"load_cell_frame": "turning"})
    else:
        record = validate(make_record(columns()).assign_attrs(load_cell_frame="turning"))
    assert frame_of(record) == "turning"
    assert record["force_x"].attrs["long_name"] == "axial support reaction"
    np.testing.assert_array_equal(record["force_x"], columns()["force_x"])


def test_words_of_ones_own_are_kept():
    gauge = xr.DataArray(np.ones(6), dims="sample", attrs={"long_name": "strain gauge 1"})
    record = in_frame(make_record(columns(force_x=gauge)), "turning")
    assert record["force_x"].attrs["long_name"] == "strain gauge 1"


@pytest.mark.parametrize("frame", ["world", "Turning", "", 1, 1.0])
def test_a_frame_that_is_none_is_refused(frame):
    named = ("'load_cell_frame'", repr(frame), "'fixed'", "'turning'")
    record = make_record(columns()).assign_attrs(load_cell_frame=frame)
    for use in (validate, frame_of, record_hash, lambda record: in_frame(record, "fixed")):
        with refused(RecordError, *named):
            use(record)
    with refused(RecordError, *named):
        make_record(columns(), attrs={"load_cell_frame": frame})


def test_a_frame_to_convert_to_that_is_none_is_refused(scanned):
    with refused(ParameterError, frame="world"):
        in_frame(scanned, "world")


def test_what_is_no_record_is_refused():
    with refused(RecordError, "xarray.Dataset", "dict"):
        in_frame({}, "turning")


def test_two_statements_that_differ_are_refused():
    with refused(RecordError, "load_cell_frame 'fixed'", "'turning'"):
        make_record(columns(), Rig(load_cell=LoadCell(frame="turning")), attrs={"load_cell_frame": "fixed"})
    twice = make_record(columns(), Rig(load_cell=LoadCell(frame="turning")), attrs={"load_cell_frame": "turning"})
    assert frame_of(twice) == "turning"


def test_a_force_that_overflows_is_refused():
    huge = np.where(np.arange(6) == 5, 1.7e308, 0.0)
    with refused(RecordError, "sample 5, column 'force_x'", "inf"):
        in_frame(make_record(columns(force_x=huge, force_y=huge, drive_angle=ANGLES - 1.0)), "turning")


def test_the_hash_sees_the_frame():
    record = make_record(columns())
    assert record_hash(record.assign_attrs(load_cell_frame="fixed")) == record_hash(record)
    assert record_hash(record.assign_attrs(load_cell_frame="turning")) != record_hash(record)


# --- Files ------------------------------------------------------------------------------------------------------


def test_a_csv_file_states_the_frame_in_its_header(tmp_path):
    path = tmp_path / "lab.csv"
    write_record(make_record(columns(), Rig(load_cell=LoadCell(frame="turning"))), path)
    lines = path.read_text(encoding="utf-8").splitlines()
    assert "# load_cell_frame: turning" in lines
    assert any(line.startswith("# column force_x: number [1] axial ") for line in lines)
    path.write_text("\n".join(lines).replace(": turning", ": spinning") + "\n", encoding="utf-8")
    with refused(RecordError, path, "'load_cell_frame'", "'spinning'", "'fixed'"):
        read_record(path)


def test_a_file_that_states_no_frame_may_be_told_it(tmp_path):
    path = tmp_path / "plain.csv"
    path.write_text(f"sweep,direction,drive_angle,{','.join(CHANNELS)}\n0,forward,1.2,0.5,0.1,0.2\n", encoding="utf-8")
    assert frame_of(read_record(path)) == "fixed"
    record = read_record(path, Rig(load_cell=LoadCell(frame="turning")))
    assert frame_of(record) == "turning"
    assert record["force_x"].attrs["long_name"] == "axial support reaction"
