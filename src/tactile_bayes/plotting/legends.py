"""Legends, in small letters and without a frame."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


def legend_entry(ax: Axes, label: str, **style: Any) -> None:
    """Add a legend entry for a style that many lines share."""
    ax.plot([], [], label=label, **style)


def legend_entries(*panels: Axes) -> dict[str, Any]:
    """Return legend handles by label, each label once."""
    found: dict[str, Any] = {}
    for ax in panels:
        found |= dict(zip(*reversed(ax.get_legend_handles_labels()), strict=True))
    return found


def legend(ax: Axes, entries: Mapping[str, Any] | None = None, **options: Any) -> None:
    """Draw a legend in small letters without a frame, of given entries or of all labels in the Axes."""
    if entries is not None:
        if not entries:
            return
        options |= {"handles": list(entries.values()), "labels": list(entries)}
    ax.legend(fontsize="small", title_fontsize="small", frameon=False, **options)


def legend_above(ax: Axes, columns: int, entries: Mapping[str, Any] | None = None, **options: Any) -> None:
    """Draw a small legend without a frame above the Axes."""
    legend(ax, entries, loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=columns, **options)


def legend_in_rows(figure: Figure, found: Mapping[str, Any], groups: Sequence[Sequence[str]], columns: int) -> None:
    """Draw a legend above all panels; each group begins a row, and labels that were not drawn are left out."""
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
