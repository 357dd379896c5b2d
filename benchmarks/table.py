"""Timing, and tables of times."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Sequence
from typing import Any, NamedTuple


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
