"""A ledger: which of many tasks are done, and what came of them, in a file that is always whole."""

from __future__ import annotations

import json
import math
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import closing, contextmanager
from pathlib import Path
from typing import Any, Generic, NamedTuple, TypeVar

from tactile_bayes.errors import TactileBayesError
from tactile_bayes.tasks.files import alone_in, write_atomically
from tactile_bayes.tasks.workers import run_tasks

__all__ = ["Kind", "Ledger", "TaskProgress", "keep_outcomes", "open_ledger"]

Task = TypeVar("Task")
Outcome = TypeVar("Outcome")

_FORMAT = 1

_NOTING = 0.05
"""Share of the time that goes into notes of what is finished."""


class Kind(NamedTuple):
    """What a ledger is of."""

    what: str
    """The outcomes, in a word; the file is called by it."""
    error: type[TactileBayesError]
    encode: Callable[[Any], dict[str, Any]]
    """From an outcome to names and values that JSON can hold, and NaN, which becomes null, and tuples."""
    decode: Callable[[dict[str, Any]], Any]
    """The way back; raises KeyError, TypeError, ValueError or AttributeError."""

    @property
    def file(self) -> str:
        return f"{self.what}.json"


class TaskProgress(NamedTuple):
    """How far many tasks have come."""

    done: int
    wanted: int
    made: int
    """Of those that are done, in this run."""
    seconds: float
    """Since this run began."""


class Ledger(Generic[Outcome]):
    """Outcomes by number; without a folder they are kept in memory alone."""

    def __init__(self, words: Mapping[str, str], folder: Path | None, kind: Kind) -> None:
        self._words = dict(words)
        self._kind = kind
        self._file = None if folder is None else folder / kind.file
        self.outcomes: dict[int, Outcome] = {}
        if self._file is not None and self._file.exists():
            self.outcomes = _read(self._file, self._words, kind)

    def write(self) -> None:
        """Write what is there."""
        if self._file is None:
            return
        rows = [{"number": number, **self._kind.encode(outcome)} for number, outcome in sorted(self.outcomes.items())]
        table = {"format": _FORMAT, "experiment": self._words, self._kind.what: rows}
        with write_atomically(self._file) as temporary:
            temporary.write_text(json.dumps(_storable(table), ensure_ascii=False, allow_nan=False), encoding="utf-8")


@contextmanager
def open_ledger(words: Mapping[str, str], folder: Path | None, kind: Kind) -> Iterator[Ledger[Any]]:
    """The ledger in a folder, which is made if it is not there; written when the block ends, however it does.

    Parameters
    ----------
    words : mapping of str to str
        What the outcomes follow from.
    folder : Path, optional
    kind : Kind
        Its error is raised if the folder has the ledger of another experiment, or none that can be read, or is being
        worked on.
    """
    if folder is None:
        yield Ledger(words, None, kind)
        return
    if folder.exists() and not folder.is_dir():
        raise kind.error(f"{folder} is a file: give a folder")
    folder.mkdir(parents=True, exist_ok=True)
    with alone_in(folder, kind.error):
        ledger: Ledger[Any] = Ledger(words, folder, kind)
        try:
            yield ledger
        finally:
            ledger.write()


def keep_outcomes(
    ledger: Ledger[Outcome],
    function: Callable[[tuple[Task, int]], Outcome],
    task: Task,
    count: int,
    *,
    workers: int | None,
    scheduler: str | None,
    progress: Callable[[TaskProgress], object] | None,
) -> dict[int, Outcome]:
    """Outcomes of a task's numbers from 0 to `count` − 1; those that are in the ledger are not made again.

    Parameters
    ----------
    ledger : Ledger
    function : callable
        Of the task and a number; of a module, not a local one.
    task
    count : int
    workers, scheduler
        As in `run_tasks`.
    progress : callable, optional
        Is given a `TaskProgress` after each.
    """
    began = time.monotonic()
    kept = {number: outcome for number, outcome in ledger.outcomes.items() if number < count}
    tasks = [(task, number) for number in range(count) if number not in kept]
    next_note, done = began, len(kept)
    with closing(run_tasks(function, tasks, workers=workers, scheduler=scheduler)) as results:
        for made, ((_, number), outcome) in enumerate(results, start=1):
            ledger.outcomes[number] = kept[number] = outcome
            if (now := time.monotonic()) >= next_note:
                ledger.write()
                next_note = time.monotonic() + (time.monotonic() - now) / _NOTING
            if progress is not None:
                progress(TaskProgress(done + made, count, made, time.monotonic() - began))
    return kept


def _read(file: Path, words: Mapping[str, str], kind: Kind) -> dict[int, Any]:
    remedy = f"give another folder, or remove {file.name} from it to begin anew"
    try:
        table = json.loads(file.read_text(encoding="utf-8"))
        if table["format"] != _FORMAT:
            raise kind.error(f"{file} has format {table['format']}, this version reads {_FORMAT}: {remedy}")
        there = dict(table["experiment"])
        outcomes = {int(row["number"]): kind.decode(row) for row in table[kind.what]}
    except TactileBayesError:
        raise
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise kind.error(f"{file} holds no {kind.what} that can be read ({error}): {remedy}") from error
    differ = [name for name in {**there, **words} if there.get(name) != words.get(name)]
    if outcomes and differ:
        told = ", ".join(
            f"{name} is {_short(there.get(name))} there and {_short(words.get(name))} here" for name in differ[:3]
        )
        more = f" and {len(differ) - 3} more" if len(differ) > 3 else ""
        raise kind.error(f"{file.parent} holds {kind.what} of another experiment: {told}{more}; {remedy}")
    return outcomes


def _storable(value: Any) -> Any:
    """As JSON holds it: null for what is not finite, and lists for tuples."""
    if isinstance(value, Mapping):
        return {name: _storable(part) for name, part in value.items()}
    if isinstance(value, list | tuple):
        return [_storable(part) for part in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


def _short(value: Any) -> str:
    words = "left out" if value is None else str(value)
    return words if len(words) <= 60 else f"{words[:57]}…"
