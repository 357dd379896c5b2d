"""Records in bags of ROS, against the same record in columns."""

import sys
from typing import NamedTuple

import numpy as np
import pytest
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

import tactile_bayes as tb
from helpers.refusals import refused
from tactile_bayes.errors import RecordError
from tactile_bayes.record.times import times_of

TYPES = get_typestore(Stores.ROS2_HUMBLE)
STAMP, HEADER = TYPES.types["builtin_interfaces/msg/Time"], TYPES.types["std_msgs/msg/Header"]
JOINTS, WRENCH = TYPES.types["sensor_msgs/msg/JointState"], TYPES.types["geometry_msgs/msg/WrenchStamped"]
FORCES, VECTOR = TYPES.types["geometry_msgs/msg/Wrench"], TYPES.types["geometry_msgs/msg/Vector3"]
ROD = tb.Rod(length=0.2, flexural_rigidity=1e-3)
COLUMNS = {
    "drive_angle": "/joint_states.position.wrist",
    "holding_moment": "/cell/wrench.wrench.torque.z",
    "force_x": "/cell/wrench.wrench.force.x",
    "force_y": "-/cell/wrench.wrench.force.y",
}
TIMES = 0.01 * np.arange(40)  # times of loads [s]


def angle(time):
    return 1.0 + 0.5 * time


def loads(time):
    return np.sin(30.0 * time), np.cos(20.0 * time), 3.0 * time


