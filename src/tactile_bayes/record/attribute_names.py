"""The names of the attributes of a record, and names that are probably misspelt ones."""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Mapping
from typing import Any

from tactile_bayes.record.quantity import unit_of
from tactile_bayes.record.schema import ATTRIBUTE_UNITS, FRAMES, LOAD_CELL_UNITS, UNITS
from tactile_bayes.record.spelling import is_misspelling, nearest, plain

_QUANTITY = re.compile(
    r"[+-]?(?:[0-9]+(?:[.,][0-9]*)?|[.,][0-9]+)(?:[eE][+-]?[0-9]+)?\s*"
    r"(?:(?P<brackets>\[[^\[\]]*\])|(?P<unit>[^\W\d].*|°))?"
)
_KNOWN = (*ATTRIBUTE_UNITS, "load_cell_frame")
_PREFIXES = {"rod_": "rod", "load_cell_": "load cell"}

USED = frozenset((*_KNOWN, "units", "units_source"))  # attributes of a record that have a meaning
_STRAY = re.compile(r'"?(?P<key>[^:=;,\t"]{1,80})"?\s*[:=;,\t]\s*(?P<value>.*)', re.DOTALL)
_WORDS = re.compile(r"(?P<key>\w+_\w+)\s+(?P<value>\S.*)", re.DOTALL)


def unused(attrs: Mapping[str, Any]) -> list[str]:
    """Return the names of attributes without a meaning here."""
    return [name for name in attrs if name not in USED]


def misspelt(name: str, value: Any) -> str | None:
    """Return why an attribute, a number named `rod_…` or `load_cell_…` or a name like a known one, may be misspelt."""
    if name in USED:
        return None
    if name == "record_format":
        return "this name is that of the format of its file: give it another"
    prefix = next((prefix for prefix in _PREFIXES if name.startswith(prefix)), None)
    if prefix is not None and (_is_quantity(value) or _likely(name, prefix)):
        return no_entry(name.removeprefix(prefix), prefix)
    is_unit = isinstance(value, str) and value.lower() in map(str.lower, UNITS)
    meant = "units" if is_unit and is_misspelling(_letters(name), "units") else _likely(name)
    return None if meant is None else f"it is no attribute of a record: did you mean {meant!r}?"


def stray_attribute(comment: str) -> tuple[str, str] | None:
    """Return the name of an attribute that a commented line states in a form that is not read, and why; else None."""
    comment = plain(comment)
    match = _STRAY.fullmatch(comment) or _WORDS.fullmatch(comment)
    if match is None:
        return None
    key, value = match["key"].strip(), match["value"].strip()
    meant = key if key in _KNOWN else _likely(key)
    if meant is None and _letters(key) == "units" and value.lower() in map(str.lower, UNITS):
        meant = "units"
    if meant is not None:
        return meant, f"it is stated in a form that is not read: write '# {meant}: {value[:80]}'"
    why = misspelt(key, value)
    return None if why is None else (key, why)


def no_entry(name: str, prefix: str = "load_cell_") -> str:
    """Message that a rod or a data sheet has no entry of this name, with the most similar one."""
    entries = [known.removeprefix(prefix) for known in _KNOWN if known.startswith(prefix)]
    near = nearest(name, entries)
    every = ", ".join(["frame", *LOAD_CELL_UNITS] if prefix == "load_cell_" else entries)
    hint = f"did you mean {near!r}?" if near else f"there are {every}."
    return (
        f"a {_PREFIXES[prefix]} has no entry {name!r}: {hint} An attribute of a record that is something else needs a "
        f"name that does not begin with {prefix!r}"
    )


def _likely(name: str, prefix: str = "") -> str | None:
    """Return the known name with a prefix that a name is, apart from case, separators and a few letters; else None."""
    letters = _letters(name.removeprefix(prefix))
    for known in _KNOWN:
        if known.startswith(prefix) and is_misspelling(letters, _letters(known.removeprefix(prefix))):
            return known
    return None


def _letters(name: str) -> str:
    return "".join(filter(str.isalnum, unicodedata.normalize("NFKC", name[:200]).lower()))


def _is_quantity(value: Any) -> bool:
    """Return whether a value is a number, or text that states one, polynomials, or a frame."""
    if not isinstance(value, str):
        return isinstance(value, int | float)
    text = value.strip()
    if text.startswith("{") or text.lower() in FRAMES:
        return True
    match = _QUANTITY.fullmatch(text)
    if match is None:
        return False
    return match["brackets"] is not None or (unit_of(match["unit"]) is not None if match["unit"] else "," in text)
