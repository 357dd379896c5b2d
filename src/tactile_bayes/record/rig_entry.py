"""Entries of a rig's file, as messages state them."""

from __future__ import annotations

import shlex
from typing import Any

from tactile_bayes.tasks.documents import toml_key, toml_value


def rig_entry(name: str, value: Any, table: str = "file") -> str:
    """Return an entry of rig.toml, with its place."""
    return rig_entries({name: value}, table)


def file_entry(name: str, value: Any) -> str:
    """Return an entry of a rig's file format as an argument, as one of rig.toml, and as options of `inspect`."""
    if name == "split_sweeps":
        options = "--split-sweeps"
    elif name == "missing":
        options = " ".join(f"--missing {each}" for each in value)
    else:
        options = f"--column {shlex.quote(f'{name}={value}')}"
    return f"Rig(file={{{name!r}: {value!r}}}), or {rig_entry(name, value)} ({options} of tactile-bayes inspect)"


def rig_entries(entries: dict[str, Any], table: str = "file") -> str:
    """Return entries of rig.toml, with their place."""
    stated = ", ".join(f"{toml_key(name)} = {toml_value(value)}" for name, value in entries.items())
    return f"{stated} under [{table}] of rig.toml"