def header(time, frame="base"):
    nanoseconds = 0 if time is None else round(1e9 * time) + 5 * 10**9
    return HEADER(STAMP(nanoseconds // 10**9, nanoseconds % 10**9), frame)


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
FINGER = [Told(time, {"finger": 0.02}) for time in np.arange(-0.045, 0.45, 0.01)]  # of another publisher


def bag(folder, joints, cell=CELL, plugin=StoragePlugin.MCAP):
    """A bag of joints and loads as they are told, in the order in which they are received."""
    kinds = ("sensor_msgs/msg/JointState", "geometry_msgs/msg/WrenchStamped")
    with Writer(folder, version=9, storage_plugin=plugin) as writer:
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


def found(path, **columns):
    return tb.read_record(path, tb.Rig(rod=ROD, file=COLUMNS | columns | {"split_sweeps": True}))


@pytest.mark.parametrize("plugin", StoragePlugin)
def test_each_load_is_a_sample_at_the_angle_of_its_time(tmp_path, plugin):
    """Of a drive that is read at other times, and loads that are received late, all at once."""
    cell = [told._replace(received=0.5) for told in CELL]
    record = found(bag(tmp_path / "sweep", drive(times=np.arange(0.05, 0.42, 0.025)), cell, plugin))
    times = TIMES[(TIMES >= 0.05) & (TIMES <= 0.4 + 1e-9)]
    np.testing.assert_allclose(record.drive_angle, angle(times), rtol=1e-12)
    for name, expected in zip(("holding_moment", "force_x", "force_y"), loads(times), strict=True):
        np.testing.assert_allclose(record[name], expected, rtol=1e-12)
    np.testing.assert_allclose(times_of(record), times - times[0], rtol=0, atol=1e-8)
    assert set(record.direction.values) == {"forward"}
    assert record.attrs["units"] == "SI"
    files = [*(tmp_path / "sweep").glob("*.mcap")]
    assert [found(path).identical(record) for path in files] == [True] * (plugin is StoragePlugin.MCAP)


@pytest.mark.parametrize("other", [[], FINGER], ids=["alone", "another joint goes on"])
def test_samples_in_a_pause_of_the_drive_are_left_out(tmp_path, other):
    told = [one for one in drive() if not 0.13 < one.time < 0.34]
    record = found(bag(tmp_path / "sweep", sorted(told + other, key=lambda one: one.time)))
    left = (record.drive_angle.values - 1.0) / 0.5
    assert not np.any((left > 0.131) & (left < 0.339))
    assert left.min() == pytest.approx(0.0)
    assert left.max() > 0.38
    assert record.sizes["sample"] > 15


def test_what_a_bag_lacks_is_named(tmp_path):
    path = bag(tmp_path / "sweep", drive())
    with pytest.raises(RecordError, match=r"drive_angle=/(joint_states|cell/wrench)\.") as error:
        tb.read_record(path, tb.Rig(rod=ROD, file={"drive_angle": "Angle", "split_sweeps": True}))
    assert "/cell/wrench, /joint_states" in str(error.value)
    with refused(RecordError, "/joint_states.position.2", "/joint_states.position."):
        found(path, drive_angle="/joint_states.position.2")


def test_what_is_no_bag_is_refused(tmp_path, monkeypatch):
    path = tmp_path / "sweep.mcap"
    path.write_bytes(b"nothing")
    with refused(RecordError, "sweep.mcap", "cannot be read"):
        found(path)
    for name in [name for name in sys.modules if name.partition(".")[0] == "rosbags"]:
        monkeypatch.setitem(sys.modules, name, None)
    with refused(RecordError, "pip install 'tactile-bayes[ros]'"):
        found(path)


RECEIVED = [told._replace(received=told.time) for told in CELL]
TWO_PUBLISHERS = sorted(drive() + FINGER, key=lambda told: told.time)
OTHER_ORDER = [t._replace(joints=dict(sorted(t.joints.items()))) if t.time > 0.2 else t for t in drive()]


LATE = [told._replace(received=told.time + (0.025 if number % 3 else 0.0)) for number, told in enumerate(drive())]
ONE_UNSTAMPED = [Told(None, {"wrist": 9.0, "elbow": 0.7}, -0.04), *drive(times=ALL[15:])]
WITH_NAN = drive(lambda t: np.nan if 0.095 < t < 0.115 or 0.195 < t < 0.285 else angle(t))


def stamped(stamp):
    """The drive with other times in its headers, received when it is read."""
    return [Told(stamp(told.time), told.joints, told.time) for told in drive()]


@pytest.mark.parametrize(
    ("joints", "cell", "times"),
    [
        pytest.param(TWO_PUBLISHERS, CELL, TIMES, id="two publishers"),
        pytest.param(OTHER_ORDER, CELL, TIMES, id="another order of joints"),
        pytest.param(stamped(lambda time: None), RECEIVED, TIMES, id="no times in headers"),
        pytest.param(stamped(lambda t: t - (5.0 if t < 0.2 else 5.2)), RECEIVED, TIMES, id="a clock that is set back"),
        pytest.param(stamped(lambda time: time + 1e6), RECEIVED, TIMES, id="another clock"),
        pytest.param(stamped(np.floor), RECEIVED, TIMES, id="whole seconds"),
        pytest.param(LATE, CELL, TIMES, id="out of order"),
        pytest.param(drive(), [told for told in CELL for _ in range(2)], TIMES, id="each twice"),
        pytest.param(ONE_UNSTAMPED, CELL, TIMES[10:], id="one without a stamp"),
        pytest.param(WITH_NAN, CELL, TIMES[(TIMES < 0.195) | (TIMES > 0.285)], id="not a number"),
    ],
)
def test_angles_are_those_of_the_times_of_loads(tmp_path, joints, cell, times):
    record = found(bag(tmp_path / "sweep", joints, cell))
    np.testing.assert_allclose(record.drive_angle, angle(times), rtol=1e-12)
    np.testing.assert_allclose(record.force_y, loads(times)[2], rtol=1e-12)


@pytest.mark.parametrize("joints", [TWO_PUBLISHERS, OTHER_ORDER], ids=["two publishers", "another order"])
def test_a_number_of_a_joint_that_is_not_always_the_same_is_refused(tmp_path, joints):
    path = bag(tmp_path / "sweep", joints)
    for name in ("0", "1", "thumb"):
        with refused(RecordError, f"/joint_states.position.{name}", "/joint_states.position.wrist"):
            found(path, drive_angle=f"/joint_states.position.{name}")


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


def test_messages_without_a_clock_or_of_two_frames_are_refused(tmp_path):
    joints = [Told(told.time + 1e6, told.joints, 0.0) for told in drive()]
    with refused(RecordError, "/joint_states.position.wrist", "time"):
        found(bag(tmp_path / "timeless", joints))
    cell = [told._replace(frame="tool" if told.time > 0.3 else "base") for told in CELL]
    with refused(RecordError, "/cell/wrench", "frames", "'base'", "'tool'"):
        found(bag(tmp_path / "sweep", drive(), cell))
