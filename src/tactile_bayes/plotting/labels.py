"""Labels and legends: numbers and units as text on axes, and legends in small letters without a frame."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from tactile_bayes.arrays import Floats
from tactile_bayes.diagnostics.findings import prefix_of
from tactile_bayes.record import COLUMNS

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.axis import Axis
    from matplotlib.figure import Figure

LABELS = {"drive_angle": r"drive angle $\varphi_0$", "holding_moment": "holding moment $m_0$"}
LABELS |= {"force_x": r"force $f_{\mathrm{A}x}$", "force_y": r"force $f_{\mathrm{A}y}$"}
LABELS |= {"contact_x": "$x$", "contact_y": "$y$"}
DRIVE_ANGLE = f"{LABELS['drive_angle']} [°]"
_DIMENSIONLESS = {"length_unit": "$L$", "moment_unit": "$EI$/$L$", "force_unit": "$EI$/$L^2$"}
# Ticks in a decade of a logarithmic axis, by the largest number of decades.
_TICKS = {0.9: (1.0, 1.5, 2.0, 3.0, 4.0, 5.0, 7.0), 2.2: (1.0, 2.0, 5.0), np.inf: (1.0,)}


def set_unit(axis: Axis, label: str, name: str, attrs: Mapping[Any, Any], values: Floats) -> None:
    """Label an axis with its unit, and in SI write tick labels in the suitable multiple of it."""
    power, unit = shown_unit(name, attrs, values)
    axis.set_label_text(f"{label}[{unit}]" if unit else label.strip())
    if power:
        show_numbers(axis, power)


def set_log_scale(axis: Axis, label: str, name: str, attrs: Mapping[Any, Any], values: Floats) -> None:
    """Make an axis logarithmic, with limits around the positive values of a column and its unit in the label."""
    from matplotlib.ticker import LogFormatterMathtext, LogLocator, NullFormatter

    good = values[np.isfinite(values) & (values > 0.0)]
    power, unit = shown_unit(name, attrs, good)
    low, high = (float(good.min()), float(good.max())) if good.size else (1.0, 1.0)
    margin = (high / low) ** 0.05 * 1.1
    limits = low / margin, high * margin
    name_of_axis = axis.axis_name  # type: ignore[attr-defined]
    axis.axes.set(**{f"{name_of_axis}scale": "log", f"{name_of_axis}lim": limits})
    decades = np.log10(high / low * margin**2)
    axis.set_major_locator(LogLocator(subs=next(ticks for most, ticks in _TICKS.items() if decades < most)))
    axis.set_minor_formatter(NullFormatter())  # Matplotlib would write minor labels in another unit
    if power or low > 1e-4:
        show_numbers(axis, power)
    else:
        axis.set_major_formatter(LogFormatterMathtext())
    axis.set_label_text(f"{label} [{unit}]" if unit else label)


def show_numbers(axis: Axis, power: int = 0) -> None:
    """Write tick labels of an axis in units of a power of ten."""
    axis.set_major_formatter(lambda value, _: number(value, power))


def shown_unit(name: str, attrs: Mapping[Any, Any], values: Floats) -> tuple[int, str]:
    """Return power of ten and name of the unit in which values of a column are shown; "" for a plain number."""
    unit = str(attrs.get("units", "1"))
    column = COLUMNS[name]
    if unit == "1":
        return 0, _DIMENSIONLESS[column.scale] if column.scale else ""
    largest = np.max(np.abs(values), initial=0.0, where=np.isfinite(values)) if unit == column.unit else 0.0
    size, prefix = prefix_of(largest)
    return round(np.log10(size)), f"{prefix}{unit}"


def number(value: float, power: int = 0, *, digits: int = 6) -> str:
    """Return a value as text, in units of a power of ten."""
    return f"{value / 10.0**power:.{digits}g}".replace("-", "−")


def percent(share: float) -> str:
    """Return a share as text, in per cent."""
    return f"{100.0 * share:.6g} %"


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
