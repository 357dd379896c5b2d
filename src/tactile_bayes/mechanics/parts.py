"""numba's compiler without machine code for functions that only compiled ones call.

That code would hold a copy of all that a function calls, optimised again for each caller: half as long again in all. It
overrides classes that are private to numba, so `compiler` uses it with versions that it was tried with, and no others.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import CompilerBase, DefaultPassBuilder
from numba.core.compiler_machinery import LoweringPass, register_pass
from numba.core.typed_passes import NativeLowering


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


class PartCompiler(CompilerBase):
    """numba's compiler without machine code: that of a function would contain a copy of all that it calls."""

    def define_pipelines(self) -> list[Any]:
        state = self.state
        state.flags.no_compile = True
        state.library = _PartLibrary(state.targetctx.codegen(), state.func_id.func_qualname)
        passes = DefaultPassBuilder.define_nopython_pipeline(state)
        passes.add_pass_after(_PartEntry, NativeLowering)
        passes.finalize()
        return [passes]
