"""A cell of a table: what number there is in it, if there is one."""

from __future__ import annotations

import math
import re
from typing import Any

__all__ = ["integer_in", "is_integer_text", "number_in"]


def number_in(cell: Any) -> float | None:
    """The number in a cell, NaN if the cell is empty, None if there is something else in it."""
    if cell is None:
        return math.nan
    if isinstance(cell, str):
        cell = cell.strip() or "nan"
        if "_" in cell:  # Python would read 1_0 as ten
            return None
    try:
        return float(cell)
    except (TypeError, ValueError, OverflowError):
        return None


def integer_in(cell: Any) -> int | None:
    """The integer in a cell, None if there is something else in it; 2.0 is one, as tables often write it so."""
    if isinstance(cell, int):
        integer = cell
    elif isinstance(cell, str) and is_integer_text(cell):
        digits = cell.strip().lstrip("+-").lstrip("0")[:20] or "0"  # 20 are too many; Python refuses more than 4300
        integer = -int(digits) if "-" in cell else int(digits)
    else:
        number = number_in(cell)
        if number is None or not number.is_integer():
            return None
        integer = int(number)
    return integer if -(2**63) <= integer < 2**63 else None


def is_integer_text(text: str) -> bool:
    """Whether a text is written as an integer, without a point or an exponent."""
    return re.fullmatch(r"\s*[+-]?[0-9]+\s*", text) is not None
