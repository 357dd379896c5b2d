"""Axes: how they are made, their colours, and their labels with units."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from tactile_bayes.errors import ParameterError
from tactile_bayes.record import CHANNELS, COLUMNS

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.axis import Axis

__all__ = [
    "BASES",
    "LABELS",
    "PALETTE",
    "PHASES",
    "AxesArray",
    "Floats",
    "channel_panels",
    "handles_once",
    "legend_entry",
    "number",
    "parameter_grid",
    "set_unit",
    "shown_unit",
    "single_axes",
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

PHASES = {"tip": "tip contact", "tangential": "tangential contact"}
LABELS = {
    "drive_angle": r"drive angle $\varphi_0$",
    "holding_moment": "holding moment $m_0$",
    "force_x": r"force $f_{\mathrm{A}x}$",
    "force_y": r"force $f_{\mathrm{A}y}$",
    "contact_x": "$x$",
    "contact_y": "$y$",
}
_DIMENSIONLESS = {"length_unit": "$L$", "moment_unit": "$EI$/$L$", "force_unit": "$EI$/$L^2$"}
_PREFIXES = {0: "", -3: "m", -6: "µ", -9: "n"}


def single_axes() -> Axes:
    from matplotlib import pyplot as plt

    return plt.subplots(figsize=(7.0, 4.0), layout="compressed")[1]


def channel_panels(axes: Sequence[Axes] | None) -> tuple[AxesArray, bool]:
    from matplotlib import pyplot as plt

    if axes is None:
        _, panels = plt.subplots(3, 1, sharex=True, figsize=(7.0, 5.4), layout="constrained")
        return panels, True
    panels = np.asarray(axes, dtype=object)
    if panels.shape != (3,):
        raise ParameterError(f"axes have shape {panels.shape}: give three, for {', '.join(CHANNELS)}")
    return panels, False


def parameter_grid(axes: Any, shape: tuple[int, int], figsize: tuple[float, float], **gridspec: Any) -> AxesArray:
    from matplotlib import pyplot as plt

    if axes is None:
        return plt.subplots(*shape, figsize=figsize, layout="constrained", squeeze=False, gridspec_kw=gridspec)[1]
    grid = np.asarray(axes, dtype=object)
    if grid.shape != shape:
        raise ParameterError(f"axes have shape {grid.shape}, and {shape} is wanted: rows are parameters")
    return grid


def legend_entry(ax: Axes, label: str, **style: Any) -> None:
    """An entry of the legend for a style that is shared by many lines."""
    ax.plot([], [], label=label, **style)


def handles_once(ax: Axes) -> tuple[list[Any], list[str]]:
    """Handles and labels of a legend, each label once."""
    unique = dict(zip(*reversed(ax.get_legend_handles_labels()), strict=True))
    return list(unique.values()), list(unique)


def set_unit(axis: Axis, label: str, name: str, attrs: Mapping[Any, Any], values: Floats) -> None:
    """Label of an axis with its unit, and in SI tick labels in the fitting multiple of it."""
    from matplotlib.ticker import FuncFormatter

    power, unit = shown_unit(name, attrs, values)
    axis.set_label_text(f"{label}[{unit}]" if unit else label.strip())
    if power:
        axis.set_major_formatter(FuncFormatter(lambda value, _: number(value, power)))


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


def _power(values: Floats) -> int:
    largest = np.max(np.abs(values), initial=0.0, where=np.isfinite(values))
    return int(np.clip(3 * np.floor(np.log10(largest) / 3), -9, 0)) if largest > 0.0 else 0
