"""Names and texts that can be stored in every file, and what a name becomes that cannot."""

from __future__ import annotations

import re
from typing import Any

__all__ = ["LONGEST_CELL", "is_storable", "is_storable_attribute", "not_storable", "storable"]

LONGEST_CELL = 131_072
"""Characters of a text in a cell, which Python's reader of CSV files takes."""

_LONGEST_NAME = 200
"""Bytes of a name; NetCDF takes 256, also of names that are made of it."""

_RESERVED = frozenset(
    ("CLASS", "NAME", "REFERENCE_LIST", "DIMENSION_LIST", "_Netcdf4Dimid", "_Netcdf4Coordinates", "_nc3_strict")
) | {"_NCProperties"}
"""Attributes that NetCDF and HDF5 keep for themselves."""

_NOT_STORABLE = re.compile("[\0\ud800-\udfff]")
_WITH_UNIT = re.compile(r"(?P<stem>[^/]*\S)\s+/\s+(?P<unit>\S.*)")


def is_storable(name: Any) -> bool:
    """Whether a column or an attribute can have this name in a CSV file and in a NetCDF file."""
    return (
        isinstance(name, str)
        and name.strip() == name
        and name not in ("", ".")
        and name.isprintable()
        and "/" not in name
        and not name.startswith("_nc4_non_coord_")
        and len(name.encode()) <= _LONGEST_NAME
    )


def is_storable_attribute(name: Any) -> bool:
    """Whether an attribute can have this name in a CSV file and in a NetCDF file."""
    return is_storable(name) and name not in _RESERVED


def not_storable(text: str) -> str | None:
    """What keeps a text from being stored in every file, None where nothing does.

    Examples
    --------
    >>> not_storable("a\\0b"), not_storable("°C")
    ('has a NUL character (0x00) in it', None)
    """
    match = _NOT_STORABLE.search(text)
    if match is None:
        return None
    return "has a NUL character (0x00) in it" if match[0] == "\0" else "has half of a surrogate pair in it"


def storable(name: str) -> str:
    """The name without a slash, which stands between groups in a NetCDF file.

    Examples
    --------
    >>> storable("Temp / °C"), storable("Fx/Fy"), storable("v / m/s")
    ('Temp [°C]', 'Fx|Fy', 'v [m|s]')
    """
    match = _WITH_UNIT.fullmatch(name)  # the form of DIN 1313
    return (f"{match['stem']} [{match['unit']}]" if match else name).replace("/", "|")
