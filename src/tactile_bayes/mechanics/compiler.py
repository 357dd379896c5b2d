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
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import CompilerBase, DefaultPassBuilder
from numba.core.compiler_machinery import LoweringPass, register_pass
from numba.core.typed_passes import NativeLowering

__all__ = ["cached", "compiled", "inlined"]

_NOTICE = "tactile-bayes: compiling the forward model; this takes a while the first time, and is kept for later"

Function = TypeVar("Function", bound=Callable[..., object])


_OPTIONS: dict[str, Any] = {"error_model": "numpy", "nogil": True, "_nrt": False, "no_cfunc_wrapper": True}
"""Options of numba. The caller in Python owns all arrays: compiled code allocates nothing and does not count references
to arrays, which would take longer than small functions do."""


class _PartLibrary(JITCodeLibrary):
    """LLVM code of a function, which is optimised and turned into machine code only inside its callers."""

    def _optimize_final_module(self) -> None:
        pass

    def _finalize_final_module(self) -> None:
        self._finalize_dynamic_globals()
        self._finalized = True


@register_pass(mutates_CFG=True, analysis_only=False)
class _PartEntry(LoweringPass):
    """Registers a function under a key in place of an entry point, which it does not have."""

    _name = "part_entry"

    def __init__(self) -> None:
        LoweringPass.__init__(self)

    def run_pass(self, state: Any) -> bool:
        key: Callable[..., object] = {}.__getitem__  # one of its own, as entry points are
        state.targetctx.insert_user_function(key, state.cr.fndesc, [state.library])
        state["cr"] = state.cr._replace(cfunc=key)
        return True


class _PartCompiler(CompilerBase):
    """numba's compiler without machine code: that of a function would contain a copy of all that it calls."""

    def define_pipelines(self) -> list[Any]:
        state = self.state
        state.flags.no_compile = True
        state.library = _PartLibrary(state.targetctx.codegen(), state.func_id.func_qualname)
        passes = DefaultPassBuilder.define_nopython_pipeline(state)
        passes.add_pass_after(_PartEntry, NativeLowering)
        passes.finalize()
        return [passes]


def compiled(function: Function) -> Function:
    """Compile a function as a part of its callers; Python cannot call it."""
    return _part(function)


def inlined(function: Function) -> Function:
    """Compile a function as `compiled` does, and put its code in place of each call.

    A call copies all fields of its arguments. For small functions of many fields that takes longer than they do.
    """
    return _part(function, forceinline=True)


def _part(function: Function, **more: bool) -> Function:
    options = {**_OPTIONS, "no_cpython_wrapper": True, **more}
    made: Function = numba.njit(function, pipeline_class=_PartCompiler, **options)
    return made


def cached(function: Function) -> Function:
    """Compile a function and cache its machine code on disk for the next process, where that is possible.

    numba notices a change of the function's own file, but not of the files of the functions that it calls. Therefore a
    hash of all files is a part of its name.
    """
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
    """Hash of all source files of this package."""
    sources = sorted(Path(__file__).parent.rglob("*.py"))
    return hashlib.sha256(b"".join(source.read_bytes() for source in sources)).hexdigest()[:12]
