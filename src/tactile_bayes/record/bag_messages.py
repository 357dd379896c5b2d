"""Messages of a bag of the Robot Operating System: their times, and the values of their fields by name."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from tactile_bayes.errors import RecordError
from tactile_bayes.record.table import Source

if TYPE_CHECKING:
    from rosbags.highlevel import AnyReader

_LONGEST = 64  # largest number of elements of an array that are columns


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

    def is_in_all(self, name: str) -> bool:
        """Return whether every message has a field."""
        return len(self.fields[name].messages) == len(self.received)


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


def messages_of(reader: AnyReader, wanted: set[str]) -> dict[str, Topic]:
    """Read the messages of some topics."""
    found = {topic: Topic() for topic in wanted}
    connections = [connection for connection in reader.connections if connection.topic in wanted]
    for connection, received, raw in reader.messages(connections):
        found[connection.topic].add(reader.deserialize(raw, connection.msgtype), received, connection.id)
    return found


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
