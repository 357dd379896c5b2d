"""The text of a specification: TOML of a mapping, and what a text says whatever its layout."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

import numpy as np

from tactile_bayes.errors import SpecificationError

__all__ = ["canonical", "toml_of"]


def canonical(value: Any) -> Any:
    """What a TOML value says, with one kind of number."""
    if isinstance(value, dict):
        return {key: canonical(inner) for key, inner in value.items()}
    if isinstance(value, list):
        return [canonical(inner) for inner in value]
    if isinstance(value, int) and not isinstance(value, bool) and abs(value) <= 2**53:
        return float(value)
    return value


def toml_of(table: Mapping[str, Any]) -> str:
    """A mapping of numbers, words, lists and mappings as TOML, each value in line."""

    def inline(value: Any) -> str:
        if isinstance(value, bool):
            return str(value).lower()
        if isinstance(value, str):
            return json.dumps(value, ensure_ascii=False)
        if isinstance(value, int | np.integer):
            return str(int(value))
        if isinstance(value, float | np.floating):
            return repr(float(value))
        if isinstance(value, Mapping):
            return (
                "{ "
                + ", ".join(f"{json.dumps(str(k), ensure_ascii=False)} = {inline(v)}" for k, v in value.items())
                + " }"
            )
        if isinstance(value, list | tuple | np.ndarray):
            return "[" + ", ".join(inline(v) for v in value) + "]"
        raise SpecificationError(
            f"a specification holds numbers, words, lists and tables, and no {type(value).__name__}"
        )

    return "".join(f"{inline(str(key))} = {inline(value)}\n" for key, value in table.items())
