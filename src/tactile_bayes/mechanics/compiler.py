"""How functions are compiled."""

from __future__ import annotations

import functools
import hashlib
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

import numba
from numba.core import event

__all__ = ["compiled", "inlined", "kept"]

_NOTICE = "tactile-bayes: compiling the forward model; this takes a while the first time, and is kept for later"

Function = TypeVar("Function", bound=Callable[..., object])


_OPTIONS: dict[str, Any] = {"error_model": "numpy", "nogil": True, "_nrt": False}
"""Arrays belong to whoever calls from Python: nothing is allocated, and references to arrays are not counted, which
takes longer than what small functions do."""


def compiled(function: Function) -> Function:
    """Machine code, as a part of what calls it."""
    wrappers = {"no_cpython_wrapper": True, "no_cfunc_wrapper": True}  # no other calls it
    made: Function = numba.njit(function, **_OPTIONS, **wrappers)
    return made


def inlined(function: Function) -> Function:
    """Compiled into every place that calls it."""
    made: Function = numba.njit(function, **_OPTIONS, inline="always")
    return made


def kept(function: Function) -> Function:
    """Machine code that is kept on disk for the next process, where there is a place to keep it.

    numba sees when the function's own file has changed, but not those of what it calls: so its name tells versions of
    them all apart.
    """
    function.__qualname__ += f"_{_version()}"
    try:
        made: Function = numba.njit(function, **_OPTIONS, cache=True)
    except RuntimeError:  # neither beside the file nor in the user's cache may anything be written
        made = numba.njit(function, **_OPTIONS)
    return made


class _Notice(event.Listener):
    """Says once that something is compiled, to whoever waits at a terminal."""

    def __init__(self) -> None:
        self.said = False

    def on_start(self, event: Any) -> None:
        ours = event.data["dispatcher"].py_func.__module__.startswith(__package__)
        if ours and not self.said and sys.stderr.isatty():
            print(_NOTICE, file=sys.stderr, flush=True)
            self.said = True

    def on_end(self, event: Any) -> None:
        pass


event.register("numba:compile", _Notice())


@functools.cache
def _version() -> str:
    """Of all source files of this package."""
    sources = sorted(Path(__file__).parent.glob("*.py"))
    return hashlib.sha256(b"".join(source.read_bytes() for source in sources)).hexdigest()[:12]
