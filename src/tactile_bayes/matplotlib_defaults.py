"""Matplotlib without the user's file of settings, for the processes of commands: such a file may even be unreadable."""

from __future__ import annotations

import sys
from contextlib import chdir
from importlib.abc import MetaPathFinder
from importlib.machinery import ModuleSpec, PathFinder
from pathlib import Path
from types import ModuleType
from typing import Any


def ignore_user_settings() -> None:
    """Have Matplotlib, when this process imports it, read its own defaults in place of the user's settings."""
    sys.meta_path.insert(0, _Matplotlib())


class _Matplotlib(MetaPathFinder):
    """Finder of Matplotlib alone, which is loaded in the folder of its defaults: it looks for settings there first."""

    def find_spec(self, fullname: str, path: Any, target: ModuleType | None = None) -> ModuleSpec | None:
        if fullname != "matplotlib":
            return None
        spec = PathFinder.find_spec(fullname, path)
        if spec is not None and spec.loader is not None and spec.origin is not None:
            defaults, load = Path(spec.origin).parent / "mpl-data", spec.loader.exec_module

            def load_there(module: ModuleType) -> None:
                with chdir(defaults):
                    load(module)

            spec.loader.exec_module = load_there  # type: ignore[method-assign]
        return spec
