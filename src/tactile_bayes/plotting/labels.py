"""Labels: numbers and units as text on axes."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from tactile_bayes.arrays import Floats
from tactile_bayes.record import COLUMNS

if TYPE_CHECKING:
    from matplotlib.axis import Axis

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


def set_unit(axis: Axis, label: str, name: str, attrs: Mapping[Any, Any], values: Floats) -> None:
    """Label an axis with its unit, and in SI write tick labels in the suitable multiple of it."""
    power, unit = shown_unit(name, attrs, values)
    axis.set_label_text(f"{label}[{unit}]" if unit else label.strip())
    if power:
        show_numbers(axis, power)


def show_numbers(axis: Axis, power: int = 0) -> None:
    """Write tick labels of an axis in units of a power of ten."""
    axis.set_major_formatter(lambda value, _: number(value, power))


def shown_unit(name: str, attrs: Mapping[Any, Any], values: Floats) -> tuple[int, str]:
    """Return power of ten and name of the unit in which values of a column are shown; "" for a plain number."""
    unit = str(attrs.get("units", "1"))
    column = COLUMNS[name]
    if unit == "1":
        return 0, _DIMENSIONLESS[column.scale] if column.scale else ""
    power = _power(values) if unit == column.unit else 0
    return power, f"{_PREFIXES[power]}{unit}"


def number(value: float, power: int = 0, *, digits: int = 6) -> str:
    """Return a value as text, in units of a power of ten."""
    return f"{value / 10.0**power:.{digits}g}".replace("-", "−")


def percent(share: float) -> str:
    """Return a share as text, in per cent."""
    return f"{100.0 * share:.6g} %"


def _power(values: Floats) -> int:
    largest = np.max(np.abs(values), initial=0.0, where=np.isfinite(values))
    return int(np.clip(3 * np.floor(np.log10(largest) / 3), -9, 0)) if largest > 0.0 else 0
