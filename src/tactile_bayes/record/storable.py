"""Names and texts that every file format can store, and the conversion of others."""

from __future__ import annotations

import re
from typing import Any

LONGEST_CELL = 131_072  # largest number of characters in a cell, that of Python's CSV reader
_LONGEST_NAME = 200  # largest number of bytes of a name; NetCDF limits it, and names derived from it, to 256
# Attributes that NetCDF and HDF5 reserve.
_RESERVED = {"CLASS", "NAME", "REFERENCE_LIST", "DIMENSION_LIST"}
_RESERVED |= {"_Netcdf4Dimid", "_Netcdf4Coordinates", "_nc3_strict", "_NCProperties"}
_NOT_STORABLE = re.compile("[\0\ud800-\udfff]")
_WITH_UNIT = re.compile(r"(?P<stem>[^/]*\S)\s+/\s+(?P<unit>\S.*)")


def is_storable(name: Any) -> bool:
    """Return whether a column can have this name in a CSV file and in a NetCDF file."""
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
    """Return whether an attribute can have this name in a CSV file and in a NetCDF file."""
    return is_storable(name) and name not in _RESERVED


def not_storable(text: str) -> str | None:
    """Return the reason why not every file can store a text, None if there is none."""
    if (match := _NOT_STORABLE.search(text)) is None:
        return None
    return "has a NUL character (0x00) in it" if match[0] == "\0" else "has half of a surrogate pair in it"


def storable(name: str) -> str:
    """Replace slashes in a name, which separate groups in a NetCDF file."""
    match = _WITH_UNIT.fullmatch(name)  # the notation of DIN 1313
    return (f"{match['stem']} [{match['unit']}]" if match else name).replace("/", "|")
