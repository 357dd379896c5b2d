"""Records in bags of the Robot Operating System: MCAP, ROS 2 and ROS 1."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tactile_bayes.arrays import Flags, Floats, Index
from tactile_bayes.errors import RecordError
from tactile_bayes.record.origin import origins_of
from tactile_bayes.record.quantity import converted, same_quantity
from tactile_bayes.record.schema import CHANNELS, MEASURED
from tactile_bayes.record.table import Cells, Source, Table

_BAGS = (".mcap", ".bag", ".db3")  # suffixes of bags
# Columns that are interpolated in time: a drive moves smoothly, and its encoder hardly scatters.
_SMOOTH = ("drive_angle", "base_x", "base_y")
# Largest time from a message to the next one of its field, over the usual one, within which samples are kept.
_INTERVALS = 5.0
_ROUNDING = 1e-6  # relative excess of the range of an angle over a turn, in which it stays all the same
_MOST_NAMED = 5  # largest number of names of joints in a message
# Largest difference between the delays of two topics, from header to reception, if their clocks are the same [ns].
_DELAY = 10 * 10**9
_LONGEST = 64  # largest number of elements of an array that are columns


def is_bag(path: Path) -> bool:
    """Return True for a path of a bag: a file, or a folder as ROS 2 writes it."""
    return path.suffix.lower() in _BAGS or (path / "metadata.yaml").is_file()


def read_bag_table(path: Path, columns: Mapping[str, str]) -> Table:
    """Read the fields of messages that a record needs, one sample for each message with the first load, whose time is
    "time" [s]; by headers, or by reception if their times cannot be right. Fields are interpolated (angle and base),
    nearest (loads) or last; samples in a pause of another field are left out, and repeated messages count once.
    """
    source = Source(str(path))
    with opened_bag(path, source) as reader:
        names = sorted({connection.topic for connection in reader.connections}, key=len, reverse=True)
        wanted = {topic for text in columns.values() if (topic := next((t for t in names if f"{t}." in text), None))}
        if not wanted:
            what = f"no column is of one of its topics: write columns like drive_angle={example(reader)}; the bag has "
            raise source.error(what + (", ".join(sorted(names)) or "no topics"))
        topics = {topic: Topic() for topic in wanted}
        connections = [connection for connection in reader.connections if connection.topic in wanted]
        for connection, received, raw in reader.messages(connections):
            topics[connection.topic].add(reader.deserialize(raw, connection.msgtype), received, connection.id)
    asked = _asked(topics, columns, source)
    faults = []
    for by_header in (True, False):
        try:
            return _table(topics, _times(topics, by_header), asked, source)
        except _ClockError as fault:
            faults.append(fault)
    raise source.error(f"{faults[0]}; by the times of reception, {faults[1]}: record it again, or take another topic")


class _ClockError(Exception):
    """The times of messages cannot be those of their values."""


class _Column(NamedTuple):
    """A field of a topic from which columns of the record come."""

    topic: str
    inner: str  # name within a message
    field: Field
    targets: tuple[str, ...]
    turn: float | None  # a turn in the unit of the field, if it is an angle

    def series(self, times: Index) -> tuple[Index, NDArray[Any]]:
        """Return times and values in ascending order, each once; refuse times that go back or have two values."""
        at, values = times[self.field.messages], np.array(self.field.values)
        known = at > 0
        if self.is_smooth and values.dtype.kind == "f":
            known &= np.isfinite(values)
        at, values = at[known], values[known]
        if at.size and self.targets:
            steps = np.diff(at)
            usual = float(np.median(np.abs(steps))) if steps.size else 0.0
            if (back := float(-steps.min(initial=0))) > _INTERVALS * max(usual, 1.0):
                raise _ClockError(f"the times of {self.topic} go back by {back / 1e9:.3g} s")
        order = np.argsort(at, kind="stable")
        at, values = at[order], values[order]
        is_again = np.append(np.diff(at) == 0, False)[: at.size]
        one, other = values[:-1], values[1:]
        differ = is_again[:-1] & (one != other) & ((one == one) | (other == other))  # NaN is as NaN
        if self.targets and np.any(differ):
            raise _ClockError(f"{self.name} has different values at one time, {at[:-1][differ][0] / 1e9:.9f} s")
        at, values = at[~is_again], values[~is_again]
        return at, values if self.turn is None else _unwrapped(at, values.astype(float), self.turn)

    @property
    def name(self) -> str:
        return f"{self.topic}.{self.inner}"

    @property
    def is_smooth(self) -> bool:
        return not set(self.targets).isdisjoint(_SMOOTH)


def _asked(topics: Mapping[str, Topic], columns: Mapping[str, str], source: Source) -> list[_Column]:
    """Return the fields of the columns that were asked for, the one that gives the samples first."""
    homes = {f"{topic}.{name}": (topic, name) for topic, found in topics.items() for name in found.fields}
    origins = {target: origin for target, origin in origins_of(columns, homes, source).items() if origin.column}
    found = []
    for name in dict.fromkeys(origins[t].column for t in (*CHANNELS, *MEASURED, *origins) if t in origins):
        topic, inner = homes[name]
        targets = tuple(target for target, origin in origins.items() if origin.column == name)
        turn = _turn_in(origins["drive_angle"].unit) if "drive_angle" in targets else None
        column = _Column(topic, inner, topics[topic].fields[inner], targets, turn)
        _refuse_mixed(column, topics[topic], source)
        found.append(column)
    return found


def _refuse_mixed(column: _Column, topic: Topic, source: Source) -> None:
    """Refuse a field whose messages are of different joints, frames or publishers."""
    field = column.field
    if not field.is_named:
        like = re.compile(re.sub(r"\\\.[0-9]+(?=\\\.|$)", r"\\..+", re.escape(column.inner)))
        named = [name for name, other in topic.fields.items() if other.is_named and like.fullmatch(name)]
        ways = " or ".join(f"{column.topic}.{name}" for name in named[:_MOST_NAMED])
        way = f"name it, as {ways}" if named else "take a field that all have"
        if len(field.labels) > 1:
            raise source.error(f"{column.name} stands for {len(field.labels)} names that its messages state: {way}")
        if len(field.messages) < len(topic.received):
            raise source.error(f"{column.name} is not in every message of {column.topic}: {way}")
        frames = topic.fields.get("header.frame_id")
        if frames is not None and len(several := sorted(set(frames.values))) > 1:
            what = f"the messages of {column.topic} are of several frames, {', '.join(map(repr, several))}"
            raise source.error(f"{what}: record one sensor on a topic")
    publishers = np.array(topic.publishers)[field.messages]
    if np.count_nonzero(np.diff(publishers)) >= np.unique(publishers).size > 1:
        raise source.error(f"{column.name} comes from several publishers at a time: record one on a topic")


def _turn_in(unit: str | None) -> float:
    """Return a turn in a unit; by default, and in what is no unit of angles, in radians."""
    pair = same_quantity("rad", unit or "rad")
    return 2.0 * np.pi if pair is None else float(converted(2.0 * np.pi, *pair))


def _times(topics: Mapping[str, Topic], by_header: bool) -> dict[str, Index]:
    """Return the times of all messages [ns], 0 if unknown, of headers or of reception; refuse different clocks."""
    times, delays = {}, {}
    for name, topic in topics.items():
        received, stamps = np.array(topic.received, dtype=np.int64), np.array(topic.stamps, dtype=np.int64)
        times[name] = stamps if by_header and np.any(stamps) else received
        known = times[name] > 0
        late = (received - times[name])[known]
        low, middle, high = np.percentile(late, (10, 50, 90)) if late.size else (0.0, 0.0, 0.0)
        if high - low < _DELAY:
            delays[name] = middle
    if delays:
        first, last = min(delays, key=delays.__getitem__), max(delays, key=delays.__getitem__)
        if (apart := delays[last] - delays[first]) > _DELAY:
            raise _ClockError(f"the clocks of {first} and {last} are {apart / 1e9:.3g} s apart")
    return times


def _table(topics: Mapping[str, Topic], times: Mapping[str, Index], asked: list[_Column], source: Source) -> Table:
    """Return the table of the columns that were asked for, and of all other fields of their topics."""
    main, taken = asked[0], {column.name for column in asked}
    # All other fields that every message has, elements by their numbers if these stand for the same.
    further = [
        _Column(topic, name, field, (), None)
        for topic, found in topics.items()
        for name, field in found.fields.items()
        if f"{topic}.{name}" not in taken and not field.is_named
        if len(field.labels) == 1 and len(field.messages) == len(found.received)
    ]
    at, _ = main.series(times[main.topic])
    cells, known = {}, np.ones(at.size, dtype=bool)
    for column in (*asked, *further):
        own, values = column.series(times[column.topic])
        if column.topic == main.topic and np.array_equal(own, at):
            cells[column.name] = values
            continue
        if column.targets:
            known &= _surrounded(own, at)
            if not np.any(known):
                raise _ClockError(f"no message of {main.topic} is between two of {column.name} that follow as usual")
        cells[column.name] = _at(own, values, at, column) if own.size else np.full(at.size, "")
    table: dict[str, Cells] = {name: (values[known], {}) for name, values in cells.items()}
    table["time"] = (at[known] - at[known][:1]) / 1e9, {"units": "s"}
    return Table(table, {}, Source(source.name, names=list(table)))


def _usual(times: Index) -> Flags:
    """Return True for the steps between messages that follow one another as usual."""
    steps = np.diff(times)
    return np.asarray(steps <= _INTERVALS * max(float(np.median(steps)), 1.0)) if steps.size else steps > 0


def _surrounded(times: Index, at: Index) -> Flags:
    """Return True for times of a message, or between two that follow one another as usual."""
    if times.size < 2:
        return np.zeros(at.size, dtype=bool)
    after = np.clip(np.searchsorted(times, at, side="right"), 1, times.size - 1)
    inside = (times[0] <= at) & (at <= times[-1])
    return np.asarray(inside & (_usual(times)[after - 1] | np.isin(at, times)))


def _unwrapped(times: Index, angles: Floats, turn: float) -> Floats:
    """Undo jumps by a turn of an angle that stays within one; in a pause it may have gone any way."""
    if angles.size < 2 or np.ptp(angles) > turn * (1.0 + _ROUNDING):
        return angles
    steps = np.diff(angles)
    turns = np.where(_usual(times), np.round(steps / turn), 0.0)
    return np.asarray(angles - turn * np.append(0.0, np.cumsum(turns)))


def _at(times: Index, values: NDArray[Any], at: Index, column: _Column) -> NDArray[Any]:
    """Return the values of a field at other times, as the columns demand that come from it."""
    if values.dtype.kind == "f" and column.is_smooth:
        return np.interp(at - times[0], times - times[0], values)  # differences, as floats have no nanoseconds of today
    last = np.clip(np.searchsorted(times, at, side="right") - 1, 0, times.size - 1)
    following = np.minimum(last + 1, times.size - 1)
    if not set(column.targets).isdisjoint(CHANNELS):
        return np.asarray(values[np.where(at - times[last] <= times[following] - at, last, following)])
    return np.asarray(values[last])


if TYPE_CHECKING:
    from rosbags.highlevel import AnyReader


# ---- messages


@dataclass(frozen=True)
class Field:
    """Values of a field in the order of reception."""

    is_named: bool  # whether it is called by a label, not a number
    messages: list[int] = field(default_factory=list)  # numbers of those that have it
    values: list[Any] = field(default_factory=list)
    labels: set[str | None] = field(default_factory=set)  # names that messages state for it, as of a joint


@dataclass(frozen=True)
class Topic:
    """Messages of a topic in the order of reception."""

    received: list[int] = field(default_factory=list)  # times of reception [ns]
    stamps: list[int] = field(default_factory=list)  # times of headers [ns], 0 where there is none
    publishers: list[int] = field(default_factory=list)
    fields: dict[str, Field] = field(default_factory=dict)

    def add(self, message: Any, received: int, publisher: int) -> None:
        """Add a message."""
        number = len(self.received)
        stamp = getattr(getattr(message, "header", None), "stamp", None)
        self.received.append(received)
        self.stamps.append(0 if stamp is None else stamp.sec * 10**9 + stamp.nanosec)
        self.publishers.append(publisher)
        for name, value, label, is_named in _fields(message):
            one = self.fields.setdefault(name, Field(is_named))
            one.messages.append(number)
            one.values.append(value)
            one.labels.add(label)


@contextmanager
def opened_bag(path: Path, source: Source) -> Iterator[AnyReader]:
    """Open a bag; any failure is raised as an error of the source."""
    try:
        from rosbags.highlevel import AnyReader
        from rosbags.typesys import Stores, get_typestore
    except ImportError as error:
        what = "bags are read by the package rosbags, which is not installed: pip install 'tactile-bayes[ros]'"
        raise source.error(what) from error
    try:
        with AnyReader([path], default_typestore=get_typestore(Stores.LATEST)) as reader:
            yield reader
    except RecordError:
        raise
    except Exception as error:  # a damaged bag causes many kinds of errors
        what = " ".join(str(error).split()) or type(error).__name__
        raise source.error(f"the bag cannot be read, it is damaged, or no bag of ROS ({what})") from error


def example(reader: AnyReader) -> str:
    """Return the name of a number in the bag."""
    for connection, _, raw in reader.messages():
        for name, value, *_ in _fields(reader.deserialize(raw, connection.msgtype)):
            if isinstance(value, float | np.floating):
                return f"{connection.topic}.{name}"
    return "/topic.field"


def _fields(
    message: Any, lead: str = "", labels: Sequence[str] = (), label: str | None = None, is_named: bool = False
) -> Iterator[tuple[str, Any, str | None, bool]]:
    """Yield numbers and texts of a message: name, value, label of the element, and whether the name has the label:
    elements of an array have numbers, and labels if a list of texts of that length is beside or above it.
    """
    if isinstance(message, bool | int | float | str | np.generic):
        yield lead.rstrip("."), message, label, is_named
    elif isinstance(message, np.ndarray | list | tuple):
        unique = labels if len(labels) == len(message) == len(set(labels)) and not _is_texts(message) else ()
        for index, element in enumerate(message[:_LONGEST]):
            of_element = unique[index] if unique else label
            yield from _fields(element, f"{lead}{index}.", label=of_element, is_named=is_named)
            if unique and of_element and not of_element.isdigit():
                yield from _fields(element, f"{lead}{of_element}.", label=of_element, is_named=True)
    elif hasattr(message, "__dataclass_fields__"):
        parts = {name: getattr(message, name) for name in message.__dataclass_fields__ if not name.startswith("__")}
        own = next((part for part in parts.values() if _is_texts(part)), labels)
        for name, part in parts.items():
            yield from _fields(part, f"{lead}{name}.", own, label, is_named)


def _is_texts(part: Any) -> bool:
    return isinstance(part, list | tuple | np.ndarray) and len(part) > 0 and all(isinstance(one, str) for one in part)
