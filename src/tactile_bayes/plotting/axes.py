"""Axes: how they are made, their colours, labels with units, and legends."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from tactile_bayes.errors import ParameterError
from tactile_bayes.record import CHANNELS, COLUMNS

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.axis import Axis

__all__ = [
    "BASES",
    "BEST",
    "DRIVE_ANGLE",
    "LABELS",
    "PALETTE",
    "PHASES",
    "SWEEP_LINES",
    "SWEEP_MARKERS",
    "AxesArray",
    "Floats",
    "channel_panels",
    "check_dataset",
    "check_panels",
    "legend",
    "legend_above",
    "legend_entries",
    "legend_entry",
    "new_panels",
    "number",
    "percent",
    "set_unit",
    "show_numbers",
    "shown_unit",
    "single_axes",
    "tile_edges",
    "write_instead",
    "write_not_measured",
]

Floats = NDArray[np.float64]
AxesArray = NDArray[np.object_]

PALETTE: Mapping[str, str] = {
    "tip": "#0072B2",
    "tangential": "#D55E00",
    "change": "#000000",
    "none": "#8C8C8C",
    "sample": "#9A9A9A",
    "object": "#EFEFEF",
    "band": "#9CCBE8",
    "median": "#0072B2",
    "gap": "#F0E442",
}
"""Colours after Okabe and Ito, told apart with any colour vision."""

BASES = ("#0072B2", "#E69F00", "#CC79A7", "#009E73", "#56B4E9", "#D55E00")
"""Colours of bases in their order, after Okabe and Ito, without the gap's; used over again from the seventh base on."""

BEST: Mapping[str, Any] = {"marker": "*", "color": "#D55E00", "markeredgecolor": "white", "linestyle": "none"}
"""The mark on the best of several choices."""

SWEEP_LINES: Mapping[str, str] = {"forward": "-", "backward": "--"}
SWEEP_MARKERS: Mapping[str, str] = {"forward": "o", "backward": "^"}

PHASES = {"tip": "tip contact", "tangential": "tangential contact"}
LABELS = {
    "drive_angle": r"drive angle $\varphi_0$",
    "holding_moment": "holding moment $m_0$",
    "force_x": r"force $f_{\mathrm{A}x}$",
    "force_y": r"force $f_{\mathrm{A}y}$",
    "contact_x": "$x$",
    "contact_y": "$y$",
}
DRIVE_ANGLE = f"{LABELS['drive_angle']} [°]"
_DIMENSIONLESS = {"length_unit": "$L$", "moment_unit": "$EI$/$L$", "force_unit": "$EI$/$L^2$"}
_PREFIXES = {0: "", -3: "m", -6: "µ", -9: "n"}


def single_axes() -> Axes:
    from matplotlib import pyplot as plt

    return plt.subplots(figsize=(7.0, 4.0), layout="compressed")[1]


def new_panels(rows: int, columns: int, height: float, width: float = 7.0, **options: Any) -> AxesArray:
    """Axes of a new figure, shape (rows, columns); options are those of `pyplot.subplots`."""
    from matplotlib import pyplot as plt

    size = (width, height)
    return plt.subplots(rows, columns, figsize=size, layout="constrained", squeeze=False, **options)[1]


def check_panels(axes: Any, shape: tuple[int, ...], meaning: str) -> AxesArray:
    """Return Axes that were given, which are to have a shape; `meaning` says what they are for."""
    panels = np.atleast_1d(np.asarray(axes, dtype=object))
    if panels.shape != shape:
        raise ParameterError(f"axes have shape {panels.shape}, and {shape} is wanted: {meaning}")
    return panels


def channel_panels(axes: Sequence[Axes] | None) -> tuple[AxesArray, bool]:
    """Three panels, and whether they are of a figure of their own."""
    if axes is None:
        return new_panels(3, 1, 5.4, sharex=True)[:, 0], True
    return check_panels(axes, (3,), f"give three, for {', '.join(CHANNELS)}"), False


