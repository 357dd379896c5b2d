"""A record in a file to which another program appends rows."""

import os

import numpy as np
import pytest
import xarray as xr

from helpers.refusals import refused
from tactile_bayes.errors import RecordError
from tactile_bayes.record import write_record
from tactile_bayes.rig import GrowingRecord, Rig, read_record


@pytest.fixture(scope="module")
def lines(measured, tmp_path_factory):
    """Lines of the file of a record, header and rows, with their ends."""
    path = tmp_path_factory.mktemp("whole") / "record.csv"
    write_record(measured, path)
    whole = path.read_text(encoding="utf-8").splitlines(keepends=True)
    head = next(number for number, line in enumerate(whole) if not line.startswith("#")) + 1
    return whole[:head], whole[head:]


@pytest.fixture
def path(tmp_path):
    return tmp_path / "record.csv"


def write(path, *parts):
    path.write_text("".join(text for part in parts for text in part), encoding="utf-8")
    return path


def with_cell(row, place, text):
    cells = row.rstrip("\n").split(",")
    cells[place] = text
    return ",".join(cells) + "\n"


SWEEP, ANGLE, MOMENT, FORCE = 0, 4, 5, 6


def test_whole_lines_are_taken_as_they_come(path, lines, measured):
    head, rows = lines
    growing = GrowingRecord(path)
    assert growing.poll() is None
    write(path, head[:3])
    assert growing.poll().record is None
    write(path, head, ["0,forw"])
    assert growing.poll().record is None
    for taken, rest in ((4, ""), (9, rows[9][:20]), (20, "")):
        write(path, head, rows[:taken], [rest])
        now = growing.poll()
        assert (now.record.sizes["sample"], now.messages, now.is_other, now.error) == (taken, (), False, None)
    write(path, head, rows[:20], rows[20][:5])
    assert growing.poll() is None
    assert growing.poll() is None
    write(path, head, rows)
    xr.testing.assert_identical(growing.poll().record, read_record(path))


def test_a_file_that_is_replaced_or_cut_short_is_told(path, lines):
    head, rows = lines
    growing = GrowingRecord(write(path, head, rows[:10]))
    growing.poll()
    write(path, head, rows[:4])
    now = growing.poll()
    assert now.is_other
    assert now.record.sizes["sample"] == 4
    (message,) = now.messages
    assert message.startswith(f"{path} ")
    assert f"had {len(head) + 10} lines, and has {len(head) + 4})" in message
    other = write(path.with_name("other.csv"), head, rows[2:12])
    os.replace(other, path)
    assert growing.poll().is_other
    path.unlink()
    assert growing.poll() is None


def test_a_change_of_the_same_size_at_the_same_time_is_seen(path, lines):
    head, rows = lines
    growing = GrowingRecord(write(path, head, rows[:10]))
    before, stat = growing.poll(), path.stat()
    write(path, head, [row.replace("0.", "1.", 1) for row in rows[:10]])
    os.utime(path, ns=(stat.st_atime_ns, stat.st_mtime_ns))
    assert path.stat().st_size == stat.st_size
    now = growing.poll()
    assert now.is_other
    assert now.sha256 != before.sha256


@pytest.mark.parametrize(
    ("wrong", "words"),
    [
        (lambda row: with_cell(row, FORCE, "overload"), "'overload' is no number"),
        (lambda row: with_cell(row, MOMENT, ""), "is missing (nan)"),
        (lambda row: with_cell(row, MOMENT, "inf"), "is inf"),
        (lambda row: row.rstrip("\n") + ",1.0\n", "there are 9 cells in 8 columns"),
        (lambda row: "\0" * 8 + "\n", "NUL"),
        (lambda row: row[:12] + "\n", "cells in 8 columns"),
        (lambda row: with_cell(row, 1, "up"), "is no direction"),
        (lambda row: with_cell(row, ANGLE, "99.0"), "more than a turn"),
    ],
)
def test_rows_that_no_record_can_have_are_told_once_and_left_out(path, lines, measured, wrong, words):
    head, rows = lines
    spoilt = [*rows[:10], wrong(rows[10]), *rows[11:30]]
    growing = GrowingRecord(write(path, head, spoilt))
    now = growing.poll()
    (message,) = now.messages
    assert message.startswith(f"{path}: line {len(head) + 11}")
    assert words in message
    assert message.endswith("left out")
    np.testing.assert_array_equal(now.record.force_y, measured.force_y[np.delete(np.arange(30), 10)])
    write(path, head, spoilt, rows[30:40])
    again = growing.poll()
    assert (again.record.sizes["sample"], again.messages) == (39, ())


