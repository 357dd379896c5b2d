"""The directive `public`: a table of names of a module, and then what their docstrings say."""

from __future__ import annotations

import importlib
import inspect
from typing import TYPE_CHECKING, Any

from sphinx.pycode import ModuleAnalyzer
from sphinx.util.docutils import SphinxDirective

if TYPE_CHECKING:
    from types import ModuleType

    from docutils.nodes import Node
    from sphinx.application import Sphinx


class PublicNames(SphinxDirective):
    """The names of a module that stand in the directive, or, where none does, all in the module's `__all__`."""

    required_arguments = 1
    has_content = True

    def run(self) -> list[Node]:
        """The table and the entries."""
        module = importlib.import_module(self.arguments[0])
        self.env.note_dependency(inspect.getfile(module))
        names = list(self.content) or list(module.__all__)
        lines = [f".. currentmodule:: {module.__name__}", "", ".. autosummary::", ""]
        lines += [f"   {name}" for name in names if callable(getattr(module, name))] + [""]
        for name in names:
            lines += _entry(module, name)
        text = "\n".join(lines)
        return self.parse_text_to_nodes(f"```{{eval-rst}}\n{text}\n```")


def _entry(module: ModuleType, name: str) -> list[str]:
    """How autodoc is asked for one name; what another module has documented is shown by its value."""
    value = getattr(module, name)
    if inspect.isclass(value):
        return [f".. autoclass:: {name}", "   :members:", "   :show-inheritance:", ""]
    if callable(value):
        return [f".. autofunction:: {name}", ""]
    if ("", name) in ModuleAnalyzer.for_module(module.__name__).find_attr_docs():
        return [f".. autodata:: {name}", ""]
    return [f".. py:data:: {name}", f"   :value: {value!r}", ""]


def setup(app: Sphinx) -> dict[str, Any]:
    """Register with Sphinx."""
    app.add_directive("public", PublicNames)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
