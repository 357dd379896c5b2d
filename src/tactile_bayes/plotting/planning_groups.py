"""Common parts of figures of a plan: their dataset, and logarithmic axes."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr

from tactile_bayes.arrays import Floats
from tactile_bayes.errors import ParameterError
from tactile_bayes.plotting.labels import show_numbers, shown_unit

if TYPE_CHECKING:
    from matplotlib.axis import Axis

# Ticks in a decade of a logarithmic axis, by the largest number of decades.
_TICKS = {0.9: (1.0, 1.5, 2.0, 3.0, 4.0, 5.0, 7.0), 2.2: (1.0, 2.0, 5.0), np.inf: (1.0,)}


def group_of(found: Any, name: str, variables: set[str]) -> xr.Dataset:
    """Return the dataset of a figure, given as a dataset, as a group, or in a whole result of `sensitivity`."""
    if isinstance(found, xr.DataTree):
        found = (found[name] if name in found.children else found).to_dataset()
    if not isinstance(found, xr.Dataset) or not variables <= set(found.variables):
        raise ParameterError(f"there is no {name} in this: give what sensitivity returned, or its group {name!r}")
    return found


def check_among(name: str, value: str, found: xr.Dataset) -> None:
    """Refuse a value that is not a label along a dimension."""
    if not isinstance(value, str) or value not in found[name].values:
        raise ParameterError(f"{name} is {value!r}: there are {', '.join(map(str, found[name].values))}")


def set_log_scale(axis: Axis, label: str, name: str, attrs: Mapping[Any, Any], values: Floats) -> None:
    """Make an axis logarithmic, with limits around the positive values of a column and its unit in the label.

    Unlike `set_unit` it leaves minor ticks without labels, which Matplotlib would write in another unit.
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
