"""Names that can be stored in every file, and what a name becomes that cannot."""

from __future__ import annotations

import re
from typing import Any

__all__ = ["is_storable", "storable"]

_WITH_UNIT = re.compile(r"(?P<stem>[^/]*\S)\s+/\s+(?P<unit>\S.*)")


def is_storable(name: Any) -> bool:
    """Whether a column or an attribute can have this name in a CSV file and in a NetCDF file."""
    return (
        isinstance(name, str)
        and name.strip() == name
        and name not in ("", ".")
        and name.isprintable()
        and "/" not in name
    )


def storable(name: str) -> str:
    """The name without a slash, which stands between groups in a NetCDF file.

    Examples
    --------
    >>> storable("Temp / °C"), storable("Fx/Fy"), storable("v / m/s")
    ('Temp [°C]', 'Fx|Fy', 'v [m|s]')
    """
    match = _WITH_UNIT.fullmatch(name)  # the form of DIN 1313
    return (f"{match['stem']} [{match['unit']}]" if match else name).replace("/", "|")
