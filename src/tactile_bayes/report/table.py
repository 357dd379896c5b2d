"""A table, as the template draws it."""

from __future__ import annotations

from typing import NamedTuple

__all__ = ["Table"]


class Table(NamedTuple):
    """A table: what it shows, its heads, its rows, and how many of the columns hold words rather than numbers."""

    caption: str
    heads: list[str]
    rows: list[list[str]]
    words: int = 1
