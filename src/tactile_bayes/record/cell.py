"""A cell of a table, and the number in it."""

from __future__ import annotations

import math
import re
from typing import Any

from tactile_bayes.record.spelling import plain_number


def number_in(cell: Any) -> float | None:
    """Parse the number in a cell: NaN for an empty cell, None for other content."""
    if cell is None:
        return math.nan
    if isinstance(cell, str):
        cell = plain_number(cell).strip() or "nan"
        if "_" in cell:  # Python would read 1_0 as ten
            return None
    try:
        return float(cell)
    except (TypeError, ValueError, OverflowError):
        return None


def number_with_comma(text: str) -> float | None:
    """Parse the number in a cell whose decimals may have a comma, None for an empty cell too."""
    return number_in(text.replace(",", ".")) if text else None


def integer_in(cell: Any) -> int | None:
    """Parse the integer in a cell, None for other content; 2.0 is accepted, since tables often contain it."""
    if isinstance(cell, int):
        integer = cell
    elif isinstance(cell, str) and is_integer_text(cell):
        digits = cell.strip().lstrip("+-").lstrip("0")[:20] or "0"  # 20 overflow; Python refuses more than 4300
        integer = -int(digits) if "-" in cell else int(digits)
    else:
        number = number_in(cell)
        if number is None or not number.is_integer():
            return None
        integer = int(number)
    return integer if -(2**63) <= integer < 2**63 else None


def is_integer_text(text: str) -> bool:
    """Return whether a text has the form of an integer, without a point or an exponent."""
    return re.fullmatch(r"\s*[+-]?[0-9]+\s*", text) is not None
