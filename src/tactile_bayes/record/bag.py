"""Records in bags of the Robot Operating System: MCAP, ROS 2 and ROS 1."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from tactile_bayes.arrays import Flags, Index
from tactile_bayes.errors import RecordError
from tactile_bayes.record.schema import CHANNELS
from tactile_bayes.record.table import Cells, Source, Table

if TYPE_CHECKING:
    from rosbags.highlevel import AnyReader

__all__ = ["is_bag", "read_bag_table"]

_BAGS = (".mcap", ".bag", ".db3")
"""Suffixes of bags."""

_SMOOTH = ("drive_angle", "base_x", "base_y")
"""Columns that are interpolated in time: a drive moves smoothly, and its encoder hardly scatters."""

_LONGEST = 64
"""Largest number of elements of an array that are columns."""

_INTERVALS = 5.0
"""Largest time from a message to the next one of its topic, over the usual one, within which samples are kept."""

Messages = dict[str, tuple[list[int], dict[str, list[Any]]]]
"""Times of messages [ns], and values of their fields, by topic."""


def is_bag(path: Path) -> bool:
    """Return True for a path of a bag: a file, or a folder as ROS 2 writes it."""
    return path.suffix.lower() in _BAGS or (path / "metadata.yaml").is_file()


def read_bag_table(path: Path, columns: Mapping[str, str]) -> Table:
    """Read the fields of messages that a record needs, one sample for each message with a load.

    Fields are named as topic, point, and the field's own path, like "/wrench.wrench.force.x"; elements of arrays have
    numbers, like "/joint_states.position.0". The time of a message is that of its header, if it has one, else that of
    its reception. Each message of the topic with the first load is a sample. Drive angle and base are interpolated
    linearly to its time; other loads are those of the nearest message, and everything else is that of the last one. A
    sample is left out if another topic has no messages around it, or pauses there for more than five times its usual
    interval.

    Parameters
    ----------
    path : Path
        A file, or a folder as ROS 2 writes it.
    columns : mapping of str to str
        Origins of the columns of the record, as for `read_record`.

    Raises
    ------
    RecordError
        If the package rosbags is missing, the bag cannot be read, or no column is of one of its topics.
    """
    source = Source(str(path))
    with _opened(path, source) as reader:
        topics = sorted({connection.topic for connection in reader.connections}, key=len, reverse=True)
        asked = {target: next((t for t in topics if f"{t}." in text), None) for target, text in columns.items()}
        wanted = {topic for topic in asked.values() if topic is not None}
        if not wanted:
            raise source.error(
                f"no column is of one of its topics: write columns like drive_angle={_example(reader)}; the bag has "
                + (", ".join(sorted(topics)) or "no topics")
            )
        messages = _messages(reader, wanted)
    loads = [topic for target in CHANNELS if (topic := asked.get(target)) is not None]
    main = (loads or sorted(wanted))[0]
    at = np.sort(messages[main][0])
    cells, known = {}, np.ones(at.size, dtype=bool)
    for topic, (received, fields) in messages.items():
        order = np.argsort(received, kind="stable")
        times = np.array(received, dtype=np.int64)[order]
        if topic != main:
            known &= _surrounded(times, at)
        for name, values in fields.items():
            column = np.array(values)[order]
            cells[f"{topic}.{name}"] = column if topic == main else _at(times, column, at, f"{topic}.{name}", columns)
    table: dict[str, Cells] = {name: (values[known], {}) for name, values in cells.items()}
    return Table(table, {}, Source(str(path), names=list(table)))


@contextmanager
def _opened(path: Path, source: Source) -> Iterator[AnyReader]:
    """Open a bag; any failure is raised as an error of the source."""
    try:
        from rosbags.highlevel import AnyReader
        from rosbags.typesys import Stores, get_typestore
    except ImportError as error:
        raise source.error(
            "bags are read by the package rosbags, which is not installed: pip install 'tactile-bayes[ros]'"
        ) from error
    try:
        with AnyReader([path], default_typestore=get_typestore(Stores.LATEST)) as reader:
            yield reader
    except RecordError:
        raise
    except Exception as error:  # a damaged bag causes many kinds of errors
        what = " ".join(str(error).split()) or type(error).__name__
        raise source.error(f"the bag cannot be read, it is damaged, or no bag of ROS ({what})") from error


def _messages(reader: AnyReader, wanted: set[str]) -> Messages:
    """Read the messages of some topics."""
    found: Messages = {topic: ([], {}) for topic in wanted}
    connections = [connection for connection in reader.connections if connection.topic in wanted]
    for connection, received, raw in reader.messages(connections):
        message = reader.deserialize(raw, connection.msgtype)
        times, fields = found[connection.topic]
        times.append(_time_of(message, received))
        for name, value in _fields(message):
            fields.setdefault(name, []).append(value)
    for times, fields in found.values():  # elements that not every message has are no columns
        for name in [name for name, values in fields.items() if len(values) < len(times)]:
            del fields[name]
    return found


def _time_of(message: Any, received: int) -> int:
    stamp = getattr(getattr(message, "header", None), "stamp", None)
    stated = 0 if stamp is None else stamp.sec * 10**9 + stamp.nanosec
    return stated or received


def _fields(message: Any, lead: str = "") -> Iterator[tuple[str, Any]]:
    """Yield numbers and texts of a message with their names."""
    if isinstance(message, bool | int | float | str | np.generic):
        yield lead.rstrip("."), message
    elif isinstance(message, np.ndarray | list | tuple):
        for index, element in enumerate(message[:_LONGEST]):
            yield from _fields(element, f"{lead}{index}.")
    elif hasattr(message, "__dataclass_fields__"):
        for name in message.__dataclass_fields__:
            if not name.startswith("__"):
                yield from _fields(getattr(message, name), f"{lead}{name}.")


def _surrounded(times: Index, at: Index) -> Flags:
    """Return True for times between two messages that follow one another as usual."""
    if times.size < 2:
        return np.zeros(at.size, dtype=bool)
    steps = np.diff(times)
    after = np.clip(np.searchsorted(times, at, side="right"), 1, times.size - 1)
    inside = (times[0] <= at) & (at <= times[-1])
    return np.asarray(inside & (steps[after - 1] <= _INTERVALS * max(float(np.median(steps)), 1.0)))


def _at(times: Index, values: Any, at: Index, name: str, columns: Mapping[str, str]) -> Any:
    """Return the values of a field at other times, as the columns demand that come from it."""
    field = re.compile(rf"{re.escape(name)}(?![\w.])")
    targets = {target for target, text in columns.items() if field.search(text)}
    if values.dtype.kind == "f" and not targets.isdisjoint(_SMOOTH):
        return np.interp(at - times[0], times - times[0], values)  # differences, as floats have no nanoseconds of today
    last = np.clip(np.searchsorted(times, at, side="right") - 1, 0, times.size - 1)
    following = np.minimum(last + 1, times.size - 1)
    if not targets.isdisjoint(CHANNELS):
        return values[np.where(at - times[last] <= times[following] - at, last, following)]
    return values[last]


def _example(reader: AnyReader) -> str:
    """Return the name of a number in the bag."""
    for connection, _, raw in reader.messages():
        for name, value in _fields(reader.deserialize(raw, connection.msgtype)):
            if isinstance(value, float | np.floating):
                return f"{connection.topic}.{name}"
    return "/joint_states.position.0"