def check_dataset(found: Any, names: set[str], kind: str, source: str, attrs: Sequence[str] = ()) -> None:
    """Refuse what is no dataset with these variables and attributes; `source` names the function that returns one."""
    is_one = isinstance(found, xr.Dataset) and names <= set(found.variables) and set(attrs) <= set(found.attrs)
    if not is_one:
        raise ParameterError(f"this is no {kind}: give what {source} returned")


def write_instead(ax: Axes, words: str) -> Axes:
    """Say why nothing is drawn, in the middle of Axes that are switched off."""
    ax.set_axis_off()
    ax.text(0.5, 0.5, words, transform=ax.transAxes, ha="center", va="center")
    return ax


def write_not_measured(ax: Axes, label: str) -> None:
    """Say that a channel was not measured."""
    ax.text(0.5, 0.5, "not measured", transform=ax.transAxes, ha="center", va="center", color=PALETTE["none"])
    ax.set_yticks([])
    ax.set_ylabel(label)


def legend_entry(ax: Axes, label: str, **style: Any) -> None:
    """An entry of the legend for a style that is shared by many lines."""
    ax.plot([], [], label=label, **style)


def legend_entries(*panels: Axes) -> dict[str, Any]:
    """Handles of legends by label, each label once."""
    found: dict[str, Any] = {}
    for ax in panels:
        found |= dict(zip(*reversed(ax.get_legend_handles_labels()), strict=True))
    return found


def legend(ax: Axes, entries: Mapping[str, Any] | None = None, **options: Any) -> None:
    """A legend in small letters without a frame, of given entries or of all that has a label in the Axes."""
    if entries is not None:
        if not entries:
            return
        options |= {"handles": list(entries.values()), "labels": list(entries)}
    ax.legend(fontsize="small", title_fontsize="small", frameon=False, **options)


def legend_above(ax: Axes, columns: int, entries: Mapping[str, Any] | None = None, **options: Any) -> None:
    """Such a legend above the Axes."""
    legend(ax, entries, loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=columns, **options)


def set_unit(axis: Axis, label: str, name: str, attrs: Mapping[Any, Any], values: Floats) -> None:
    """Label of an axis with its unit, and in SI tick labels in the fitting multiple of it."""
    power, unit = shown_unit(name, attrs, values)
    axis.set_label_text(f"{label}[{unit}]" if unit else label.strip())
    if power:
        show_numbers(axis, power)


def show_numbers(axis: Axis, power: int = 0) -> None:
    """Write ticks of an axis in units of a power of ten."""
    axis.set_major_formatter(lambda value, _: number(value, power))


def shown_unit(name: str, attrs: Mapping[Any, Any], values: Floats) -> tuple[int, str]:
    """Power of ten and name of the unit in which such values of a column are shown; "" for a plain number."""
    unit = str(attrs.get("units", "1"))
    column = COLUMNS[name]
    if unit == "1":
        return 0, _DIMENSIONLESS[column.scale] if column.scale else ""
    power = _power(values) if unit == column.unit else 0
    return power, f"{_PREFIXES[power]}{unit}"


def number(value: float, power: int = 0, *, digits: int = 6) -> str:
    """A value in units of a power of ten, as a text."""
    return f"{value / 10.0**power:.{digits}g}".replace("-", "−")


def percent(share: float) -> str:
    """A share in per cent, as a text."""
    return f"{100.0 * share:.6g} %"


def tile_edges(values: Floats) -> Floats:
    """Edges of tiles around values in increasing order: midway between two."""
    if values.size == 1:
        return np.array([0.95, 1.05]) * values
    middle = 0.5 * (values[1:] + values[:-1])
    return np.concatenate([[2.0 * values[0] - middle[0]], middle, [2.0 * values[-1] - middle[-1]]])


def _power(values: Floats) -> int:
    largest = np.max(np.abs(values), initial=0.0, where=np.isfinite(values))
    return int(np.clip(3 * np.floor(np.log10(largest) / 3), -9, 0)) if largest > 0.0 else 0
