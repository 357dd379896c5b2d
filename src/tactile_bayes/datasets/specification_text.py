"""The text of a specification: TOML from a mapping, its default values, and a canonical form."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import zip_longest
from typing import Any

from tactile_bayes.contours.families import FAMILIES
from tactile_bayes.contours.family import ContourFamily
from tactile_bayes.errors import ParameterError, SpecificationError
from tactile_bayes.tasks.documents import read_toml, toml_key, toml_value

UNNAMED = "unnamed"

SCAN = {"bases": [[0.0, 0.0]], "directions": ["forward", "backward"], "samples": 180, "margin": 0.1}
# Default values of keys; a specification with an explicit default is the same.
DEFAULTS = {
    "name": UNNAMED,
    "description": "",
    "shard_records": 500,
    "precision": "double",
    "each_contour": False,
    "scan": SCAN,
    "load_cell": {"frame": "fixed"},
    "rod": {"diameter": 0.0},
    "unknown": "nothing",
}


def meaning(text: str) -> dict[str, Any]:
    """Return the meaning of the text of a specification.

    It does not depend on comments, layout, the notation of numbers (1 or 1.0), or explicit default values."""
    said = without(DEFAULTS, read_toml(text))
    said["contours"] = [
        without({"weight": 1.0, **left_out(FAMILIES[group["family"]])}, group) for group in said["contours"]
    ]
    return dict(canonical(said))


def left_out(family: ContourFamily) -> dict[str, Any]:
    """Default values of the parameters of a family: x_c = 0, and standard normal weights."""
    standard = {"normal": [0.0, 1.0]}
    return {
        "x_c": 0.0,
        **{n: standard for n, entry in family.table.items() if entry.prior and entry.prior.distribution == "norm"},
    }


def canonical(value: Any) -> Any:
    """Return a TOML value with one kind of number."""
    if isinstance(value, dict):
        return {key: canonical(inner) for key, inner in value.items()}
    if isinstance(value, list):
        return [canonical(inner) for inner in value]
    if isinstance(value, int) and not isinstance(value, bool) and abs(value) <= 2**53:
        return float(value)
    return value


def without(defaults: Mapping[str, Any], said: Mapping[str, Any]) -> dict[str, Any]:
    """Remove keys with default values, and tables that contain no others."""
    found = {}
    for key, value in said.items():
        default = defaults.get(key)
        if isinstance(default, Mapping) and isinstance(value, Mapping):
            value = without(default, value)
            default = {}
        if canonical(value) != canonical(default):
            found[key] = value
    return found


def differences(one: Any, other: Any, key: str = "") -> list[tuple[str, Any, Any]]:
    """Find the differences of two canonical specifications: the key and both values, None for a missing one.

    A distribution is one value, and so is a whole table of contours that the other specification lacks.
    """
    if key == "contours":
        tables = zip_longest(one or [], other or [])
        return [d for k, (a, b) in enumerate(tables) for d in differences(a, b, f"{key}[{k}]")]
    is_table = "." not in key and (isinstance(one, dict) or isinstance(other, dict))
    if is_table and not (key.startswith("contours") and None in (one, other)):
        one, other = one or {}, other or {}
        return [
            difference
            for name in dict.fromkeys([*one, *other])
            for difference in differences(one.get(name), other.get(name), f"{key}.{name}".lstrip("."))
        ]
    return [] if one == other else [(key, one, other)]


def toml_of(table: Mapping[str, Any]) -> str:
    """Convert a mapping of numbers, words, lists and mappings to TOML, with inline values."""
    try:
        return "".join(f"{toml_key(str(key))} = {toml_value(value)}\n" for key, value in table.items())
    except ParameterError as error:
        raise SpecificationError(f"a specification cannot be written: {error}") from error