def test_many_rows_with_the_same_fault_are_one_message(path, lines):
    head, rows = lines
    spoilt = [with_cell(row, FORCE, "nan") if 5 <= k < 12 else row for k, row in enumerate(rows[:30])]
    (message,) = GrowingRecord(write(path, head, spoilt)).poll().messages
    first = len(head) + 6
    assert f"line {first}, " in message
    assert f"and 6 more, up to line {first + 6} " in message


def test_samples_before_the_sensor_speaks_are_waited_for(path, lines):
    head, rows = lines
    mute = [",".join([*row.split(",")[:5], "", "", ""]) + "\n" for row in rows[:4]]
    growing = GrowingRecord(write(path, head, mute))
    now = growing.poll()
    assert (now.record, now.error) == (None, None)
    assert "every load channel is empty" in now.messages[0]
    write(path, head, mute, rows[4:10])
    assert growing.poll().record.sizes["sample"] == 6


def test_a_file_that_is_mostly_unreadable_or_has_wrong_columns_is_an_error(path, lines):
    """Such as angles in degrees, of which a few are less than a turn in radians."""
    head, rows = lines
    now = GrowingRecord(write(path, head, [with_cell(row, ANGLE, str(k)) for k, row in enumerate(rows[:80])])).poll()
    assert now.record is None
    assert "look like degrees" in str(now.error)
    error = GrowingRecord(write(path, ["sweep,direction,drive_angle\n", "0,forward,1.2\n"])).poll().error
    assert isinstance(error, RecordError)
    assert "column 'holding_moment'" in str(error)
    assert not error.lines


# --- The order of samples ------------------------------------------------------------------------------------------


TURN = 79  # samples of the forward sweep


@pytest.mark.parametrize(
    ("order", "left_out"),
    [
        ([*range(20), 3, 4, *range(20, 30)], [20, 21]),  # far behind
        ([*range(15), 16, 15, *range(17, 30)], []),  # neighbours in the other order
        ([*range(20), 35, *range(20, 30)], []),  # far ahead, which does not make the others late
        ([*range(TURN + 8), 5, *range(TURN + 8, TURN + 12)], [TURN + 8]),  # of a sweep that was over
    ],
)
def test_samples_that_come_too_late_are_told_and_left_out(path, lines, order, left_out):
    head, rows = lines
    now = GrowingRecord(write(path, head, [rows[k] for k in order])).poll()
    angles = np.array([float(rows[k].split(",")[ANGLE]) for k in order])
    np.testing.assert_array_equal(now.record.drive_angle, np.delete(angles, left_out))
    messages = "".join(now.messages)
    assert all(f"line {len(head) + 1 + k}" in messages for k in left_out)
    assert bool(now.messages) is bool(left_out)


def test_a_stray_number_of_a_sweep_is_told(path, lines, measured):
    assert (measured.direction == "forward").sum() == TURN
    head, rows = lines
    now = GrowingRecord(write(path, head, [*rows[:10], with_cell(rows[10], SWEEP, "7"), *rows[11:30]])).poll()
    assert now.record.sizes["sample"] == 29
    assert set(now.record.sweep.values.tolist()) == {0}
    assert "sweep 7" in now.messages[0]


@pytest.mark.parametrize("quantum", [0.0, 0.004])
def test_the_scatter_of_an_encoder_is_no_fault(path, quantum):
    """Noise of three steps, or counts of as much, leave out none of 2,000 samples."""
    count = 2000
    angle = np.linspace(0.5, 2.5, count) + np.random.default_rng(1).normal(0.0, 0.003, count)
    if quantum:
        angle = np.round(angle / quantum) * quantum
    rows = [f"0,forward,{value!r},0.1,0.1,0.1\n" for value in angle.tolist()]
    now = GrowingRecord(write(path, ["sweep,direction,drive_angle,holding_moment,force_x,force_y\n"], rows)).poll()
    assert now.messages == ()
    assert now.record.sizes["sample"] == count


def test_sweeps_can_be_split_while_they_come(path, lines, measured):
    bare = [",".join(line.split(",")[2:]) for line in [lines[0][-1], *lines[1]]]
    head = [line for line in lines[0] if line.startswith("#") and "column" not in line]
    growing = GrowingRecord(path, Rig(file={"split_sweeps": True}))
    write(path, head, bare[:2])
    now = growing.poll()
    assert now.record is None
    assert "one sample" in str(now.error)
    write(path, head, bare)
    np.testing.assert_array_equal(growing.poll().record.direction, measured.direction)


def test_only_a_csv_file_grows(tmp_path):
    for path, words in ((tmp_path, "is a folder"), (tmp_path / "record.nc", "only a .csv file")):
        with refused(RecordError, words):
            GrowingRecord(path)
