"""Records in bags of ROS, against the same record in columns."""

import builtins

import numpy as np
import pytest
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

import tactile_bayes as tb
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
TIMES = 0.01 * np.arange(40)
"""Times of loads [s]; the drive is read every 0.025 s from 0.05 s on."""


def header(time):
    nanoseconds = round(1e9 * time) + 5 * 10**9
    return HEADER(STAMP(nanoseconds // 10**9, nanoseconds % 10**9), "base")


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


@pytest.fixture(params=[StoragePlugin.MCAP, StoragePlugin.SQLITE3], ids=["mcap", "sqlite3"])
def folder(request, tmp_path):
    return written(tmp_path / "sweep", request.param)


def read(path, **changes):
    return tb.read_record(path, **({"columns": COLUMNS, "split_sweeps": True, "rod": ROD} | changes))


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
        read(folder, columns={"drive_angle": "Angle"})
    assert "/cell/wrench, /joint_states" in str(error.value)
    with pytest.raises(RecordError, match=r"/joint_states\.position\.2.*/joint_states\.position\.1"):
        read(folder, columns=COLUMNS | {"drive_angle": "/joint_states.position.2"})


def test_what_is_no_bag_is_refused(tmp_path, monkeypatch):
    path = tmp_path / "sweep.mcap"
    path.write_bytes(b"nothing")
    with pytest.raises(RecordError, match=r"sweep\.mcap: the bag cannot be read"):
        read(path)
    imported = builtins.__import__

    def without(name, *arguments):
        if name.startswith("rosbags"):
            raise ImportError(name)
        return imported(name, *arguments)

    monkeypatch.setattr(builtins, "__import__", without)
    with pytest.raises(RecordError, match=r"pip install 'tactile-bayes\[ros\]'"):
        read(path)
