"""Records of a base that is carried: files of a stage, sweeps and directions from its motion, and travels."""

import numpy as np
import pytest

import tactile_bayes as tb
from helpers.load_cells import CELL
from helpers.refusals import refused
from tactile_bayes.errors import RecordError
from tactile_bayes.record import carried_sweeps, travels_of
from tactile_bayes.rig import Rig

CIRCLE = tb.contours.Circle(0.3, 0.8)
THERE = tb.Translation(base=(0.8, 0.0), heading=np.pi, drive_angle=1.2, travel=1.6)
BACK = tb.Translation(base=(-0.8, 0.0), heading=0.0, drive_angle=1.2, travel=1.6)
SHORT = tb.Translation(base=(0.6, 0.0), heading=np.pi, drive_angle=1.2, travel=1.2)
MOTION = tb.Motion(x=[0.8, -0.8], y=0.0, drive_angle=[0.9, 1.7])
ROD = tb.Rod(length=0.1, flexural_rigidity=1.2e-5)


@pytest.fixture
def staged(tmp_path):
    """Write the file of a stage, with or without a column of angles, and read it."""

    def read(record, *, head="", angles=True, rod=None, **columns):
        names = ["base_x", "base_y", *(["drive_angle"] if angles else []), "holding_moment", "force_x", "force_y"]
        rows = zip(*(record[name].values.tolist() for name in names), strict=True)
        lines = [",".join(names), *(",".join(map(repr, row)) for row in rows)]
        (tmp_path / "stage.csv").write_text(head + "\n".join(lines) + "\n", encoding="utf-8")
        return tb.read_record(tmp_path / "stage.csv", tb.Rig(rod=rod, file={**columns, "split_sweeps": True}))

    return read


@pytest.mark.parametrize(
    ("head", "columns"),
    [("# drive_angle: 68.75 [deg]\n", {}), ("# drive_angle: 1.2\n", {}), ("", {"drive_angle": "68.75[deg]"})],
)
def test_a_clamped_rod_states_its_angle_once(staged, head, columns):
    read = staged(tb.scan(CIRCLE, drive=THERE).record, head=head, angles=False, **columns)
    np.testing.assert_allclose(read.drive_angle, 1.2, atol=1e-4)
    assert carried_sweeps(read) == (0,)
    assert set(read.direction.values) == {"forward"}
    assert "drive_angle" not in read.attrs


@pytest.mark.parametrize(
    "drive", [[THERE], [BACK], [MOTION], [THERE, tb.Translation((-0.8, 0.0), 0.0, np.pi - 1.2, 1.6)]]
)
def test_sweeps_and_directions_follow_from_the_motion(staged, drive):
    """A column of angles precedes an angle in the header."""
    record = tb.scan(CIRCLE, drive=drive).record
    read = staged(record, head="# drive_angle: 0.3\n")
    np.testing.assert_array_equal(read.drive_angle, record.drive_angle)
    np.testing.assert_array_equal(read.direction, record.direction)
    assert len(set(read.sweep.values.tolist())) == len(drive)


def test_lengths_of_a_stage_are_in_metres(staged):
    drive = tb.Translation((0.08, 0.0), np.pi, 1.2, 0.16)
    record = tb.scan(tb.contours.Circle(0.03, 0.08), drive=drive, rig=Rig(rod=ROD)).record
    with pytest.warns(tb.errors.RecordWarning, match="for base_x, .* m, N m, N and N"):
        read = staged(record, head="# drive_angle: 68.75 [deg]\n", angles=False, rod=ROD)
    assert travels_of(read)[-1] == pytest.approx(0.16)
    assert set(read.direction.values) == {"forward"}


@pytest.mark.parametrize(
    "drive",
    [
        [tb.Rotation(), THERE],
        [SHORT, tb.Rotation((-0.6, 0.0)), tb.Rotation((0.2, 0.0))],
        [tb.Rotation((0.6, 0.0)), SHORT, BACK, tb.Rotation()],
        [tb.Rotation(), MOTION, tb.Rotation((0.1, -0.1))],
    ],
    ids=["beside", "from-its-end", "from-its-begin", "a-motion-between"],
)
@pytest.mark.parametrize("noise", [0.0, 1e-4])
def test_a_record_of_both_kinds_is_parted_where_the_base_begins_or_stops_to_move(staged, drive, noise):
    """Also with noise of the encoder, and where a pivot is where the base begins or ends to move."""
    record = tb.scan(CIRCLE, drive=drive).record
    angle = record.drive_angle.values + np.random.default_rng(1).normal(0.0, noise, record.sizes["sample"])
    record = record.assign(drive_angle=("sample", angle, record.drive_angle.attrs))
    read = staged(record)
    ends, found = (np.flatnonzero(np.diff(one.sweep)) for one in (record, read))
    assert found.size == ends.size
    assert np.abs(found - ends).max() <= 1  # a sample at which the drive turns back belongs to either sweep
    assert np.count_nonzero(read.direction != record.direction) <= np.count_nonzero(found != ends)


def test_a_rod_that_moves_along_itself_has_no_direction(tmp_path):
    x = 0.01 * np.arange(50)
    path = tmp_path / "stage.csv"
    path.write_text("base_x,drive_angle,holding_moment,force_x,force_y\n" + "".join(f"{v},0,0,0,0\n" for v in x))
    with refused(RecordError, "no side of the rod leads", "line 2"):
        tb.read_record(path, tb.Rig(file={"split_sweeps": True}))


def test_travels_are_ways_where_the_base_is_carried():
    record = tb.scan(CIRCLE, drive=[tb.Rotation(), THERE]).record
    turned = record.sweep.values < 2
    travels = travels_of(record)
    np.testing.assert_array_equal(travels[turned], record.drive_angle.values[turned])
    np.testing.assert_allclose(travels[~turned], 0.01 * np.arange(161), atol=1e-12)


def test_an_inspection_reports_travels_and_finds_lost_samples():
    measured = CELL.measure(tb.scan(CIRCLE, drive=BACK).record, rng=1)
    found = tb.inspect_record(measured)
    sweeps = found.sweeps.isel(sweep=0)
    assert bool(sweeps.carried)
    assert [float(sweeps.travel), float(sweeps.travel_step)] == pytest.approx([1.6, 0.01])
    assert not found.samples.uneven_step.values.any()
    lost = tb.inspect_record(measured.isel(sample=np.delete(np.arange(161), [30, 31])))
    assert np.flatnonzero(lost.samples.uneven_step.values).tolist() == [30]
