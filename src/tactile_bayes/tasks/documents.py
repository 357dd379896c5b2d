"""JSON and TOML texts, which may be hostile: depth and size are limited before anything is parsed."""

from __future__ import annotations

import json
import math
import re
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from tactile_bayes.checks import shown
from tactile_bayes.errors import ParameterError

_DEEPEST = 64  # largest depth of lists and tables in one another, and largest number of parts of a dotted key
LARGEST = 1 << 23  # largest number of characters of a TOML text, which takes seconds to parse
_BARE = re.compile(r"[A-Za-z0-9_-]+")
_BRACKET = re.compile(r"[\[\]{}]")
_JSON_STRING = re.compile(r'"(?:[^"\\]++|\\.)*+"?', re.DOTALL)
_TOML_STRING = re.compile(
    r'"""(?:[^"\\]++|\\.|"(?!""))*+(?:""")?|'
    r"'''(?:[^']++|'(?!''))*+(?:''')?|"
    r'"(?:[^"\\\n]++|\\.)*+"?|'
    r"'[^'\n]*+'?|"
    r"#[^\n]*",
    re.DOTALL,
)
_DOTTED = re.compile(r"[\w\-. \t]+")


def read_json(text: Any, name: str) -> Any:
    """Return the value of a JSON text, which messages call by `name`."""
    try:
        whole = text.decode("utf-8") if isinstance(text, bytes) else text
        if isinstance(whole, str):
            _refuse_deep(whole, _JSON_STRING, name)
        return json.loads(whole)
    except (TypeError, ValueError) as error:
        if isinstance(error, ParameterError):
            raise
        raise ParameterError(f"{name} is {shown(text)}, no JSON text that can be read: {error}") from error


def json_value(value: Any) -> Any:
    """Return a value in types of JSON: no arrays, no paths, and null for numbers that are not finite."""
    if hasattr(value, "items"):
        return {str(name): json_value(part) for name, part in value.items()}
    if isinstance(value, Path):
        return str(value)
    if hasattr(value, "values"):  # of xarray
        value = value.values
    if hasattr(value, "tolist"):  # arrays and numbers of NumPy
        value = value.tolist()
    if isinstance(value, list | tuple):
        return [json_value(part) for part in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


def read_toml(text: str) -> dict[str, Any]:
    """Return the tables of a TOML text."""
    if len(text) > LARGEST:
        raise ParameterError(f"the text has {len(text):,} characters: give at most {LARGEST:,}")
    _refuse_deep(text, _TOML_STRING, "the text")
    longest = max((run[0].count(".") for run in _DOTTED.finditer(_TOML_STRING.sub("s", text))), default=0)
    if longest >= _DEEPEST:
        raise ParameterError(f"a key has {longest + 1} parts, more than {_DEEPEST}: remove dots")
    try:
        return tomllib.loads(text)
    except ValueError as error:
        raise ParameterError(f"not TOML: {error}") from error


def _refuse_deep(text: str, strings: re.Pattern[str], name: str) -> None:
    """Refuse brackets in one another, apart from those in strings."""
    if text.count("[") + text.count("{") <= _DEEPEST:
        return
    depth = 0
    for bracket in _BRACKET.finditer(strings.sub("", text)):
        depth += 1 if bracket[0] in "[{" else -1
        if depth > _DEEPEST:
            raise ParameterError(f"{name} is nested deeper than {_DEEPEST} levels: write it as this package does")


def toml_value(value: Any) -> str:
    """Return a number, a text, a list or a mapping of these as an inline value of TOML."""
    if isinstance(value, bool | str):
        return json.dumps(value, ensure_ascii=False)
    if isinstance(value, int | np.integer):
        return str(int(value))
    if isinstance(value, float | np.floating):
        return repr(float(value))
    if isinstance(value, Mapping):
        return (
            f"{{ {', '.join(f'{toml_key(str(k))} = {toml_value(v)}' for k, v in value.items())} }}" if value else "{}"
        )
    if isinstance(value, list | tuple | np.ndarray):
        return "[" + ", ".join(toml_value(v) for v in value) + "]"
    raise ParameterError(f"TOML holds numbers, words, lists and tables, and no {type(value).__name__}")


def toml_key(key: str) -> str:
    """Return a key of TOML, in quotation marks if it needs them."""
    return key if _BARE.fullmatch(key) else json.dumps(key, ensure_ascii=False)
