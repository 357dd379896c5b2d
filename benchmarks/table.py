"""What the benchmarks share: timing, tables, words of the command line, and results that are kept."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from tactile_bayes.errors import StudyError
from tactile_bayes.tasks import Kind, keep_outcomes, open_results_store, run_tasks


class Row(NamedTuple):
    """Times of the same result by other code and by this package."""

    what: str
    otherwise: float  # time of a piece [s]
    here: float


def best_time(job: Callable[[], Any], repeats: int = 5) -> float:
    """Return the shortest of several times [s], that of an undisturbed job."""
    times = []
    for _ in range(repeats):
        began = time.perf_counter()
        result = job()
        times.append(time.perf_counter() - began)
        del result  # not on the clock
    return min(times)


def line(name: str, cells: Iterable[object], first: int, width: int = 11) -> str:
    """Return a line of a table, whose first column has its own width."""
    return f"{name:<{first}}" + "".join(f"{cell:>{width}}" for cell in cells)


def folder_name(words: str) -> str:
    """Return words as the name of a folder."""
    return "".join(c if c.isalnum() or c in ".-" else "-" for c in words.strip())


def counts_and_names(words: Sequence[str]) -> tuple[list[int], list[str]]:
    """Return the numbers and the other words of a command line, without options."""
    given = [word for word in words if not word.startswith("--")]
    return [int(word) for word in given if word.isdigit()], [word for word in given if not word.isdigit()]


def results(function: Callable[[Any], Any], tasks: Sequence[Any], workers: int | None = None) -> Iterator[Any]:
    """Yield tasks with their results, and count them on a terminal."""
    for done, result in enumerate(run_tasks(function, tasks, workers=workers), start=1):
        if sys.stderr.isatty():
            print(f"\r{done} of {len(tasks)}", end="", file=sys.stderr)
        yield result


def stored(
    out: Path, identity: Mapping[str, str], function: Callable[[Any], Any], task: object, count: int
) -> list[dict[str, Any]]:
    """Return the records that a function makes of a task, by number; a stopped run goes on from a folder."""
    kind = Kind("records", StudyError, dict, lambda row: {name: v for name, v in row.items() if name != "number"})
    with open_results_store(identity, out, kind) as store:
        kept = keep_outcomes(store, function, task, count, workers=None)
    return [kept[number] for number in range(count)]


def print_ratios(rows: Iterable[Row]) -> None:
    print(f"{'':<102}{'otherwise':>10}{'here':>10}{'ratio':>9}")
    for what, otherwise, here in rows:
        print(f"{what:<102}{_text(otherwise):>10}{_text(here):>10}{otherwise / here:>9,.0f}")


def print_growth(what: str, counts: Sequence[int], job_of: Callable[[int], Callable[[], Any]]) -> None:
    """Print the time of a piece for several numbers of pieces, which is constant for linear growth."""
    cells = []
    for count in counts:
        seconds = best_time(job_of(count), 3 if count == max(counts) else 10)
        cells.append(f"{_text(seconds / count)} of {count:,}")
    print(f"{what:<38}" + "".join(f"{cell:>22}" for cell in cells))


def _text(seconds: float) -> str:
    for unit, size in (("s", 1.0), ("ms", 1e-3), ("µs", 1e-6)):
        if seconds >= size:
            return f"{seconds / size:.3g} {unit}"
    return f"{seconds / 1e-9:.3g} ns"
