"""Parts of one computation, side by side on threads of this process."""

from __future__ import annotations

import functools
import os
import threading
from collections.abc import Callable, Generator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager

import numpy as np

_PARTS = 2  # parts for each thread, of which some take longer than others
_here = threading.local()


def cores() -> int:
    """Return the number of cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def in_parts(function: Callable[[slice], None], count: int, fewest: int) -> None:
    """Call a function on parts of `count` items, side by side if there are cores for them and parts are large enough.

    The function releases the global interpreter lock, and writes the results of its items. There are as many threads as
    cores, or as the environment variable NUMBA_NUM_THREADS says, and one within `one_thread`.
    """
    threads = 1 if getattr(_here, "is_one", False) else min(_threads(), count // fewest)
    if threads < 2:
        function(slice(0, count))
        return
    ends = np.linspace(0, count, _PARTS * threads + 1).astype(int).tolist()
    for _ in _team(os.getpid()).map(function, map(slice, ends[:-1], ends[1:])):
        pass


@contextmanager
def one_thread() -> Generator[None, None, None]:
    """Compute without other threads: this one is among many."""
    before = getattr(_here, "is_one", False)
    _here.is_one = True
    try:
        yield
    finally:
        _here.is_one = before


def _threads() -> int:
    from numba.core import config  # numba takes a second to load

    return int(vars(config)["NUMBA_NUM_THREADS"])  # from the environment, by default the number of cores


@functools.cache
def _team(process: int) -> ThreadPoolExecutor:
    """Threads of a process: one that was forked has its own."""
    return ThreadPoolExecutor(_threads(), "tactile-bayes", _begin)


def _begin() -> None:
    _here.is_one = True
