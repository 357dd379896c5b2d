"""What figures of a plan have in common: which dataset they draw, whose colour is which, and logarithmic axes."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr

from tactile_bayes.errors import ParameterError
from tactile_bayes.plotting.axes import Floats
from tactile_bayes.plotting.labels import show_numbers, shown_unit
from tactile_bayes.plotting.marks import BASES

if TYPE_CHECKING:
    from matplotlib.axis import Axis

__all__ = [
    "METHOD_COLOURS",
    "READING_COLOURS",
    "check_among",
    "group_of",
    "of_sweep",
    "set_log_scale",
    "sweep_in_words",
]

READING_COLOURS: Mapping[str, str] = {
    "holding_moment": BASES[0],
    "force_x": BASES[1],
    "force_y": BASES[3],
    "drive_angle": BASES[2],
}
METHOD_COLOURS: Mapping[str, str] = {"raw": "#D55E00", "constrained": "#0072B2"}

_TICKS = {0.9: (1.0, 1.5, 2.0, 3.0, 4.0, 5.0, 7.0), 2.2: (1.0, 2.0, 5.0), np.inf: (1.0,)}
"""In a decade of a logarithmic axis, by how many decades it has at most."""


def group_of(found: Any, name: str, variables: set[str]) -> xr.Dataset:
    """The dataset that a figure is drawn from: it may be given itself, as a group, or in the whole of a `sensitivity`.

    Raises
    ------
    ParameterError
        If it is another.
    """
    if isinstance(found, xr.DataTree):
        found = (found[name] if name in found.children else found).to_dataset()
    if not isinstance(found, xr.Dataset) or not variables <= set(found.variables):
        raise ParameterError(f"there is no {name} in this: give what sensitivity returned, or its group {name!r}")
    return found


def check_among(name: str, value: str, found: xr.Dataset) -> None:
    """Refuse what is none of the labels along a dimension.

    Raises
    ------
    ParameterError
        If it is another.
    """
    if value not in found[name].values:
        raise ParameterError(f"{name} is {value!r}: there are {', '.join(map(str, found[name].values))}")


def of_sweep(found: xr.Dataset, sweep: int) -> xr.Dataset:
    """Its samples in order of the drive angle.

    Raises
    ------
    ParameterError
        If there is no such sweep.
    """
    numbers = found["sweep"].values
    here = np.flatnonzero(numbers == sweep)
    if isinstance(sweep, bool) or not here.size:
        raise ParameterError(f"sweep is {sweep!r}: there are {', '.join(map(str, np.unique(numbers)))}")
    return found.isel(sample=here[np.argsort(found["drive_angle"].values[here], kind="stable")])


def sweep_in_words(chosen: xr.Dataset) -> str:
    """Its direction."""
    return f"{chosen['direction'].values[0]} sweep"


def set_log_scale(axis: Axis, label: str, name: str, attrs: Mapping[Any, Any], values: Floats) -> None:
    """A logarithmic axis that just holds positive values of a column, with its unit in the label.

    Other than `set_unit`, it labels minor ticks not at all: matplotlib would write them in another unit.
    """
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
    axis.set_minor_formatter(NullFormatter())
    if power or low > 1e-4:
        show_numbers(axis, power)
    else:
        axis.set_major_formatter(LogFormatterMathtext())
    axis.set_label_text(f"{label} [{unit}]" if unit else label)
