"""Records in bags of ROS, against the same record in columns."""

import builtins
from typing import NamedTuple

import numpy as np
import pytest
import xarray as xr
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

import tactile_bayes as tb
from helpers.refusals import refused
from tactile_bayes.errors import RecordError

TYPES = get_typestore(Stores.ROS2_HUMBLE)
STAMP, HEADER = TYPES.types["builtin_interfaces/msg/Time"], TYPES.types["std_msgs/msg/Header"]
JOINTS, WRENCH = TYPES.types["sensor_msgs/msg/JointState"], TYPES.types["geometry_msgs/msg/WrenchStamped"]
FORCES, VECTOR = TYPES.types["geometry_msgs/msg/Wrench"], TYPES.types["geometry_msgs/msg/Vector3"]
COLUMNS = {
    "drive_angle": "/joint_states.position.1",
    "holding_moment": "/cell/wrench.wrench.torque.z",
    "force_x": "/cell/wrench.wrench.force.x",
    "force_y": "-/cell/wrench.wrench.force.y",
}
ROD = tb.Rod(length=0.2, flexural_rigidity=1e-3)
TIMES = 0.01 * np.arange(40)  # times of loads [s]; the drive is read every 0.025 s from 0.05 s on


def header(time, frame="base"):
    nanoseconds = 0 if time is None else round(1e9 * time) + 5 * 10**9
    return HEADER(STAMP(nanoseconds // 10**9, nanoseconds % 10**9), frame)


def angle(time):
    return 1.0 + 0.5 * time


def loads(time):
    return np.sin(30.0 * time), np.cos(20.0 * time), 3.0 * time


def written(folder, plugin, paused=(9.0, 9.0)):
    joints, wrench = "sensor_msgs/msg/JointState", "geometry_msgs/msg/WrenchStamped"
    with Writer(folder, version=9, storage_plugin=plugin) as writer:
        drive = writer.add_connection("/joint_states", joints, typestore=TYPES)
        cell = writer.add_connection("/cell/wrench", wrench, typestore=TYPES)
        for time in np.arange(0.05, 0.42, 0.025):
            if not paused[0] < time < paused[1]:
                empty = np.zeros(0)
                message = JOINTS(header(time), ["a", "b"], np.array([7.0, angle(time)]), empty, empty)
                writer.write(drive, round(1e9 * time), TYPES.serialize_cdr(message, joints))
        for time in TIMES:
            moment, x, y = loads(time)
            message = WRENCH(header(time), FORCES(VECTOR(x, -y, 0.0), VECTOR(0.0, 0.0, moment)))
            writer.write(cell, 3, TYPES.serialize_cdr(message, wrench))  # received late, all at once
    return folder


class Told(NamedTuple):
    """A message of the drive: time, positions by joint, time of reception if it is not that time, and frame."""

    time: float | None
    joints: dict
    received: float | None = None
    frame: str = "base"


ALL = np.arange(-5, 45) / 100  # times of the drive, among which are those of all loads [s]


def drive(angle=angle, times=ALL):
    return [Told(time, {"wrist": angle(time), "elbow": 0.7}) for time in times]


CELL = [Told(time, loads(time)) for time in TIMES]


def bag(folder, joints, cell=CELL):
    """A bag of joints and loads as they are told, in the order in which they are received."""
    kinds = ("sensor_msgs/msg/JointState", "geometry_msgs/msg/WrenchStamped")
    with Writer(folder, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        topics = [writer.add_connection(topic, kind, typestore=TYPES) for topic, kind in zip(
            ("/joint_states", "/cell/wrench"), kinds, strict=True)]  # fmt: skip
        for number, messages in enumerate((joints, cell)):
            for time, told, received, frame in messages:
                if number:
                    moment, x, y = told
                    message = WRENCH(header(time, frame), FORCES(VECTOR(x, -y, 0.0), VECTOR(0.0, 0.0, moment)))
                else:
                    positions = np.array(list(told.values()))
                    message = JOINTS(header(time, frame), list(told), positions, np.zeros(0), np.zeros(0))
                at = round(1e9 * (time if received is None else received)) + 5 * 10**9
                writer.write(topics[number], at, TYPES.serialize_cdr(message, kinds[number]))
    return folder


NAMED = COLUMNS | {"drive_angle": "/joint_states.position.wrist"}


def found(path, **columns):
    return read(path, NAMED | columns)


@pytest.fixture(params=[StoragePlugin.MCAP, StoragePlugin.SQLITE3], ids=["mcap", "sqlite3"])
def folder(request, tmp_path):
    return written(tmp_path / "sweep", request.param)


def read(path, columns=COLUMNS):
    return tb.read_record(path, tb.Rig(rod=ROD, file=columns | {"split_sweeps": True}))


def test_each_load_is_a_sample_at_the_angle_of_its_time(folder):
    record = read(folder)
    times = TIMES[(TIMES >= 0.05) & (TIMES <= 0.4 + 1e-9)]
    np.testing.assert_allclose(record.drive_angle, angle(times), rtol=1e-12)
    for name, expected in zip(("holding_moment", "force_x", "force_y"), loads(times), strict=True):
        np.testing.assert_allclose(record[name], expected, rtol=1e-12)
    assert set(record.direction.values) == {"forward"}
    assert record.attrs["units"] == "SI"


def test_a_file_alone_is_read_too(tmp_path):
    (path,) = written(tmp_path / "sweep", StoragePlugin.MCAP).glob("*.mcap")
    assert read(path).identical(read(path.parent))


def test_samples_in_a_pause_of_the_drive_are_left_out(tmp_path):
    record = read(written(tmp_path / "sweep", StoragePlugin.MCAP, paused=(0.13, 0.34)))
    left = (record.drive_angle.values - 1.0) / 0.5
    assert left.min() == pytest.approx(0.05)
    assert not np.any((left > 0.126) & (left < 0.349))
    assert left.max() > 0.38


def test_what_a_bag_lacks_is_named(folder):
    with pytest.raises(RecordError, match=r"drive_angle=/(joint_states|cell/wrench)\.") as error:
        read(folder, {"drive_angle": "Angle"})
    assert "/cell/wrench, /joint_states" in str(error.value)
    with pytest.raises(RecordError, match=r"/joint_states\.position\.2.*/joint_states\.position\.1"):
        read(folder, COLUMNS | {"drive_angle": "/joint_states.position.2"})


def test_what_is_no_bag_is_refused(tmp_path, monkeypatch):
    path = tmp_path / "sweep.mcap"
    path.write_bytes(b"nothing")
    with refused(RecordError, "sweep.mcap", "cannot be read"):
        read(path)
    imported = builtins.__import__

    def without(name, *arguments):
        if name.startswith("rosbags"):
            raise ImportError(name)
        return imported(name, *arguments)

    monkeypatch.setattr(builtins, "__import__", without)
    with pytest.raises(RecordError, match=r"pip install 'tactile-bayes\[ros\]'"):
        read(path)


FINGER = [Told(time, {"finger": 0.02}) for time in np.arange(-0.045, 0.45, 0.01)]


@pytest.mark.parametrize(
    "joints",
    [
        sorted(drive() + FINGER, key=lambda told: told.time),
        [told._replace(joints=dict(sorted(told.joints.items()))) if told.time > 0.2 else told for told in drive()],
    ],
    ids=["two publishers", "another order"],
)
def test_a_joint_is_found_by_its_name_in_every_message(tmp_path, joints):
    path = bag(tmp_path / "sweep", joints)
    np.testing.assert_allclose(found(path).drive_angle, angle(TIMES), rtol=1e-12)
    with refused(RecordError, "/joint_states.position.0", "/joint_states.position.wrist"):
        found(path, drive_angle="/joint_states.position.0")
    with refused(RecordError, "/joint_states.position.1"):
        found(path, drive_angle="/joint_states.position.1")
    with refused(RecordError, "/joint_states.position.thumb", "/joint_states.position.wrist"):
        found(path, drive_angle="/joint_states.position.thumb")


def test_a_number_will_do_where_it_always_stands_for_the_same(tmp_path):
    path = bag(tmp_path / "sweep", drive())
    by_number = found(path, drive_angle="/joint_states.position.0")
    np.testing.assert_array_equal(by_number.drive_angle, found(path).drive_angle)
    assert not any("wrist" in str(name) for name in by_number.data_vars)


@pytest.mark.parametrize(("unit", "turn"), [("", 2 * np.pi), ("[deg]", 360.0)])
def test_an_angle_that_jumps_by_a_turn_goes_on(tmp_path, unit, turn):
    """A joint in [−π, π) that passes π."""

    def wrapped(time):
        return (turn / 2 + turn / 50 * (time - 0.21) + turn / 2) % turn - turn / 2

    record = found(bag(tmp_path / "wrapped", drive(wrapped)), drive_angle=f"/joint_states.position.wrist{unit}")
    expected = np.pi + 2 * np.pi / 50 * (TIMES - 0.21)
    np.testing.assert_allclose(record.drive_angle, expected, rtol=1e-12)


def test_the_angle_of_another_column_is_not_turned(tmp_path):
    joints = [Told(time, {"wrist": 3.0 if time < 0.2 else -3.0, "elbow": angle(time)}) for time in ALL]
    record = found(bag(tmp_path / "sweep", joints), drive_angle="/joint_states.position.elbow",
                   base_x="/joint_states.position.wrist")  # fmt: skip
    assert set(record.base_x.values.tolist()) == {3.0, -3.0}


def test_a_message_without_a_stamp_is_none(tmp_path):
    early = [Told(None, {"wrist": 9.0, "elbow": 0.7}, -0.04), *drive(times=ALL[15:])]
    record = found(bag(tmp_path / "sweep", early))
    np.testing.assert_allclose(record.drive_angle, angle(TIMES[10:]), rtol=1e-12)


@pytest.mark.parametrize(
    "stamp",
    [lambda time: None, lambda time: time - 5.0 if time < 0.2 else time - 5.2, lambda time: time + 1e6,
     lambda time: np.floor(time)],
    ids=["none", "a clock that is set back", "another clock", "whole seconds"],
)  # fmt: skip
def test_times_of_reception_hold_where_those_of_headers_cannot(tmp_path, stamp):
    joints = [Told(stamp(told.time), told.joints, told.time) for told in drive()]
    record = found(bag(tmp_path / "sweep", joints, [told._replace(received=told.time) for told in CELL]))
    np.testing.assert_allclose(record.drive_angle, angle(TIMES), rtol=1e-12)


def test_a_bag_without_a_clock_is_refused(tmp_path):
    joints = [Told(told.time + 1e6, told.joints, 0.0) for told in drive()]
    with refused(RecordError, "/joint_states.position.wrist", "time"):
        found(bag(tmp_path / "sweep", joints))


def test_messages_out_of_order_are_put_in_order(tmp_path):
    joints = [told._replace(received=told.time + (0.025 if number % 3 else 0.0)) for number, told in enumerate(drive())]
    np.testing.assert_allclose(found(bag(tmp_path / "sweep", joints)).drive_angle, angle(TIMES), rtol=1e-12)


def test_a_message_that_is_there_again_counts_once(tmp_path):
    twice = [told for told in CELL for _ in range(2)]
    once, again = found(bag(tmp_path / "once", drive())), found(bag(tmp_path / "again", drive(), twice))
    assert again.sizes["sample"] == once.sizes["sample"] == TIMES.size
    xr.testing.assert_equal(once, again)


def test_nan_of_a_drive_is_no_value(tmp_path):
    joints = drive(lambda time: np.nan if 0.095 < time < 0.115 else np.nan if 0.195 < time < 0.285 else angle(time))
    record = found(bag(tmp_path / "sweep", joints))
    there = (TIMES < 0.195) | (TIMES > 0.285)
    np.testing.assert_allclose(record.drive_angle, angle(TIMES[there]), rtol=1e-12)


def test_loads_of_two_frames_are_refused(tmp_path):
    cell = [told._replace(frame="tool" if told.time > 0.3 else "base") for told in CELL]
    with refused(RecordError, "/cell/wrench", "frames", "'base'", "'tool'"):
        found(bag(tmp_path / "sweep", drive(), cell))


def test_a_pause_is_not_bridged_by_another_joint(tmp_path):
    """The other publisher goes on while the drive is silent."""
    told = [one for one in drive() if not 0.13 < one.time < 0.34]
    record = found(bag(tmp_path / "sweep", sorted(told + FINGER, key=lambda one: one.time)))
    left = (record.drive_angle.values - 1.0) / 0.5
    assert not np.any((left > 0.131) & (left < 0.339))
    assert record.sizes["sample"] > 15
