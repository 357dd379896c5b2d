"""Numbers, units, meanings of parameters, and tables as text on a page."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping
from typing import Any, NamedTuple

import numpy as np
import xarray as xr

from tactile_bayes.contours.families import FAMILIES
from tactile_bayes.plotting.labels import number, shown_unit
from tactile_bayes.rig.parameters import parameter_named

FORMULAS = {
    "parabola": "y = a (x − x_c)² + q",
    "circle": "a circle of radius r, lowest at (x_c, q)",
    "ellipse": "an ellipse of semi-axes a (sideways) and b, lowest at (x_c, q)",
    "power-law": "(y − q)/w = (|x − x_c|/w)ⁿ",
    "shape-free": "any smooth contour: log radius of curvature is a random function of the slope angle",
    "flat-sided": "any smooth contour with one flat side, shape-free elsewhere",
}


class PageTable(NamedTuple):
    """A table: caption, heads, rows, and the number of leading columns with text instead of numbers."""

    caption: str
    heads: list[str]
    rows: list[list[str]]
    words: int = 1


class Shown(NamedTuple):
    """A unit in which values are written: its power of ten relative to the values' own unit, and its name."""

    power: int
    name: str

    def text(self, value: float, digits: int = 4) -> str:
        """Return the value without its unit, to some digits, without an exponent unless extreme; – if not finite."""
        shown = value / 10.0**self.power
        if not math.isfinite(shown):
            return "–"
        if not 1e-6 < abs(shown) < 1e9:
            return number(shown, digits=digits)
        decimals = digits - 1 - math.floor(math.log10(abs(shown)))
        return number(round(shown, decimals), digits=15)

    def full(self, value: float, digits: int = 4) -> str:
        """Return the value with its unit, joined by a no-break space."""
        return f"{self.text(value, digits)}\u00a0{self.name}".rstrip()

    @property
    def bracketed(self) -> str:
        """The unit in brackets, as it follows a label; "" without a unit."""
        return f" [{self.name}]" if self.name else ""


def shown_as(column: str, attrs: Mapping[Any, Any], values: Any) -> Shown:
    r"""Return the unit that suits values of a column of a record: mm, mN m, or that of the rod."""
    power, unit = shown_unit(column, attrs, np.asarray(values, dtype=float))
    return Shown(power, unit.replace("$", "").replace("^2", "²"))


def spread(values: Iterable[float], width: float) -> list[str]:
    """Return numbers with as many decimals as show an interval of this width to two digits."""
    if not (math.isfinite(width) and width > 0.0):
        return [number(value) if math.isfinite(value) else "–" for value in values]
    decimals = 1 - math.floor(math.log10(width))
    if decimals > 9 or decimals < -3:
        return [fixed(value, ".4g") for value in values]
    return [fixed(value, f".{max(0, decimals)}f") for value in values]


def rows_of(found: xr.Dataset, *names: str) -> Iterator[tuple[Any, ...]]:
    """Return the entries of variables or coordinates along their first dimension."""
    return zip(*(found[name].values.tolist() for name in names), strict=True)


def sentence(words: str) -> str:
    """Return text with a capital first letter."""
    return words[0].upper() + words[1:]


def fixed(value: float, form: str) -> str:
    """Return a number in a format, with a true minus sign, except for zero; – if not finite."""
    if not math.isfinite(value):
        return "–"
    text = f"{value:{form}}"
    return text.removeprefix("-") if float(text) == 0.0 else text.replace("-", "−")


def chance(value: float) -> str:
    """Return a probability to three decimals; only exact 0 and 1 are written so."""
    if not math.isfinite(value):
        return "–"
    if 0.0 < value < 1.0:
        return "<0.001" if value < 0.001 else ">0.999" if value > 0.999 else f"{value:.3f}"
    return f"{value:g}"


def percent(value: float) -> str:
    """Return a share in per cent, to six significant digits."""
    return f"{100.0 * value:.6g}\u00a0%"


def meaning_of(name: str, family: str) -> str:
    """Return the meaning of a parameter of a contour, of its rig, or of the noise."""
    if name == "gap width":
        return "width of the arc that no sweep touches"
    table = FAMILIES[family].table if family in FAMILIES else {}
    if found := parameter_named(name) or table.get(name):
        side = next((f"{side} flank: " for side in ("left", "right") if name.startswith(f"{side}_")), "")
        return side + found.meaning
    return ""


def is_direction(name: str) -> bool:
    """Return True for a parameter that is one weight of a random function, and has no meaning by itself."""
    return name.startswith("z_")
