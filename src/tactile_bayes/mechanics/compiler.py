"""How functions are compiled."""

from __future__ import annotations

import functools
import hashlib
from collections.abc import Callable
from pathlib import Path
from typing import TypeVar

import numba

__all__ = ["compiled", "inlined", "kept"]

Function = TypeVar("Function", bound=Callable[..., object])


def compiled(function: Function) -> Function:
    """Machine code, as a part of what calls it."""
    made: Function = numba.njit(function, error_model="numpy", nogil=True)
    return made


def inlined(function: Function) -> Function:
    """Compiled into every place that calls it: a call that hands arrays over counts references to each of them, which
    takes longer than what small functions do."""
    made: Function = numba.njit(function, error_model="numpy", nogil=True, inline="always")
    return made


def kept(function: Function) -> Function:
    """Machine code that is kept on disk for the next process, where there is a place to keep it.

    numba sees when the function's own file has changed, but not those of what it calls: so its name tells versions of
    them all apart.
    """
    function.__qualname__ += f"_{_version()}"
    try:
        made: Function = numba.njit(function, error_model="numpy", nogil=True, cache=True)
    except RuntimeError:  # neither beside the file nor in the user's cache may anything be written
        made = compiled(function)
    return made


@functools.cache
def _version() -> str:
    """Of all source files of this package."""
    sources = sorted(Path(__file__).parent.glob("*.py"))
    return hashlib.sha256(b"".join(source.read_bytes() for source in sources)).hexdigest()[:12]
