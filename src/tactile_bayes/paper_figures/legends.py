"""Legends above panels, in rows of their own for what belongs together."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["legend_in_rows"]


def legend_in_rows(figure: Figure, found: Mapping[str, Any], groups: Sequence[Sequence[str]], columns: int) -> None:
    """A legend above all panels; each group begins a row, and labels that were not drawn are left out."""
    from matplotlib.lines import Line2D

    rows: list[list[str]] = []
    for group in groups:
        drawn = [label for label in group if label in found]
        rows += [drawn[i : i + columns] for i in range(0, len(drawn), columns)]
    wide = max(len(row) for row in rows)
    filled = [row + [""] * (wide - len(row)) for row in rows]
    # Matplotlib fills a legend column by column.
    labels = [row[k] for k in range(wide) for row in filled]
    empty = Line2D([], [], linestyle="none")
    handles = [found.get(label, empty) for label in labels]
    figure.legend(handles, labels, loc="outside upper center", ncols=wide, fontsize="small", frameon=False)
