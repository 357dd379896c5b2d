"""The results store: outcomes of finished tasks in a file that is always complete."""

from __future__ import annotations

import json
import os
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import closing, contextmanager
from dataclasses import fields
from importlib.metadata import version
from pathlib import Path
from typing import Any, Generic, NamedTuple, TypeVar

from tactile_bayes.checks import check_path
from tactile_bayes.errors import TactileBayesError
from tactile_bayes.tasks.documents import json_value, read_json
from tactile_bayes.tasks.files import alone_in, check_format, write_atomically
from tactile_bayes.tasks.workers import TaskProgress, Workers, run_tasks, workers_of

Task = TypeVar("Task")
Outcome = TypeVar("Outcome")

_FORMAT = 1

_WRITING_SHARE = 0.05  # share of the time that is spent on writing outcomes
_LONGEST = 60  # largest number of characters of a text in a message


class Kind(NamedTuple):
    """Kind of the outcomes in a results store."""

    what: str  # name of the outcomes, and of the file
    error: type[TactileBayesError]
    encode: Callable[[Any], dict[str, Any]]  # maps an outcome to names and values; NaN becomes null, and a tuple a list
    # Inverse of `encode`; raises KeyError, TypeError, ValueError or AttributeError.
    decode: Callable[[dict[str, Any]], Any]

    @property
    def file(self) -> str:
        return f"{self.what}.json"


class FieldsAlone:
    """Dataclass that is sent to workers as its fields alone: what is made of them is made again where it is needed."""

    def __getstate__(self) -> dict[str, Any]:
        return {each.name: getattr(self, each.name) for each in fields(self)}  # type: ignore[arg-type]


def versions_of(*libraries: str) -> dict[str, str]:
    """Return the versions of libraries on which results depend, as entries of their identity."""
    return {f"version of {name}": version(name) for name in libraries}


class ResultsStore(Generic[Outcome]):
    """Outcomes by number, in a file; without a folder they stay in memory."""

    def __init__(self, identity: Mapping[str, str], folder: Path | None, kind: Kind) -> None:
        self._identity = dict(identity)
        self._kind = kind
        self._file = None if folder is None else folder / kind.file
        self.outcomes: dict[int, Outcome] = {}
        if self._file is not None and self._file.exists():
            self.outcomes = _read(self._file, self._identity, kind)

    def write(self) -> None:
        """Write all outcomes, if there is a folder."""
        if self._file is None:
            return
        rows = [{"number": number, **self._kind.encode(outcome)} for number, outcome in sorted(self.outcomes.items())]
        table = {"format": _FORMAT, "experiment": self._identity, self._kind.what: rows}
        with write_atomically(self._file) as temporary:
            temporary.write_text(json.dumps(json_value(table), ensure_ascii=False, allow_nan=False), encoding="utf-8")


@contextmanager
def open_results_store(
    identity: Mapping[str, str], out: str | os.PathLike[str] | None, kind: Kind
) -> Iterator[ResultsStore[Any]]:
    """Open the results store in a folder, which is created if it does not exist; write it at the end of the block."""
    if out is None:
        yield ResultsStore(identity, None, kind)
        return
    folder = check_path("out", out).resolve()
    with alone_in(folder, kind.error):
        store: ResultsStore[Any] = ResultsStore(identity, folder, kind)
        try:
            yield store
        finally:
            store.write()


def keep_outcomes(
    store: ResultsStore[Outcome],
    function: Callable[[tuple[Task, int]], Outcome],
    task: Task,
    count: int,
    *,
    workers: int | str | Workers | None,
) -> dict[int, Outcome]:
    """Return the outcomes of a task for the numbers from 0 to `count` − 1, and compute those not in the store."""
    workers, began = workers_of(workers), time.monotonic()
    kept = {number: outcome for number, outcome in store.outcomes.items() if number < count}
    tasks = [(task, number) for number in range(count) if number not in kept]
    next_write, done = began, len(kept)
    with closing(run_tasks(function, tasks, workers=workers)) as results:
        for made, ((_, number), outcome) in enumerate(results, start=1):
            store.outcomes[number] = kept[number] = outcome
            if (now := time.monotonic()) >= next_write:
                store.write()
                next_write = time.monotonic() + (time.monotonic() - now) / _WRITING_SHARE
            if workers.progress is not None:
                workers.progress(TaskProgress(done + made, count, made, time.monotonic() - began))
    return kept


def _read(file: Path, identity: Mapping[str, str], kind: Kind) -> dict[int, Any]:
    correction = f"give another folder, or remove {file.name} from it to start again"
    try:
        table = read_json(file.read_bytes(), "it")
        check_format(table["format"], _FORMAT, lambda what: kind.error(f"{file} {what}: or {correction}"))
        there = dict(table["experiment"])
        outcomes = {int(row["number"]): kind.decode(row) for row in table[kind.what]}
    except kind.error:
        raise
    except (KeyError, TypeError, ValueError, AttributeError, OverflowError) as error:
        raise kind.error(f"{file} holds no {kind.what} that can be read ({error}): {correction}") from error
    if outcomes and (differ := differences(there, identity)):
        raise kind.error(f"{file.parent} holds {kind.what} of another experiment: {differ}; {correction}")
    return outcomes


def differences(there: Mapping[str, str], here: Mapping[str, str], most: int = 3) -> str:
    """Return in words what differs between the identities of a stored thing and of the one asked for; "" if nothing."""
    differ = [name for name in {**there, **here} if there.get(name) != here.get(name)]
    parts = ((name, *_differing(there.get(name), here.get(name))) for name in differ[:most])
    named = ", ".join(f"{name} is {had} there and {has} here" for name, had, has in parts)
    return named + (f" and {len(differ) - most} more" if len(differ) > most else "")


def _differing(there: Any, here: Any) -> tuple[str, ...]:
    """Return two values as text, long ones from the entry on in which they differ."""
    texts = ["left out" if value is None else str(value) for value in (there, here)]
    is_long = max(map(len, texts)) > _LONGEST
    same = next((i for i, (one, other) in enumerate(zip(*texts, strict=False)) if one != other), 0) if is_long else 0
    begin = texts[0].rfind(", ", 0, same) + 2 if ", " in texts[0][:same] else 0
    return tuple(("…" if begin else "") + _short(text[begin:]) for text in texts)


def _short(text: str) -> str:
    return text if len(text) <= _LONGEST else f"{text[: _LONGEST - 3]}…"
