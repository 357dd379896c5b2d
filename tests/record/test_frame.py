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


def test_a_force_along_the_rod_is_axial_and_one_to_its_left_is_transversal():
    along = make_record(columns(force_x=2.0 * np.cos(ANGLES), force_y=2.0 * np.sin(ANGLES)))
    turning = in_frame(along, "turning")
    assert turning.attrs == {**along.attrs, "load_cell_frame": "turning"}
    names = [turning[name].attrs["long_name"] for name in ("force_x", "force_y")]
    assert names == ["axial support reaction", "transversal support reaction"]
    np.testing.assert_allclose(turning["force_x"], 2.0, rtol=4 * EPS)
    np.testing.assert_allclose(turning["force_y"], 0.0, atol=4 * EPS)
    across = make_record(columns(force_x=-2.0 * np.sin(ANGLES), force_y=2.0 * np.cos(ANGLES)))
    np.testing.assert_allclose(in_frame(across, "turning")["force_x"], 0.0, atol=4 * EPS)
    np.testing.assert_allclose(in_frame(across, "turning")["force_y"], 2.0, rtol=4 * EPS)


@settings(max_examples=20, deadline=None)
@given(hnp.arrays(float, (4, 6), elements=moderate), st.floats(-1.0, 1.0), st.sampled_from(FRAMES))
def test_there_and_back_is_the_same_record(forces, turn, frame):
    names = ("force_x", "force_y", "truth_force_x", "truth_force_y")
    table = columns(**dict(zip(names, forces, strict=True)), drive_angle=ANGLES + turn)
    record = make_record(table, Rig(load_cell=LoadCell(frame=frame)))
    before = record.copy(deep=True)
    other = in_frame(record, next(name for name in FRAMES if name != frame))
    assert record.identical(before)
    back = in_frame(other, frame)
    assert back.attrs == record.attrs
    for name in record:
        assert back[name].attrs == record[name].attrs
        if name not in names:
            assert record[name].identical(other[name])
            assert record[name].identical(back[name])
    for pair in (names[:2], names[2:]):
        forces = np.array([record[name].values for name in pair])
        size = np.hypot(*forces)
        np.testing.assert_allclose(np.hypot(*(other[name].values for name in pair)), size, rtol=8 * EPS, atol=1e-300)
        assert np.all(np.abs(np.array([back[name].values for name in pair]) - forces) <= 8 * EPS * size + 1e-300)


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


def test_without_any_force_there_is_nothing_to_lose():
    record = make_record(columns(force_x=None, force_y=None), Rig(file={"missing": ("force_x", "force_y")}))
    turning = in_frame(record, "turning")
    assert frame_of(turning) == "turning"
    xr.testing.assert_equal(turning, record)


GAP = np.where(np.arange(6) == 2, np.nan, 0.5)
HUGE = np.where(np.arange(6) == 5, 1.7e308, 0.0)


@pytest.mark.parametrize(
    ("table", "frame", "named"),
    [
        *(
            (columns(**{name: np.full(6, np.nan)}), frame, [f"{name} was not", f"{wanted} frame", f"so {other}"])
            for name, other in (("force_x", "force_y"), ("force_y", "force_x"))
            for frame, wanted in (FRAMES, FRAMES[::-1])
        ),
        (columns(truth_force_y=np.ones(6)), "fixed", ["sample 0", "a truth_force_y", "no truth_force_x", "turning"]),
        (columns(truth_force_x=np.ones(6), truth_force_y=GAP), "fixed", ["sample 2", "a truth_force_x"]),
        (columns(force_x=HUGE, force_y=HUGE, drive_angle=ANGLES - 1.0), "fixed", ["sample 5, column 'force_x'", "inf"]),
    ],
)
def test_what_cannot_be_turned_is_refused_and_returned_in_its_own_frame(table, frame, named):
    record = make_record(table, Rig(load_cell=LoadCell(frame=frame)))
    assert in_frame(record, frame) is record
    with refused(RecordError, *named):
        in_frame(record, next(other for other in FRAMES if other != frame))


def test_a_record_may_be_said_to_turn(tmp_path):
    """To the load cell, as an attribute, later, or of a file that states no frame; a name of one's own is kept."""
    plain, cell = make_record(columns()), Rig(load_cell=LoadCell(frame="turning"))
    assert frame_of(plain) == "fixed"
    assert "load_cell_frame" not in plain.attrs
    write_record(plain, tmp_path / "plain.csv")
    assert frame_of(read_record(tmp_path / "plain.csv")) == "fixed"
    for record in (
        make_record(columns(), cell),
        make_record(columns(), attrs={"load_cell_frame": "turning"}),
        make_record(columns(), cell, attrs={"load_cell_frame": "turning"}),
        validate(plain.assign_attrs(load_cell_frame="turning")),
        read_record(tmp_path / "plain.csv", cell),
    ):
        assert frame_of(record) == "turning"
        assert record["force_x"].attrs["long_name"] == "axial support reaction"
        np.testing.assert_array_equal(record["force_x"], columns()["force_x"])
    gauge = xr.DataArray(np.ones(6), dims="sample", attrs={"long_name": "strain gauge 1"})
    record = in_frame(make_record(columns(force_x=gauge)), "turning")
    assert record["force_x"].attrs["long_name"] == "strain gauge 1"


@pytest.mark.parametrize("frame", ["world", "Turning", "", 1, 1.0])
def test_a_frame_that_is_none_is_refused(frame):
    record = make_record(columns()).assign_attrs(load_cell_frame=frame)
    for use in (validate, frame_of, record_hash, lambda record: in_frame(record, "fixed"),
                lambda record: make_record(columns(), attrs=record.attrs)):  # fmt: skip
        with refused(RecordError, "'load_cell_frame'", repr(frame), "'fixed'", "'turning'"):
            use(record)


def test_frames_that_contradict_or_do_not_exist_are_refused():
    with refused(RecordError, "load_cell_frame 'fixed'", "'turning'"):
        make_record(columns(), Rig(load_cell=LoadCell(frame="turning")), attrs={"load_cell_frame": "fixed"})
    with refused(ParameterError, frame="world"):
        in_frame(make_record(columns()), "world")
    with refused(RecordError, "xarray.Dataset", "dict"):
        in_frame({}, "turning")
