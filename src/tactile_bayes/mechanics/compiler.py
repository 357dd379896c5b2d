"""The compilation of functions by numba."""

from __future__ import annotations

import functools
import gc
import hashlib
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

import numba
from numba.core import event

_NOTICE = "tactile-bayes: compiling the forward model; this takes a while the first time, and is kept for later"

Function = TypeVar("Function", bound=Callable[..., object])


_OPTIONS: dict[str, Any] = {"error_model": "numpy", "nogil": True, "no_cfunc_wrapper": True}

# First and last version of numba whose internals `parts` was tried with. Beyond them functions are compiled by its
# public options alone: the same results, but compiling for the first use takes twice as long.
_KNOWN = (0, 61), (0, 68)
_OF_PARTS: dict[str, Any] = {}
if _KNOWN[0] <= tuple(map(int, numba.__version__.split(".")[:2])) <= _KNOWN[1]:
    from tactile_bayes.mechanics.parts import PartCompiler

    _OF_PARTS = {"pipeline_class": PartCompiler}
    # The caller in Python owns all arrays: compiled code allocates nothing and does not count references to arrays,
    # which would take longer than small functions do.
    _OPTIONS["_nrt"] = False


def compiled(function: Function) -> Function:
    """Compile a function as a part of its callers; Python cannot call it. For a literal True, False or number in a call
    all is compiled once more: bool(1) is none."""
    return _part(function)


def inlined(function: Function) -> Function:
    """Compile a function as `compiled` does, and put its code in place of each call. A call copies all fields of its
    arguments. For small functions of many fields that takes longer than they do."""
    return _part(function, forceinline=True)


def _part(function: Function, **more: bool) -> Function:
    options: dict[str, Any] = {**_OPTIONS, **_OF_PARTS, **more, "no_cpython_wrapper": True}
    made: Function = numba.njit(function, **options)
    return made


def cached(function: Function) -> Function:
    """Compile a function and cache its machine code on disk for the next process, where that is possible. numba notices
    a change of the function's own file, but not of the files of the functions that it calls. Therefore a hash of all
    files is a part of its name."""
    function.__qualname__ += f"_{_version()}"
    try:
        made: Function = numba.njit(function, cache=True, **_OPTIONS)
    except RuntimeError:  # neither beside the file nor in the user's cache may anything be written
        made = numba.njit(function, **_OPTIONS)
    return made


def _is_ours(event: Any) -> bool:
    return bool(event.data["dispatcher"].py_func.__module__.startswith(__package__))


class _Rest(event.Listener):
    """Switches the garbage collector off during compilation: it takes a tenth of the time and frees a fifth of the
    memory."""

    def __init__(self) -> None:
        self.depth = 0
        self.was_awake = False

    def on_start(self, event: Any) -> None:
        if _is_ours(event):
            if not self.depth:
                self.was_awake = gc.isenabled()
                gc.disable()
            self.depth += 1

    def on_end(self, event: Any) -> None:
        if _is_ours(event):
            self.depth -= 1
            if not self.depth and self.was_awake:
                gc.enable()


class _Notice(event.Listener):
    """Listener that prints once to a terminal that functions are compiled."""

    def __init__(self) -> None:
        self.said = False

    def on_start(self, event: Any) -> None:
        if _is_ours(event) and not self.said and sys.stderr.isatty():
            print(_NOTICE, file=sys.stderr, flush=True)
            self.said = True

    def on_end(self, event: Any) -> None:
        pass


event.register("numba:compile", _Notice())
event.register("numba:compile", _Rest())


@functools.cache
def _version() -> str:
    """Hash of all source files whose functions or constants are compiled."""
    here = Path(__file__).parent
    sources = [*sorted(here.rglob("*.py")), here.parent / "contours" / "halves.py"]
    return hashlib.sha256(b"".join(source.read_bytes() for source in sources)).hexdigest()[:12]
